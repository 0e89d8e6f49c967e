"""A recorded log through the engine that the live service uses, and what became of its advisories."""

import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from math import floor, inf
from typing import Any

from deconflict.advisory import AdvisoryState, ConflictAdvisory
from deconflict.blackbox.start import Start
from deconflict.engine import Engine
from deconflict.roles.receiver import fleet_of
from deconflict.site import Site
from ingest.fleet import Fleet
from ingest.measures import Measures
from ingest.playback import EngineStarted, Event, Noted, Reader, Received, Tick
from ingest.seam import Batch, Floats
from metrics import conform
from metrics.arrivals import Arrivals
from metrics.calibration import SETTLED_S, Calibration
from metrics.forecasts import ForecastErrors
from metrics.scenes import Scene
from metrics.scoring import Alert, Presence, score
from metrics.truth import Pair, Truth

TICK_S = 0.25
"""Between passes over a log that has no ticks of its own."""

FORESEEN_S = 10.0
"""An advisory that was cleared longer before a near moment than this had nothing to do with it."""

Line = dict[str, Any]
Tell = Callable[[Line], None]
Watch = Callable[[float, Batch], None]


def with_ticks(events: Iterable[Event]) -> Iterator[Event]:
    """The events, with ticks at whole multiples of `TICK_S` among them where the log has none."""
    last: int | None = None
    for event in events:
        if isinstance(event, Tick | Noted):
            last = -1
        if isinstance(event, Received) and last != -1:
            now = floor(event.arrival_s / TICK_S)
            if last is not None:
                # a gap in the recording is not stepped through
                yield from (Tick(step * TICK_S) for step in range(max(last, now - 400) + 1, now + 1))
            last = now
        yield event
    if last is not None and last != -1:
        yield Tick((last + 1) * TICK_S)


@dataclass(slots=True)
class Told:
    """One advisory so far: what scoring needs of its revisions."""

    pair: Pair
    vendors: tuple[str, str]
    raised_s: float
    predicted_s: float
    place: tuple[str, float, float]
    cleared_s: float = inf


class Run:
    """One clearance's engine over one log."""

    def __init__(self, site: Site, clearance_m: float, start: Start) -> None:
        conflict = site.conflict.model_copy(update={"clearance_m": clearance_m})
        self.clearance_m = clearance_m
        self.engine = Engine(
            site.model_copy(update={"conflict": conflict}),
            start.open,
            start.encounters,
            burdens_s=start.burdens_s,
            learned=start.learned,
        )
        self.calibration = Calibration(clearance_m)
        self.raised: Counter[str] = Counter()
        """Advisories by kind."""
        self.told: dict[str, Told] = {}
        """By advisory."""

    def step(self, batch: Batch, now_s: float) -> list[ConflictAdvisory]:
        """One pass; what it has to say of conflicts."""
        self.engine.receive(batch)
        told = self.engine.step(now_s)
        self.raised.update(one.kind for one in told if one.state is AdvisoryState.RAISED)
        revisions = [one for one in told if isinstance(one, ConflictAdvisory)]
        for one in revisions:
            self._take(one)
        self.calibration.sample(now_s, self.engine.probabilities())
        return revisions

    def alerts(self, truth: Truth) -> Iterator[Alert]:
        for one in self.told.values():
            left_s = min(truth.motion.last_seen_s(robot) for robot in one.pair)
            yield Alert(one.pair, one.vendors, one.raised_s, one.cleared_s, one.predicted_s, left_s, one.place)

    def _take(self, one: ConflictAdvisory) -> None:
        predicted_s = one.predicted_at.timestamp()
        told = self.told.get(one.id)
        if told is None:
            place = (one.location.datum, one.location.x, one.location.y)
            told = self.told[one.id] = Told(one.robots, one.vendors, one.raised_at.timestamp(), predicted_s, place)
        if one.time_to_conflict_s > 0:
            told.predicted_s = predicted_s
        if one.state is AdvisoryState.CLEARED:
            told.cleared_s = one.updated_at.timestamp()


