"""How robots drive along the cells that they visit, and where they would be without obstacles. Compiled."""

from math import cos, pi, sin, sqrt
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from benchmarks.planned_floors.floors.driving.grid import CELL_M as _CELL_M
from benchmarks.planned_floors.truth.motion import STEP_S as _STEP_S
from ingest.batch import Floats, Ints
from ingest.kernels import inner, kernel

CELL_M, STEP_S = float(_CELL_M), float(_STEP_S)
ACCELERATION_MPS2 = 1.0
TURNING_RADPS = pi / 2
SIDEWAYS_MPS = 0.4
MOSTLY_GONE = 0.7
"""A cell may be entered when the previous robot has driven this share of the way to its next cell."""
SNAP_M = 0.02
"""A robot that is this near to its stopping point has reached it."""
FACING_RAD = 1e-3
NOTHING_M = 1e-6
LEAST_MPS = 1e-3
"""Prevents that a robot stops a millimetre before its stopping point."""
SAMPLES_PER_S = round(1 / STEP_S)
NO_WAIT = np.iinfo(np.int64).max
NO_PLAN, AWAITS_ORDER, TURNS, GOES = range(4)
"""The next action of a robot without obstacles."""

Driving = NDArray[Any]
"""One record of `DRIVING` for each robot."""

DRIVING = np.dtype(
    [
        ("visit", np.int64),  # the cell that it is in, or comes from
        ("gone_m", np.float64),  # from the middle of that cell towards the next
        ("speed_mps", np.float64),
        ("yaw_rad", np.float64),
        ("aside_m", np.float64),  # to the left of its way
        ("aside_to_m", np.float64),  # where it is going to, to the left of its way
        ("turns_aside_m", np.float64),  # it may turn into its next leg with at most this offset
        ("waits_before", np.int64),  # the first visit that it may not begin, `NO_WAIT` if it need not wait
        ("top_mps", np.float64),  # greatest speed that it is allowed now; 0 to brake and stand
    ],
    align=True,
)

Ways = NDArray[Any]
"""Of `VISIT`: rows are robots, columns their visits."""

VISIT = np.dtype(
    [
        ("x_m", np.float64),  # the middle of the cell
        ("y_m", np.float64),
        ("heading_rad", np.float64),  # from there to the cell of the next visit
        ("first_robot", np.int64),  # the robot of the same fleet that uses the cell before, -1 for none
        ("first_visit", np.int64),  # that robot's visit
    ],
    align=True,
)

_DRIVING, _WAYS = numba.from_dtype(DRIVING)[::1], numba.from_dtype(VISIT)[:, ::1]
_ROWS, _POSES = numba.int64[::1], numba.float64[:, ::1]


@inner
def _granted(driving: Driving, ways: Ways, robot: int, visit: int) -> bool:
    """Whether the order of its fleet, and what it was asked to wait for, allow a robot to enter the cell of a visit."""
    if visit >= driving[robot].waits_before:
        return False
    entry = ways[robot, visit]
    if entry.first_robot < 0:
        return True
    first = driving[entry.first_robot]
    return bool(first.visit + first.gone_m / CELL_M >= entry.first_visit + MOSTLY_GONE)


@inner
def _turned(angle: float) -> float:
    """The same angle within [-pi, pi)."""
    return float((angle + pi) % (2 * pi) - pi)


@inner
def _next_move(driving: Driving, count: Ints, ways: Ways, robot: int, in_order: bool) -> int:
    """`NO_PLAN`, `AWAITS_ORDER`, `TURNS` or `GOES`."""
    me = driving[robot]
    if me.visit + 1 >= count[robot]:
        return NO_PLAN
    if me.gone_m > 0.0:
        return GOES
    if abs(_turned(ways[robot, me.visit].heading_rad - me.yaw_rad)) > FACING_RAD:
        return TURNS
    if in_order and not _granted(driving, ways, robot, me.visit + 1):
        return AWAITS_ORDER
    return GOES


@inner
def _free_m(driving: Driving, count: Ints, ways: Ways, robot: int, in_order: bool) -> float:
    """Metres to the next point at which a driving robot must stop: a corner, the end of its plan, or a cell that it may
    not enter."""
    me = driving[robot]
    free_m, at, most_m = CELL_M - me.gone_m, me.visit + 1, 2 * CELL_M
    heading = ways[robot, me.visit].heading_rad
    while free_m < most_m and at + 1 < count[robot]:
        if abs(ways[robot, at].heading_rad - heading) > FACING_RAD:
            break
        if in_order and not _granted(driving, ways, robot, at + 1):
            break
        free_m += CELL_M
        at += 1
    return float(free_m)


