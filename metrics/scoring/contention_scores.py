"""Scores of advisories on contention, double occupancy, deadlocks and blockages.

An advisory came true if its event began before the advisory was cleared, or within 5 s after that.

| advisory | event |
| --- | --- |
| contention | one of its robots waited for the place |
| double occupancy | more robots were in the place than its capacity, for at least 2 s |
| deadlock | all robots of its ring stood at the same time for at least 5 s |
| blockage | a robot that it delays stood within 4 m of the blocker, outside of every resource |

Recall is known only for the first two: all waits longer than the site's limit, and all double occupancies.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from math import hypot, inf, nan
from typing import Any

import numpy as np

from deconflict.settings.site import Site
from deconflict_client.advisory import (
    AdvisoryState,
    AnyAdvisory,
    BlockageAdvisory,
    ContentionAdvisory,
    DeadlockAdvisory,
)
from ingest.batch import Batch, Floats
from metrics.scoring.bootstrap import interval
from metrics.scoring.place_scores import AHEAD_S, PlaceForecast, PlaceScores
from metrics.scoring.summaries import mean, means, median, spread
from metrics.truth.resource_use import ResourceUse, TimeSpan

AFTER_S = 5.0
"""An event that begins at most this long after the advisory was cleared still counts."""
GIVEN_UP_S = 30.0
"""If no event has followed this long after the predicted time, the advisory did not come true."""
CROWDED_S, LOCKED_S = 2.0, 5.0
"""Least duration of a double occupancy and of a deadlock."""
NEAR_M = 4.0
"""Greatest distance of a held up robot from the blocker."""
KINDS = ("contention", "double_occupancy", "deadlock", "blockage")


@dataclass(slots=True, eq=False)
class ContentionAlert:
    """One advisory, from its revisions so far."""

    kind: str
    places: frozenset[str]
    """Ids of the resources or of the zone that it concerns, if any."""
    spot: tuple[str, float, float]
    """Datum, x and y in the floor's frame."""
    raised_s: float
    predicted_s: float
    """When the event was predicted to begin."""
    wait_s: float
    """The longest predicted wait when it was raised. nan unless it is a contention."""
    robots: set[str] = field(default_factory=set)
    """Robots that would wait, of all revisions."""
    cleared_s: float = inf

    @property
    def stood(self) -> TimeSpan:
        return TimeSpan(self.raised_s, self.cleared_s)


@dataclass(frozen=True, slots=True)
class AlertOutcome:
    """The outcome of an advisory."""

    came_s: float
    """When the event began. nan if there was none."""
    known: bool
    """Whether the outcome is known: the log is long enough, and the robots did not leave before."""
    wait_s: float = nan
    """The longest wait of its robots. nan unless it is a contention."""


