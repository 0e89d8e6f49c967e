"""What contention keeps of each robot as numbers, a record each, and the kernels that write and read them."""

from math import hypot
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from deconflict.contention.robots.lookahead import STEP_S
from ingest.batch import Basis, Bools, Floats, Ints
from ingest.kernels import inner, kernel

STANDS_M = 0.1
"""A robot that has moved no further than this stands."""
STANDS_S = 3.0
"""For so long, if it is forecast to move."""
WAY_M = 0.5
"""A way with less than this left is gone."""
LEAST_M = 0.05
"""What touches another one's way by less than this is not in it; nor is a way narrower than that on either side."""
STRAIGHT = int(3.0 / STEP_S)
"""A robot that tells no path is taken to go straight on for so many steps; nobody knows its way beyond."""

Records = NDArray[Any]
"""Of `ROBOT`, by slot."""

ROBOT = np.dtype(
    [
        ("event_s", np.float64),  # when its newest pose was true
        ("x_m", np.float64),  # middle of its envelope then
        ("y_m", np.float64),
        ("length_m", np.float64),  # of its envelope, along the heading
        ("width_m", np.float64),  # across the heading
        ("bottom_m", np.float64),  # heights that it reaches from and to; -inf and inf where they are unknown
        ("top_m", np.float64),
        ("way_m", np.float64),  # how far it gets in the next ten seconds
        ("stood_s", np.float64),  # since when it stands where it is
        ("goes", np.bool_),  # it is forecast to move
        ("stands", np.bool_),  # it is at rest, whatever it says
        ("floor", np.int64),  # number of the floor that it is on
        ("stops", np.int64),  # how many destinations lie ahead
        ("row", np.int64),  # of the batch that told this
        ("stood_floor", np.int64),  # floor and place where it stands
        ("yaw_rad", np.float64),  # of its newest pose
        ("stood_x_m", np.float64),
        ("stood_y_m", np.float64),
        ("west_m", np.float64),  # box around its way, or around the last one that it was on
        ("south_m", np.float64),
        ("east_m", np.float64),
        ("north_m", np.float64),
        ("known", np.bool_),  # it was heard before
        ("here", np.bool_),  # it has a resource
        ("waits", np.bool_),  # it has stopped on its way
        ("beside", np.bool_),  # it lay beside or in a resource
        ("passes", np.bool_),  # it had a zone near its way
        ("bound", np.bool_),  # it had a stop at a resource
    ],
    align=True,
)

SEEN = 1 + [*(ROBOT.names or ())].index("stops")
"""So many fields, the first of a record, are what `Seen` tells of a robot."""

STOP = np.dtype(
    [
        ("told_s", np.float64),  # when the robot says that it is there; where its path ends, as forecast
        ("t_s", np.float64),  # when it means to be there, and can
        ("expected_s", np.float64),  # when it is expected there: later where it is overdue
        ("spread_s", np.float64),  # half the width of the middle 80 % of that
        ("x_m", np.float64),  # where it is
        ("y_m", np.float64),
        ("floor", np.int64),  # number of its floor
        ("resource", np.int64),  # number of the resource that it is in; -1 where it is in none
    ],
    align=True,
)
"""One destination ahead."""
Stops = NDArray[Any]
"""Of `STOP`, by slot and in the order of their times."""

BESIDE, PASSES, BOUND, ENDS, HALTS, MOVES, GOES_ON = (1 << bit for bit in range(7))
"""What is asked of shapes about a robot that has reported: the resource that it has, the zones on its way, the
resources that it goes to, the one that its way ends in. And what becomes of a way left: it begins, shrinks, is gone."""

Drawn = tuple[Ints, Floats]
"""Floors (n,) of outlines, and boxes (n, 4) around them: west, south, east and north."""

_RECORDS = numba.types.Array(numba.from_dtype(ROBOT), 1, "C")
_STOPS = numba.types.Array(numba.from_dtype(STOP), 2, "C")
_FLOATS, _INTS, _BOOLS = (
    numba.types.Array(kind, 1, "C", readonly=True) for kind in (numba.float64, numba.int64, numba.boolean)
)
_TABLE, _INT_TABLE = (numba.types.Array(kind, 2, "C", readonly=True) for kind in (numba.float64, numba.int64))
_LINES = numba.types.Array(numba.float64, 3, "C", readonly=True)
_STATIONARY, _VELOCITY = int(Basis.STATIONARY), int(Basis.VELOCITY)


@inner
def _touches(floor: int, west: float, south: float, east: float, north: float, floors: Ints, boxes_m: Floats) -> bool:
    """Whether a box touches any of those on its floor."""
    for at in range(len(floors)):
        beside = boxes_m[at, 0] > east or boxes_m[at, 2] < west or boxes_m[at, 1] > north or boxes_m[at, 3] < south
        if floors[at] == floor and not beside:
            return True
    return False


