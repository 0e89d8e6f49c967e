"""A recorded log through the engine that the live service uses, and what became of its advisories.

Three steps, each with a state of its own: `Reading` makes passes of messages, a `Run` for each clearance says what the
engine says at a pass, and the `Outcome` holds that against what happened.
"""

import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from math import floor, inf
from typing import Any

from deconflict.advisory import AdvisoryState, AnyAdvisory, ConflictAdvisory
from deconflict.blackbox.start import Start
from deconflict.engine import Engine
from deconflict.gathering import Gathering
from deconflict.site import Site
from ingest import stamps
from ingest.playback import Event, Reader
from ingest.seam import Batch, Floats
from metrics import conform
from metrics.arrivals import Arrivals
from metrics.calibration import SETTLED_S, Calibration
from metrics.contention import Contention
from metrics.forecasts import ForecastErrors
from metrics.passes import Pass, Reading
from metrics.scenes import Scene
from metrics.scoring import Alert, Presence, score
from metrics.truth import Pair, Truth
from metrics.vendors import VendorRecords

FORESEEN_S = 10.0
"""An advisory that was cleared longer before a near moment than this had nothing to do with it."""
FOLLOWED = 1024
"""Robots whose reports are followed at once: for what is asked of in the end, no pass has to be short."""

Line = dict[str, Any]
Tell = Callable[[Line], None]
Watch = Callable[[float, Batch], None]
Published = Sequence[tuple[Pair, float]]
"""Pairs, and the probability of each."""


@dataclass(slots=True)
class Told:
    """One advisory so far: what scoring needs of its revisions."""

    pair: Pair
    vendors: tuple[str, str]
    raised_s: float
    predicted_s: float
    place: tuple[str, float, float]
    cleared_s: float = inf


@dataclass(frozen=True, slots=True)
class Said:
    """What one clearance's engine had to say at one pass."""

    revisions: list[ConflictAdvisory]
    others: Sequence[AnyAdvisory]
    """Revisions of other kinds."""
    raised: Sequence[str]
    """The kinds of the advisories that were raised."""
    probabilities: Published
    """Of getting in each other's way, at the first pass of each second; none at others."""
    contact_probabilities: Published
    """Of coming within the clearance, of the same pairs."""
    bands_m: Floats
    """(n, horizons, bands) radii that its ledger held for the forecasts of the batch."""
    waiting: Sequence[str] = ()
    """Robots that wait as advised."""
    measured: dict[str, Any] | None = None
    """What the engine would tell of itself, where the pass has that of the receiver."""


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
        self._second = -1

    def step(self, one: Pass) -> Said:
        bands_m = self._bands_m(one.batch)
        self.engine.receive(one.batch)
        told = self.engine.step(one.now_s, one.effort, one.pending, one.heard)
        raised = [each.kind for each in told if each.state is AdvisoryState.RAISED]
        revisions = [each for each in told if isinstance(each, ConflictAdvisory)]
        others = [each for each in told if not isinstance(each, ConflictAdvisory)]
        waiting = self.engine.foresight.heeding(one.now_s)
        measured = self.measured() if one.measured else None
        return Said(revisions, others, raised, *self._published(one.now_s), bands_m, waiting, measured)

    def measured(self) -> dict[str, Any]:
        """What the engine would tell of itself now."""
        return self.engine.measures.as_document()

    def _published(self, now_s: float) -> tuple[Published, Published]:
        """The probabilities of getting in each other's way and of contact, at the first pass of each second."""
        if floor(now_s) == self._second:
            return (), ()
        self._second = floor(now_s)
        return self.engine.probabilities(), self.engine.foresight.contact_probabilities()

    def _bands_m(self, batch: Batch) -> Floats:
        ledger = self.engine.foresight.ledger
        rows = ledger.rows(batch.vendors, batch.models, batch.basis.tolist(), batch.now_s)
        bands_m: Floats = ledger.bands_m[rows]
        return bands_m


class Verdict:
    """What one clearance's engine said, until it can be judged."""

    def __init__(self, clearance_m: float) -> None:
        self.clearance_m = clearance_m
        self.calibration = Calibration(clearance_m)
        self.raised: Counter[str] = Counter()
        """Advisories by kind."""
        self.told: dict[str, Told] = {}
        """By advisory."""

    def take(self, now_s: float, said: Said) -> None:
        self.raised.update(said.raised)
        for one in said.revisions:
            self._take(one)
        self.calibration.sample(now_s, said.probabilities)
        self.calibration.waits.see(now_s, said.waiting)

    def alerts(self, truth: Truth) -> Iterator[Alert]:
        for one in self.told.values():
            left_s = min(truth.motion.last_seen_s(robot) for robot in one.pair)
            heeded = self.calibration.waits.began_s(one.pair, one.raised_s, one.cleared_s) < inf
            yield Alert(one.pair, one.vendors, one.raised_s, one.cleared_s, one.predicted_s, left_s, one.place, heeded)

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


