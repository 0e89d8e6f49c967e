"""The recorded motion: linear between two reported positions if the reports are at most 2.1 s apart."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from math import ceil, floor, inf, nan
from typing import NamedTuple

import numpy as np

from deconflict.foresight.motion_assumptions import JOINED_S
from deconflict.sweep.geometry.pose import between
from deconflict.sweep.robot_slots import RobotSlots
from deconflict.sweep.shapes.shape_table import SHAPES
from deconflict.sweep.shapes.trailers import rows_of_trains, trailer_forecasts
from ingest.batch import Batch, Floats, Forecasts, Ints
from ingest.kernels import FLOAT, INT, MATRIX, READ_FLOATS, READ_INTS, copy_row, inner, kernel, ready
from ingest.shapes import MOST_TRAILERS

BODIES = MOST_TRAILERS + 1
"""Body `BODIES * slot` is a robot. The numbers after it are its trailers."""
_SIZE = ("length", "width", "bottom", "top", "shape")
_LEG = ("body", "begin_s", "end_s", "x0", "y0", "yaw0", "x1", "y1", "yaw1", "floor", "since_s", *_SIZE)
_LAST = ("t_s", "x", "y", "yaw", "floor", "since_s", "present_s", *_SIZE)
_PRESENT = _LAST.index("present_s")
_NEVER = np.array([0.0 if name == "present_s" else -inf for name in _LAST])
"""The last report of a robot before its first one."""


def without_doubted(batch: Batch, bands_m: Floats, doubted: Collection[str]) -> tuple[Batch, Floats]:
    """A batch of n robots and the (n, horizons, bands) error radii of their forecasts, without those that are `doubted`
    or not examined: what they report is not believed."""
    if not doubted and batch.examined.all():
        return batch, bands_m
    names, examined = set(doubted), batch.examined.tolist()
    rows = np.array([row for row, uuid in enumerate(batch.robots) if examined[row] and uuid not in names], np.int64)
    return batch.take(rows, batch.gone), bands_m[rows]


class RecordedPlace(NamedTuple):
    """A place on a floor."""

    floor: int
    """Index of the floor in the batches."""
    x_m: float
    y_m: float


@dataclass(frozen=True, slots=True, eq=False)
class SampledMotion:
    """The poses of r robots and trailers at s samples; nan while one is absent. Those that are absent at all samples
    are left out."""

    first: int
    """The first sample, in steps since the epoch."""
    body: Ints
    """(r,) numbers of robots and trailers, ascending; see `BODIES`."""
    x_m: Floats
    """(r, s)"""
    y_m: Floats
    yaw_rad: Floats
    half_m: Floats
    """(2, r, s) half length and half width."""
    height_m: Floats
    """(2, r, s) lowest and highest height of the robot; -inf and inf if unknown."""
    floor: Floats
    """(r, s)"""
    since_s: Floats
    """(r, s) time since which it has been present without a break."""
    shape: Floats | None = None
    """(r, s) number of its shape in `SHAPES`, 0 for a rectangle; None if all are rectangles."""

    @property
    def robot(self) -> Ints:
        """(r,) the slot of each robot, or of the robot that pulls the trailer."""
        return self.body // BODIES

    def place(self, robot: int, sample: int) -> RecordedPlace:
        """The place of a robot that is there at a sample."""
        at = int(np.searchsorted(self.robot, robot)), sample - self.first
        return RecordedPlace(int(self.floor[at]), float(self.x_m[at]), float(self.y_m[at]))


class RecordedMotion:
    """The newest report of every robot and trailer, and the legs between reports that have not been sampled yet."""

    def __init__(self) -> None:
        self.slots = RobotSlots()
        """No robot leaves its slot."""
        self._last = np.empty((0, len(_LAST)))
        self._unsampled: list[Floats] = []
        """(n, 16) legs, columns as in `_LEG`."""

    def report(self, robots: Sequence[str], forecasts: Forecasts) -> None:
        """Add a leg from each robot's last pose to its first knot, if that is newer."""
        slots, _ = self.slots.assign(robots)
        if (more := BODIES * len(self.slots) - len(self._last)) > 0:
            self._last = np.concatenate([self._last, np.tile(_NEVER, (max(more, len(self._last), 64), 1))])
        self._add_legs(BODIES * slots, forecasts)
        if trains := rows_of_trains(forecasts):
            trailers, pulled_by = trailer_forecasts(_present(forecasts, trains))
            number = np.arange(len(pulled_by)) - np.searchsorted(pulled_by, pulled_by) + 1
            self._add_legs(BODIES * slots[trains][pulled_by] + number, trailers)

    def _add_legs(self, bodies: Ints, forecasts: Forecasts) -> None:
        knots = (forecasts.t_s, forecasts.x_m, forecasts.y_m, forecasts.yaw_rad, ready(forecasts.floor, np.int64))
        shape = np.zeros(len(bodies)) + SHAPES.numbers(forecasts)
        sizes = (forecasts.length_m, forecasts.width_m, forecasts.bottom_m, forecasts.top_m, shape)
        legs = _legs(bodies, forecasts.start, *knots, *sizes, self._last)
        if len(legs):
            self._unsampled.append(legs)

    @property
    def newest_s(self) -> float:
        return float(self._last[:, 0].max(initial=-inf))

    def last_seen_s(self, robot: str) -> float:
        slot = self.slots.by_uuid.get(robot)
        return -inf if slot is None else float(self._last[BODIES * slot, 0])

    def present_s(self) -> dict[str, float]:
        """How long each robot was present."""
        of_robots = self._last[: BODIES * len(self.slots) : BODIES, _PRESENT]
        return dict(zip(self.slots.uuids, of_robots.tolist(), strict=True))

    def sampled(self, first: int, samples: int, step_s: float) -> SampledMotion:
        """The motion at `samples` samples from `first` on. Drops the legs before their end."""
        legs = np.concatenate([np.empty((0, len(_LEG))), *self._unsampled])
        self._unsampled = [legs[np.floor(legs[:, 2] / step_s) >= first + samples]]
        body, there = _joined(legs, BODIES * len(self.slots), first, samples, step_s)
        x_m, y_m, yaw_rad, floor, since_s = there[:5]
        columns = (x_m, y_m, yaw_rad, there[5:7] / 2, there[7:9], floor, since_s)
        return SampledMotion(first, body, *columns, there[9] if (there[9] > 0).any() else None)

    def pair(self, a: int, b: int) -> tuple[str, str]:
        """The names of two robots, in ascending order."""
        first, second = sorted((self.slots.uuids[a], self.slots.uuids[b]))
        return first, second


