"""Forecasts as knots with velocities: from each knot on, a robot moves straight and turns evenly.

A slab is one whole second of absolute time. The motion of a robot in a slab depends only on its knots and on the slab,
not on the pass. Times within a slab count from its start: small numbers, which keep their precision at any date.

`delayed` is long because it is one loop that writes the knots of all robots one behind the other.
"""

from math import sqrt
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from deconflict.sweep.geometry.pose import between
from ingest.batch import Floats, Forecasts, Ints
from ingest.frames.angles import turn_between
from ingest.kernels import BOOL, FLOAT, FLOATS, INT, INTS, READ_FLOATS, READ_INTS, copy_row, inner, kernel, ready
from ingest.shapes import is_sound as is_sound_shape

KNOT = np.dtype(
    [
        ("t", np.float64),  # seconds since the epoch
        ("x", np.float64),  # centre of the envelope, metres
        ("y", np.float64),
        ("yaw", np.float64),  # heading within [-pi, pi)
        ("vx", np.float64),  # velocity until the next knot, 0 after the last
        ("vy", np.float64),
        ("turn", np.float64),  # turning rate until the next knot, radians a second, 0 after the last
        ("reported_yaw", np.float64),  # heading as reported
        ("floor", np.int64),
    ],
    align=True,
)
"""One knot of a forecast."""

Knots = NDArray[Any]
"""Of `KNOT`."""

ROBOT = np.dtype(
    [
        ("half_length", np.float64),  # of the envelope, metres
        ("half_width", np.float64),
        ("radius", np.float64),  # of the circle around the envelope
        ("bottom", np.float64),  # heights
        ("top", np.float64),
        ("appears", np.float64),  # time of the first knot
        ("first", np.int64),  # place of its first knot
        ("count", np.int64),  # how many knots it has
        ("grown", np.float64),  # how much larger than reported a shape is all around
        ("shape", np.int64),  # number of its shape, 0 for a rectangle
        ("train", np.int64),  # one more than the slot of the robot that pulls its train, 0 if it is in none
    ],
    align=True,
)
"""One robot, whose knots are `first` to `first + count - 1`."""

Robots = NDArray[Any]
"""Of `ROBOT`."""

_turn_between = inner(turn_between)
_KNOT, _ROBOT = (numba.from_dtype(dtype) for dtype in (KNOT, ROBOT))

FARTHEST_M, LATEST_S, MOST_TURNED_RAD = 1e8, 1e11, 1e6
"""Largest valid places, times and headings. Beyond them, differences would lose their precision."""
UNSOUND = -1
"""Result of `replace` if a forecast is invalid."""
SAME_S = 1e-6
"""If a forecast is cut at a time, a knot this soon after it is left out."""


def is_sound(
    start: Ints,
    t_s: Floats,
    x_m: Floats,
    y_m: Floats,
    yaw_rad: Floats,
    length_m: Floats,
    width_m: Floats,
    bottom_m: Floats,
    top_m: Floats,
) -> bool:
    """Whether `motion_faults` finds no fault. A comparison with nan is false."""
    for row in range(len(start) - 1):
        if start[row + 1] <= start[row] or not bottom_m[row] <= top_m[row]:
            return False
        if not (0.0 < length_m[row] <= FARTHEST_M and 0.0 < width_m[row] <= FARTHEST_M):
            return False
        for k in range(start[row], start[row + 1]):
            if not (abs(x_m[k]) <= FARTHEST_M and abs(y_m[k]) <= FARTHEST_M):
                return False
            if not (abs(t_s[k]) <= LATEST_S and abs(yaw_rad[k]) <= MOST_TURNED_RAD):
                return False
            if k > start[row] and not t_s[k] > t_s[k - 1]:
                return False
    return True


_is_sound, _sound = inner(is_sound), kernel(BOOL(READ_INTS, *[READ_FLOATS] * 8))(is_sound)


def faults(forecasts: Forecasts) -> dict[int, str]:
    """The reason why a robot can't be swept, by row. The other robots can."""
    return motion_faults(forecasts) | dict.fromkeys(_unsound_shapes(forecasts), "shape-not-valid")


def motion_faults(forecasts: Forecasts) -> dict[int, str]:
    """As `faults`, without those of shapes."""
    f = forecasts
    by_knot, by_robot = (f.t_s, f.x_m, f.y_m, f.yaw_rad), (f.length_m, f.width_m, f.bottom_m, f.top_m)
    sound = _sound(ready(f.start, np.int64), *(ready(column) for column in (*by_knot, *by_robot)))
    return {} if sound else _reasons(forecasts)


def _unsound_shapes(forecasts: Forecasts) -> list[int]:
    """The rows of shapes that can't be swept."""
    shapes = () if forecasts.shapes is None else forecasts.shapes
    return [row for row, shape in enumerate(shapes) if shape is not None and not is_sound_shape(shape)]


