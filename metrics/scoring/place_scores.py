"""Scores of forecasts for shared places, up to a quarter of an hour ahead: who arrives when, when a place is full, and
who will need a charger.

Every ten seconds the service predicts for each resource who occupies it and who will, from when to when. A predicted
robot has arrived once the centre of its envelope is inside. A robot that has not arrived by the predicted time is late
by at least the time until its last report. If it did not report after the predicted time, the outcome is unknown. The
predicted need for a charger is compared with whether the robot came to one within the time.
"""

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import inf
from typing import Any, NamedTuple

import numpy as np

from deconflict.contention.queues.charger_forecast import AHEAD_S as NEEDS_AHEAD_S
from deconflict.contention.queues.charger_forecast import ChargingNeed
from deconflict.contention.queues.queue_forecast import QueueForecast
from deconflict.settings.shared_places import Resource
from ingest.batch import Bools, Floats, Ints
from metrics.scoring.length_quantiles import BINS, bins_of, quantile
from metrics.truth.resource_use import PlaceEntry

AHEAD_S: Floats = np.array([30.0, 60.0, 120.0, 300.0, 900.0])
"""Upper bounds of the classes of time ahead."""
EVERY_S = 10.0
GIVEN_UP_S = 900.0
"""A robot that is later than this counts as never arriving."""
REPORTS_S = 60.0
"""A robot reports again within this time. Until then it is not known what it did."""


class PlannedStay(NamedTuple):
    """One robot occupies a resource, or is predicted to. Times are seconds since the epoch."""

    place: str
    robot: str
    coming: bool
    """Whether it has not arrived yet."""
    begin_s: float
    end_s: float


class PlaceForecast(NamedTuple):
    """The service's forecast for places at one moment."""

    turns: Sequence[PlannedStay]
    """Occupations of resources."""
    needs: Mapping[str, Floats]
    """By robot that has not announced a charger as its destination: probability that it needs one within each of
    `AHEAD_S`."""


class PlannedArrival(NamedTuple):
    """One prediction that a robot arrives."""

    predicted_s: float
    begin_s: float


def forecast_of(
    turns: Mapping[str, QueueForecast], needs: Iterable[ChargingNeed], resources: Iterable[Resource]
) -> PlaceForecast:
    """The forecast of an engine. `turns` are those of all places."""
    at_s, ahead_s = np.concatenate([[0.0], NEEDS_AHEAD_S]), AHEAD_S
    likely = {need.robot: np.interp(ahead_s, at_s, np.concatenate([[0.0], need.likely])) for need in needs}
    return PlaceForecast(planned_stays(turns, resources), likely)


def planned_stays(turns: Mapping[str, QueueForecast], resources: Iterable[Resource]) -> list[PlannedStay]:
    """The current and predicted occupations of resources."""
    return [
        PlannedStay(resource.id, row.robot, row.coming, begin_s, end_s)
        for resource in resources
        if resource.id in turns
        for row, begin_s, end_s in zip(
            turns[resource.id].entries, turns[resource.id].begin_s, turns[resource.id].end_s, strict=True
        )
    ]


@dataclass(slots=True, eq=False)
class PlaceCounts:
    """Counts of one class of time ahead."""

    off: Ints = field(default_factory=lambda: np.zeros(BINS, np.int64))
    """(BINS,) errors of predicted arrival times, by size in seconds."""
    predicted: int = 0
    """Predicted arrivals whose outcome is known."""
    arrived: int = 0
    """Those of which the robot arrived."""
    late: int = 0
    """Those of which the robot was late."""
    entries: int = 0
    """Robots that arrived."""
    predicted_entries: int = 0
    """Those of them that were predicted to arrive, or to need a charger with a probability of at least one half."""
    needs: Floats = field(default_factory=lambda: np.zeros(4))
    """(4,) number of predicted needs for a charger, sum of their probabilities, number that came to one, and sum of
    squared errors."""


