"""Announced arrivals: when robots say they will be where, kept until they arrive or change their plan."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import dist, hypot, inf
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from deconflict.sweep.robot_slots import RobotSlots
from ingest.batch import Batch, Destinations, Floats, Ints
from ingest.kernels import INT, READ_FLOATS, READ_INTS, inner, kernel, ready

ARRIVED_M = 0.75
"""A robot this near to its destination has arrived."""
REPEAT_S = 30.0
"""A repeated announcement is kept again after this time."""
MOST_ANNOUNCEMENTS = 32
"""Kept for one destination: a quarter of an hour."""
MOST_OPEN = 32
"""Destinations of one robot at which it has not arrived: the newest."""
FORGET_S = 600.0
"""An arrival that is later than this is given up."""
ROUNDING_M = 1e-6
"""Margin for rounding errors."""

DatumPoint = tuple[str, float, float]
"""Datum, x and y."""
FloorPoints = tuple[Ints, Floats, Floats]
"""Floor, x and y of many points, in columns."""

MOST_POINTS = 10
"""Destinations that a robot may announce by the standard; reports with more are always processed."""
UNKNOWN = -1
LAST_REPORT = np.dtype(
    [
        ("count", np.int64),  # how many destinations it announced; `UNKNOWN` if its next report must be processed
        ("made_s", np.float64),  # the earliest of the times at which each destination was last kept
        ("free_m", np.float64),  # how far it can go without arriving at a destination or leaving one
        ("floor", np.int64, 1 + MOST_POINTS),  # floors of the robot and of its destinations, and below their places
        ("x_m", np.float64, 1 + MOST_POINTS),
        ("y_m", np.float64, 1 + MOST_POINTS),
    ],
    align=True,
)
"""A robot's last report that was processed. A report that differs in nothing from it need not be."""

_REPORTS = numba.types.Array(numba.from_dtype(LAST_REPORT), 1, "C")


class Announcement(NamedTuple):
    """One announced arrival."""

    made_s: float
    """Time of the announcement, seconds since the epoch."""
    announced_s: float
    """Announced time of the arrival."""


@inner
def _write_points(
    report: Any, numbers: Ints, floor: Ints, x_m: Floats, y_m: Floats, to: int, first: int, count: int
) -> None:
    """Write `count` points from `first` on into a report, from place `to` on."""
    for k in range(count):
        report.floor[to + k] = numbers[floor[first + k]] if floor[first + k] >= 0 else -1
        report.x_m[to + k], report.y_m[to + k] = x_m[first + k], y_m[first + k]


@kernel(
    (INT, _REPORTS, *[READ_INTS] * 2, READ_FLOATS, READ_INTS, *[READ_FLOATS] * 2, *[READ_INTS] * 2, *[READ_FLOATS] * 2)
)
def _next_new_report(
    row: int,
    reports: NDArray[Any],
    slots: Ints,
    numbers: Ints,
    now_s: Floats,
    floor: Ints,
    x_m: Floats,
    y_m: Floats,
    start: Ints,
    to_floor: Ints,
    to_x_m: Floats,
    to_y_m: Floats,
) -> int:
    """The first row from `row` on whose report must be processed; its points are written into `reports`.

    That is if it announces other destinations than before, or again after a while, or if the robot may have arrived.
    """
    while row < len(slots):
        first, count, report = start[row], start[row + 1] - start[row], reports[slots[row]]
        is_same = count == report.count
        if is_same and count:
            on = numbers[floor[row]] if floor[row] >= 0 else -1
            away_m = hypot(x_m[row] - report.x_m[0], y_m[row] - report.y_m[0])
            is_same = now_s[row] - report.made_s < REPEAT_S and on == report.floor[0] and away_m <= report.free_m
            for k in range(count if is_same else 0):
                on = numbers[to_floor[first + k]] if to_floor[first + k] >= 0 else -1
                is_same = is_same and on == report.floor[1 + k]
                is_same = is_same and to_x_m[first + k] == report.x_m[1 + k] and to_y_m[first + k] == report.y_m[1 + k]
        if not is_same:
            _write_points(reports[slots[row]], numbers, floor, x_m, y_m, 0, row, 1)
            _write_points(reports[slots[row]], numbers, to_floor, to_x_m, to_y_m, 1, first, min(count, MOST_POINTS))
            reports[slots[row]].count = count if count <= MOST_POINTS else UNKNOWN
            break
        row += 1
    return row