class Replay:
    """One log through one fleet and an engine for each clearance."""

    def __init__(
        self, site: Site, clearances_m: Iterable[float], tell: Tell | None, watch: Watch | None, start: Start
    ) -> None:
        self.runs = [Run(site, clearance_m, start) for clearance_m in clearances_m]
        self.fleet: Fleet = fleet_of(site, Measures())
        self.truth = Truth([run.clearance_m for run in self.runs])
        self.forecasts, self.arrivals = ForecastErrors(), Arrivals()
        self.vendor_of: dict[str, str] = {}
        """By robot that has said where it is."""
        self.messages = 0
        self.first_s, self.last_s = inf, -inf
        self._tell, self._watch = tell, watch
        self._everything = False

    def take(self, event: Event) -> None:
        if isinstance(event, Received):
            self.messages += 1
            self.first_s, self.last_s = min(self.first_s, event.arrival_s), max(self.last_s, event.arrival_s)
            conform.take(self.fleet, event)
        elif isinstance(event, EngineStarted):
            self._everything = True
        elif isinstance(event, Tick):
            self._pass(event.now_s)

    def finish(self) -> None:
        """Look at what is left of what happened."""
        self.truth.finish()
        self.forecasts.finish()
        self._resolve()

    def result(self) -> dict[str, Any]:
        """What the log held, and the scores of every clearance."""
        presence = Presence(self.vendor_of, self.truth.motion.present_s())
        return {
            "messages": self.messages,
            "robots": len(self.vendor_of),
            "span_s": max(self.last_s - self.first_s, 0.0),
            "scores": [self._score(run, presence) for run in self.runs],
            "forecast_error": self.forecasts.figures(),
            "arrivals": self.arrivals.figures(),
            "advisories_raised": dict(sorted(self.runs[0].raised.items())) if self.runs else {},
            "nearest": [self._scene(scene) for scene in self.truth.scenes.finish(self.truth.motion)],
            "conformance": conform.findings(self.fleet.measures),
        }

    def _pass(self, now_s: float) -> None:
        batch = self.fleet.cut(now_s, self._everything)
        self._everything = False
        self.vendor_of.update(zip(batch.robots, batch.vendors, strict=True))
        self.truth.report(batch.robots, batch.forecasts)
        makers = list(zip(batch.vendors, batch.models, strict=True))
        self.forecasts.take(batch.robots, makers, batch.forecasts, self._bands_m(batch))
        self.forecasts.advance(now_s)
        self.arrivals.take(batch)
        if self._watch:
            self._watch(now_s, batch)
        revisions = [one for run in self.runs for one in run.step(batch, now_s)]
        if self._tell:
            for one in sorted(revisions, key=lambda each: (each.clearance_m, each.id)):
                self._tell(advisory_line(one))
        looked_until_s = self.truth.until_s
        self.truth.advance(now_s)
        if self.truth.until_s > looked_until_s:
            self._resolve()

    def _bands_m(self, batch: Batch) -> Floats | None:
        """(n, horizons, bands) radii that the first engine's ledger holds for the forecasts of a batch."""
        if not self.runs or not len(batch):
            return None
        ledger = self.runs[0].engine.foresight.ledger
        rows = ledger.rows(batch.vendors, batch.models, batch.basis.tolist(), batch.now_s)
        bands_m: Floats = ledger.bands_m[rows]
        return bands_m

    def _scene(self, scene: Scene) -> dict[str, Any]:
        """One of the nearest moments, and how long before it the first clearance's advisory stood."""
        before = (
            scene.at_s - told.raised_s
            for told in self.runs[0].told.values()
            if told.pair == scene.pair and told.raised_s < scene.at_s and told.cleared_s > scene.at_s - FORESEEN_S
        )
        vendors = [self.vendor_of[robot] for robot in scene.pair]
        return {"vendors": vendors, "warned_s": max(before, default=None), **scene.document()}

    def _resolve(self) -> None:
        for run in self.runs:
            run.calibration.resolve(self.truth, self.vendor_of)

    def _score(self, run: Run, presence: Presence) -> dict[str, Any]:
        figures = score(
            self.truth.encounters(run.clearance_m),
            list(run.alerts(self.truth)),
            run.clearance_m,
            presence,
            run.calibration.by_vendors,
        )
        return figures | {
            "censored_samples": run.calibration.censored,
            "settled": {"after_s": SETTLED_S, **run.calibration.settled.figures()},
        }


def replay(
    reader: Reader,
    events: Iterable[Event],
    site: Site,
    clearances_m: Iterable[float],
    *,
    tell: Tell | None = None,
    watch: Watch | None = None,
    start: Start = Start(),  # noqa: B008 - frozen
) -> dict[str, Any]:
    """Scores of every clearance over the events that `reader` reads.

    `tell` is called with what the live stream would have said, as it is said, and `watch` with the time and the batch
    of each pass. `start` is what the engine goes on with, of a black box. `speed_x_real_time` is the one value that
    differs from run to run.
    """
    run = Replay(site, clearances_m, tell, watch, start)
    began = time.perf_counter()
    for event in with_ticks(events):
        run.take(event)
    run.finish()
    result = run.result()
    took_s = time.perf_counter() - began
    return {
        "messages": result["messages"],
        "robots": result["robots"],
        "span_s": result["span_s"],
        "speed_x_real_time": result["span_s"] / took_s,
        "unreadable_lines": reader.unreadable,
        **result,
    }


def advisory_line(one: ConflictAdvisory) -> Line:
    """One revision as an event."""
    return {
        "event": one.state.value,
        "at": one.updated_at.isoformat(),
        "id": one.id,
        "robots": list(one.robots),
        "clearance_m": one.clearance_m,
        "probability": one.probability,
        "severity": one.severity.value,
        "time_to_conflict_s": one.time_to_conflict_s,
        "min_separation_m": one.min_separation_m,
        "summary": one.summary,
    }
