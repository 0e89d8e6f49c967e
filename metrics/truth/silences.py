"""When each robot was there, by its reports, and since when it has been silent.

When a robot is silent is told by `deconflict/foresight/presence/report_intervals.py`. One that is silent has left as
far as is known, unless another one has driven through its place: then it was not there.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

import numpy as np

from deconflict.foresight.presence.report_intervals import GAPS, GRACE_S, grace_after_s
from ingest.batch import Bools, Floats, Forecasts, Ints
from metrics.truth.recorded_motion import SampledMotion

MINUTE_S = 60.0


@dataclass(slots=True, eq=False)
class RobotSilence:
    """One silence of one robot."""

    begin_s: float
    """When it was heard last."""
    end_s: float = inf
    """When it was heard again."""
    is_passed: bool = False
    """Another robot has driven through its place."""


class Silences:
    """As reports come in. Memory holds each robot's newest report, and its silences. Columns are by row."""

    def __init__(self) -> None:
        self._rows: dict[str, int] = {}
        self._names: list[str] = []
        self._heard_s = np.zeros(0)
        """When the newest report was true; -inf before the first."""
        self._there_s = np.zeros(0)
        """How long the robot was there."""
        self._known = np.zeros(0, np.int64)
        """How many times between two reports there were."""
        self._gaps_s = np.zeros((0, GAPS))
        """The newest of them."""
        self._place = np.zeros((0, 8))
        """x_m, y_m, yaw_rad, floor, half sides, bottom and top, by the newest report."""
        self._of: dict[int, list[RobotSilence]] = {}
        """In order."""
        self._ongoing: dict[int, RobotSilence] = {}
        self._by_minute_s: defaultdict[int, float] = defaultdict(float)

    def report(self, robots: Sequence[str], forecasts: Forecasts) -> None:
        """Take the present poses, the first knots, of robots that have reported."""
        rows = np.fromiter(map(self._row, robots), np.int64, len(robots))
        knots = forecasts.start[:-1]
        is_newer = forecasts.t_s[knots] > self._heard_s[rows]
        rows, knots = rows[is_newer], knots[is_newer]
        heard_s = forecasts.t_s[knots]
        self._count(rows, heard_s, heard_s - self._heard_s[rows])
        self._heard_s[rows] = heard_s
        columns = (getattr(forecasts, name)[knots] for name in ("x_m", "y_m", "yaw_rad", "floor"))
        sizes_m = (forecasts.length_m[is_newer] / 2, forecasts.width_m[is_newer] / 2)
        levels_m = (forecasts.bottom_m[is_newer], forecasts.top_m[is_newer])
        self._place[rows] = np.stack([*columns, *sizes_m, *levels_m], axis=1)

    def fallen_silent(self, now_s: float) -> list[str]:
        """The robots that are silent now and were not when this was asked before."""
        late = np.flatnonzero(now_s - self._heard_s[: len(self._names)] > GRACE_S).tolist()
        fallen = [row for row in late if row not in self._ongoing and now_s - self._heard_s[row] > self._limit_s(row)]
        for row in fallen:
            self._fall_silent(row)
        return [self._names[row] for row in fallen]

    def look(self, stretch: SampledMotion) -> None:
        """Look for robots that drive through the place of a silent one."""
        rows = np.array([row for row, silence in self._ongoing.items() if not silence.is_passed], np.int64)
        if not len(rows) or not len(stretch.robot):
            return
        places = self._place[rows]
        for at, other in np.argwhere(_near(places, stretch)).tolist():
            if _drives_through(places[at], stretch, other):
                self._ongoing[int(rows[at])].is_passed = True

    def finish(self) -> None:
        """Nothing more comes: from its last report on nothing is known of any robot."""
        for row in range(len(self._names)):
            if row not in self._ongoing:
                self._fall_silent(row)

    def left_s(self, robot: str, from_s: float) -> float:
        """When a robot left, as far as is known: before `from_s` where it was silent then, or else when it next fell
        silent; inf where it did not. A silence in which another robot drove through its place does not count."""
        for silence in self._of.get(self._rows.get(robot, -1), ()):
            if silence.end_s > from_s and not silence.is_passed:
                return silence.begin_s
        return inf

    def was_silent(self, robot: str) -> bool:
        """Whether a robot has ever been silent."""
        return self._rows.get(robot, -1) in self._of

    def present_s(self) -> dict[str, float]:
        """How long each robot was there."""
        return dict(zip(self._names, self._there_s[: len(self._names)].tolist(), strict=True))

    def by_minute(self) -> dict[int, float]:
        """How long robots were there in all, by minute since the epoch."""
        return dict(self._by_minute_s)

    def _count(self, rows: Ints, heard_s: Floats, gap_s: Floats) -> None:
        """Note the times between the reports of robots, and that those were there meanwhile that were not silent."""
        counts = gap_s < inf
        for at in np.flatnonzero(counts & (gap_s > GRACE_S)).tolist():
            counts[at] = not self._ends_silence(int(rows[at]), float(heard_s[at]))
        rows, heard_s, gap_s = rows[counts], heard_s[counts], gap_s[counts]
        self._gaps_s[rows, self._known[rows] % GAPS] = gap_s
        self._known[rows] += 1
        self._there_s[rows] += gap_s
        minutes = (heard_s / MINUTE_S).astype(np.int64)
        for minute in np.unique(minutes).tolist():
            self._by_minute_s[minute] += float(gap_s[minutes == minute].sum())

    def _ends_silence(self, row: int, now_s: float) -> bool:
        """Whether a robot was silent that is heard again."""
        silence = self._ongoing.pop(row, None)
        if silence is None:
            if now_s - self._heard_s[row] <= self._limit_s(row):
                return False
            silence = RobotSilence(float(self._heard_s[row]))
            self._of.setdefault(row, []).append(silence)
        silence.end_s = now_s
        return True

    def _fall_silent(self, row: int) -> None:
        self._ongoing[row] = RobotSilence(float(self._heard_s[row]))
        self._of.setdefault(row, []).append(self._ongoing[row])

    def _limit_s(self, row: int) -> float:
        """How long a robot may say nothing before it is silent."""
        return grace_after_s(self._gaps_s[row, : self._known[row]].tolist())

    def _row(self, robot: str) -> int:
        row = self._rows.get(robot)
        if row is None:
            row = self._rows[robot] = len(self._names)
            self._names.append(robot)
            if row == len(self._heard_s):
                self._grow(max(row, 64))
        return row

    def _grow(self, more: int) -> None:
        for name in ("_heard_s", "_there_s", "_known", "_gaps_s", "_place"):
            column = getattr(self, name)
            setattr(self, name, np.concatenate([column, np.zeros((more, *column.shape[1:]), column.dtype)]))
        self._heard_s[-more:] = -inf


