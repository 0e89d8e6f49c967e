"""Oriented rectangles: which body or wall one of them touches."""

from math import cos, sin

import numpy as np

from ingest.batch import Bools, Floats
from ingest.kernels import inner, kernel

NOTHING, WALL = -1, -2


@inner
def _touch(
    x_m: float, y_m: float, yaw: float, long: float, wide: float,
    x2_m: float, y2_m: float, yaw2: float, long2: float, wide2: float,
) -> bool:  # fmt: skip
    """Whether two rectangles, given by centre, heading and half sizes, touch: by their four axes."""
    dx_m, dy_m = x2_m - x_m, y2_m - y_m
    reach_m = long + wide + long2 + wide2
    if dx_m * dx_m + dy_m * dy_m > reach_m * reach_m:
        return False
    c, s = abs(cos(yaw2 - yaw)), abs(sin(yaw2 - yaw))
    if abs(dx_m * cos(yaw) + dy_m * sin(yaw)) > long + long2 * c + wide2 * s:
        return False
    if abs(dy_m * cos(yaw) - dx_m * sin(yaw)) > wide + long2 * s + wide2 * c:
        return False
    if abs(dx_m * cos(yaw2) + dy_m * sin(yaw2)) > long2 + long * c + wide * s:
        return False
    return abs(dy_m * cos(yaw2) - dx_m * sin(yaw2)) <= wide2 + long * s + wide * c


@kernel("i8(f8[:,::1],f8[:,::1],i8,f8,f8,f8,f8,f8)")
def first_hit(
    bodies: Floats, walls: Floats, me: int, x_m: float, y_m: float, yaw: float, long: float, wide: float
) -> int:
    """The nearest body that a rectangle of half sizes `long` and `wide` touches, or WALL, or NOTHING.

    `bodies` (n, 5) are x, y, yaw and half sizes, of which row `me` is left out; `walls` (w, 4) centres and half sizes.
    """
    found, least_m2 = NOTHING, np.inf
    for row in range(len(bodies)):
        body = bodies[row]
        if row != me and _touch(x_m, y_m, yaw, long, wide, body[0], body[1], body[2], body[3], body[4]):
            away_m2 = (body[0] - bodies[me, 0]) ** 2 + (body[1] - bodies[me, 1]) ** 2
            if away_m2 < least_m2:
                found, least_m2 = row, away_m2
    if found != NOTHING:
        return found
    for row in range(len(walls)):
        wall = walls[row]
        reach_m = long + wide
        if abs(x_m - wall[0]) > wall[2] + reach_m or abs(y_m - wall[1]) > wall[3] + reach_m:
            continue
        if _touch(x_m, y_m, yaw, long, wide, wall[0], wall[1], 0.0, wall[2], wall[3]):
            return WALL
    return NOTHING


@kernel("b1[:,::1](f8[:,::1],f8)")
def near_pairs(bodies: Floats, gap_m: float) -> Bools:
    """(n, n) whether two bodies (n, 5) are nearer than `gap_m`; above the diagonal only."""
    count, more = len(bodies), gap_m / 2
    found = np.zeros((count, count), np.bool_)
    for a in range(count):
        for b in range(a + 1, count):
            p, q = bodies[a], bodies[b]
            found[a, b] = _touch(p[0], p[1], p[2], p[3] + more, p[4] + more, q[0], q[1], q[2], q[3] + more, q[4] + more)
    return found
