"""Swerving: a robot leaves its path sideways to pass another, if there is room."""

from math import cos, sin

import numpy as np

from benchmarks.planned_floors.floors.protection.fields import FIELD, Fields, occupied
from benchmarks.planned_floors.floors.protection.scene import HALF_M, Scene
from ingest.batch import Floats

GAP_M = 0.15
"""Gap between the bodies when they are side by side."""
FURTHEST_ASIDE_M = 1.2
LEAST_RUN_CELLS = 3
"""A robot swerves only if this many cells are straight ahead."""
BEYOND_M = 1.5
"""Length beyond the other robot for which the path must be free."""
NEXT_M = 0.1
"""Looked at before each step sideways."""
MOVING_MPS, ONCOMING_COS = 0.1, -0.7


def room_aside_m(scene: Scene, robot: int, other: int) -> float | None:
    """The offset to the left at which a robot can pass another. None if it can't.

    One that moves is gone past only where it comes towards the robot.
    """
    if scene.turning[robot] or scene.straight_cells(robot) < LEAST_RUN_CELLS:
        return None
    ahead_m, left_m, reach_m = _relative(scene, robot, other)
    off_rad = scene.poses[other, 2] - scene.poses[robot, 2]
    if ahead_m <= 0 or (scene.driving["speed_mps"][other] > MOVING_MPS and cos(off_rad) > ONCOMING_COS):
        return None
    beside_m = reach_m[1] + HALF_M[1] + GAP_M
    targets_m = sorted((left_m + beside_m, left_m - beside_m), key=abs)
    return next((float(target_m) for target_m in targets_m if _has_room(scene, robot, target_m, ahead_m)), None)


def has_passed(scene: Scene, robot: int, other: int) -> bool:
    """Whether another robot is behind, or no longer on the robot's own path."""
    if not scene.present[other]:
        return True
    ahead_m, left_m, reach_m = _relative(scene, robot, other)
    off_way_m = abs(left_m + scene.driving["aside_m"][robot])
    return bool(ahead_m < -(HALF_M[0] + reach_m[0]) or off_way_m > HALF_M[1] + reach_m[1] + GAP_M)


def next_aside_m(scene: Scene, robot: int, target_m: float) -> float:
    """The next sideways offset. The robot does not move towards a near body."""
    aside_m = float(scene.driving["aside_m"][robot])
    step_m = min(max(target_m - aside_m, -NEXT_M), NEXT_M)
    field: Fields = np.zeros(1, FIELD)
    field["front_m"] = field["rear_m"] = HALF_M[0]
    field["left_m"], field["right_m"] = HALF_M[1] + max(step_m, 0.0), HALF_M[1] + max(-step_m, 0.0)
    return aside_m if occupied(scene.poses, scene.present, field, HALF_M, robot) else target_m


def _relative(scene: Scene, robot: int, other: int) -> tuple[float, float, Floats]:
    """Distance ahead and to the left of another's centre, and half extent (2,) of its body along and across."""
    yaw = scene.poses[robot, 2]
    dx_m, dy_m = (scene.poses[other] - scene.poses[robot])[:2]
    c, s = abs(cos(scene.poses[other, 2] - yaw)), abs(sin(scene.poses[other, 2] - yaw))
    reach_m = np.array([HALF_M[0] * c + HALF_M[1] * s, HALF_M[0] * s + HALF_M[1] * c])
    return dx_m * cos(yaw) + dy_m * sin(yaw), dy_m * cos(yaw) - dx_m * sin(yaw), reach_m


def _has_room(scene: Scene, robot: int, aside_m: float, ahead_m: float) -> bool:
    """Whether the space beside the path is free, from the robot to beyond the other."""
    if abs(aside_m) > FURTHEST_ASIDE_M:
        return False
    x_m, y_m, yaw = scene.poses[robot]
    until_m = ahead_m + BEYOND_M
    for along_m in np.arange(0.0, until_m, 0.5).tolist():
        for across_m in (aside_m - HALF_M[1], aside_m + HALF_M[1]):
            place_m = x_m + along_m * cos(yaw) - across_m * sin(yaw), y_m + along_m * sin(yaw) + across_m * cos(yaw)
            if not scene.grid.free(*place_m):
                return False
    field: Fields = np.zeros(1, FIELD)
    field["front_m"] = until_m
    field["left_m"], field["right_m"] = aside_m + HALF_M[1] + GAP_M / 2, HALF_M[1] + GAP_M / 2 - aside_m
    return not occupied(scene.poses, scene.present, field, HALF_M, robot)