def _near(places: Floats, stretch: SampledMotion) -> Bools:
    """(s, r) whether the middle of each robot of a stretch comes into the box around each place (s, 8)."""
    x_m, y_m, _, _, half_length_m, half_width_m, _, _ = places.T[:, :, None]
    reach_m = np.hypot(half_length_m, half_width_m)
    near = np.ones((len(places), len(stretch.robot)), np.bool_)
    for place_m, where_m in ((x_m, stretch.x_m), (y_m, stretch.y_m)):
        near &= np.nanmin(where_m, axis=1) <= place_m + reach_m
        near &= np.nanmax(where_m, axis=1) >= place_m - reach_m
    return near


def _drives_through(place: Floats, stretch: SampledMotion, other: int) -> bool:
    """Whether the middle of a robot of a stretch comes within the outline at a place (8,)."""
    x_m, y_m, yaw_rad, floor, half_length_m, half_width_m, bottom_m, top_m = place.tolist()
    dx_m, dy_m = stretch.x_m[other] - x_m, stretch.y_m[other] - y_m
    cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
    within = np.abs(cosine * dx_m + sine * dy_m) < half_length_m
    within &= np.abs(cosine * dy_m - sine * dx_m) < half_width_m
    within &= (stretch.height_m[0, other] < top_m) & (bottom_m < stretch.height_m[1, other])
    return bool(np.any(within & (stretch.floor[other] == floor)))
