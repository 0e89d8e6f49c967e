"""The engine's process: requests batches from the receiver, runs the engine, and delivers to the operator face."""

import json
import logging
import threading
import time
from collections.abc import Callable, Collection, Iterable
from functools import partial
from pathlib import Path
from typing import Protocol

from deconflict.advice.advice_thread import AdviceThread
from deconflict.engine.canary.canary_engine import judged
from deconflict.engine.canary.canary_parcel import WITH_CANARY
from deconflict.engine.canary.canary_parcel import unpacked as unpacked_canary
from deconflict.engine.engine import Engine
from deconflict.engine.load_shedding import Effort, LoadShedder, adapt_effort
from deconflict.engine.message_latency import LEARNED_EVERY_S, arrivals_s
from deconflict.operator.ledger.loss_ledger import ledger_entries, refusal_entries
from deconflict.roles.engine_link.delivery import RETRY_S, Delivery
from deconflict.roles.engine_link.restoration import stored_state
from deconflict.runtime.heartbeat import LONG_SILENCE_LIMIT_S, SILENCE_LIMIT_S
from deconflict.runtime.learned_state import Part, UnreadableError, unpacked
from deconflict.runtime.rpc import Caller, LinkDownError
from deconflict.settings.hot_reload import CurrentSite
from deconflict.settings.site import Site
from deconflict_client.advisory import AnyAdvisory
from ingest.batch import Batch, Floats, Pair
from ingest.measures.measures import Measures

EVERYTHING = b"everything"
"""The request of an engine that knows nothing of the floor. Its pass may take long and counts for no deadline."""

log = logging.getLogger(__name__)


class PassJudge(Protocol):
    """Judges warnings by what happened later."""

    def add(
        self,
        now_s: float,
        batch: Batch,
        bands_m: Floats,
        revisions: Iterable[AnyAdvisory],
        waiting: Iterable[str | Pair],
        doubted: Collection[str],
    ) -> None:
        """Add a pass: what the engine received and published, the errors that it expected of the forecasts, who does as
        advised, and robots that are compared with some others only."""

    def begin_anew(self) -> None:
        """Forget what is not judged yet."""


MakeJudge = Callable[[float, float, Measures], PassJudge]
"""Makes a judge for a clearance, and the margin at which a pair has drawn apart, that counts in these measures."""


