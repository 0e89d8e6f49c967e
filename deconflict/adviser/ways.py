"""Where robots that stand would be on the next metres of their ways, and whose bodies are there."""

from typing import NamedTuple

import numba
import numpy as np

from deconflict.contention.robots.bounding_boxes import touching_boxes
from deconflict.contention.robots.lookahead import STEP_S
from deconflict.contention.robots.record_kernels import Records, steps_along
from deconflict.contention.robots.robot_table import RobotTable
from deconflict.sweep.geometry.heights import heights_overlap
from deconflict.sweep.pair_choice import nearest_of_each
from ingest.batch import Bools, Floats, Ints
from ingest.kernels import kernel

_COLUMN = numba.types.Array(numba.float64, 3, "A", readonly=True)
_BOXES = numba.types.Tuple([_COLUMN] * 6)  # type: ignore[no-untyped-call]


@kernel(numba.boolean[:, :, ::1](_BOXES, _BOXES))
def touching(boxes: tuple[Floats, ...], others: tuple[Floats, ...]) -> Bools:
    """(n, m, k) whether rectangles touch, by their four axes. Comparisons with nan are false.

    Each has six columns (n, m, k): x and y of the centre, cosine and sine of the direction, half of the length and of
    the width, in metres.
    """
    x_m, y_m, cos, sin, half_length_m, half_width_m = boxes
    other_x_m, other_y_m, other_cos, other_sin, other_half_length_m, other_half_width_m = others
    found = np.zeros(x_m.shape, np.bool_)
    for at in np.ndindex(x_m.shape):
        dx_m, dy_m = other_x_m[at] - x_m[at], other_y_m[at] - y_m[at]
        c = abs(cos[at] * other_cos[at] + sin[at] * other_sin[at])
        s = abs(cos[at] * other_sin[at] - sin[at] * other_cos[at])
        length_m, width_m = half_length_m[at], half_width_m[at]
        other_length_m, other_width_m = other_half_length_m[at], other_half_width_m[at]
        found[at] = (
            abs(dx_m * cos[at] + dy_m * sin[at]) <= length_m + other_length_m * c + other_width_m * s
            and abs(dy_m * cos[at] - dx_m * sin[at]) <= width_m + other_length_m * s + other_width_m * c
            and abs(dx_m * other_cos[at] + dy_m * other_sin[at]) <= other_length_m + length_m * c + width_m * s
            and abs(dy_m * other_cos[at] - dx_m * other_sin[at]) <= other_width_m + length_m * s + width_m * c
        )
    return found


REACH_M = 2.2
"""Length of the way that is looked at: a robot keeps a distance, and stops some way before what it stops for."""
STRIDE_M = 0.2
MARGIN_M, BESIDE_M = 0.45, 0.05
"""Room that a robot keeps free in front of its body and at each side."""
WITHIN_S = 5.0
"""A robot that means to go on only later than this waits for something of its own."""
WAITING = "waitingExternalEvent"
"""State of a robot that would go on, but for something around it."""
LEAST_WAY_M = 0.1
MOST_MET = 4
"""Of the ways near to one, so many are compared with it: those whose middles are nearest."""
TURNED_RAD = 0.3
"""A way that begins in another direction needs room for the robot to turn."""


Point = tuple[float, float]
"""x and y in metres."""


class Boxes(NamedTuple):
    """Oriented rectangles. All arrays have one shape."""

    x_m: Floats
    """Their centres."""
    y_m: Floats
    yaw_rad: Floats
    half_length_m: Floats
    half_width_m: Floats


class Ways(NamedTuple):
    """The next metres of the ways of n robots, each with k boxes: the bodies with the room that they keep."""

    slots: Ints
    """(n,)"""
    boxes: Boxes
    """(n, k). The first is where a robot turns, the others are along its way. Nan beyond what it will use."""


def wanted_ways(robots: RobotTable, slots: Ints, reach_m: float = REACH_M, within_s: float = WITHIN_S) -> Ways:
    """The ways of those robots of `slots` that mean to move on, as far as they come within `within_s` and `reach_m`."""
    records = robots.records[slots]
    here_m = np.stack([records["reported_x_m"], records["reported_y_m"]], axis=1)[:, None]
    soon = round(within_s / STEP_S)
    points_m = np.concatenate([here_m, _steps_m(robots, slots)[:, : soon + 1]], axis=1)
    legs_m = np.hypot(*np.moveaxis(np.diff(points_m, axis=1), -1, 0))
    gone_m = np.concatenate([np.zeros((len(slots), 1)), legs_m.cumsum(axis=1)], axis=1)
    goes = gone_m[:, -1] >= LEAST_WAY_M
    along_m = np.arange(0.0, reach_m + STRIDE_M / 2, STRIDE_M)
    return Ways(slots[goes], _boxes(records[goes], points_m[goes], gone_m[goes], along_m))