def _reasons(forecasts: Forecasts) -> dict[int, str]:
    """The reasons of `motion_faults`. Of several reasons of one robot the last in the list below counts."""
    reasons: dict[int, str] = {}
    sizes = np.column_stack([forecasts.length_m, forecasts.width_m])
    heights_wrong = np.isnan(forecasts.bottom_m) | np.isnan(forecasts.top_m) | (forecasts.bottom_m > forecasts.top_m)
    counts = np.diff(forecasts.start)
    finite = np.isfinite(forecasts.t_s) & np.isfinite(forecasts.x_m)
    finite &= np.isfinite(forecasts.y_m) & np.isfinite(forecasts.yaw_rad)
    near = (np.abs(forecasts.x_m) <= FARTHEST_M) & (np.abs(forecasts.y_m) <= FARTHEST_M)
    near &= (np.abs(forecasts.t_s) <= LATEST_S) & (np.abs(forecasts.yaw_rad) <= MOST_TURNED_RAD)
    robots = np.arange(len(forecasts))
    owner = np.repeat(robots, counts)
    later = np.ones(len(owner), bool)
    later[1:] = (forecasts.t_s[1:] > forecasts.t_s[:-1]) | (owner[1:] != owner[:-1])
    for wrong, whose, reason in (
        (heights_wrong, robots, "heights-not-ordered"),
        (~later, owner, "times-not-increasing"),
        ((sizes > FARTHEST_M).any(axis=1), robots, "out-of-range"),
        (~near, owner, "out-of-range"),
        (~finite, owner, "not-finite"),
        (~(sizes > 0).all(axis=1), robots, "size-not-positive"),
        (~np.isfinite(sizes).all(axis=1), robots, "size-not-finite"),
        (counts < 1, robots, "no-knots"),
    ):
        if wrong.any():
            reasons |= dict.fromkeys(whose[wrong].tolist(), reason)
    return reasons


@inner
def _write_knots(
    knots: Knots, first: Ints, start: Ints, t_s: Floats, x_m: Floats, y_m: Floats, yaw_rad: Floats, on_floor: Ints
) -> None:
    """Write the knots of row i from `first[i]` on."""
    for row in range(len(first)):
        for k in range(start[row], start[row + 1]):
            knot = knots[first[row] + k - start[row]]
            knot.t, knot.x, knot.y, knot.floor = t_s[k], x_m[k], y_m[k], on_floor[k]
            knot.yaw = _turn_between(0.0, yaw_rad[k])
            knot.vx, knot.vy, knot.turn, knot.reported_yaw = 0.0, 0.0, 0.0, yaw_rad[k]
            if k + 1 < start[row + 1] and on_floor[k + 1] == on_floor[k]:
                span = t_s[k + 1] - t_s[k]
                knot.vx, knot.vy = (x_m[k + 1] - x_m[k]) / span, (y_m[k + 1] - y_m[k]) / span
                knot.turn = _turn_between(yaw_rad[k], yaw_rad[k + 1]) / span


@inner
def _set_robot(
    robot: Any, first: int, count: int, appears: float, length_m: float, width_m: float, bottom_m: float, top_m: float
) -> None:
    half_length, half_width = length_m / 2, width_m / 2
    robot.half_length, robot.half_width = half_length, half_width
    robot.radius = sqrt(half_length * half_length + half_width * half_width)
    robot.bottom, robot.top, robot.appears, robot.first, robot.count = bottom_m, top_m, appears, first, count
    robot.grown, robot.shape, robot.train = 0.0, 0, 0


@kernel(INT(*(_ROBOT[::1], _KNOT[::1], INTS, INT), READ_INTS, *[READ_FLOATS] * 4, READ_INTS, *[READ_FLOATS] * 4))
def _replace(
    robots: Robots,
    knots: Knots,
    slots: Ints,
    used: int,
    start: Ints,
    t_s: Floats,
    x_m: Floats,
    y_m: Floats,
    yaw_rad: Floats,
    on_floor: Ints,
    length_m: Floats,
    width_m: Floats,
    bottom_m: Floats,
    top_m: Floats,
) -> int:
    if not _is_sound(start, t_s, x_m, y_m, yaw_rad, length_m, width_m, bottom_m, top_m):
        return UNSOUND
    first, end = np.empty(len(slots), np.int64), used
    for row in range(len(slots)):
        robot, count = robots[slots[row]], start[row + 1] - start[row]
        if robot.count == count:
            first[row] = robot.first
        else:
            first[row] = end
            end += count
    if end <= len(knots):
        for row in range(len(slots)):
            sizes_m = length_m[row], width_m[row], bottom_m[row], top_m[row]
            count, appears = start[row + 1] - start[row], t_s[start[row]]
            _set_robot(robots[slots[row]], first[row], count, appears, *sizes_m)
        _write_knots(knots, first, start, t_s, x_m, y_m, yaw_rad, on_floor)
    return end