class EngineRole:
    """Runs the engine. It waits for no network and no disk: a thread of its own delivers the decisions."""

    def __init__(
        self,
        site: Site,
        runtime: Path,
        *,
        is_first: bool = False,
        ended_early: str = "",
        make_judge: MakeJudge | None = None,
    ) -> None:
        """If `is_first`, no engine of this service ran before, and messages that came earlier count for no latency.
        `ended_early` is `role_files.early_end` of the engine before: this one starts without the learned state. Without
        `make_judge` nobody judges the warnings."""
        self._make_judge = make_judge
        self._judge: PassJudge | None = None
        self._is_first, self._ended_early = is_first, ended_early
        self._site, self._current_site = site, CurrentSite(runtime, site)
        self._receiver = Caller(runtime, "receiver")
        self._delivery = Delivery(runtime)
        self._adviser = AdviceThread()
        self._kept_s = time.monotonic()
        self._load = LoadShedder(site.engine.deadline_s)

    def run(self, stop: threading.Event, beat: Callable[[int], object] = lambda _: None) -> None:
        """Run until `stop` is set. Calls `beat` with the number of seconds that this may be silent from now."""
        beat(LONG_SILENCE_LIMIT_S)
        engine = self._restored_engine(stop)
        if engine is None:
            return
        self._delivery.start()
        log.info("the engine is ready and predicts from now on")
        try:
            self._run_engine(engine, stop, beat)
        finally:
            self._adviser.end()
            self._delivery.stop()
            self._receiver.close()

    def _run_engine(self, engine: Engine, stop: threading.Event, beat: Callable[[int], object]) -> None:
        request = EVERYTHING
        self._judge = self._judge_of(engine)
        while not stop.is_set():
            beat(LONG_SILENCE_LIMIT_S if request == EVERYTHING else SILENCE_LIMIT_S)
            if not self._delivery.has_room():
                stop.wait(RETRY_S)
                continue
            pending, followed = engine.pending(), json.dumps(engine.followed, separators=(",", ":")).encode()
            try:
                payload = b"%b %d %d %b %b" % (request, self._load.effort, pending, followed, WITH_CANARY)
                reply, canary = unpacked_canary(self._receiver.call("batch", payload))
                batch = Batch.from_bytes(reply)
            except LinkDownError:
                request = EVERYTHING
                stop.wait(RETRY_S)
                continue
            arrived_s = {} if self._is_first else arrivals_s(batch, time.time())
            bands_m = engine.foresight.ledger.bands_of(batch)
            revisions = self._run_pass(engine, batch, pending, arrived_s, timed=request != EVERYTHING)
            self._advise(engine, batch.now_s)
            self._judge_pass(engine, batch, bands_m, revisions)
            if canary:
                self._delivery.add_canary(judged(canary))
            self._is_first = False
            request = b"changes"
            if changed := self._current_site.changed():
                engine, request = engine.renewed(changed), EVERYTHING
                self._load = LoadShedder(changed.engine.deadline_s, self._load.effort)
                self._judge = self._judge_of(engine)
        self._delivery.keep(engine.learned(), {})

    def _restored_engine(self, stop: threading.Event) -> Engine | None:
        """An engine with the stored state; None if `stop` is set before the operator face answers."""
        operator = Caller(self._delivery.runtime, "operator")
        while not stop.is_set():
            try:
                stored = stored_state(operator, self._delivery.set_asides)
                known = stored.open, stored.encounters, self._adviser.submit, stored.burdens_s, self._learned(operator)
                engine = Engine(self._site, *known)
                if engine.set_aside:
                    operator.call("unlearn_parts", json.dumps(engine.set_aside).encode())
                return engine
            except LinkDownError:
                stop.wait(RETRY_S)
            finally:
                operator.close()
        return None

    def _learned(self, operator: Caller) -> dict[str, Part] | None:
        """The learned state; None if there is none or it is set aside. Raises `LinkDownError`."""
        if not (learned := operator.call("learned")):
            return None
        try:
            if self._ended_early:
                raise UnreadableError(f"the engine that went on with it {self._ended_early}")
            return unpacked(learned)
        except UnreadableError as error:
            operator.call("unlearn", str(error).encode())
            return None

    def _run_pass(
        self, engine: Engine, batch: Batch, pending: int, arrived_s: dict[str, Floats], *, timed: bool
    ) -> list[AnyAdvisory]:
        """One pass of the engine, and its revisions. `timed` is whether it counts for the deadline."""
        began_s = time.perf_counter()
        engine.receive(batch)
        revisions = engine.step(batch.now_s, self._load.effort, pending)
        took_s = time.perf_counter() - began_s
        engine.measures.observe("deconflict_sweep_duration_seconds", [took_s])
        if timed:
            adapt_effort(self._load, engine.measures, took_s)
        self._adviser.count(engine.measures)
        robots = engine.live.robots
        near = [(a, b, batch.now_s, (robots[a].vendor, robots[b].vendor)) for a, b in engine.near_misses]
        presence = partial(engine.presence_document, batch.now_s)
        losses = [*ledger_entries(engine.losses), *refusal_entries(engine.refusals)]
        self._delivery.add_pass(batch.now_s, revisions, arrived_s, engine.measures, near, presence, losses)
        if time.monotonic() - self._kept_s >= LEARNED_EVERY_S:
            self._kept_s = time.monotonic()
            under_way = engine.under_way() if engine.site.keeps_boxes else {}
            self._delivery.keep(engine.learned() | {"tick": {"now_s": batch.now_s}}, under_way)
        return revisions

    def _judge_of(self, engine: Engine) -> PassJudge | None:
        conflict = engine.site.conflict
        return self._make_judge and self._make_judge(conflict.clearance_m, conflict.clear_margin_m, engine.measures)

    def _judge_pass(self, engine: Engine, batch: Batch, bands_m: Floats, revisions: list[AnyAdvisory]) -> None:
        """Let the judge see a pass that is delivered, if there is time for it. No fault of it ends the engine."""
        if self._judge is None:
            return
        try:
            if self._load.effort > Effort.FULL:
                self._judge.begin_anew()
            else:
                waiting = engine.foresight.following_advice(batch.now_s)
                doubted = engine.claims.partly_examined()
                self._judge.add(batch.now_s, batch, bands_m, revisions, waiting, doubted)
        except Exception:
            log.exception("warnings can't be judged, which should be reported; they are judged anew")
            engine.measures.count("deconflict_judge_failures_total")
            self._judge = self._judge_of(engine)

    def _advise(self, engine: Engine, now_s: float) -> None:
        """Ask robots for what saves time."""
        try:
            revisions = engine.advise(now_s, self._delivery.take_answers(), self._load.effort)
        except Exception:
            log.exception("nothing can be asked of robots, which should be reported")
            engine.measures.count("deconflict_advice_failures_total")
            revisions = engine.withdraw_advice(now_s)
        if revisions:
            self._delivery.add_advice(revisions)
