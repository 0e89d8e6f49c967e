"""The records that contention keeps of robots, field by field, and the kernels that write and read them.

`update_records` is long because it is one loop that copies many columns into the fields of a record.
"""

from math import hypot, inf, pi
from typing import Any, NamedTuple

import numba
import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.ops import substring

from deconflict.contention.robots.bounding_boxes import write_box
from deconflict.contention.robots.lookahead import LOOKAHEAD, PATHS_AHEAD, STEP_S, STEPS, Lookahead, PathsAhead
from ingest.batch import Basis, Bools, Floats, Ints
from ingest.kernels import (
    CUBE,
    FLOAT,
    INTS,
    MATRIX,
    READ_BOOLS,
    READ_FLOATS,
    READ_INTS,
    READ_MATRIX,
    copy_rows,
    inner,
    kernel,
    named_type,
)

STANDS_M = 0.1
"""A robot that has moved no farther than this stands."""
RESTS_M, RESTS_RAD = 0.05, 0.05
"""A robot whose reports differ by no more than this is at rest, wherever it says that it will be."""
RESTS_S = 0.8
"""A robot that rests for so long between two reports stands there."""
STANDS_S = 3.0
"""A robot that is forecast to move stands only after this long."""
WAY_M = 0.5
"""A path with less than this left has ended."""
LEAST_M = 0.05
"""What reaches less than this into a robot's path does not block it; no path is narrower than this on either side."""
STRAIGHT = int(3.0 / STEP_S)
"""A robot without a path is assumed to go straight on for this many steps; its further path is not known."""

Records = NDArray[Any]
"""Of `ROBOT`, by slot."""

ROBOT = np.dtype(
    [
        ("event_s", np.float64),  # when its newest pose was true
        ("x_m", np.float64),  # centre of its envelope then
        ("y_m", np.float64),
        ("length_m", np.float64),  # of its envelope, along the heading
        ("width_m", np.float64),  # across the heading
        ("bottom_m", np.float64),  # the lowest height it reaches; -inf if not known
        ("top_m", np.float64),  # the highest height it reaches; inf if not known
        ("way_m", np.float64),  # length of its forecast path in the next ten seconds
        ("stood_s", np.float64),  # since when it stands where it is
        ("goes", np.bool_),  # it is forecast to move
        ("stands", np.bool_),  # it is at rest, whatever it reports
        ("floor", np.int64),  # number of the floor that it is on
        ("stops", np.int64),  # how many stops lie ahead
        ("row", np.int64),  # row of the batch that this comes from
        ("stood_floor", np.int64),  # number of the floor where it stands
        ("yaw_rad", np.float64),  # heading of its newest pose, anticlockwise from x
        ("stood_x_m", np.float64),  # where it stands: centre of its envelope
        ("stood_y_m", np.float64),
        ("west_m", np.float64),  # box around its path, or around its last path; west is the least x, south the least y
        ("south_m", np.float64),
        ("east_m", np.float64),
        ("north_m", np.float64),
        ("reported_x_m", np.float64),  # centre of its envelope in its newest report
        ("reported_y_m", np.float64),
        ("reported_yaw_rad", np.float64),
        ("rests_s", np.float64),  # since when its reports have it at that pose
        ("speed_mps", np.float64),  # its mean speed between its last two reports; inf after the first
        ("known", np.bool_),  # the slot is in use
        ("here", np.bool_),  # it has a resource
        ("waits", np.bool_),  # it has stopped on its path
        ("beside", np.bool_),  # it was in the box of a resource
        ("passes", np.bool_),  # it had a zone near its path
        ("bound", np.bool_),  # it has a stop in the box of a resource
        ("held_up", np.bool_),  # it stands by its velocity, and has a stop ahead
    ],
    align=True,
)

VIEWED_FIELDS = 1 + [*(ROBOT.names or ())].index("stops")
"""So many fields, the first of a record, are in `RobotView`."""

STOP = np.dtype(
    [
        ("announced_s", np.float64),  # when the robot announces to be there; at its path's end, as forecast
        ("t_s", np.float64),  # that time corrected by its vendor's past errors
        ("expected_s", np.float64),  # when it is expected there: later if it is overdue
        ("spread_s", np.float64),  # half the width of the 80 % interval of that
        ("x_m", np.float64),  # where it is
        ("y_m", np.float64),
        ("floor", np.int64),  # number of its floor
        ("resource", np.int64),  # number of the resource that it is in; -1 if none
    ],
    align=True,
)
"""One stop ahead."""
Stops = NDArray[Any]
"""Of `STOP`, by slot and in the order of their times."""