def replace(robots: Robots, knots: Knots, slots: Ints, used: int, forecasts: Forecasts) -> int:
    """Write forecasts into the `robots` of `slots` (n,), and their knots into `knots`: in place of the old knots if
    they are as many, else from `used` on.

    Returns the new end of the used knots. Nothing is written if that is beyond `knots`, or if a forecast is invalid:
    then the result is `UNSOUND`.
    """
    f, table = forecasts, (robots, knots, slots, used)
    t_s, x_m, y_m, yaw_rad = (ready(column) for column in (f.t_s, f.x_m, f.y_m, f.yaw_rad))
    sizes_m = (ready(column) for column in (f.length_m, f.width_m, f.bottom_m, f.top_m))
    return _replace(*table, ready(f.start, np.int64), t_s, x_m, y_m, yaw_rad, ready(f.floor, np.int64), *sizes_m)


_SWEPT = numba.types.Tuple((_ROBOT[::1], _KNOT[::1]))  # type: ignore[no-untyped-call]


@kernel(_SWEPT(_ROBOT[::1], _KNOT[::1], INTS))
def taken(robots: Robots, knots: Knots, slots: Ints) -> tuple[Robots, Knots]:
    """Copies of the robots of `slots` (n,), in that order, and of their knots; slot -1 gives a robot without knots."""
    some, n = np.zeros(len(slots), ROBOT), 0
    for row in range(len(slots)):
        if slots[row] >= 0:
            some[row] = robots[slots[row]]
            n += some[row].count
    own, n = np.empty(n, KNOT), 0
    for row in range(len(some)):
        first, count = some[row].first, some[row].count
        copy_row(knots[first : first + count], own[n : n + count])
        some[row].first, n = n, n + count
    return some, own


@kernel(_SWEPT(_ROBOT[::1], _KNOT[::1], INTS, FLOATS, *[FLOAT] * 4))
def delayed(
    robots: Robots,
    knots: Knots,
    rows: Ints,
    hold_s: Floats,
    leaves_s: float,
    horizon_s: float,
    short_s: float,
    beyond_s: float,
) -> tuple[Robots, Knots]:
    """The robots of `rows` (n,), each held for `hold_s` (n,) from `leaves_s` on, and their knots.

    The knots of a robot are its pose at `leaves_s` and when its hold ends, its later knots, and one more in line with
    the last two, `beyond_s` after its horizon; that one is left out if the forecast ends more than `short_s` before the
    horizon. A robot without knots still has none.
    """
    held, begins, most = robots[rows], np.zeros(len(rows) + 1, np.int64), 0
    for robot in held:
        most += robot.count + 3
    t, x, y, yaw, on_floor = np.empty(most), np.empty(most), np.empty(most), np.empty(most), np.empty(most, np.int64)
    n = 0
    for at in range(len(held)):
        begins[at + 1] = begin = n
        first, end, hold = held[at].first, held[at].first + held[at].count, hold_s[at]
        if first == end:
            continue
        ahead = first
        while ahead < end and knots[ahead].t <= leaves_s:
            ahead += 1
        before, after = knots[max(ahead - 1, first)], knots[min(ahead, end - 1)]
        if after.floor != before.floor:
            after = before
        knot = before.t, before.x, before.y, before.reported_yaw
        following = after.t, after.x, after.y, after.reported_yaw
        leaves_x, leaves_y, leaves_yaw, _, _ = between(knot, following, leaves_s)
        for _ in range(1 if hold == 0.0 else 2):
            t[n], on_floor[n] = leaves_s + hold * (n - begin), before.floor
            x[n], y[n], yaw[n] = leaves_x, leaves_y, leaves_yaw
            n += 1
        for k in range(ahead, end):
            if knots[k].t > leaves_s + SAME_S:
                t[n], x[n], y[n] = knots[k].t + hold, knots[k].x, knots[k].y
                yaw[n], on_floor[n] = knots[k].reported_yaw, knots[k].floor
                n += 1
        a, b, ends = n - 2, n - 1, leaves_s + horizon_s + hold
        if a >= begin and ends - short_s <= t[b] < ends + beyond_s and on_floor[a] == on_floor[b]:
            t[n], on_floor[n], yaw[n] = ends + beyond_s, on_floor[b], yaw[b]
            share = (t[n] - t[b]) / (t[b] - t[a])
            x[n], y[n] = x[b] + share * (x[b] - x[a]), y[b] + share * (y[b] - y[a])
            n += 1
        begins[at + 1] = n
        held[at].first, held[at].count, held[at].appears = begin, n - begin, t[begin]
    late = np.empty(n, KNOT)
    _write_knots(late, begins[:-1], begins, t, x, y, yaw, on_floor)
    return held, late