@kernel(
    numba.int64[::1](
        _RECORDS,
        numba.float64[:, :, ::1],
        *[_INTS] * 2,
        _FLOATS,
        _BOOLS,
        _INTS,
        *[_TABLE] * 3,
        _INT_TABLE,
        _LINES,
        _TABLE,
        *[_FLOATS] * 5,
        _INTS,
        _BOOLS,
        *[_INTS, _TABLE] * 2,
        numba.float64,
    )
)
def take_in(
    robots: Records,
    kept_ways: Floats,
    slots: Ints,
    numbers: Ints,
    event_s: Floats,
    resting: Bools,
    basis: Ints,
    x_m: Floats,
    y_m: Floats,
    yaw_rad: Floats,
    floor: Ints,
    ways: Floats,
    boxes_m: Floats,
    way_m: Floats,
    length_m: Floats,
    width_m: Floats,
    bottom_m: Floats,
    top_m: Floats,
    stops: Ints,
    bound: Bools,
    resource_floors: Ints,
    resources_m: Floats,
    zone_floors: Ints,
    zones_m: Floats,
    spare_m: float,
) -> Ints:
    """Write what n robots say into their records, and the ways of those that go; (n,) what is to be asked of shapes.

    `x_m`, `y_m`, `yaw_rad` and `floor` are of `Ahead`, `ways`, `boxes_m` and `way_m` of `Ways`; `numbers` are of the
    floors of the batch, `stops` are how many there are of each and `bound` whether any may be at a resource. Zones are
    asked about where a way is no farther than the envelope reaches and `spare_m`.
    """
    asked = np.zeros(len(slots), np.int64)
    steps = x_m.shape[1]
    for row in range(len(slots)):
        one = robots[slots[row]]
        on, x, y = numbers[floor[row, 0]] if floor[row, 0] >= 0 else -1, x_m[row, 0], y_m[row, 0]
        went, moved = one.goes, on != one.floor or x != one.x_m or y != one.y_m
        goes = basis[row] != _STATIONARY and way_m[row] > WAY_M
        one.event_s, one.floor, one.x_m, one.y_m, one.yaw_rad = event_s[row], on, x, y, yaw_rad[row, 0]
        one.length_m, one.width_m, one.way_m, one.goes = length_m[row], width_m[row], way_m[row], goes
        one.bottom_m, one.top_m = bottom_m[row], top_m[row]
        if goes:
            one.west_m, one.south_m, one.east_m, one.north_m = boxes_m[row]
            kept_ways[slots[row]] = ways[row]
        on_its_way = not goes and not resting[row]
        if not on_its_way:
            asked[row] |= GOES_ON if one.waits else 0
        elif went:
            asked[row] |= HALTS
        elif one.waits and moved:
            asked[row] |= MOVES
        one.waits = on_its_way and (one.waits or went)
        stood = one.known and on == one.stood_floor and hypot(x - one.stood_x_m, y - one.stood_y_m) <= STANDS_M
        if not stood:
            one.stood_floor, one.stood_x_m, one.stood_y_m, one.stood_s = on, x, y, event_s[row]
        one.stands = not goes or event_s[row] - one.stood_s >= STANDS_S
        beside = _touches(on, x, y, x, y, resource_floors, resources_m)
        if beside or one.beside:
            asked[row] |= BESIDE
        reach_m = hypot(length_m[row], width_m[row]) / 2 + spare_m
        west, south, east, north = boxes_m[row]
        passes = _touches(on, west - reach_m, south - reach_m, east + reach_m, north + reach_m, zone_floors, zones_m)
        if passes or one.passes:
            asked[row] |= PASSES
        if bound[row]:
            asked[row] |= BOUND
        if goes and basis[row] != _VELOCITY and floor[row, steps - 1] == floor[row, 0]:
            x, y = x_m[row, steps - 1], y_m[row, steps - 1]
            if _touches(on, x, y, x, y, resource_floors, resources_m):
                asked[row] |= ENDS
        one.known, one.beside, one.passes, one.bound, one.stops = True, beside, passes, bound[row], stops[row]
        one.row = row
    return asked


@kernel(
    numba.types.Tuple((*[numba.float64[:, ::1]] * 3, numba.int64[:, ::1], *[numba.int64[::1]] * 2))(  # type: ignore[no-untyped-call]
        _RECORDS, _STOPS, numba.float64
    )
)
def around(robots: Records, stops: Stops, spare_m: float) -> tuple[Floats, Floats, Floats, Ints, Ints, Ints]:
    """Boxes, and whose: the ends of legs that lie in no resource, robots that stand, ways of those that go or wait.

    The boxes are (n, 4), `spare_m` larger than they have to be; of an end is told the slot and which stop of the
    robot's it is, of the others the slot. None where nobody stands.
    """
    ends, standing, going = 0, 0, 0
    for slot in range(len(robots)):
        one = robots[slot]
        standing += one.known and one.stands and one.floor >= 0
    for slot in range(len(robots) if standing else 0):
        one = robots[slot]
        going += one.goes or one.waits
        for k in range(one.stops):
            ends += stops[slot, k].resource < 0
    ends_m, standing_m, going_m = np.empty((ends, 4)), np.empty((standing, 4)), np.empty((going, 4))
    end, stander, goer = np.empty((ends, 2), np.int64), np.empty(standing, np.int64), np.empty(going, np.int64)
    ends, standing, going = 0, 0, 0
    for slot in range(len(robots) if len(stander) else 0):
        one = robots[slot]
        if one.known and one.stands and one.floor >= 0:
            by_m = hypot(one.length_m, one.width_m) / 2 + spare_m
            standing_m[standing] = one.x_m - by_m, one.y_m - by_m, one.x_m + by_m, one.y_m + by_m
            stander[standing] = slot
            standing += 1
        if one.goes or one.waits:
            by_m = one.width_m / 2 + LEAST_M + spare_m
            going_m[going] = one.west_m - by_m, one.south_m - by_m, one.east_m + by_m, one.north_m + by_m
            goer[going] = slot
            going += 1
        for k in range(one.stops):
            stop = stops[slot, k]
            if stop.resource < 0:
                ends_m[ends] = stop.x_m, stop.y_m, stop.x_m, stop.y_m
                end[ends] = slot, k
                ends += 1
    return ends_m, standing_m, going_m, end, stander, goer