def _present(forecasts: Forecasts, rows: Sequence[int]) -> Forecasts:
    """The first knots of the robots of `rows`."""
    chosen = forecasts.take(rows)
    knots = chosen.start[:-1]
    by_knot = {name: getattr(chosen, name)[knots] for name in ("t_s", "x_m", "y_m", "yaw_rad", "floor")}
    return replace(chosen, start=np.arange(len(chosen) + 1), **by_knot)


@inner
def _take_over(before: Floats, leg: Floats) -> None:
    """Set the begin of a leg, and the size and heights, from the report before it."""
    leg[1] = before[0]
    copy_row(before[1:4], leg[3:6])
    copy_row(before[7:12], leg[11:16])


@kernel(MATRIX(*[READ_INTS] * 2, *[READ_FLOATS] * 4, READ_INTS, *[READ_FLOATS] * 5, MATRIX))
def _legs(
    rows: Ints,
    start: Ints,
    t_s: Floats,
    x_m: Floats,
    y_m: Floats,
    yaw_rad: Floats,
    floor: Ints,
    length_m: Floats,
    width_m: Floats,
    bottom_m: Floats,
    top_m: Floats,
    shape: Floats,
    last: Floats,
) -> Floats:
    """(n, 16) legs, columns as in `_LEG`, of each body with a newer report. Its first knot becomes its `last` row.

    Sizes and heights are those at the beginning of a leg.
    """
    legs, n = np.empty((len(rows), 16)), 0
    for robot in range(len(rows)):
        knot, before, leg = start[robot], last[rows[robot]], legs[n]
        gap_s = t_s[knot] - before[0]
        if not gap_s > 0.0:
            continue
        since_s, present_s = before[5] if gap_s <= JOINED_S else t_s[knot], before[6]
        joins = gap_s <= JOINED_S and before[4] == floor[knot]
        if joins:
            _take_over(before, leg)
            present_s += gap_s
        before[0], before[1], before[2], before[3] = t_s[knot], x_m[knot], y_m[knot], yaw_rad[knot]
        before[4], before[5], before[6] = floor[knot], since_s, present_s
        before[7], before[8], before[9], before[10] = length_m[robot], width_m[robot], bottom_m[robot], top_m[robot]
        before[11] = shape[robot]
        if not joins:
            _take_over(before, leg)
        leg[0], leg[2], leg[9], leg[10] = rows[robot], before[0], before[4], since_s
        copy_row(before[1:4], leg[6:9])
        n += 1
    return legs[:n].copy()


@kernel((MATRIX, INT, INT, INT, FLOAT))
def _joined(legs: Floats, bodies: int, first: int, samples: int, step_s: float) -> tuple[Ints, Floats]:
    """(r,) the bodies that are present at any sample, and (10, r, samples) x, y, yaw, floor, present since, length,
    width, bottom, top and shape; nan while one is absent."""
    begins, ends = np.empty(len(legs), np.int64), np.empty(len(legs), np.int64)
    row_of = np.full(bodies, -1)
    for leg in range(len(legs)):
        begin_s, end_s = legs[leg, 1], legs[leg, 2]
        begin = floor(begin_s / step_s) + 1 if begin_s < end_s else ceil(end_s / step_s)
        begins[leg], ends[leg] = max(begin, first), min(floor(end_s / step_s), first + samples - 1)
        if begins[leg] <= ends[leg]:
            row_of[int(legs[leg, 0])] = 0
    body = np.flatnonzero(row_of == 0)
    for row in range(len(body)):
        row_of[body[row]] = row
    there = np.full((10, len(body), samples), np.nan)
    for leg in range(len(legs)):
        who, begin_s, end_s, x0, y0, yaw0, x1, y1, yaw1, on, since_s = legs[leg, :11]
        row, before, after = row_of[int(who)], (begin_s, x0, y0, yaw0), (end_s, x1, y1, yaw1)
        for sample in range(begins[leg], ends[leg] + 1):
            at = there[:, row, sample - first]
            at[0], at[1], at[2], _, _ = between(before, after, sample * step_s)
            at[3], at[4] = nan if on < 0 else on, since_s
            copy_row(legs[leg, 11:16], at[5:10])
    return body, there
