"""Advisories on contention, double occupancy, deadlocks and blockages, held against what robots then did.

| advisory | came true if, and began before or within 5 s after it was cleared |
| --- | --- |
| contention | one of its robots waited for the place |
| double occupancy | more robots were in the place than it takes, for at least 2 s |
| deadlock | all robots of its ring stood at the same time for at least 5 s |
| blockage | a robot that it holds up stood within 4 m of the blocker, outside of every resource |

What happened without an advisory is known of the first two: waits as long as the site wants to be told of, and crowds.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from math import hypot, inf, nan
from typing import Any

import numpy as np

from deconflict.advisory import AdvisoryState, AnyAdvisory, BlockageAdvisory, ContentionAdvisory, DeadlockAdvisory
from deconflict.settings.site import Site
from ingest.batch import Batch, Floats
from metrics.scoring.bootstrap import interval
from metrics.scoring.place_scores import AHEAD_S, PlaceForecast, PlaceScores
from metrics.scoring.summaries import mean, means, median, spread
from metrics.truth.resource_use import ResourceUse, TimeSpan

AFTER_S = 5.0
TOLD_S = 30.0
"""Of an advisory without a consequence so long after the time that it told, there was none."""
CROWDED_S, LOCKED_S = 2.0, 5.0
NEAR_M = 4.0
KINDS = ("contention", "double_occupancy", "deadlock", "blockage")


@dataclass(slots=True, eq=False)
class ContentionAlert:
    """One advisory, as it was raised and as far as it has come."""

    kind: str
    places: frozenset[str]
    """Ids of the resources or of the zone that it is of, if of any."""
    spot: tuple[str, float, float]
    raised_s: float
    predicted_s: float
    wait_s: float
    """The longest that was foretold when it was raised; nan of another kind."""
    robots: set[str] = field(default_factory=set)
    """Those that would wait, of every revision."""
    cleared_s: float = inf

    @property
    def stood(self) -> TimeSpan:
        return TimeSpan(self.raised_s, self.cleared_s)


@dataclass(frozen=True, slots=True)
class AlertOutcome:
    """What became of an advisory."""

    came_s: float
    """When what it foretold began; nan where it did not."""
    known: bool
    """Whether it can be told: the log goes on for long enough, and its robots did not leave before."""
    wait_s: float = nan
    """The longest of its robots, where it was about that."""


class ContentionScores:
    """Advisories that are not of conflicts, and the conduct of the robots."""

    def __init__(self, site: Site) -> None:
        self._resource_use = ResourceUse(site.resources, site.zones)
        self._places = PlaceScores(site.resources, self._resource_use.last_seen_s)
        self._resources = site.resources
        self._least_wait_s = site.contention.least_wait_s
        self._told: dict[str, ContentionAlert] = {}
        self._last_s = -inf

    def add_batch(self, batch: Batch) -> None:
        """Robots that have reported."""
        self._resource_use.add_batch(batch)
        for entry in self._resource_use.new_entries():
            self._places.enter(entry)
        for robot in batch.gone:
            self._places.forget(robot)
        self._places.advance(batch.now_s)

    def add_output(self, now_s: float, revisions: Iterable[AnyAdvisory], forecast: PlaceForecast | None = None) -> None:
        """What was said at a pass, and of places where that was asked for."""
        self._last_s = now_s
        for one in revisions:
            self._hear(one)
        if forecast:
            self._places.say(now_s, forecast)

    def _hear(self, one: AnyAdvisory) -> None:
        if not isinstance(one, ContentionAdvisory | DeadlockAdvisory | BlockageAdvisory):
            return
        told = self._told.get(one.id)
        if told is None:
            of_places = (one.resource, *one.resources) if isinstance(one, ContentionAdvisory) else ()
            wait_s = one.wait_s if one.kind == "contention" else nan
            spot = (one.location.datum, one.location.x, one.location.y)
            times_s = (one.raised_at.timestamp(), one.predicted_at.timestamp())
            told = self._told[one.id] = ContentionAlert(one.kind, frozenset(of_places), spot, *times_s, wait_s)
        told.robots |= set(one.holds_up if isinstance(one, BlockageAdvisory) else one.robots)
        if one.state is AdvisoryState.CLEARED:
            told.cleared_s = one.updated_at.timestamp()

    def figures(self) -> list[dict[str, Any]]:
        """By kind, of those of which anything was told or happened. Ends what goes on."""
        self._resource_use.finish()
        happened = {"contention": self._long_waits(), "double_occupancy": self._crowds()}
        rows = [(kind, [one for one in self._told.values() if one.kind == kind], happened.get(kind)) for kind in KINDS]
        return [self._figures(kind, told, events) for kind, told, events in rows if told or events]

    def place_figures(self) -> list[dict[str, Any]]:
        """What was said of places, by how far ahead; once `figures` has been asked for."""
        stays_s = {one.id: self._resource_use.stays_s(one.id) for one in self._resources}
        return self._places.figures(self._last_s, stays_s)

    def _figures(self, kind: str, told: list[ContentionAlert], events: "list[Incident] | None") -> dict[str, Any]:
        outcomes = [self._outcome(one) for one in told]
        came = np.array([float(np.isfinite(one.came_s)) if one.known else nan for one in outcomes])
        leads_s = np.array([known.came_s - one.raised_s for one, known in zip(told, outcomes, strict=True)])
        off_s = np.array([abs(known.wait_s - one.wait_s) for one, known in zip(told, outcomes, strict=True)])
        foretold = None if events is None else np.array([_is_told(one, told) for one in events]).reshape(-1, 2)
        return {
            "kind": kind,
            "alerts": len(told),
            "censored": sum(not one.known for one in outcomes),
            "precision": mean(came),
            "lead_time_s": spread(leads_s),
            "wait_error_s": median(off_s),
            "by_ahead": _by_ahead(told, came),
            "happened": None if events is None else len(events),
            "recall": None if foretold is None else mean(foretold[:, 0]),
            "recall_any": None if foretold is None else mean(foretold[:, 1]),
            "intervals": {
                "precision": interval(came, means),
                "recall": None if foretold is None else interval(foretold[:, 0], means),
            },
        }

    def _outcome(self, one: ContentionAlert) -> AlertOutcome:
        spans = {
            "contention": self._waits_of,
            "double_occupancy": self._crowds_of,
            "deadlock": self._locks_of,
            "blockage": self._held_up_by,
        }[one.kind](one)
        if spans:
            longest_s = max(span.lasts_s for span in spans) if one.kind == "contention" else nan
            return AlertOutcome(min(span.from_s for span in spans), known=True, wait_s=longest_s)
        until_s = one.predicted_s + TOLD_S
        heard = any(self._resource_use.last_seen_s.get(robot, -inf) >= one.predicted_s for robot in one.robots)
        return AlertOutcome(nan, known=heard and self._last_s >= until_s)

    def _waits_of(self, one: ContentionAlert) -> list[TimeSpan]:
        waits = [wait for wait in self._resource_use.waits if wait.place in one.places and wait.robot in one.robots]
        return [wait.span for wait in waits if _meets(wait.span, one)]

    def _crowds_of(self, one: ContentionAlert) -> list[TimeSpan]:
        spans = [span for place in sorted(one.places) for span in self._resource_use.crowds.get(place, ())]
        return [span for span in spans if span.lasts_s >= CROWDED_S and _meets(span, one)]

    def _locks_of(self, one: ContentionAlert) -> list[TimeSpan]:
        together = [TimeSpan(-inf, inf)]
        for robot in sorted(one.robots):
            stands = [stand.span for stand in self._resource_use.stands.get(robot, ())]
            together = [both for span in stands for so_far in together if (both := span.within(so_far)).lasts_s > 0]
        return [span for span in together if span.lasts_s >= LOCKED_S and _meets(span, one)]

    def _held_up_by(self, one: ContentionAlert) -> list[TimeSpan]:
        floor, x_m, y_m = one.spot
        return [
            stand.span
            for robot in sorted(one.robots)
            for stand in self._resource_use.stands.get(robot, ())
            if stand.outside and stand.floor == floor and hypot(stand.x_m - x_m, stand.y_m - y_m) <= NEAR_M
            if _meets(stand.span, one)
        ]

    def _long_waits(self) -> "list[Incident]":
        """Waits that the site wants to be told of."""
        long = (one for one in self._resource_use.waits if one.span.lasts_s >= self._least_wait_s)
        return [Incident(one.place, one.robot, one.span) for one in long]

    def _crowds(self) -> "list[Incident]":
        return [
            Incident(place, "", span)
            for place, spans in self._resource_use.crowds.items()
            for span in spans
            if span.lasts_s >= CROWDED_S
        ]


def _by_ahead(told: Sequence[ContentionAlert], came: Floats) -> list[dict[str, Any]]:
    """How many came true, by how far ahead they were told of when they were raised; (n,) nan where it is not known."""
    ahead_s = np.array([one.predicted_s - one.raised_s for one in told])
    column = np.searchsorted(AHEAD_S, np.minimum(ahead_s, AHEAD_S[-1]))
    return [
        {"ahead_up_to_s": up_to_s, "alerts": int((column == at).sum()), "precision": mean(came[column == at])}
        for at, up_to_s in enumerate(AHEAD_S.tolist())
        if (column == at).any()
    ]


@dataclass(frozen=True, slots=True)
class Incident:
    """Something that happened at a place, to a robot or ("") to any."""

    place: str
    robot: str
    span: TimeSpan


def _meets(span: TimeSpan, one: ContentionAlert) -> bool:
    return span.from_s <= one.cleared_s + AFTER_S and span.to_s >= one.raised_s


def _is_told(event: Incident, told: Sequence[ContentionAlert]) -> tuple[float, float]:
    """Whether an advisory stood when it began, and whether one stood while it lasted."""
    about = [one.stood for one in told if event.place in one.places and (not event.robot or event.robot in one.robots)]
    before = any(stood.from_s <= event.span.from_s <= stood.to_s for stood in about)
    return float(before), float(any(event.span.within(stood).lasts_s >= 0 for stood in about))