class AnnouncedArrivals:
    """The announced arrivals of all robots, until they arrive."""

    def __init__(self, slots: RobotSlots | None = None) -> None:
        """`slots` are those of the table that holds the robots, which frees them."""
        self._open: dict[str, dict[DatumPoint, list[Announcement]]] = {}
        """By robot and destination, to the decimetre; empty for a robot that has arrived at all it announced."""
        self._floors = {"": -1}
        """Numbers of floors in `_reports`."""
        self._slots = RobotSlots() if slots is None else slots
        self._reports = np.zeros(0, LAST_REPORT)
        """By slot, with spare rows."""

    def add_batch(
        self, batch: Batch, now_s: Floats, here: FloorPoints, destinations: Destinations
    ) -> Iterator[tuple[int, list[list[Announcement]]]]:
        """Add the `destinations` of robots (n,) that are `here` at `now_s`.

        Yields rows of robots that have arrived somewhere, and for each place what they had announced of it.
        """
        slots, _ = self._slots.assign(batch.robots)
        if len(self._slots) > len(self._reports):
            self._reports = np.pad(self._reports, (0, len(self._slots)))
        if not len(destinations.t_s) and not self._open:
            return
        known = self._floors
        numbers = np.array([known.setdefault(datum, len(known)) for datum in batch.floors], np.int64)
        floor, x_m, y_m = ready(here[0], np.int64), ready(here[1]), ready(here[2])
        start, to_floor, to_x_m, to_y_m = destinations.start, destinations.floor, destinations.x_m, destinations.y_m
        columns = (floor, x_m, y_m, ready(start, np.int64), ready(to_floor, np.int64), ready(to_x_m), ready(to_y_m))
        row, now_s = -1, ready(now_s)
        while (row := _next_new_report(row + 1, self._reports, slots, numbers, now_s, *columns)) < len(slots):
            stops = slice(start[row], start[row + 1])
            points = zip(batch.datums(to_floor[stops]), to_x_m[stops].tolist(), to_y_m[stops].tolist(), strict=True)
            at = batch.floors[floor[row]] if floor[row] >= 0 else "", float(x_m[row]), float(y_m[row])
            announced_s = destinations.t_s[stops].tolist()
            if arrivals := self.add(batch.robots[row], float(now_s[row]), at, list(points), announced_s):
                yield row, arrivals

    def add(
        self, robot: str, now_s: float, here: DatumPoint, points: Sequence[DatumPoint], announced_s: Sequence[float]
    ) -> list[list[Announcement]]:
        """Add the report of a robot that is at `here` and announces when it will be at each of `points`.

        Returns what it had announced of each destination at which it has arrived.
        """
        ahead = {(datum, round(x, 1), round(y, 1)): t_s for (datum, x, y), t_s in zip(points, announced_s, strict=True)}
        open_points = self._open.get(robot, {})
        arrived = []
        for point, announcements in list(open_points.items()):
            if near(point, here):
                arrived.append(open_points.pop(point))
            elif point not in ahead and _is_given_up(announcements[-1], now_s):
                del open_points[point]
        for point, t_s in ahead.items():
            if point not in open_points and near(point, here):
                continue
            announcements = open_points.setdefault(point, [])
            is_due = not announcements or now_s - announcements[-1].made_s >= REPEAT_S
            if len(announcements) < MOST_ANNOUNCEMENTS and is_due:
                announcements.append(Announcement(now_s, t_s))
        for point in sorted(open_points, key=ahead.__contains__)[: max(len(open_points) - MOST_OPEN, 0)]:
            del open_points[point]
        if open_points or ahead:
            self._open[robot] = open_points
        else:
            self._open.pop(robot, None)
        self._note_report(robot, here, ahead, open_points)
        return arrived

    def _note_report(
        self,
        robot: str,
        here: DatumPoint,
        ahead: Mapping[DatumPoint, float],
        open_points: Mapping[DatumPoint, list[Announcement]],
    ) -> None:
        """Write into a robot's last report what decides whether its next one must be processed."""
        if robot in self._slots.by_uuid:
            report = self._reports[self._slots.by_uuid[robot]]
            report["made_s"] = min((announcements[-1].made_s for announcements in open_points.values()), default=inf)
            report["free_m"] = _free_m(here, ahead)
            if not open_points.keys() <= ahead.keys():
                report["count"] = UNKNOWN

    def open(self) -> Iterator[tuple[str, list[Announcement]]]:
        """Robots, and what they announced of each destination at which they have not arrived."""
        for robot, open_points in self._open.items():
            for announcements in open_points.values():
                yield robot, announcements

    def forget(self, robot: str) -> None:
        self._open.pop(robot, None)
        if robot in self._slots.by_uuid:
            self._reports["count"][self._slots.by_uuid[robot]] = 0


def near(a: DatumPoint, b: DatumPoint, within_m: float = ARRIVED_M) -> bool:
    return a[0] == b[0] and hypot(a[1] - b[1], a[2] - b[2]) <= within_m


def _free_m(here: DatumPoint, points: Iterable[DatumPoint]) -> float:
    """How far a robot can go and still be near to the same points as now."""
    from_m = [abs(dist(point[1:], here[1:]) - ARRIVED_M) for point in points if point[0] == here[0]]
    return min(from_m, default=inf) - ROUNDING_M


def _is_given_up(last: Announcement, now_s: float) -> bool:
    """Whether a destination that is no longer announced is still ahead, so that the plan has changed, or long past."""
    return last.announced_s > now_s or last.announced_s + FORGET_S < now_s