def _steps_m(robots: RobotTable, slots: Ints) -> Floats:
    """(n, STEPS + 1, 2) the newest paths of robots, each `STEP_S` from the next. A robot that says that it waits on its
    path, or is held up before its destination, has what is left of it. All others stay."""
    x_m, y_m, goes, waits = (robots.records[name][slots] for name in ("x_m", "y_m", "goes", "waits"))
    here_m = np.stack([x_m, y_m], axis=1)[:, None]
    steps_m: Floats = np.where(goes[:, None, None], robots.steps_m[slots], here_m)
    for row in np.flatnonzero(waits & ~goes).tolist():
        slot = int(slots[row])
        if robots.records["held_up"][slot] or robots[robots.slots.uuids[slot]].state == WAITING:
            (path,) = robots.paths([slot])
            steps_m[row] = steps_along(path)
    return steps_m


def _boxes(records: Records, points_m: Floats, gone_m: Floats, along_m: Floats) -> Boxes:
    """(n, k) along the polylines `points_m` (n, p, 2), whose points are `gone_m` (n, p) from their begins."""
    along_m = np.broadcast_to(along_m, (len(points_m), len(along_m)))
    leg = (gone_m[:, None, 1:-1] <= along_m[:, :, None]).sum(axis=2)
    row = np.arange(len(points_m))[:, None]
    length_m = np.maximum(gone_m[row, leg + 1] - gone_m[row, leg], 1e-9)
    ahead = np.clip((along_m - gone_m[row, leg]) / length_m, 0.0, 1.0)[..., None]
    places_m = points_m[row, leg] + ahead * (points_m[row, leg + 1] - points_m[row, leg])
    ways = points_m[row, leg + 1] - points_m[row, leg]
    yaw_rad = np.arctan2(ways[..., 1], ways[..., 0])
    places_m[along_m > gone_m[:, -1:] + STRIDE_M] = np.nan
    half_length_m = np.broadcast_to(records["length_m"][:, None] / 2 + MARGIN_M / 2, yaw_rad.shape)
    half_width_m = np.broadcast_to(records["width_m"][:, None] / 2 + BESIDE_M, yaw_rad.shape)
    x_m = places_m[..., 0] + np.cos(yaw_rad) * MARGIN_M / 2
    y_m = places_m[..., 1] + np.sin(yaw_rad) * MARGIN_M / 2
    along = Boxes(x_m, y_m, yaw_rad, half_length_m, half_width_m)
    turning = _turning(records, yaw_rad[:, 0])
    return Boxes._make(np.concatenate(columns, axis=1) for columns in zip(turning, along, strict=True))


def _turning(records: Records, first_rad: Floats) -> Boxes:
    """(n, 1) the room in which robots turn before they set out; nan if they need not turn."""
    off_rad = np.abs(np.remainder(first_rad - records["reported_yaw_rad"] + np.pi, 2 * np.pi) - np.pi)
    x_m = np.where(off_rad > TURNED_RAD, records["reported_x_m"], np.nan)
    reach_m = np.hypot(records["length_m"], records["width_m"]) / 2
    columns = (x_m, records["reported_y_m"], records["reported_yaw_rad"], reach_m, reach_m)
    return Boxes._make(column[:, None] for column in columns)


def bodies(robots: RobotTable, slots: Ints) -> Boxes:
    """(n,) where robots were last reported."""
    names = "reported_x_m", "reported_y_m", "reported_yaw_rad", "length_m", "width_m"
    x_m, y_m, yaw_rad, length_m, width_m = (robots.records[name][slots] for name in names)
    return Boxes(x_m, y_m, yaw_rad, length_m / 2, width_m / 2)


