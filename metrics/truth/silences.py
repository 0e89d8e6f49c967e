"""When each robot was present by its reports, and when it was silent.

`deconflict/foresight/presence/report_intervals.py` defines when a robot is silent. A silent robot may have left. If
another robot drives through its place, the silent one was not there.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

import numpy as np

from deconflict.foresight.presence.report_intervals import GAPS, GRACE_S, grace_after_s
from deconflict.sweep.geometry.heights import heights_overlap
from deconflict.sweep.robot_slots import RobotSlots, lengthen
from ingest.batch import Bools, Floats, Forecasts, Ints
from metrics.truth.recorded_motion import SampledMotion

MINUTE_S = 60.0
_COLUMNS = ("_heard_s", "_there_s", "_known", "_gaps_s", "_within_s", "_place", "_is_silent")


@dataclass(slots=True, eq=False)
class RobotSilence:
    """One silence of one robot."""

    begin_s: float
    """Time of the last report before it."""
    end_s: float = inf
    """Time of the next report; inf until then."""
    is_passed: bool = False
    """Whether another robot has driven through its place."""


class Silences:
    """Finds silences while reports arrive. Keeps each robot's newest report and its silences, one robot a row."""

    def __init__(self, slots: RobotSlots) -> None:
        """`slots` are those of the recorded motion."""
        self._slots = slots
        self._heard_s = np.zeros(0)
        """When the newest report was true; -inf before the first."""
        self._there_s = np.zeros(0)
        """How long the robot was present."""
        self._known = np.zeros(0, np.int64)
        """Number of known intervals between reports."""
        self._gaps_s = np.zeros((0, GAPS))
        """The newest intervals between reports."""
        self._within_s = np.zeros(0)
        """How late the next report may come by the rules of the robot's language."""
        self._place = np.zeros((0, 8))
        """x_m, y_m, yaw_rad, floor, half sides, bottom and top, by the newest report."""
        self._of: dict[int, list[RobotSilence]] = {}
        """By row: all silences, in order."""
        self._is_silent = np.zeros(0, np.bool_)
        """Whether the last of these goes on."""
        self.by_minute_s: defaultdict[int, float] = defaultdict(float)
        """Total presence of all robots, by minute since the epoch."""
        self.on_foot: set[str] = set()
        """UUIDs of the people on foot, whose presence counts nowhere."""

    def report(self, robots: Sequence[str], forecasts: Forecasts, reports_within_s: Floats | None = None) -> None:
        """Add the present poses of robots that have reported. These are the first knots of the forecasts."""
        rows, _ = self._slots.assign(robots)
        if (more := len(self._slots) - len(self._heard_s)) > 0:
            more = max(more, len(self._heard_s), 64)
            lengthen(self, _COLUMNS, more)
            self._heard_s[-more:] = -inf
        knots = forecasts.start[:-1]
        is_newer = forecasts.t_s[knots] > self._heard_s[rows]
        rows, knots = rows[is_newer], knots[is_newer]
        heard_s = forecasts.t_s[knots]
        self._count(rows, heard_s, heard_s - self._heard_s[rows])
        self._heard_s[rows] = heard_s
        self._within_s[rows] = 0.0 if reports_within_s is None else reports_within_s[is_newer]
        columns = (getattr(forecasts, name)[knots] for name in ("x_m", "y_m", "yaw_rad", "floor"))
        sizes_m = (forecasts.length_m[is_newer] / 2, forecasts.width_m[is_newer] / 2)
        levels_m = (forecasts.bottom_m[is_newer], forecasts.top_m[is_newer])
        self._place[rows] = np.stack([*columns, *sizes_m, *levels_m], axis=1)

    def fallen_silent(self, now_s: float) -> list[str]:
        """The robots that have become silent since the last call."""
        is_late = (now_s - self._heard_s > GRACE_S) & ~self._is_silent
        late = np.flatnonzero(is_late[: len(self._slots)]).tolist()
        fallen = [row for row in late if now_s - self._heard_s[row] > self._limit_s(row)]
        for row in fallen:
            self._fall_silent(row)
        return [self._slots.uuids[row] for row in fallen]

    def find_driven_through(self, sampled: SampledMotion) -> None:
        """Find robots that drive through the place of a silent one."""
        silent = np.flatnonzero(self._is_silent).tolist()
        rows = np.array([row for row in silent if not self._of[row][-1].is_passed], np.int64)
        if not len(rows) or not len(sampled.robot):
            return
        places = self._place[rows]
        is_other = rows[:, None] != sampled.robot
        for at, near in enumerate(is_other & _near(places, sampled)):
            others = np.flatnonzero(near)
            may_meet = (sampled.floor[others] == places[at, 3]).any(axis=1)
            may_meet &= heights_overlap(*sampled.height_m[:, others], *places[at, 6:]).any(axis=1)
            if any(_drives_through(places[at], sampled, other) for other in others[may_meet].tolist()):
                self._of[int(rows[at])][-1].is_passed = True

    def finish(self) -> None:
        """End of the log: every robot is silent from its last report."""
        for row in np.flatnonzero(~self._is_silent[: len(self._slots)]).tolist():
            self._fall_silent(row)

    def left_s(self, robot: str, from_s: float) -> float:
        """When a robot may have left: the begin of its silence at `from_s`, or else of its next silence; inf if there
        is none. A silence in which another robot drove through its place does not count."""
        for silence in self._of.get(self._slots.by_uuid.get(robot, -1), ()):
            if silence.end_s > from_s and not silence.is_passed:
                return silence.begin_s
        return inf

    def may_have_left(self, robot: str, before_s: float) -> bool:
        """Whether a robot was last heard before a time, and nobody has driven through its place."""
        row = self._slots.by_uuid.get(robot, -1)
        if row < 0 or self._heard_s[row] >= before_s:
            return False
        return not (self._is_silent[row] and self._of[row][-1].is_passed)

    def was_silent(self, robot: str) -> bool:
        """Whether a robot has ever been silent."""
        return self._slots.by_uuid.get(robot, -1) in self._of

    def present_s(self) -> dict[str, float]:
        """How long each robot was present."""
        there_s = zip(self._slots.uuids, self._there_s[: len(self._slots)].tolist(), strict=True)
        return {uuid: present_s for uuid, present_s in there_s if uuid not in self.on_foot}

    def _count(self, rows: Ints, heard_s: Floats, gap_s: Floats) -> None:
        """Add the intervals between reports, and the presence of robots that were not silent in them."""
        counts = gap_s < inf
        for at in np.flatnonzero(counts & (gap_s > GRACE_S)).tolist():
            counts[at] = not self._ends_silence(int(rows[at]), float(heard_s[at]))
        rows, heard_s, gap_s = rows[counts], heard_s[counts], gap_s[counts]
        self._gaps_s[rows, self._known[rows] % GAPS] = gap_s
        self._known[rows] += 1
        self._there_s[rows] += gap_s
        if self.on_foot:
            gap_s = np.where([self._slots.uuids[row] in self.on_foot for row in rows.tolist()], 0.0, gap_s)
        minutes = (heard_s / MINUTE_S).astype(np.int64)
        for minute in sorted(set(minutes.tolist())):
            self.by_minute_s[minute] += float(gap_s[minutes == minute].sum())

    def _ends_silence(self, row: int, now_s: float) -> bool:
        """End the silence of a robot that reports again. Returns whether it was silent."""
        if not self._is_silent[row]:
            if now_s - self._heard_s[row] <= self._limit_s(row):
                return False
            self._fall_silent(row)
        self._is_silent[row] = False
        self._of[row][-1].end_s = now_s
        return True

    def _fall_silent(self, row: int) -> None:
        self._is_silent[row] = True
        self._of.setdefault(row, []).append(RobotSilence(float(self._heard_s[row])))

    def _limit_s(self, row: int) -> float:
        """How long a robot may send no report before it is silent."""
        return max(grace_after_s(self._gaps_s[row, : self._known[row]].tolist()), float(self._within_s[row]))


