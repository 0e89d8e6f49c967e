"""The engine's process: asks the receiver for a batch, steps, hands what it decided to the operator face."""

import json
import logging
import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from pydantic_core import to_json

from deconflict.advisory import ADVISORY, AnyAdvisory, Recommendation
from deconflict.engine.engine import Engine
from deconflict.engine.load_shedding import Effort, LoadShedder
from deconflict.engine.message_latency import LEARNED_EVERY_S, arrivals_s, observe_latency
from deconflict.runtime.heartbeat import LONG_S, SILENT_S
from deconflict.runtime.learned_state import Part, UnreadableError, packed, unpacked
from deconflict.runtime.rpc import Caller, LinkDownError
from deconflict.settings.hot_reload import InForce
from deconflict.settings.site import Site
from ingest.batch import Batch, Floats
from ingest.measures.measures import Measures

RETRY_S = 0.2
MEASURES_EVERY_S = 1.0
MOST_WAITING_BYTES = 64 << 20
"""Wait for an operator face that takes nothing: some five minutes of a crowded floor."""
EVERYTHING = b"everything"
"""What an engine asks for that knows nothing of the floor. It may take long, so that its pass is not judged."""
LEFT_OUT = {
    Effort.FULL: "nothing is left out any more",
    Effort.COARSE: "smallest separations are told to a quarter of a metre",
    Effort.NEAR: "conflicts later than conflict.warning_s wait as well, and queues are looked at every ten seconds",
}

NO_ADVICE = Recommendation(cost_s=0.0, bound_s=0.0, proven_optimal=False, note="no advice could be worked out")

log = logging.getLogger(__name__)


class UndeliveredError(Exception):
    """The operator face has taken nothing for long."""

    def __init__(self) -> None:
        much = f"{MOST_WAITING_BYTES >> 20} MiB"
        super().__init__(f"{much} wait for an operator face that takes nothing; the engine begins anew once it does")


class EngineRole:
    """Computes. Holds no socket of the network, waits for no disk: a thread of its own delivers what it decided."""

    def __init__(self, site: Site, runtime: Path) -> None:
        self._site, self._in_force = site, InForce(runtime, site)
        self._receiver = Caller(runtime, "receiver")
        self._outbox = Outbox(runtime)
        self._adviser = ThreadPoolExecutor(1, "adviser")
        self._solved_s: deque[float] = deque()
        """How long advice took to work out, filled by any thread."""
        self._failed: deque[Exception] = deque()
        """And why it could not be."""
        self._kept_s = time.monotonic()
        self._load = LoadShedder(site.engine.deadline_s)

    def run(self, stop: threading.Event, goes_on: Callable[[int], object] = lambda _: None) -> None:
        """Step until `stop` is set. `goes_on` is told each time for how many seconds this may now be silent."""
        goes_on(LONG_S)
        engine = self._restored(stop)
        if engine is None:
            return
        self._outbox.start()
        try:
            self._stepped(engine, stop, goes_on)
        finally:
            self._adviser.shutdown(cancel_futures=True)
            self._outbox.stop()
            self._receiver.close()

    def _stepped(self, engine: Engine, stop: threading.Event, goes_on: Callable[[int], object]) -> None:
        ask = EVERYTHING
        while not stop.is_set():
            goes_on(LONG_S if ask == EVERYTHING else SILENT_S)
            pending = engine.pending()
            try:
                batch = Batch.from_bytes(self._receiver.call("batch", b"%b %d %d" % (ask, self._load.effort, pending)))
            except LinkDownError:
                ask = EVERYTHING
                stop.wait(RETRY_S)
                continue
            self._step(engine, batch, pending, judged=ask != EVERYTHING)
            ask = b"changes"
            if changed := self._in_force.changed():
                engine, ask = engine.renewed(changed), EVERYTHING
                self._load = LoadShedder(changed.engine.deadline_s, self._load.effort)
        self._outbox.keep(engine.learned())

    def _restored(self, stop: threading.Event) -> Engine | None:
        """An engine that goes on with what is stored; None if stopped before that could be had."""
        operator = Caller(self._outbox.runtime, "operator")
        while not stop.is_set():
            try:
                stored, learned = json.loads(operator.call("restore")), operator.call("learned")
                try:
                    return self._engine(stored, unpacked(learned) if learned else None)
                except UnreadableError as error:
                    operator.call("unlearn", str(error).encode())
                    return self._engine(stored, None)
            except LinkDownError:
                stop.wait(RETRY_S)
            finally:
                operator.close()
        return None

    def _engine(self, stored: dict[str, Any], learned: dict[str, Part] | None) -> Engine:
        """An engine that goes on with the stored advisories, and with what was learned."""
        return Engine(
            self._site,
            [ADVISORY.validate_python(one) for one in stored["open"]],
            {(a, b): count for a, b, count in stored["encounters"]},
            lambda work: self._adviser.submit(self._timed, work),
            stored["burdens_s"],
            learned,
        )

    def _timed(self, work: Callable[[], Recommendation]) -> Recommendation:
        began_s = time.perf_counter()
        try:
            advice = work()
        except Exception as error:
            log.exception("advice could not be worked out; conflicts are told without it")
            self._failed.append(error)
            return NO_ADVICE
        self._solved_s.append(time.perf_counter() - began_s)
        return advice

    def _step(self, engine: Engine, batch: Batch, pending: int, *, judged: bool) -> None:
        began_s = time.perf_counter()
        engine.receive(batch)
        revisions = engine.step(batch.now_s, self._load.effort, pending)
        took_s = time.perf_counter() - began_s
        engine.measures.observe("deconflict_sweep_duration_seconds", [took_s])
        if judged:
            self._judge(engine.measures, took_s)
        failed = [self._failed.popleft() for _ in range(len(self._failed))]
        engine.measures.count("deconflict_advice_failures_total", by=len(failed))
        solved_s = [self._solved_s.popleft() for _ in range(len(self._solved_s))]
        engine.measures.observe("deconflict_advice_solve_seconds", solved_s)
        robots = engine.live.robots
        near = [(a, b, batch.now_s, (robots[a].vendor, robots[b].vendor)) for a, b in engine.near_misses]
        presence = partial(engine.presence.document, batch.now_s)
        self._outbox.put(revisions, arrivals_s(batch, time.time()), engine.measures, near, presence)
        if time.monotonic() - self._kept_s >= LEARNED_EVERY_S:
            self._kept_s = time.monotonic()
            self._outbox.keep(engine.learned() | {"tick": {"now_s": batch.now_s}})

    def _judge(self, measures: Measures, took_s: float) -> None:
        """Say whether a pass was late, and do less or more from now on."""
        before = self._load.effort
        measures.count("deconflict_deadlines_missed_total", by=self._load.add_pass(took_s))
        measures.level("deconflict_engine_effort_reduced", {(): self._load.effort})
        if self._load.effort > before:
            log.warning("the engine can't keep up, a pass took %.2f s: %s", took_s, LEFT_OUT[self._load.effort])
        elif self._load.effort < before:
            log.info("the engine keeps up again: %s", LEFT_OUT[self._load.effort])


