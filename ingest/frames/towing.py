"""How trailers follow: the axle of each is drawn along by the axle ahead of it, as in the usual kinematic model."""

from collections.abc import Sequence
from math import atan, atan2, ceil, cos, exp, hypot, sin, tan

STEP_M = 0.2
"""The axle ahead moves straight for no more than this."""


def towed_yaw(yaw_rad: float, hitch_m: float, dx_m: float, dy_m: float) -> float:
    """The heading of a trailer after the axle ahead has moved straight by (`dx_m`, `dy_m`): a tractrix."""
    way_m = hypot(dx_m, dy_m)
    if way_m == 0.0:
        return yaw_rad
    direction = atan2(dy_m, dx_m)
    return direction + 2.0 * atan(tan((yaw_rad - direction) / 2.0) * exp(-way_m / hitch_m))


def towed_along(yaws_rad: Sequence[float], hitches_m: Sequence[float], dx_m: float, dy_m: float) -> list[float]:
    """The headings of all trailers after the robot's axle has moved straight by (`dx_m`, `dy_m`)."""
    headings, steps = list(yaws_rad), ceil(hypot(dx_m, dy_m) / STEP_M)
    for _ in range(steps):
        step_x, step_y = dx_m / steps, dy_m / steps
        for row, hitch_m in enumerate(hitches_m):
            before = headings[row]
            headings[row] = towed_yaw(before, hitch_m, step_x, step_y)
            step_x += hitch_m * (cos(before) - cos(headings[row]))
            step_y += hitch_m * (sin(before) - sin(headings[row]))
    return headings


def axle_at(x_m: float, y_m: float, yaw_rad: float, axle_m: tuple[float, float]) -> tuple[float, float]:
    """Where the axle of a robot is, which is at `axle_m` from the centre of its envelope: ahead, and to its left."""
    c, s = cos(yaw_rad), sin(yaw_rad)
    return x_m + c * axle_m[0] - s * axle_m[1], y_m + s * axle_m[0] + c * axle_m[1]


def poses_behind(
    axle: tuple[float, float], yaws_rad: Sequence[float], hitches_m: Sequence[float]
) -> list[tuple[float, float, float]]:
    """x, y and heading of the trailers behind an axle."""
    (x_m, y_m), poses = axle, []
    for yaw_rad, hitch_m in zip(yaws_rad, hitches_m, strict=True):
        x_m, y_m = x_m - hitch_m * cos(yaw_rad), y_m - hitch_m * sin(yaw_rad)
        poses.append((x_m, y_m, yaw_rad))
    return poses