class PlaceScores:
    """Forecasts for resources, kept until their outcome is known."""

    def __init__(self, resources: Sequence[Resource], last_seen_s: Mapping[str, float]) -> None:
        """`last_seen_s` is the time of the last report by robot. The caller keeps it up to date."""
        self._capacity, self._last_seen_s = {resource.id: resource.capacity for resource in resources}, last_seen_s
        self._counts = [PlaceCounts() for _ in AHEAD_S]
        self._waiting: dict[tuple[str, str], list[PlannedArrival]] = {}
        """Predicted arrivals without a known outcome, by place and robot, in the order of prediction."""
        self._chargers = {resource.id for resource in resources if resource.kind == "charger"}
        self._needs: dict[str, deque[tuple[float, Floats]]] = {}
        """By robot: times at which its need for a charger was predicted, ascending, and the probability within each of
        `AHEAD_S`. None is empty."""
        self._full: list[tuple[float, Ints]] = []
        """Time of each forecast, and (places, len(AHEAD_S)) whether each place is predicted to be full then."""
        self._first_s = inf

    def add_forecast(self, now_s: float, forecast: PlaceForecast) -> None:
        """Add the forecast that the service makes now."""
        self._first_s = min(self._first_s, now_s)
        numbers = {place: number for number, place in enumerate(self._capacity)}
        inside, at_s = np.zeros((len(numbers), len(AHEAD_S)), np.int64), now_s + AHEAD_S
        for robot, likely in forecast.needs.items():
            self._needs.setdefault(robot, deque()).append((now_s, likely))
        for stay in forecast.turns:
            inside[numbers[stay.place]] += (stay.begin_s <= at_s) & (at_s < stay.end_s)
            if stay.coming and stay.begin_s - now_s <= AHEAD_S[-1]:
                self._waiting.setdefault((stay.place, stay.robot), []).append(PlannedArrival(now_s, stay.begin_s))
        capacity = np.array(list(self._capacity.values()))
        self._full.append((now_s, (inside >= capacity[:, None]).astype(np.int8)))

    def add_entry(self, entry: PlaceEntry) -> None:
        """Add the entry of a robot into a place. Predictions made after its time stay open."""
        if entry.place not in self._capacity:
            return
        predictions = self._waiting.pop((entry.place, entry.robot), [])
        before = [prediction for prediction in predictions if prediction.predicted_s < entry.t_s]
        if after := predictions[len(before) :]:
            self._waiting[entry.place, entry.robot] = after
        for prediction in before:
            self._count(prediction, entry.t_s - prediction.begin_s, arrived=True)
        ahead_s = entry.t_s - np.array([prediction.predicted_s for prediction in before])
        needed_s = self._needs_before(entry) if entry.place in self._chargers else np.empty((0, len(AHEAD_S)))
        heard_s = entry.t_s - max(entry.known_s, self._first_s)
        for column, (least_s, most_s) in enumerate(pairwise((0.0, *AHEAD_S.tolist()))):
            if heard_s >= most_s:
                predicted_s = np.concatenate([ahead_s, needed_s[:, column]])
                self._counts[column].entries += 1
                self._counts[column].predicted_entries += bool(
                    ((predicted_s > least_s) & (predicted_s <= most_s)).any()
                )

    def _needs_before(self, entry: PlaceEntry) -> Floats:
        """Count the predicted needs of a robot that has come to a charger.

        Returns (n, len(AHEAD_S)) how long before that its need was predicted with a probability of at least one half,
        within each of `AHEAD_S`; nan if it was not.
        """
        before = self._take_needs(entry.robot, entry.t_s)
        for predicted_s, likely in before:
            self._count_need(likely, entry.t_s - predicted_s <= AHEAD_S, np.full(len(AHEAD_S), True))
        ahead_s = np.array([entry.t_s - predicted_s for predicted_s, _ in before])[:, None]
        likely = np.array([likely for _, likely in before]).reshape(-1, len(AHEAD_S))
        return np.where(likely >= 0.5, ahead_s, np.nan)

    def _count_need(self, likely: Floats, arrived: Bools, known: Bools) -> None:
        """Count one predicted need and whether the robot came to a charger, by `AHEAD_S` as far as it is known."""
        for column in np.flatnonzero(known).tolist():
            probability, outcome = float(likely[column]), float(arrived[column])
            self._counts[column].needs += (1.0, probability, outcome, (probability - outcome) ** 2)

    def forget(self, robot: str) -> None:
        """Drop the predictions of a robot that has left, because their outcome is unknown."""
        self._needs.pop(robot, None)
        for key in [key for key in self._waiting if key[1] == robot]:
            del self._waiting[key]

    def figures(self, last_s: float, stays: Mapping[str, Floats]) -> list[dict[str, Any]]:
        """Figures by time ahead. `stays` (n, 2) are begin and end of the stays of robots in each place, until `last_s`.

        Also counts the predictions that are still open. Call it once, at the end.
        """
        for (_, robot), predictions in self._waiting.items():
            for prediction in predictions:
                self._count_missed(prediction, robot)
        self._waiting.clear()
        for robot in list(self._needs):
            self._count_unneeded(robot, inf)
        if not any(counts.predicted or counts.entries or counts.needs[0] for counts in self._counts):
            return []
        full = self._full_figures(last_s, stays)
        return [
            {"ahead_up_to_s": ahead_s, **_figures(counts), **of_full}
            for ahead_s, counts, of_full in zip(AHEAD_S.tolist(), self._counts, full, strict=True)
        ]

    def _count(self, prediction: PlannedArrival, late_s: float, *, arrived: bool) -> None:
        counts = self._counts[int(np.searchsorted(AHEAD_S, prediction.begin_s - prediction.predicted_s))]
        counts.predicted += 1
        counts.arrived += arrived
        counts.late += late_s > 0
        counts.off += np.bincount(bins_of(np.array([abs(late_s)])), minlength=BINS)

    def advance(self, now_s: float) -> None:
        """Count the predictions of robots that will not arrive any more. All events until `now_s` must be known."""
        for key, predictions in list(self._waiting.items()):
            while predictions and predictions[0].begin_s + GIVEN_UP_S < now_s:
                self._count_missed(predictions.pop(0), key[1])
            if not predictions:
                del self._waiting[key]
        due_s = now_s - float(AHEAD_S[-1]) - REPORTS_S
        for robot in [robot for robot, predictions in self._needs.items() if predictions[0][0] < due_s]:
            self._count_unneeded(robot, due_s)

    def _count_unneeded(self, robot: str, until_s: float) -> None:
        """Count the needs predicted before `until_s` of a robot that has not come to a charger."""
        seen_s = self._last_seen_s.get(robot, -inf)
        for predicted_s, likely in self._take_needs(robot, until_s):
            self._count_need(likely, np.full(len(AHEAD_S), False), predicted_s + AHEAD_S <= seen_s)

    def _take_needs(self, robot: str, until_s: float) -> list[tuple[float, Floats]]:
        """Remove and return the needs of a robot that were predicted before `until_s`."""
        predictions, taken = self._needs.get(robot, deque()), []
        while predictions and predictions[0][0] < until_s:
            taken.append(predictions.popleft())
        if not predictions:
            self._needs.pop(robot, None)
        return taken

    def _count_missed(self, prediction: PlannedArrival, robot: str) -> None:
        """Count a prediction whose robot has not arrived, if the robot reported after the predicted time."""
        late_s = min(self._last_seen_s.get(robot, -inf) - prediction.begin_s, GIVEN_UP_S)
        if late_s > 0:
            self._count(prediction, late_s, arrived=False)

    def _full_figures(self, last_s: float, stays: Mapping[str, Floats]) -> list[dict[str, Any]]:
        at_s = np.array([predicted_s for predicted_s, _ in self._full])[:, None] + AHEAD_S
        predicted = np.array([full for _, full in self._full], bool)
        actual = np.stack(
            [_inside(stays[place], at_s) >= capacity for place, capacity in self._capacity.items()], axis=1
        )
        known = np.broadcast_to((at_s <= last_s)[:, None], predicted.shape)
        return [
            _full_row(predicted[:, :, column][known[:, :, column]], actual[:, :, column][known[:, :, column]])
            for column in range(len(AHEAD_S))
        ]