RESOURCE = 1 << 0
"""Bit: which resource the robot has may have changed."""
PASSAGES = 1 << 1
"""Bit: which zones are on its way may have changed."""
STOPS = 1 << 2
"""Bit: which resources its stops are in may have changed."""
PATH_END = 1 << 3
"""Bit: its path may end in a resource."""
HALTS = 1 << 4
"""Bit: it has stopped on its path."""
MOVES = 1 << 5
"""Bit: it has moved since it stopped on its path."""
WAIT_ENDS = 1 << 6
"""Bit: it moves on, or rests."""
AT_REST = 1 << 7
"""Bit: it rests where it is reported, wherever its path leads."""


class Outlines(NamedTuple):
    """Outlines of n places."""

    floors: Ints
    """(n,) numbers of their floors."""
    boxes_m: Floats
    """(n, 4) boxes around them: west, south, east and north."""


_RECORDS = numba.types.Array(numba.from_dtype(ROBOT), 1, "C")
_STOPS = numba.types.Array(numba.from_dtype(STOP), 2, "C")
_SIZES = numba.types.UniTuple(READ_FLOATS, 4)  # type: ignore[no-untyped-call]
OUTLINES = named_type(Outlines, INTS, MATRIX)
"""The type of `Outlines` in kernels."""
_STATIONARY, _VELOCITY = int(Basis.STATIONARY), int(Basis.VELOCITY)


@inner
def _touches(floor: int, west: float, south: float, east: float, north: float, outlines: Outlines) -> bool:
    """Whether a box touches any of those on its floor."""
    boxes_m = outlines.boxes_m
    for at in range(len(boxes_m)):
        is_apart = boxes_m[at, 0] > east or boxes_m[at, 2] < west or boxes_m[at, 1] > north or boxes_m[at, 3] < south
        if outlines.floors[at] == floor and not is_apart:
            return True
    return False


@inner
def _update_waiting(robot: Any, was_moving: bool, has_moved: bool, is_resting: bool) -> int:
    """Update whether a robot waits on its path; the bits of how that changed."""
    is_on_its_way = not robot.goes and not is_resting
    bits = 0
    if not is_on_its_way:
        bits = WAIT_ENDS if robot.waits else 0
    elif was_moving:
        bits = HALTS
    elif robot.waits and has_moved:
        bits = MOVES
    robot.waits = is_on_its_way and (robot.waits or was_moving)
    return bits


@inner
def _update_standing(robot: Any, event_s: float) -> None:
    """Update where and since when a robot stands, from its newest pose."""
    has_stood = robot.known and robot.floor == robot.stood_floor
    has_stood = has_stood and hypot(robot.x_m - robot.stood_x_m, robot.y_m - robot.stood_y_m) <= STANDS_M
    if not has_stood:
        robot.stood_floor, robot.stood_x_m, robot.stood_y_m = robot.floor, robot.x_m, robot.y_m
        robot.stood_s = event_s
    robot.stands = not robot.goes or event_s - robot.stood_s >= STANDS_S


@inner
def _update_rest(robot: Any, before_s: float, event_s: float, pose: Floats) -> None:
    """Update where a robot is by its newest report, since when it has been there, and how fast it came there.

    `before_s` is when its pose before was true.
    """
    x_m, y_m, yaw_rad = pose
    moved_m = hypot(x_m - robot.reported_x_m, y_m - robot.reported_y_m)
    if not robot.known:
        robot.speed_mps = inf
    elif event_s > before_s:
        robot.speed_mps = moved_m / (event_s - before_s)
    turned_rad = abs((yaw_rad - robot.reported_yaw_rad + pi) % (2 * pi) - pi)
    if not robot.known or moved_m > RESTS_M or turned_rad > RESTS_RAD:
        robot.rests_s, robot.reported_x_m, robot.reported_y_m, robot.reported_yaw_rad = event_s, x_m, y_m, yaw_rad