class Outbox:
    """Delivers revisions in order, again and again until the operator face has stored them."""

    def __init__(self, runtime: Path) -> None:
        self.runtime = runtime
        self.measures = Measures()
        self._operator = Caller(runtime, "operator")
        self._waiting: queue.SimpleQueue[tuple[bytes, dict[str, Floats]] | None] = queue.SimpleQueue()
        """Parcels, each with the arrivals of what it reflects."""
        self._put_bytes = self._taken_bytes = 0
        self._learned: deque[dict[str, Part]] = deque(maxlen=1)
        self._thread = threading.Thread(target=self._deliver, name="outbox")
        self._stopping = threading.Event()
        self._measured_s = 0.0

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """Deliver what waits, once, and end."""
        self._stopping.set()
        self._waiting.put(None)
        self._thread.join()
        self._operator.close()

    def put(
        self,
        revisions: list[AnyAdvisory],
        arrivals_s: dict[str, Floats],
        measures: Measures,
        near_misses: Sequence[tuple[str, str, float, tuple[str, str]]] = (),
        presence: Callable[[], dict[str, Any] | None] = lambda: None,
    ) -> None:
        """Queue one step: its revisions, the arrivals of the messages it reflects, by vendor, and near misses; and once
        a second what it measured, and who is still there.

        Raises `UndeliveredError` where too much waits, and lets go of it: nobody was told of it.
        """
        due = time.monotonic() - self._measured_s >= MEASURES_EVERY_S
        if due:
            self._measured_s = time.monotonic()
        parcel = {
            "advisories": revisions,
            "measures": [measures.as_document(), self.measures.as_document()] if due else None,
            "near_misses": near_misses,
            "presence": presence() if due else None,
        }
        step = to_json(parcel) if revisions or due or near_misses else b"", arrivals_s
        self._put_bytes += _weight(*step)
        self._waiting.put(step)
        if self._put_bytes - self._taken_bytes > MOST_WAITING_BYTES:
            self._waiting = queue.SimpleQueue()
            raise UndeliveredError

    def keep(self, learned: dict[str, Part]) -> None:
        """Hand over what was learned after the next parcel; what still waits is replaced by it."""
        self._learned.append(learned)

    def _deliver(self) -> None:
        while (step := self._waiting.get()) is not None:
            parcel, arrivals_s = step
            if parcel:
                self._publish(parcel)
            self._taken_bytes += _weight(parcel, arrivals_s)
            observe_latency(self.measures, arrivals_s, time.time())
            self._keep()
        self._keep()

    def _keep(self) -> None:
        with suppress(LinkDownError):  # the next will come in a minute
            while self._learned:
                self._operator.call("learn", packed(self._learned.pop()))

    def _publish(self, parcel: bytes) -> None:
        while True:
            try:
                self._operator.call("publish", parcel)
            except LinkDownError:
                if self._stopping.wait(RETRY_S):
                    return
            else:
                return


def _weight(parcel: bytes, arrivals_s: dict[str, Floats]) -> int:
    """Roughly what a step takes that waits, bytes."""
    return len(parcel) + sum(arrived_s.nbytes for arrived_s in arrivals_s.values())