def _inside(stays_s: Floats, at_s: Floats) -> Ints:
    """The number of robots in a place at each time."""
    arrived, left = (np.sort(column) for column in stays_s.T)
    return np.searchsorted(arrived, at_s, "right") - np.searchsorted(left, at_s, "right")


def _full_row(predicted: Bools, actual: Bools) -> dict[str, Any]:
    both = int((predicted & actual).sum())
    return {
        "full_said": int(predicted.sum()),
        "full_precision": _share(both, int(predicted.sum())),
        "full_happened": int(actual.sum()),
        "full_recall": _share(both, int(actual.sum())),
    }


def _figures(counts: PlaceCounts) -> dict[str, Any]:
    return {
        "said": counts.predicted,
        "came": _share(counts.arrived, counts.predicted),
        "off_median_s": quantile(counts.off, 0.5),
        "off_p90_s": quantile(counts.off, 0.9),
        "late": _share(counts.late, counts.predicted),
        "entries": counts.entries,
        "foretold": _share(counts.predicted_entries, counts.entries),
        **_need_figures(*counts.needs.tolist()),
    }


def _need_figures(count: float, probability: float, arrived: float, squared: float) -> dict[str, Any]:
    return {
        "need_said": int(count),
        "need_likely": probability / count if count else None,
        "need_came": arrived / count if count else None,
        "need_brier": squared / count if count else None,
    }


def _share(part: int, whole: int) -> float | None:
    return part / whole if whole else None