@inner
def _update_near(robot: Any, path_box_m: Floats, resources: Outlines, zones: Outlines, spare_m: float) -> int:
    """Update whether a robot is near a resource and its path near a zone; bits if it is, or was before."""
    was_beside, passed = robot.beside, robot.passes
    rests = robot.event_s - robot.rests_s >= RESTS_S
    floor, x, y = robot.floor, robot.reported_x_m if rests else robot.x_m, robot.reported_y_m if rests else robot.y_m
    reach_m = hypot(robot.length_m, robot.width_m) / 2 + spare_m
    west, south, east, north = path_box_m
    west, south, east, north = min(west, x), min(south, y), max(east, x), max(north, y)
    robot.beside = _touches(floor, x, y, x, y, resources)
    robot.passes = _touches(floor, west - reach_m, south - reach_m, east + reach_m, north + reach_m, zones)
    bits = AT_REST if rests else 0
    return bits | (RESOURCE if robot.beside or was_beside else 0) | (PASSAGES if robot.passes or passed else 0)


@kernel(
    INTS(
        _RECORDS,
        CUBE,
        *[READ_INTS] * 2,
        READ_FLOATS,
        READ_MATRIX,
        READ_BOOLS,
        READ_INTS,
        LOOKAHEAD,
        PATHS_AHEAD,
        _SIZES,
        READ_INTS,
        READ_BOOLS,
        *[OUTLINES] * 2,
        FLOAT,
    )
)
def update_records(
    robots: Records,
    kept_paths: Floats,
    slots: Ints,
    floor_numbers: Ints,
    event_s: Floats,
    reported: Floats,
    resting: Bools,
    basis: Ints,
    view: Lookahead,
    paths: PathsAhead,
    sizes_m: tuple[Floats, Floats, Floats, Floats],
    stops: Ints,
    bound: Bools,
    resources: Outlines,
    zones: Outlines,
    spare_m: float,
) -> Ints:
    """Update the records of n robots, and the paths of those that move; (n,) bits of what has to be updated with them.

    `floor_numbers` are the table's numbers of the batch's floors. `reported` (n, 3) are the x, y and yaw of the newest
    reports. `sizes_m` are length, width, bottom and top. `stops`
    are how many stops each robot has, `bound` whether any of them may be in a resource. A zone may be on a robot's way
    if the path comes as near to it as the envelope reaches and `spare_m`.
    """
    length_m, width_m, bottom_m, top_m = sizes_m
    stale = np.zeros(len(slots), np.int64)
    last = view.x_m.shape[1] - 1
    for row in range(len(slots)):
        robot = robots[slots[row]]
        floor, x, y = view.floor[row, 0], view.x_m[row, 0], view.y_m[row, 0]
        on = floor_numbers[floor] if floor >= 0 else -1
        was_moving, before_s = robot.goes and on == robot.floor, robot.event_s
        has_moved = on != robot.floor or x != robot.x_m or y != robot.y_m
        goes = basis[row] != _STATIONARY and paths.way_m[row] > WAY_M
        robot.event_s, robot.floor, robot.x_m, robot.y_m, robot.yaw_rad = event_s[row], on, x, y, view.yaw_rad[row, 0]
        robot.length_m, robot.width_m, robot.way_m, robot.goes = length_m[row], width_m[row], paths.way_m[row], goes
        robot.bottom_m, robot.top_m = bottom_m[row], top_m[row]
        if goes:
            robot.west_m, robot.south_m, robot.east_m, robot.north_m = paths.boxes_m[row]
            copy_rows(paths.lines_m[row], kept_paths[slots[row]])
        stale[row] |= _update_waiting(robot, was_moving, has_moved, resting[row])
        if robot.waits:
            robot.west_m, robot.east_m = min(robot.west_m, x), max(robot.east_m, x)
            robot.south_m, robot.north_m = min(robot.south_m, y), max(robot.north_m, y)
        _update_standing(robot, event_s[row])
        _update_rest(robot, before_s, event_s[row], reported[row])
        stale[row] |= _update_near(robot, paths.boxes_m[row], resources, zones, spare_m)
        if bound[row]:
            stale[row] |= STOPS
        if goes and basis[row] != _VELOCITY and view.floor[row, last] == floor:
            end_x, end_y = view.x_m[row, last], view.y_m[row, last]
            if _touches(on, end_x, end_y, end_x, end_y, resources):
                stale[row] |= PATH_END
        robot.known, robot.bound, robot.stops, robot.row = True, bound[row], stops[row], row
        robot.held_up = not goes and basis[row] == _VELOCITY and stops[row] > 0
    return stale