@inner
def _turn(me: Any, heading_rad: float) -> None:
    """Turn in place towards a heading, for one step."""
    me.speed_mps = 0.0
    if me.top_mps > 0.0 and abs(me.aside_m) <= me.turns_aside_m:
        most_rad, off_rad = TURNING_RADPS * STEP_S, _turned(heading_rad - me.yaw_rad)
        me.yaw_rad = _turned(me.yaw_rad + min(max(off_rad, -most_rad), most_rad))


@inner
def _go(me: Any, free_m: float) -> None:
    """Drive for one step, with `free_m` to the next stopping point."""
    least_mps = max(me.speed_mps - ACCELERATION_MPS2 * STEP_S, 0.0)
    wanted_mps = max(min(me.speed_mps + ACCELERATION_MPS2 * STEP_S, me.top_mps), least_mps)
    left_m = max(free_m - wanted_mps * STEP_S / 2, 0.0)
    me.speed_mps = min(wanted_mps, sqrt(2 * ACCELERATION_MPS2 * left_m) + LEAST_MPS)
    gone_m = min(me.speed_mps * STEP_S, free_m)
    if free_m - gone_m < SNAP_M and wanted_mps > 0.0:
        gone_m, me.speed_mps = free_m, 0.0
    me.gone_m += gone_m
    while me.gone_m >= CELL_M - NOTHING_M:
        me.visit += 1
        me.gone_m -= CELL_M
        if me.gone_m < NOTHING_M:
            me.gone_m = 0.0


@inner
def _step(driving: Driving, count: Ints, ways: Ways, robot: int, in_order: bool) -> None:
    """Advance one robot by `STEP_S`."""
    me = driving[robot]
    sideways_m = SIDEWAYS_MPS * STEP_S
    me.aside_m += min(max(me.aside_to_m - me.aside_m, -sideways_m), sideways_m)
    move = _next_move(driving, count, ways, robot, in_order)
    if move == GOES:
        _go(me, _free_m(driving, count, ways, robot, in_order))
    elif move == TURNS:
        _turn(me, ways[robot, me.visit].heading_rad)
    else:
        me.speed_mps = 0.0


@inner
def _set_pose(driving: Driving, ways: Ways, robot: int, pose: Floats) -> None:
    """Write x, y, yaw of a robot into `pose` (3,)."""
    me = driving[robot]
    at = ways[robot, me.visit]
    heading = at.heading_rad if me.gone_m > 0.0 else me.yaw_rad
    pose[0] = at.x_m + me.gone_m * cos(heading) - me.aside_m * sin(heading)
    pose[1] = at.y_m + me.gone_m * sin(heading) + me.aside_m * cos(heading)
    pose[2] = me.yaw_rad


@kernel(numba.int64[::1](_DRIVING, _ROWS, _WAYS))
def next_moves(driving: Driving, count: Ints, ways: Ways) -> Ints:
    """(n,) next action of each robot without obstacles. `count` (n,) is the number of its known visits."""
    moves = np.empty(len(driving), np.int64)
    for robot in range(len(driving)):
        moves[robot] = _next_move(driving, count, ways, robot, True)
    return moves


@kernel(numba.void(_DRIVING, _ROWS, _WAYS, _POSES))
def advance(driving: Driving, count: Ints, ways: Ways, poses: Floats) -> None:
    """Advance all robots by `STEP_S`, in the order of their fleets. Writes x, y, yaw into `poses` (n, 3)."""
    for robot in range(len(driving)):
        _step(driving, count, ways, robot, True)
        _set_pose(driving, ways, robot, poses[robot])


@kernel(numba.float64[:, :, ::1](_DRIVING, _ROWS, _WAYS, _ROWS, numba.boolean, numba.int64, numba.int64))
def foreseen(
    driving: Driving, count: Ints, ways: Ways, fleet: Ints, in_order: bool, first_sample: int, seconds: int
) -> Floats:
    """(fleet, seconds, 3) x, y, yaw of the robots of a fleet if nothing held them up but the order of their fleet, or
    not even that: `first_sample` steps from now, and every second from then on. `driving` is used up."""
    poses = np.empty((len(fleet), seconds, 3))
    for sample in range(1, first_sample + round((seconds - 1) / STEP_S) + 1):
        for robot in fleet:
            _step(driving, count, ways, robot, in_order)
        since = sample - first_sample
        if since >= 0 and since % SAMPLES_PER_S == 0:
            for row in range(len(fleet)):
                _set_pose(driving, ways, fleet[row], poses[row, since // SAMPLES_PER_S])
    return poses