def first_in_way(robots: RobotTable, ways: Ways, others: Ints) -> tuple[Ints, Floats]:
    """(n,) the slot of `others` (m,) whose body is first on each way, -1 if none is; and the direction of the way
    there."""
    body = bodies(robots, others)
    pairs = touching_boxes(around(ways.boxes), around(Boxes._make(column[:, None] for column in body)))
    row, other = pairs.T
    is_other = (ways.slots[row] != others[other]) & can_meet(robots, ways.slots[row], others[other])
    row, other = row[is_other], other[is_other]
    hit = touch(Boxes._make(c[row] for c in ways.boxes), Boxes._make(c[other][:, None] for c in body))
    found, way_rad = np.full(len(ways.slots), -1), ways.boxes.yaw_rad[:, 1].copy()
    first = np.where(hit.any(axis=1), hit.argmax(axis=1), hit.shape[1])
    away_m = np.hypot(*(body[k][other] - robots.records[name][ways.slots[row]] for k, name in _REPORTED))
    order = np.lexsort((away_m, first))[::-1]
    order = order[first[order] < hit.shape[1]]
    found[row[order]] = others[other[order]]
    way_rad[row[order]] = ways.boxes.yaw_rad[row[order], np.maximum(first[order], 1)]
    return found, way_rad


def can_meet(robots: RobotTable, slots: Ints, others: Ints) -> Bools:
    """(n,) whether robots are on one floor, and neither passes above the other."""
    floor, bottom_m, top_m = (robots.records[name] for name in ("floor", "bottom_m", "top_m"))
    overlap = heights_overlap(bottom_m[slots], top_m[slots], bottom_m[others], top_m[others])
    found: Bools = (floor[slots] == floor[others]) & overlap
    return found


def meetings(robots: RobotTable, ways: Ways) -> list[tuple[tuple[int, int], tuple[Point, Point]]]:
    """Where ways meet, each pair once: of each way with the `MOST_MET` nearest. The slots of both robots, and the first
    point of each one's way where it would be in the other's."""
    outer = around(ways.boxes) if len(ways.slots) else np.empty((0, 4))
    row, other = touching_boxes(outer, outer).T
    chosen = (row != other) & can_meet(robots, ways.slots[row], ways.slots[other])
    row, other = row[chosen], other[chosen]
    middle_m = (outer[:, :2] + outer[:, 2:]) / 2
    near = nearest_of_each(row, np.hypot(*(middle_m[row] - middle_m[other]).T), MOST_MET)
    row, other = np.unique(np.sort(np.stack([row[near], other[near]]), axis=0), axis=1)
    mine = Boxes._make(column[row][:, :, None] for column in ways.boxes)
    theirs = Boxes._make(column[other][:, None, :] for column in ways.boxes)
    meet = touch(mine, theirs)
    found = []
    for pair in np.flatnonzero(meet.any(axis=(1, 2))).tolist():
        a, b = int(row[pair]), int(other[pair])
        first = int(meet[pair].any(axis=1).argmax()), int(meet[pair].any(axis=0).argmax())
        before_m = _point(ways, a, first[0]), _point(ways, b, first[1])
        found.append(((int(ways.slots[a]), int(ways.slots[b])), before_m))
    return found


def _point(ways: Ways, row: int, box: int) -> Point:
    return float(ways.boxes.x_m[row, box]), float(ways.boxes.y_m[row, box])


_REPORTED = ((0, "reported_x_m"), (1, "reported_y_m"))


def around(boxes: Boxes) -> Floats:
    """(n, 4) west, south, east and north of the k rectangles (n, k) of each row."""
    reach_m = np.hypot(boxes.half_length_m, boxes.half_width_m)
    least = (np.nanmin(axis_m - reach_m, axis=1) for axis_m in boxes[:2])
    most = (np.nanmax(axis_m + reach_m, axis=1) for axis_m in boxes[:2])
    return np.stack([*least, *most], axis=1)


def touch_any(boxes: Boxes, others: Boxes) -> Bools:
    """(n,) whether each of `boxes` (n,) touches any of `others` (m,)."""
    mine, theirs = Boxes._make(c[:, None] for c in boxes), Boxes._make(c[None] for c in others)
    found: Bools = np.any(touch(mine, theirs), axis=1)
    return found


def touch(boxes: Boxes, others: Boxes) -> Bools:
    """Whether rectangles touch; arrays of up to three axes, of shapes that fit. Comparisons with nan are false."""
    shape = np.broadcast_shapes(boxes.x_m.shape, others.x_m.shape)
    three_axes = (1,) * (3 - len(shape)) + shape
    mine, theirs = (
        tuple(
            np.broadcast_to(column, three_axes)
            for column in (each.x_m, each.y_m, np.cos(each.yaw_rad), np.sin(each.yaw_rad), *each[3:])
        )
        for each in (boxes, others)
    )
    return touching(mine, theirs).reshape(shape)
