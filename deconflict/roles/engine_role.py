"""The engine's process: requests batches from the receiver, runs the engine, and delivers to the operator face."""

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
from deconflict.runtime.heartbeat import LONG_SILENCE_LIMIT_S, SILENCE_LIMIT_S
from deconflict.runtime.learned_state import Part, UnreadableError, packed, unpacked
from deconflict.runtime.rpc import Caller, LinkDownError
from deconflict.settings.hot_reload import CurrentSite
from deconflict.settings.site import Site
from ingest.batch import Batch, Floats
from ingest.measures.measures import Measures

RETRY_S = 0.2
MEASURES_EVERY_S = 1.0
MOST_WAITING_BYTES = 64 << 20
"""Most bytes that wait for an operator face that does not answer: some five minutes of a crowded floor."""
EVERYTHING = b"everything"
"""The request of an engine that knows nothing of the floor. Its pass may take long and counts for no deadline."""
LEFT_OUT = {
    Effort.FULL: "nothing is left out any more",
    Effort.COARSE: "smallest separations are given to a quarter of a metre",
    Effort.NEAR: "conflicts later than conflict.warning_s wait as well, and queues are checked every ten seconds",
}

NO_ADVICE = Recommendation(cost_s=0.0, bound_s=0.0, proven_optimal=False, note="no advice could be worked out")

log = logging.getLogger(__name__)


class UndeliveredError(Exception):
    """The operator face has accepted nothing for long."""

    def __init__(self) -> None:
        size = f"{MOST_WAITING_BYTES >> 20} MiB"
        super().__init__(f"{size} wait for an operator face that does not answer; the engine restarts once it does")