class ContentionScores:
    """Advisories of other kinds than conflicts, and what the robots then did."""

    def __init__(self, site: Site) -> None:
        self._resource_use = ResourceUse(site.resources, site.zones)
        self._place_scores = PlaceScores(site.resources, self._resource_use.last_seen_s)
        self._resources = site.resources
        self._least_wait_s = site.contention.least_wait_s
        self._alerts: dict[str, ContentionAlert] = {}
        self.outcomes: dict[str, AlertOutcome] = {}
        """By id of the advisory, once `figures` has been called."""
        self._last_s = -inf

    def add_batch(self, batch: Batch) -> None:
        """Add the reports of a batch."""
        self._resource_use.add_batch(batch)
        for entry in self._resource_use.new_entries():
            self._place_scores.add_entry(entry)
        for robot in batch.gone:
            self._place_scores.forget(robot)
        self._place_scores.advance(batch.now_s)

    def add_output(self, now_s: float, revisions: Iterable[AnyAdvisory], forecast: PlaceForecast | None = None) -> None:
        """Add the revisions of a pass, and the forecast for places if there is one."""
        self._last_s = now_s
        for revision in revisions:
            self._add_revision(revision)
        if forecast:
            self._place_scores.add_forecast(now_s, forecast)

    def _add_revision(self, revision: AnyAdvisory) -> None:
        if not isinstance(revision, ContentionAdvisory | DeadlockAdvisory | BlockageAdvisory):
            return
        alert = self._alerts.get(revision.id)
        if alert is None:
            of_places = (revision.resource, *revision.resources) if isinstance(revision, ContentionAdvisory) else ()
            wait_s = revision.wait_s if revision.kind == "contention" else nan
            spot = (revision.location.datum, revision.location.x, revision.location.y)
            times_s = (revision.raised_at.timestamp(), revision.predicted_at.timestamp())
            alert = self._alerts[revision.id] = ContentionAlert(
                revision.kind, frozenset(of_places), spot, *times_s, wait_s
            )
        alert.robots |= set(revision.holds_up if isinstance(revision, BlockageAdvisory) else revision.robots)
        if revision.state is AdvisoryState.CLEARED:
            alert.cleared_s = revision.updated_at.timestamp()

    def figures(self) -> list[dict[str, Any]]:
        """Figures by kind, without kinds that have neither advisories nor events. Call it once, after the last
        batch."""
        self._resource_use.finish()
        self.outcomes = {name: self._outcome(alert) for name, alert in self._alerts.items()}
        happened = {"contention": self._long_waits(), "double_occupancy": self._crowds()}
        rows = [
            (kind, [name for name, alert in self._alerts.items() if alert.kind == kind], happened.get(kind))
            for kind in KINDS
        ]
        return [self._figures(kind, names, events) for kind, names, events in rows if names or events]

    def place_figures(self) -> list[dict[str, Any]]:
        """Scores of the forecasts for places, by how far ahead. Call it after `figures`."""
        stays_s = {resource.id: self._resource_use.stays_s(resource.id) for resource in self._resources}
        return self._place_scores.figures(self._last_s, stays_s)

    def _figures(self, kind: str, names: Sequence[str], events: "list[Incident] | None") -> dict[str, Any]:
        alerts, outcomes = [self._alerts[name] for name in names], [self.outcomes[name] for name in names]
        came = np.array([float(np.isfinite(outcome.came_s)) if outcome.known else nan for outcome in outcomes])
        leads_s = np.array([outcome.came_s - alert.raised_s for alert, outcome in zip(alerts, outcomes, strict=True)])
        off_s = np.array([abs(outcome.wait_s - alert.wait_s) for alert, outcome in zip(alerts, outcomes, strict=True)])
        predicted = (
            None if events is None else np.array([_is_predicted(event, alerts) for event in events]).reshape(-1, 2)
        )
        return {
            "kind": kind,
            "alerts": len(alerts),
            "censored": sum(not outcome.known for outcome in outcomes),
            "precision": mean(came),
            "lead_time_s": spread(leads_s),
            "wait_error_s": median(off_s),
            "by_ahead": _by_ahead(alerts, came),
            "happened": None if events is None else len(events),
            "recall": None if predicted is None else mean(predicted[:, 0]),
            "recall_any": None if predicted is None else mean(predicted[:, 1]),
            "intervals": {
                "precision": interval(came, means),
                "recall": None if predicted is None else interval(predicted[:, 0], means),
            },
        }

    def _outcome(self, alert: ContentionAlert) -> AlertOutcome:
        spans = {
            "contention": self._waits_of,
            "double_occupancy": self._crowds_of,
            "deadlock": self._locks_of,
            "blockage": self._held_up_by,
        }[alert.kind](alert)
        if spans:
            longest_s = max(span.lasts_s for span in spans) if alert.kind == "contention" else nan
            return AlertOutcome(min(span.from_s for span in spans), known=True, wait_s=longest_s)
        until_s = alert.predicted_s + GIVEN_UP_S
        heard = any(self._resource_use.last_seen_s.get(robot, -inf) >= alert.predicted_s for robot in alert.robots)
        return AlertOutcome(nan, known=heard and self._last_s >= until_s)

    def _waits_of(self, alert: ContentionAlert) -> list[TimeSpan]:
        waits = [wait for wait in self._resource_use.waits if wait.place in alert.places and wait.robot in alert.robots]
        return [wait.span for wait in waits if _meets(wait.span, alert)]

    def _crowds_of(self, alert: ContentionAlert) -> list[TimeSpan]:
        spans = [span for place in sorted(alert.places) for span in self._resource_use.crowds.get(place, ())]
        return [span for span in spans if span.lasts_s >= CROWDED_S and _meets(span, alert)]

    def _locks_of(self, alert: ContentionAlert) -> list[TimeSpan]:
        together = [TimeSpan(-inf, inf)]
        for robot in sorted(alert.robots):
            stands = [stand.span for stand in self._resource_use.stands.get(robot, ())]
            together = [both for span in stands for so_far in together if (both := span.within(so_far)).lasts_s > 0]
        return [span for span in together if span.lasts_s >= LOCKED_S and _meets(span, alert)]

    def _held_up_by(self, alert: ContentionAlert) -> list[TimeSpan]:
        floor, x_m, y_m = alert.spot
        return [
            stand.span
            for robot in sorted(alert.robots)
            for stand in self._resource_use.stands.get(robot, ())
            if stand.outside and stand.floor == floor and hypot(stand.x_m - x_m, stand.y_m - y_m) <= NEAR_M
            if _meets(stand.span, alert)
        ]

    def _long_waits(self) -> "list[Incident]":
        """Waits that are longer than the site's limit."""
        long = (wait for wait in self._resource_use.waits if wait.span.lasts_s >= self._least_wait_s)
        return [Incident(wait.place, wait.robot, wait.span) for wait in long]

    def _crowds(self) -> "list[Incident]":
        return [
            Incident(place, "", span)
            for place, spans in self._resource_use.crowds.items()
            for span in spans
            if span.lasts_s >= CROWDED_S
        ]


def _by_ahead(alerts: Sequence[ContentionAlert], came: Floats) -> list[dict[str, Any]]:
    """Share that came true, by the predicted time ahead when they were raised. `came` (n,) is nan if it is unknown."""
    ahead_s = np.array([alert.predicted_s - alert.raised_s for alert in alerts])
    column = np.searchsorted(AHEAD_S, np.minimum(ahead_s, AHEAD_S[-1]))
    return [
        {"ahead_up_to_s": up_to_s, "alerts": int((column == at).sum()), "precision": mean(came[column == at])}
        for at, up_to_s in enumerate(AHEAD_S.tolist())
        if (column == at).any()
    ]


@dataclass(frozen=True, slots=True)
class Incident:
    """An event at a place. `robot` is "" if it concerns all robots there."""

    place: str
    robot: str
    span: TimeSpan


def _meets(span: TimeSpan, alert: ContentionAlert) -> bool:
    return span.from_s <= alert.cleared_s + AFTER_S and span.to_s >= alert.raised_s


def _is_predicted(event: Incident, alerts: Sequence[ContentionAlert]) -> tuple[float, float]:
    """Whether an advisory was open when the event began, and whether one was open at any time during it."""
    about = [
        alert.stood
        for alert in alerts
        if event.place in alert.places and (not event.robot or event.robot in alert.robots)
    ]
    before = any(stood.from_s <= event.span.from_s <= stood.to_s for stood in about)
    return float(before), float(any(event.span.within(stood).lasts_s >= 0 for stood in about))
