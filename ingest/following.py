"""The forecast of a robot that follows its path, compiled.

What it takes, `ingest/forecast.py` makes the same of, knot by knot. It leaves alone a heading that is not known, times
that are past or out of order, a path that contradicts the robot's motion, and degrees.
"""

from math import atan2, cos, inf, isnan, sin

import numpy as np
from numba import types

from ingest.compiled import inner, kernel
from ingest.forecast import JUMP_SLACK_M, Sighting, View, jump_mps
from ingest.paths import Path
from ingest.seam import Floats

WITHIN = 1e-12
"""As in `ingest/transforms.py`."""
NEARLY = 1 - 1e-9
"""Share of the farthest way that is no jump for certain, however lengths are rounded."""
_NUMBER, _ROWS = types.float64, types.float64[:, ::1]
_SAME = np.empty((0, 12))
"""The table of no transformation."""
Placed = tuple[float, float, float, float, float, float]


def follow(path: Path, here: Sighting, view: View) -> tuple[Floats, tuple[int, ...]] | None:
    """Knots (k, 4) of the envelope's centre from `here` along the path, and the floor of each, or None."""
    frame, floor = view.frame_of(path.datums[0])
    points, reading, body = path.poses, view.reading, view.body
    if frame.projection is not None or isinstance(points, tuple):
        return None
    knots = np.empty((len(points) + 1, 4))
    count = _follow(
        points,
        here.t_s,
        here.x_m,
        here.y_m,
        here.yaw_rad,
        here.clock_offset_s,
        here.t_s + reading.horizon_s + reading.quiet_after_s,
        jump_mps(body),
        JUMP_SLACK_M if here.floor == floor else inf,
        JUMP_SLACK_M,
        *body.offset_m,
        frame.transform.table if frame.transform else _SAME,
        knots,
    )
    if not count:
        return None
    floors = (floor,) * count if here.floor == floor else (here.floor, *(floor,) * (count - 1))
    return knots if count == len(knots) else knots[:count], floors


@inner
def _beside(x: float, y: float, rim: Floats) -> Placed:
    """As `Adjusted._beside`."""
    least, at, nearest = inf, 0.0, 0
    for i in range(len(rim)):
        dx, dy = rim[i, 2], rim[i, 3]
        share = ((x - rim[i, 0]) * dx + (y - rim[i, 1]) * dy) / rim[i, 4]
        share = 0.0 if share < 0.0 else 1.0 if share > 1.0 else share
        away_x, away_y = x - rim[i, 0] - share * dx, y - rim[i, 1] - share * dy
        distance2 = away_x * away_x + away_y * away_y
        if distance2 < least:
            least, at, nearest = distance2, share, i
    more_x, more_y = rim[nearest, 7], rim[nearest, 8]
    by_x, by_y = rim[nearest, 5] + at * more_x, rim[nearest, 6] + at * more_y
    if at in {0.0, 1.0}:
        return by_x, by_y, 0.0, 0.0, 0.0, 0.0
    u, v = rim[nearest, 2] / rim[nearest, 4], rim[nearest, 3] / rim[nearest, 4]
    return by_x, by_y, more_x * u, more_x * v, more_y * u, more_y * v


@inner
def _correction(x: float, y: float, triangles: Floats, rim: Floats) -> Placed:
    """As `Adjusted._correction`."""
    for i in range(len(triangles)):
        dx, dy = x - triangles[i, 4], y - triangles[i, 5]
        first, second = triangles[i, 0] * dx + triangles[i, 1] * dy, triangles[i, 2] * dx + triangles[i, 3] * dy
        if not (first < -WITHIN or second < -WITHIN or first + second > 1 + WITHIN):
            a, b, c, d = triangles[i, 8], triangles[i, 9], triangles[i, 10], triangles[i, 11]
            return triangles[i, 6] + a * dx + b * dy, triangles[i, 7] + c * dx + d * dy, a, b, c, d
    return _beside(x, y, rim)


@inner
def _placed(x: float, y: float, yaw_rad: float, table: Floats) -> tuple[float, float, float]:
    """As `transforms._Map.pose`; an empty table leaves everything as it is."""
    if len(table) == 0:
        return x, y, yaw_rad
    base, rim = table[0], table[1 + int(table[0, 8]) :]
    a, b, c, d = base[0], base[1], base[2], base[3]
    to_x, to_y = a * x + b * y + base[4], c * x + d * y + base[5]
    if len(rim):
        by_x, by_y, more_a, more_b, more_c, more_d = _correction(
            x - base[6], y - base[7], table[1 : len(table) - len(rim)], rim
        )
        to_x, to_y, a, b, c, d = to_x + by_x, to_y + by_y, a + more_a, b + more_b, c + more_c, d + more_d
    along, across = cos(yaw_rad), sin(yaw_rad)
    return to_x, to_y, atan2(c * along + d * across, a * along + b * across)


@kernel(types.UniTuple(_NUMBER, 3)(_NUMBER, _NUMBER, _NUMBER, _ROWS))  # type: ignore[no-untyped-call]
def placed(x: float, y: float, yaw_rad: float, table: Floats) -> tuple[float, float, float]:
    """As `_placed`."""
    return _placed(x, y, yaw_rad, table)


@inner
def _put(knots: Floats, row: int, t_s: float, x: float, y: float, yaw_rad: float, dx: float, dy: float) -> None:
    """A knot of the envelope's centre, which lies `dx` before the location and `dy` to its left."""
    if dx != 0.0 or dy != 0.0:
        c, s = cos(yaw_rad), sin(yaw_rad)
        x, y = x + c * dx - s * dy, y + s * dx + c * dy
    knots[row, 0], knots[row, 1], knots[row, 2], knots[row, 3] = t_s, x, y, yaw_rad


@kernel(types.int64(_ROWS, *[_NUMBER] * 11, _ROWS, _ROWS))
def _follow(
    points: Floats,
    t_s: float,
    x: float,
    y: float,
    yaw_rad: float,
    clock_offset_s: float,
    until_s: float,
    most_mps: float,
    first_slack_m: float,
    slack_m: float,
    dx: float,
    dy: float,
    table: Floats,
    knots: Floats,
) -> int:
    """How many knots there are, at most one more than `points`; 0 where they are left to others.

    `first_slack_m` is inf where the first point lies on another floor.
    """
    if isnan(yaw_rad):
        return 0
    _put(knots, 0, t_s, x, y, yaw_rad, dx, dy)
    count, before_s, last_s = 1, -inf, t_s
    for i in range(len(points)):
        at_s = points[i, 0] + clock_offset_s
        if not at_s > before_s:
            return 0
        before_s = at_s
        if at_s <= t_s or last_s >= until_s:
            continue
        to_x, to_y, to_rad = _placed(points[i, 1], points[i, 2], points[i, 3], table)
        way_m = most_mps * (at_s - last_s) + (first_slack_m if count == 1 else slack_m)
        if not (to_x - x) * (to_x - x) + (to_y - y) * (to_y - y) < way_m * way_m * NEARLY:
            return 0
        _put(knots, count, at_s, to_x, to_y, to_rad, dx, dy)
        count, last_s, x, y = count + 1, at_s, to_x, to_y
    return count if count > 1 else 0