class EngineRole:
    """Runs the engine. It waits for no network and no disk: a thread of its own delivers the decisions."""

    def __init__(self, site: Site, runtime: Path) -> None:
        self._site, self._current_site = site, CurrentSite(runtime, site)
        self._receiver = Caller(runtime, "receiver")
        self._delivery = Delivery(runtime)
        self._adviser = ThreadPoolExecutor(1, "adviser")
        self._solved_s: deque[float] = deque()
        """Durations of solves since the last pass. Any thread appends."""
        self._failed: deque[Exception] = deque()
        """Errors of solves since the last pass. Any thread appends."""
        self._kept_s = time.monotonic()
        self._load = LoadShedder(site.engine.deadline_s)

    def run(self, stop: threading.Event, beat: Callable[[int], object] = lambda _: None) -> None:
        """Run until `stop` is set. Calls `beat` with the number of seconds that this may be silent from now."""
        beat(LONG_SILENCE_LIMIT_S)
        engine = self._restored_engine(stop)
        if engine is None:
            return
        self._delivery.start()
        try:
            self._run_engine(engine, stop, beat)
        finally:
            self._adviser.shutdown(cancel_futures=True)
            self._delivery.stop()
            self._receiver.close()

    def _run_engine(self, engine: Engine, stop: threading.Event, beat: Callable[[int], object]) -> None:
        request = EVERYTHING
        while not stop.is_set():
            beat(LONG_SILENCE_LIMIT_S if request == EVERYTHING else SILENCE_LIMIT_S)
            pending = engine.pending()
            try:
                payload = b"%b %d %d" % (request, self._load.effort, pending)
                batch = Batch.from_bytes(self._receiver.call("batch", payload))
            except LinkDownError:
                request = EVERYTHING
                stop.wait(RETRY_S)
                continue
            self._run_pass(engine, batch, pending, timed=request != EVERYTHING)
            request = b"changes"
            if changed := self._current_site.changed():
                engine, request = engine.renewed(changed), EVERYTHING
                self._load = LoadShedder(changed.engine.deadline_s, self._load.effort)
        self._delivery.keep(engine.learned())

    def _restored_engine(self, stop: threading.Event) -> Engine | None:
        """An engine with the stored state; None if `stop` is set before the operator face answers."""
        operator = Caller(self._delivery.runtime, "operator")
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
        """An engine with the stored advisories and the learned state."""
        return Engine(
            self._site,
            [ADVISORY.validate_python(advisory) for advisory in stored["open"]],
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
            log.exception("the solver failed; conflicts are published without advice")
            self._failed.append(error)
            return NO_ADVICE
        self._solved_s.append(time.perf_counter() - began_s)
        return advice

    def _run_pass(self, engine: Engine, batch: Batch, pending: int, *, timed: bool) -> None:
        """One pass of the engine. `timed` is whether it counts for the deadline."""
        began_s = time.perf_counter()
        engine.receive(batch)
        revisions = engine.step(batch.now_s, self._load.effort, pending)
        took_s = time.perf_counter() - began_s
        engine.measures.observe("deconflict_sweep_duration_seconds", [took_s])
        if timed:
            self._adapt_effort(engine.measures, took_s)
        failed = [self._failed.popleft() for _ in range(len(self._failed))]
        engine.measures.count("deconflict_advice_failures_total", by=len(failed))
        solved_s = [self._solved_s.popleft() for _ in range(len(self._solved_s))]
        engine.measures.observe("deconflict_advice_solve_seconds", solved_s)
        robots = engine.live.robots
        near = [(a, b, batch.now_s, (robots[a].vendor, robots[b].vendor)) for a, b in engine.near_misses]
        presence = partial(engine.presence.document, batch.now_s)
        self._delivery.add_pass(revisions, arrivals_s(batch, time.time()), engine.measures, near, presence)
        if time.monotonic() - self._kept_s >= LEARNED_EVERY_S:
            self._kept_s = time.monotonic()
            self._delivery.keep(engine.learned() | {"tick": {"now_s": batch.now_s}})

    def _adapt_effort(self, measures: Measures, took_s: float) -> None:
        """Count whether the pass was late, and set the effort of the next passes."""
        before = self._load.effort
        measures.count("deconflict_deadlines_missed_total", by=self._load.add_pass(took_s))
        measures.level("deconflict_engine_effort_reduced", {(): self._load.effort})
        if self._load.effort > before:
            log.warning("the engine can't keep up, a pass took %.2f s: %s", took_s, LEFT_OUT[self._load.effort])
        elif self._load.effort < before:
            log.info("the engine keeps up again: %s", LEFT_OUT[self._load.effort])


class Delivery:
    """Delivers revisions in order, and retries until the operator face has stored them."""

    def __init__(self, runtime: Path) -> None:
        self.runtime = runtime
        self.measures = Measures()
        self._operator = Caller(runtime, "operator")
        self._waiting: queue.SimpleQueue[tuple[bytes, dict[str, Floats]] | None] = queue.SimpleQueue()
        """Parcels, each with the arrival times of the messages that it reflects."""
        self._added_bytes = self._delivered_bytes = 0
        self._learned: deque[dict[str, Part]] = deque(maxlen=1)
        self._thread = threading.Thread(target=self._deliver, name="delivery")
        self._stopping = threading.Event()
        self._measured_s = 0.0

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """Try once to deliver what waits, and end."""
        self._stopping.set()
        self._waiting.put(None)
        self._thread.join()
        self._operator.close()

    def add_pass(
        self,
        revisions: list[AnyAdvisory],
        arrivals_s: dict[str, Floats],
        measures: Measures,
        near_misses: Sequence[tuple[str, str, float, tuple[str, str]]] = (),
        presence: Callable[[], dict[str, Any] | None] = lambda: None,
    ) -> None:
        """Queue one pass: its revisions and near misses, and once a second its measures and the robots' presence.

        `arrivals_s` has by vendor the arrival times of the messages that the pass reflects. Raises `UndeliveredError`
        if too much waits, and drops it: nobody has received it.
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
        self._added_bytes += _size_bytes(*step)
        self._waiting.put(step)
        if self._added_bytes - self._delivered_bytes > MOST_WAITING_BYTES:
            self._waiting = queue.SimpleQueue()
            raise UndeliveredError

    def keep(self, learned: dict[str, Part]) -> None:
        """Deliver the learned state after the next parcel. Replaces one that still waits."""
        self._learned.append(learned)

    def _deliver(self) -> None:
        while (step := self._waiting.get()) is not None:
            parcel, arrivals_s = step
            if parcel:
                self._publish(parcel)
            self._delivered_bytes += _size_bytes(parcel, arrivals_s)
            observe_latency(self.measures, arrivals_s, time.time())
            self._deliver_learned()
        self._deliver_learned()

    def _deliver_learned(self) -> None:
        with suppress(LinkDownError):  # the next one comes in a minute
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


def _size_bytes(parcel: bytes, arrivals_s: dict[str, Floats]) -> int:
    """Approximate memory of one queued pass."""
    return len(parcel) + sum(arrived_s.nbytes for arrived_s in arrivals_s.values())
