"""A recorded log through the engine that the live service uses, and what became of its advisories.

Three steps, each with a state of its own: `Reading` makes passes of messages, a `Run` for each clearance says what the
engine says at a pass, and the `Outcome` holds that against what happened.
"""

import time
from collections.abc import Callable, Iterable, Sequence
from itertools import chain
from math import floor, inf
from typing import Any

from deconflict.advisory import AdvisoryState, ConflictAdvisory
from deconflict.contention.robots.batch_merging import Gathering
from deconflict.engine.engine import Engine
from deconflict.operator.blackbox.start_state import Start
from deconflict.settings.site import Site
from ingest.batch import Batch, Floats
from ingest.languages.massrobotics import timestamps
from ingest.recording.log_reader import Event, Reader
from metrics.replay import conformance_counts
from metrics.replay.clearance_scores import Verdict
from metrics.replay.engine_output import Published, Said
from metrics.replay.engine_passes import Pass, Reading
from metrics.scoring.arrival_scores import Arrivals
from metrics.scoring.contention_scores import Contention
from metrics.scoring.forecast_scores import ForecastErrors
from metrics.scoring.place_scores import EVERY_S, Forecast, forecast_of
from metrics.scoring.vendor_records import VendorRecords
from metrics.truth.absences import Absences
from metrics.truth.encounters import Truth
from metrics.truth.interactions import Interactions
from metrics.truth.nearest_scenes import Scene

FORESEEN_S = 10.0
"""An advisory that was cleared longer before a near moment than this had nothing to do with it."""
FOLLOWED = 1024
"""Robots whose reports are followed at once: for what is asked of in the end, no pass has to be short."""

Line = dict[str, Any]
Tell = Callable[[Line], None]
Watch = Callable[[float, Batch], None]


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
        self._second, self._places_said = -1, -1

    def step(self, one: Pass) -> Said:
        bands_m = self._bands_m(one.batch)
        self.engine.receive(one.batch)
        told = self.engine.step(one.now_s, one.effort, one.pending, one.heard)
        raised = [each.kind for each in told if each.state is AdvisoryState.RAISED]
        revisions = [each for each in told if isinstance(each, ConflictAdvisory)]
        others = [each for each in told if not isinstance(each, ConflictAdvisory)]
        waiting = self.engine.foresight.robots_following_advice(one.now_s)
        measured = self.measured() if one.measured else None
        published, places = self._published(one.now_s), self._places(one.now_s)
        return Said(revisions, others, raised, *published, bands_m, waiting, measured, places)

    def measured(self) -> dict[str, Any]:
        """What the engine would tell of itself now."""
        return self.engine.measures.as_document()

    def _published(self, now_s: float) -> tuple[Published, Published]:
        """The probabilities of getting in each other's way and of contact, at the first pass of each second."""
        if floor(now_s) == self._second:
            return (), ()
        self._second = floor(now_s)
        return self.engine.probabilities(), self.engine.foresight.contact_probabilities()

    def _places(self, now_s: float) -> Forecast | None:
        """What is said of places at the first pass of each `EVERY_S`; None at others."""
        if floor(now_s / EVERY_S) == self._places_said:
            return None
        self._places_said = floor(now_s / EVERY_S)
        return forecast_of(self.engine.turns(), self.engine.needs(), self.engine.site.resources)

    def _bands_m(self, batch: Batch) -> Floats:
        ledger = self.engine.foresight.ledger
        rows = ledger.rows(batch.vendors, batch.models, batch.basis.tolist(), batch.now_s)
        bands_m: Floats = ledger.bands_m[rows]
        return bands_m


class Outcome:
    """What happened on the floor, and what that makes of what every engine said."""

    def __init__(self, site: Site, clearances_m: Sequence[float]) -> None:
        self.truth, self.interactions = Truth(clearances_m), Interactions()
        self.absences = Absences(clearances_m)
        of_all = (self.truth, self.interactions, self.absences)
        self.verdicts = [Verdict(clearance_m, *of_all) for clearance_m in clearances_m]
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
        self._second: int | None = None

    def take(self, one: Pass, said: Sequence[Said]) -> None:
        """One pass and what each engine said at it."""
        now_s, batch = one.now_s, one.batch
        self.vendor_of.update(zip(batch.robots, batch.vendors, strict=True))
        self._name_of.update(zip(batch.robots, batch.names, strict=True))
        self._floors = batch.floors
        self.truth.report(batch.robots, batch.forecasts)
        self.absences.take(batch)
        makers = list(zip(batch.vendors, batch.models, strict=True))
        self.forecasts.take(batch.robots, makers, batch.forecasts, said[0].bands_m if said else None)
        self.forecasts.advance(now_s)
        for due in self._gathering.put(batch):
            self._follow(due.batch)
        others, places = (said[0].others, said[0].places) if said else ((), None)
        self.contention.hear(now_s, others, places)
        self.interactions.take(batch, self.forecasts.usually_aside_m(makers))
        for verdict, each in zip(self.verdicts, said, strict=True):
            verdict.take(now_s, batch, each)
        self._look(now_s)
        if one.measured and said and said[0].measured:
            self._vendors.look(now_s, (one.measured, said[0].measured))
        looked_until_s = self.truth.until_s
        self.truth.advance(now_s)
        if self.truth.until_s > looked_until_s:
            self._resolve()

    def _look(self, now_s: float) -> None:
        """Let the believers of paths look, at the first pass of each second."""
        before, self._second = self._second, floor(now_s)
        if before == self._second:
            return
        fallen_silent = self.truth.silences.fallen_silent(now_s)
        for verdict in self.verdicts:
            verdict.believer.look(now_s, fallen_silent)

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
        self.absences.finish()
        self.forecasts.finish()
        self._resolve()
        scores = [verdict.score(self.vendor_of, reading.now_s) for verdict in self.verdicts]
        ece = {one["vendor"]: one["ece"] for one in scores[0]["by_vendor"]} if scores else {}
        scenes = self.truth.scenes.finish(self.truth.motion) if self.verdicts else []
        nearest = [self._scene(scene, reading.first_s) for scene in scenes]
        self._vendors.look(reading.now_s, (reading.measured(), *measured))
        return {
            "messages": reading.messages,
            "robots": len(self.vendor_of),
            "span_s": reading.span_s,
            "scores": scores,
            "interactions": self.interactions.figures(),
            "vendors": self._vendors.figures(ece),
            "forecast_error": self.forecasts.figures(),
            "arrivals": self.arrivals.figures(),
            "contention": self.contention.figures(),
            "places": self.contention.places(),
            "advisories_raised": dict(sorted(self.verdicts[0].raised.items())) if self.verdicts else {},
            "nearest": nearest,
            "conformance": conformance_counts.findings(reading.fleet.measures),
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
            "at": timestamps.write(round(at_s, 1)),
            "into_s": round(at_s - first_s, 1),
            "floor": floor,
            "floor_name": self._floor_names.get(floor, ""),
            "warned_s": None if raised_s is None else at_s - raised_s,
            "warned_until_s": at_s - cleared_s if over else None,
            **scene.document(),
        }

    def _resolve(self) -> None:
        for verdict in self.verdicts:
            verdict.resolve(self.vendor_of)


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
        **conformance_counts.lines(reader),
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