class Outcome:
    """What happened on the floor, and what that makes of what every engine said."""

    def __init__(self, site: Site, clearances_m: Sequence[float]) -> None:
        self.verdicts = [Verdict(clearance_m) for clearance_m in clearances_m]
        self.truth = Truth(clearances_m)
        self.forecasts, self.arrivals, self.contention = ForecastErrors(), Arrivals(), Contention(site)
        self._gathering = Gathering(FOLLOWED)
        self.vendor_of: dict[str, str] = {}
        """By robot that has said where it is."""
        self._name_of: dict[str, str] = {}
        """What a person calls each of them."""
        self._floors: Sequence[str] = ()
        """By index, as batches have them."""
        self._floor_names = {one.id: one.name for one in site.datums}
        self._vendors = VendorRecords()

    def take(self, one: Pass, said: Sequence[Said]) -> None:
        """One pass and what each engine said at it."""
        now_s, batch = one.now_s, one.batch
        self.vendor_of.update(zip(batch.robots, batch.vendors, strict=True))
        self._name_of.update(zip(batch.robots, batch.names, strict=True))
        self._floors = batch.floors
        self.truth.report(batch.robots, batch.forecasts)
        makers = list(zip(batch.vendors, batch.models, strict=True))
        self.forecasts.take(batch.robots, makers, batch.forecasts, said[0].bands_m if said else None)
        self.forecasts.advance(now_s)
        for due in self._gathering.put(batch):
            self._follow(due.batch)
        self.contention.hear(now_s, said[0].others if said else ())
        for verdict, each in zip(self.verdicts, said, strict=True):
            verdict.take(now_s, each)
        if one.measured and said and said[0].measured:
            self._vendors.look(now_s, (one.measured, said[0].measured))
        looked_until_s = self.truth.until_s
        self.truth.advance(now_s)
        if self.truth.until_s > looked_until_s:
            self._resolve()

    def _follow(self, batch: Batch) -> None:
        """What is asked of in the end alone."""
        self.arrivals.take(batch)
        self.contention.take(batch)

    def result(self, reading: Reading, measured: Sequence[dict[str, Any]]) -> dict[str, Any]:
        """What the log held, and the scores of every clearance, once nothing more comes.

        `measured` is what the first clearance's engine would tell of itself in the end; empty where there is none.
        """
        for due in self._gathering.rest():
            self._follow(due.batch)
        self.truth.finish()
        self.forecasts.finish()
        self._resolve()
        presence = Presence(self.vendor_of, self.truth.motion.present_s())
        scores = [self._score(verdict, presence) for verdict in self.verdicts]
        ece = {one["vendor"]: one["ece"] for one in scores[0]["by_vendor"]} if scores else {}
        scenes = self.truth.scenes.finish(self.truth.motion) if self.verdicts else []
        nearest = [self._scene(scene, reading.first_s) for scene in scenes]
        self._vendors.look(reading.now_s, (reading.measured(), *measured))
        return {
            "messages": reading.messages,
            "robots": len(self.vendor_of),
            "span_s": reading.span_s,
            "scores": scores,
            "vendors": self._vendors.figures(ece),
            "forecast_error": self.forecasts.figures(),
            "arrivals": self.arrivals.figures(),
            "contention": self.contention.figures(),
            "advisories_raised": dict(sorted(self.verdicts[0].raised.items())) if self.verdicts else {},
            "nearest": nearest,
            "conformance": conform.findings(reading.fleet.measures),
        }

    def _scene(self, scene: Scene, first_s: float) -> dict[str, Any]:
        """One of the nearest moments, and when the first clearance's advisory was raised before it.

        One that stands is told of before one that has been cleared, and the earliest of them.
        """
        at_s = scene.at_s
        before = [
            (told.cleared_s < at_s, told.raised_s, told.cleared_s)
            for told in self.verdicts[0].told.values()
            if told.pair == scene.pair and told.raised_s < at_s and told.cleared_s > at_s - FORESEEN_S
        ]
        over, raised_s, cleared_s = min(before, default=(False, None, inf))
        floor = self._floors[scene.floor] if scene.floor >= 0 else ""
        return {
            "vendors": [self.vendor_of[robot] for robot in scene.pair],
            "names": [self._name_of[robot] for robot in scene.pair],
            "at": stamps.write(round(at_s, 1)),
            "into_s": round(at_s - first_s, 1),
            "floor": floor,
            "floor_name": self._floor_names.get(floor, ""),
            "warned_s": None if raised_s is None else at_s - raised_s,
            "warned_until_s": at_s - cleared_s if over else None,
            **scene.document(),
        }

    def _resolve(self) -> None:
        for verdict in self.verdicts:
            verdict.calibration.resolve(self.truth, self.vendor_of)

    def _score(self, verdict: Verdict, presence: Presence) -> dict[str, Any]:
        figures = score(
            self.truth.encounters(verdict.clearance_m),
            list(verdict.alerts(self.truth)),
            verdict.clearance_m,
            presence,
            verdict.calibration.by_vendors,
        )
        return figures | {
            "censored_samples": int(verdict.calibration.whole().left.sum()),
            "heeded_samples": verdict.calibration.heeded,
            "settled": {"after_s": SETTLED_S, **verdict.calibration.settled.figures()},
        }


def replay(
    reader: Reader,
    events: Iterable[Event],
    site: Site,
    clearances_m: Sequence[float],
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
    began = time.perf_counter()
    reading, outcome = Reading(site), Outcome(site, clearances_m)
    runs = [Run(site, clearance_m, start) for clearance_m in clearances_m]
    for one in chain(reading.take(events), reading.finish()):
        if watch:
            watch(one.now_s, one.batch)
        said = [run.step(one) for run in runs]
        outcome.take(one, said)
        if tell:
            for line in streamed(said):
                tell(line)
    result = outcome.result(reading, [run.measured() for run in runs[:1]])
    return document(result, reader, time.perf_counter() - began)


def document(result: dict[str, Any], reader: Reader, took_s: float) -> dict[str, Any]:
    """A result with how it was come by."""
    return {
        "messages": result["messages"],
        "robots": result["robots"],
        "span_s": result["span_s"],
        "speed_x_real_time": result["span_s"] / took_s,
        **conform.lines(reader),
        **result,
    }


def streamed(said: Sequence[Said]) -> list[Line]:
    """What the live stream would have told at one pass, of what each engine said at it."""
    revisions = [revision for each in said for revision in each.revisions]
    return [advisory_line(revision) for revision in sorted(revisions, key=lambda each: (each.clearance_m, each.id))]


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
