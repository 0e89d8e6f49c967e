"""What happened: encounters of the recorded motion, found as a log is read, in bounded memory.

Truth is each robot's reported positions on its floor, joined linearly at 10 Hz where two reports are at most 2.1 s
apart; separation of two robots is that of their oriented envelopes. An encounter is a maximal run of one pair below a
threshold; two runs are one where the gap is at most 1 s or the pair never drew further apart than it and 0.1 m. It is
foreseeable where both robots were present for at least 2 s before its start.
"""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from math import floor, inf

import numpy as np
from scipy.spatial import KDTree

from deconflict.rectangles import gap
from ingest.angles import turn_between
from ingest.seam import Floats

STEP_S = 0.1
JOINED_S = 2.1
BRIDGED_S = 1.0
DRAWN_APART_M = 0.1
FORESEEABLE_S = 2.0
LAG_S = 3.0
"""How long after a moment all reports about it have come."""

Pair = tuple[str, str]


@dataclass(frozen=True, slots=True)
class Report:
    """Where a robot's envelope truly was."""

    t_s: float
    floor: int
    x_m: float
    y_m: float
    yaw_rad: float
    length_m: float
    width_m: float


@dataclass(slots=True, eq=False)
class Encounter:
    """One encounter of a pair below one threshold."""

    pair: Pair
    start_s: float
    end_s: float
    foreseeable: bool
    furthest_m: float = 0.0
    """Largest separation since it was last below."""


@dataclass(slots=True, eq=False)
class Track:
    """The newest reports of one robot, and since when it has been there without a break."""

    reports: deque[Report] = field(default_factory=deque)
    since_s: float = -inf

    def add(self, report: Report) -> None:
        if self.reports and report.t_s <= self.reports[-1].t_s:
            return
        if not self.reports or report.t_s - self.reports[-1].t_s > JOINED_S:
            self.since_s = report.t_s
        self.reports.append(report)

    def at(self, t_s: float) -> Report | None:
        """The joined motion at `t_s`; forgets what lies before."""
        while len(self.reports) > 1 and self.reports[1].t_s <= t_s:
            self.reports.popleft()
        if not self.reports or self.reports[0].t_s > t_s:
            return None
        before = self.reports[0]
        if before.t_s == t_s:
            return before
        if len(self.reports) == 1:
            return None
        after = self.reports[1]
        if after.t_s - before.t_s > JOINED_S or after.floor != before.floor:
            return None
        share = (t_s - before.t_s) / (after.t_s - before.t_s)
        return Report(
            t_s,
            before.floor,
            before.x_m + share * (after.x_m - before.x_m),
            before.y_m + share * (after.y_m - before.y_m),
            before.yaw_rad + share * turn_between(before.yaw_rad, after.yaw_rad),
            before.length_m,
            before.width_m,
        )


class Truth:
    """Encounters below each of some thresholds, as reports come in."""

    def __init__(self, thresholds_m: Sequence[float]) -> None:
        self._thresholds_m = tuple(thresholds_m)
        self._tracks: dict[str, Track] = {}
        self._open: dict[float, dict[Pair, Encounter]] = {threshold: {} for threshold in thresholds_m}
        self._closed: dict[float, list[Encounter]] = {threshold: [] for threshold in thresholds_m}
        self._next: int | None = None
        """The next sample, in steps since the epoch."""

    def report(self, robot: str, report: Report) -> None:
        self._tracks.setdefault(robot, Track()).add(report)
        if self._next is None:
            self._next = floor(report.t_s / STEP_S) + 1

    def last_seen_s(self, robot: str) -> float:
        track = self._tracks.get(robot)
        return track.reports[-1].t_s if track and track.reports else -inf

    def advance(self, now_s: float) -> None:
        """Look at every sample that all reports have come for."""
        while self._next is not None and self._next * STEP_S <= now_s - LAG_S:
            self._sample(self._next * STEP_S)
            self._next += 1

    def finish(self) -> None:
        """Look at what is left, and end every encounter."""
        last_s = max((self.last_seen_s(robot) for robot in self._tracks), default=-inf)
        self.advance(last_s + LAG_S)
        for threshold, open_ in self._open.items():
            self._closed[threshold] += open_.values()
            open_.clear()

    def encounters(self, threshold_m: float) -> list[Encounter]:
        """Those that have ended, by start."""
        return sorted(self._closed[threshold_m], key=lambda one: (one.start_s, one.pair))

    def _sample(self, t_s: float) -> None:
        there = {robot: report for robot, track in self._tracks.items() if (report := track.at(t_s))}
        near = dict(self._separations(there))
        for threshold in self._thresholds_m:
            self._follow(threshold, t_s, near)

    def _separations(self, there: dict[str, Report]) -> Iterator[tuple[Pair, float]]:
        robots = sorted(there)
        if len(robots) < 2:
            return
        rows = np.array(
            [
                (one.x_m, one.y_m, one.yaw_rad, one.length_m / 2, one.width_m / 2, one.floor)
                for one in map(there.get, robots)
                if one
            ]
        )
        reach_m = 2 * float(np.hypot(rows[:, 3], rows[:, 4]).max()) + max(self._thresholds_m) + 2 * DRAWN_APART_M
        pairs = KDTree(rows[:, :2]).query_pairs(reach_m, output_type="ndarray")
        pairs = pairs[(rows[pairs[:, 0], 5] == rows[pairs[:, 1], 5]) & (rows[pairs[:, 0], 5] >= 0)]
        a, b = rows[pairs.min(axis=1)], rows[pairs.max(axis=1)]
        distances: Floats = gap(
            b[:, 0] - a[:, 0], b[:, 1] - a[:, 1], a[:, 2], b[:, 2], a[:, 3:5].T, b[:, 3:5].T
        ).distance
        for (i, j), distance in zip(np.sort(pairs, axis=1).tolist(), distances.tolist(), strict=True):
            yield (robots[i], robots[j]), distance

    def _follow(self, threshold_m: float, t_s: float, near: dict[Pair, float]) -> None:
        open_ = self._open[threshold_m]
        for pair, separation_m in near.items():
            if separation_m <= threshold_m and (separation_m < threshold_m or threshold_m == 0):
                encounter = open_.get(pair)
                if encounter is None:
                    since_s = max(self._tracks[robot].since_s for robot in pair)
                    open_[pair] = Encounter(pair, t_s, t_s, t_s - since_s >= FORESEEABLE_S)
                else:
                    encounter.end_s, encounter.furthest_m = t_s, 0.0
        for pair, encounter in list(open_.items()):
            encounter.furthest_m = max(encounter.furthest_m, near.get(pair, inf))
            if t_s - encounter.end_s > BRIDGED_S and encounter.furthest_m > threshold_m + DRAWN_APART_M:
                self._closed[threshold_m].append(open_.pop(pair))
