"""What was said of places up to a quarter of an hour ahead, by how far ahead: who comes when, when a place is full, and
who will need a charger.

Every ten seconds the service says of each resource who has it, who will want it, and from when to when each has it. Who
was said to come has come once its envelope's middle is inside. One that had not by the time told is late by at least as
long as it was watched after that; where that is nothing, it is not known what came of it. A robot that will need a
charger, as its battery tells, is held against whether it has come to one by then.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import inf
from typing import Any, NamedTuple

import numpy as np

from deconflict.contention.queues.charger_forecast import AHEAD_S as NEEDS_AHEAD_S
from deconflict.contention.queues.charger_forecast import Need
from deconflict.contention.queues.queue_forecast import Turns
from deconflict.settings.shared_places import Resource
from ingest.batch import Bools, Floats, Ints
from metrics.scoring.length_quantiles import BINS, bins_of, quantile
from metrics.truth.resource_use import PlaceEntry

AHEAD_S: Floats = np.array([30.0, 60.0, 120.0, 300.0, 900.0])
"""What was said up to so long ahead, and longer than the one before, is counted together."""
EVERY_S = 10.0
GIVEN_UP_S = 900.0
"""A robot that is later than this does not come any more."""
REPORTS_S = 60.0
"""Within so long a robot reports again: until then it is not known what it did."""


class PlannedStay(NamedTuple):
    """One robot has a resource, or will. Times are seconds since the epoch."""

    place: str
    robot: str
    coming: bool
    """It is not there yet."""
    begin_s: float
    end_s: float


class PlaceForecast(NamedTuple):
    """What the service says of places at one moment."""

    turns: Sequence[PlannedStay]
    """Of resources."""
    needs: Mapping[str, Floats]
    """By robot that has not said that it comes to a charger, how likely it does within each of `AHEAD_S`."""


class PlannedArrival(NamedTuple):
    """One robot was said to come."""

    said_s: float
    begin_s: float


def forecast_of(turns: Mapping[str, Turns], needs: Iterable[Need], resources: Iterable[Resource]) -> PlaceForecast:
    """What an engine says, with `turns` of all places."""
    at_s, ahead_s = np.concatenate([[0.0], NEEDS_AHEAD_S]), AHEAD_S
    likely = {one.robot: np.interp(ahead_s, at_s, np.concatenate([[0.0], one.likely])) for one in needs}
    return PlaceForecast(turns_said(turns, resources), likely)


def turns_said(turns: Mapping[str, Turns], resources: Iterable[Resource]) -> list[PlannedStay]:
    """What the service says of resources."""
    return [
        PlannedStay(one.id, row.robot, row.coming, begin_s, end_s)
        for one in resources
        if one.id in turns
        for row, begin_s, end_s in zip(turns[one.id].rows, turns[one.id].begin_s, turns[one.id].end_s, strict=True)
    ]


@dataclass(slots=True, eq=False)
class PlaceCounts:
    """Of what was said so far ahead."""

    off: Ints = field(default_factory=lambda: np.zeros(BINS, np.int64))
    """By size, how far off the times were, in seconds."""
    said: int = 0
    came: int = 0
    late: int = 0
    entries: int = 0
    """Robots that came."""
    foretold: int = 0
    """Those of them that were said to, or that would more likely than not need a charger."""
    needs: Floats = field(default_factory=lambda: np.zeros(4))
    """How often robots were said to need a charger, the sum of how likely, how often they came to one, and the sum of
    squared errors of that."""


class PlaceScores:
    """What was said of resources, until it is known what became of it."""

    def __init__(self, resources: Sequence[Resource], last_seen_s: Mapping[str, float]) -> None:
        """`last_seen_s` says by robot when it was heard of last; it is kept up to date by another."""
        self._capacity, self._last_seen_s = {one.id: one.capacity for one in resources}, last_seen_s
        self._counts = [PlaceCounts() for _ in AHEAD_S]
        self._waiting: dict[tuple[str, str], list[PlannedArrival]] = {}
        """By place and robot, in the order in which it was said."""
        self._chargers = {one.id for one in resources if one.kind == "charger"}
        self._needs: dict[str, list[tuple[float, Floats]]] = {}
        """By robot, when it was said to need a charger, and how likely within each of `AHEAD_S`."""
        self._full: list[tuple[float, Ints]] = []
        """When something was said, and (places, len(AHEAD_S)) whether each place is full so long after."""
        self._first_s = inf

    def say(self, now_s: float, forecast: PlaceForecast) -> None:
        """What the service says now."""
        self._first_s = min(self._first_s, now_s)
        numbers = {place: number for number, place in enumerate(self._capacity)}
        inside, at_s = np.zeros((len(numbers), len(AHEAD_S)), np.int64), now_s + AHEAD_S
        for robot, likely in forecast.needs.items():
            self._needs.setdefault(robot, []).append((now_s, likely))
        for one in forecast.turns:
            inside[numbers[one.place]] += (one.begin_s <= at_s) & (at_s < one.end_s)
            if one.coming and one.begin_s - now_s <= AHEAD_S[-1]:
                self._waiting.setdefault((one.place, one.robot), []).append(PlannedArrival(now_s, one.begin_s))
        capacity = np.array(list(self._capacity.values()))
        self._full.append((now_s, (inside >= capacity[:, None]).astype(np.int8)))

    def enter(self, entry: PlaceEntry) -> None:
        """A robot has come, wherever that is heard of later than what was said since."""
        if entry.place not in self._capacity:
            return
        said = self._waiting.pop((entry.place, entry.robot), [])
        before = [one for one in said if one.said_s < entry.t_s]
        if after := said[len(before) :]:
            self._waiting[entry.place, entry.robot] = after
        for one in before:
            self._judge(one, entry.t_s - one.begin_s, came=True)
        ahead_s = entry.t_s - np.array([one.said_s for one in before])
        needed_s = self._need(entry) if entry.place in self._chargers else np.empty((0, len(AHEAD_S)))
        heard_s = entry.t_s - max(entry.known_s, self._first_s)
        for column, (least_s, most_s) in enumerate(pairwise((0.0, *AHEAD_S.tolist()))):
            if heard_s >= most_s:
                said_s = np.concatenate([ahead_s, needed_s[:, column]])
                self._counts[column].entries += 1
                self._counts[column].foretold += bool(((said_s > least_s) & (said_s <= most_s)).any())

    def _need(self, entry: PlaceEntry) -> Floats:
        """A robot has come to a charger: (n, len(AHEAD_S)) how long before that it was said to need one, more likely
        than not, within each of `AHEAD_S`; nan where it was not."""
        said = self._needs.pop(entry.robot, [])
        before = [one for one in said if one[0] < entry.t_s]
        if after := said[len(before) :]:
            self._needs[entry.robot] = after
        for said_s, likely in before:
            self._judge_need(likely, entry.t_s - said_s <= AHEAD_S, np.full(len(AHEAD_S), True))
        ahead_s = np.array([entry.t_s - said_s for said_s, _ in before])[:, None]
        likely = np.array([likely for _, likely in before]).reshape(-1, len(AHEAD_S))
        needed_s: Floats = np.where(likely >= 0.5, ahead_s, np.nan)
        return needed_s

    def _judge_need(self, likely: Floats, came: Bools, known: Bools) -> None:
        """What was said of one robot, and whether it came to a charger, by `AHEAD_S` as far as that is known."""
        for column in np.flatnonzero(known).tolist():
            share, truly = float(likely[column]), float(came[column])
            self._counts[column].needs += (1.0, share, truly, (share - truly) ** 2)

    def forget(self, robot: str) -> None:
        """A robot has left: what would have come of it is not known."""
        self._needs.pop(robot, None)
        for key in [key for key in self._waiting if key[1] == robot]:
            del self._waiting[key]

    def figures(self, last_s: float, stays: Mapping[str, Floats]) -> list[dict[str, Any]]:
        """By how far ahead it was said; `stays` (n, 2) are from when to when robots were in each place, until `last_s`.

        Ends what waits.
        """
        for (_, robot), said in self._waiting.items():
            for one in said:
                self._miss(one, robot)
        self._waiting.clear()
        for robot in list(self._needs):
            self._not_needed(robot, inf)
        if not any(counts.said or counts.entries or counts.needs[0] for counts in self._counts):
            return []
        full = self._full_figures(last_s, stays)
        return [
            {"ahead_up_to_s": ahead_s, **_figures(counts), **of_full}
            for ahead_s, counts, of_full in zip(AHEAD_S.tolist(), self._counts, full, strict=True)
        ]

    def _judge(self, one: PlannedArrival, late_s: float, *, came: bool) -> None:
        counts = self._counts[int(np.searchsorted(AHEAD_S, one.begin_s - one.said_s))]
        counts.said += 1
        counts.came += came
        counts.late += late_s > 0
        counts.off += np.bincount(bins_of(np.array([abs(late_s)])), minlength=BINS)

    def advance(self, now_s: float) -> None:
        """Judge what was said of robots that do not come any more, once all that happened until `now_s` is known."""
        for key, said in list(self._waiting.items()):
            while said and said[0].begin_s + GIVEN_UP_S < now_s:
                self._miss(said.pop(0), key[1])
            if not said:
                del self._waiting[key]
        for robot in list(self._needs):
            self._not_needed(robot, now_s - AHEAD_S[-1] - REPORTS_S)

    def _not_needed(self, robot: str, until_s: float) -> None:
        """Judge what was said before `until_s` of a robot that has not come to a charger."""
        said, seen_s = self._needs.pop(robot), self._last_seen_s.get(robot, -inf)
        for said_s, likely in said:
            if said_s < until_s:
                self._judge_need(likely, np.full(len(AHEAD_S), False), said_s + AHEAD_S <= seen_s)
        if rest := [one for one in said if one[0] >= until_s]:
            self._needs[robot] = rest

    def _miss(self, one: PlannedArrival, robot: str) -> None:
        """Judge what was said of a robot that has not come, if it was heard of after the time told."""
        late_s = min(self._last_seen_s.get(robot, -inf) - one.begin_s, GIVEN_UP_S)
        if late_s > 0:
            self._judge(one, late_s, came=False)

    def _full_figures(self, last_s: float, stays: Mapping[str, Floats]) -> list[dict[str, Any]]:
        at_s = np.array([said_s for said_s, _ in self._full])[:, None] + AHEAD_S
        said = np.array([full for _, full in self._full], bool)
        truly = np.stack(
            [_inside(stays[place], at_s) >= capacity for place, capacity in self._capacity.items()], axis=1
        )
        known = np.broadcast_to((at_s <= last_s)[:, None], said.shape)
        return [
            _full_row(said[:, :, column][known[:, :, column]], truly[:, :, column][known[:, :, column]])
            for column in range(len(AHEAD_S))
        ]


def _inside(stays_s: Floats, at_s: Floats) -> Ints:
    """How many robots are in a place at each of some times."""
    came, left = (np.sort(column) for column in stays_s.T)
    return np.searchsorted(came, at_s, "right") - np.searchsorted(left, at_s, "right")


def _full_row(said: Bools, truly: Bools) -> dict[str, Any]:
    both = int((said & truly).sum())
    return {
        "full_said": int(said.sum()),
        "full_precision": _share(both, int(said.sum())),
        "full_happened": int(truly.sum()),
        "full_recall": _share(both, int(truly.sum())),
    }


def _figures(counts: PlaceCounts) -> dict[str, Any]:
    return {
        "said": counts.said,
        "came": _share(counts.came, counts.said),
        "off_median_s": quantile(counts.off, 0.5),
        "off_p90_s": quantile(counts.off, 0.9),
        "late": _share(counts.late, counts.said),
        "entries": counts.entries,
        "foretold": _share(counts.foretold, counts.entries),
        **_need_figures(*counts.needs.tolist()),
    }


def _need_figures(said: float, likely: float, came: float, squared: float) -> dict[str, Any]:
    return {
        "need_said": int(said),
        "need_likely": likely / said if said else None,
        "need_came": came / said if said else None,
        "need_brier": squared / said if said else None,
    }


def _share(part: int, whole: int) -> float | None:
    return part / whole if whole else None
