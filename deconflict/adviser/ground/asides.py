"""Where a robot can step aside to: a place near it, off the way of the robot that it lets through."""

from math import pi

import numpy as np

from deconflict.adviser.ground.barred_ground import BarredGround
from deconflict.adviser.ground.seen_ground import SeenGround, size_of
from deconflict.adviser.ground.tracks import ROOM_M
from deconflict.adviser.ways import BESIDE_M, Boxes, Point, Ways, touch_any
from deconflict.contention.robots.robot_table import RobotTable
from ingest.batch import Floats

STEP_M, FARTHEST_M = 0.25, 4.0
DIRECTIONS = 16
BEHIND_RAD = 0.6
"""Nobody steps aside more nearly backwards: that is backing out."""


def aside_m(
    robots: RobotTable, robot: str, passing: Ways, others: Boxes, barred: BarredGround, seen: SeenGround
) -> Point | None:
    """The nearest place, to its right if two are as near, to which a robot can move as it stands now, without turning:
    past no body of `others` (m,), only over ground where a body as large was seen and that is not barred, and to where
    it touches none of the ways of those that are to pass. None if there is none."""
    size, (x_m, y_m, yaw_rad) = robots[robot], robots.reported_pose(robot)
    directions_rad = yaw_rad + _directions_rad()
    away_m = np.arange(1, round(FARTHEST_M / STEP_M) + 1) * STEP_M
    to_x_m, to_y_m = (at_m + turn(directions_rad)[:, None] * away_m for at_m, turn in ((x_m, np.cos), (y_m, np.sin)))
    shape = to_x_m.shape
    poses = np.column_stack([to_x_m.ravel(), to_y_m.ravel(), np.full(to_x_m.size, yaw_rad)])
    body = _boxes(poses, size.length_m, size.width_m, 0.0)
    is_free = ~touch_any(_boxes(poses, size.length_m, size.width_m, BESIDE_M), others)
    is_free &= ~barred.bars_driving(size.datum, body) & seen.holds(size.datum, size_of(robots, robot), body)
    reachable = np.logical_and.accumulate(is_free.reshape(shape), axis=1)
    ways = Boxes._make(column.reshape(-1) for column in passing.boxes)
    is_off = ~touch_any(_boxes(poses, size.length_m, size.width_m, ROOM_M), ways)
    is_off &= ~barred.bars_standing(size.datum, body)
    found = np.flatnonzero((reachable & is_off.reshape(shape)).T)
    if not len(found):
        return None
    step, direction = divmod(int(found[0]), len(directions_rad))
    return round(float(to_x_m[direction, step]), 2), round(float(to_y_m[direction, step]), 2)


def _directions_rad() -> Floats:
    """Off the heading; those straight across first."""
    all_rad = np.arange(DIRECTIONS) * 2 * pi / DIRECTIONS - pi
    ahead_rad = all_rad[np.abs(all_rad) < pi - BEHIND_RAD]
    return ahead_rad[np.lexsort((ahead_rad, np.abs(np.abs(ahead_rad) - pi / 2).round(6)))]


def _boxes(poses: Floats, length_m: float, width_m: float, room_m: float) -> Boxes:
    halves = (np.full(len(poses), size_m / 2 + room_m) for size_m in (length_m, width_m))
    return Boxes(*poses.T, *halves)