@kernel((_RECORDS, _STOPS, FLOAT))
def collect_boxes(robots: Records, stops: Stops, spare_m: float) -> tuple[Floats, Floats, Floats, Ints, Ints, Ints]:
    """Boxes of stops that lie in no resource, of robots that stand, and of the paths of robots that move or wait.

    Returns three arrays of boxes (n, 4), each box enlarged by `spare_m` on every side; then (n, 2) slot and number of
    each stop, (n,) slot of each standing robot, (n,) slot of the robot of each path. All are empty if no robot stands.
    """
    ends, standing, going = 0, 0, 0
    for slot in range(len(robots)):
        robot = robots[slot]
        standing += robot.known and robot.stands and robot.floor >= 0
    for slot in range(len(robots) if standing else 0):
        robot = robots[slot]
        going += robot.goes or robot.waits
        for k in range(robot.stops):
            ends += stops[slot, k].resource < 0
    ends_m, standing_m, going_m = np.empty((ends, 4)), np.empty((standing, 4)), np.empty((going, 4))
    end, stander, goer = np.empty((ends, 2), np.int64), np.empty(standing, np.int64), np.empty(going, np.int64)
    ends, standing, going = 0, 0, 0
    for slot in range(len(robots) if len(stander) else 0):
        robot = robots[slot]
        if robot.known and robot.stands and robot.floor >= 0:
            by_m = hypot(robot.length_m, robot.width_m) / 2 + spare_m
            x_m, y_m = robot.x_m, robot.y_m
            write_box(standing_m[standing], x_m - by_m, y_m - by_m, x_m + by_m, y_m + by_m)
            stander[standing] = slot
            standing += 1
        if robot.goes or robot.waits:
            by_m = robot.width_m / 2 + LEAST_M + spare_m
            west_m, south_m, east_m, north_m = robot.west_m, robot.south_m, robot.east_m, robot.north_m
            write_box(going_m[going], west_m - by_m, south_m - by_m, east_m + by_m, north_m + by_m)
            goer[going] = slot
            going += 1
        for k in range(robot.stops):
            stop = stops[slot, k]
            if stop.resource < 0:
                write_box(ends_m[ends], stop.x_m, stop.y_m, stop.x_m, stop.y_m)
                end[ends, 0], end[ends, 1] = slot, k
                ends += 1
    return ends_m, standing_m, going_m, end, stander, goer


def resting(records: Records) -> Bools:
    """(n,) which robots rest where they are reported, wherever their paths lead."""
    rests: Bools = records["event_s"] - records["rests_s"] >= RESTS_S
    return rests


def path_from(here: tuple[float, float], steps_m: Floats, length_m: float) -> shapely.LineString:
    """The path of a robot that has stopped `here`: also from short of where its path begins, as it was believed there.

    `steps_m` (STEPS + 1, 2) lead on from where it was believed to be.
    """
    gone_m = steps_m - steps_m[0]
    first_m, begin_m = gone_m[np.argmax(np.hypot(*gone_m.T) > STANDS_M)], steps_m[0] - here
    along, across = begin_m @ first_m, begin_m[0] * first_m[1] - begin_m[1] * first_m[0]
    is_short = along > 0.0 and abs(across) <= length_m * hypot(*first_m)
    return shapely.linestrings(np.vstack((here, steps_m)) if is_short else steps_m)


def rest_of(path: shapely.LineString, here: shapely.Point, length_m: float) -> shapely.LineString | None:
    """What is left of the path of a robot that stands `here`; None if it has reached its end, or is off it."""
    done_m = float(shapely.line_locate_point(path, here))
    if path.length - done_m < WAY_M or shapely.distance(path, here) > length_m:
        return None
    return path if done_m == 0 else substring(path, done_m, path.length)


def steps_along(path: shapely.LineString) -> Floats:
    """(STEPS + 1, 2) points along a path, equally far from each other."""
    points = shapely.line_interpolate_point(path, np.linspace(0.0, 1.0, STEPS + 1), normalized=True)
    steps_m: Floats = shapely.get_coordinates(points)
    return steps_m