def _near(places: Floats, sampled: SampledMotion) -> Bools:
    """(s, r) whether the centre of each of r robots enters the bounding box of each place (s, 8)."""
    x_m, y_m, _, _, half_length_m, half_width_m, _, _ = places.T[:, :, None]
    reach_m = np.hypot(half_length_m, half_width_m)
    near = np.ones((len(places), len(sampled.robot)), np.bool_)
    for place_m, where_m in ((x_m, sampled.x_m), (y_m, sampled.y_m)):
        near &= np.nanmin(where_m, axis=1) <= place_m + reach_m
        near &= np.nanmax(where_m, axis=1) >= place_m - reach_m
    return near


def _drives_through(place: Floats, sampled: SampledMotion, other: int) -> bool:
    """Whether the centre of a robot enters the outline at a place (8,)."""
    x_m, y_m, yaw_rad, floor, half_length_m, half_width_m, *_ = place.tolist()
    dx_m, dy_m = sampled.x_m[other] - x_m, sampled.y_m[other] - y_m
    cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
    within = np.abs(cosine * dx_m + sine * dy_m) < half_length_m
    within &= np.abs(cosine * dy_m - sine * dx_m) < half_width_m
    within &= heights_overlap(*sampled.height_m[:, other], *place[6:])
    return bool(np.any(within & (sampled.floor[other] == floor)))
