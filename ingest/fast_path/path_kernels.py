"""The forecast of a robot whose status repeats its last, in one kernel.

`ingest/fleet/prediction/forecast.py` computes the same forecast, knot by knot. The kernel gives up on times
that are past or out of order, on a path that contradicts the robot's motion, and on motion that needs a correction.
"""

from math import atan2, ceil, cos, inf, isnan, pi, sin

import numpy as np
from numba import types

from ingest.batch import Floats
from ingest.frames.angles import turn_between
from ingest.kernels import inner, kernel

WITHIN = 1e-12
"""As in `ingest/frames/transforms.py`."""
NEARLY = 1 - 1e-9
"""Share of the farthest way that is no jump for certain, however lengths are rounded."""
_NUMBER, _ROWS = types.float64, types.float64[:, ::1]
AS_IT_IS = np.empty((0, 12))
"""The table of no transformation."""
Placed = tuple[float, float, float, float, float, float]
_GONE = types.Tuple((*[types.int64] * 2, types.boolean, *[_NUMBER] * 7))  # type: ignore[no-untyped-call]
Gone = tuple[int, int, bool, float, float, float, float, float, float, float]
(BASIS, LOADED, MIRRORED, STOPS_FLOOR, CENTRE_X, CENTRE_Y, MOST_MPS, LEEWAY_M, HORIZON_S, QUIET_S, STOPS_AHEAD_S) = (
    range(11)
)
(MOST_POINTS, PATH_S, STOPS_S, SLACK_S, COMPARABLE_S, SHOWING_M, JUMP_M, MOST_TURN, SLOW_TURN) = range(11, 20)
"""What `go_on` is told of the robot and of the rules, by place in `limits`."""
BY_PATH, BY_VELOCITY = 1, 2
"""Of `Basis`; other robots stand."""
STRAIGHT_RADPS = 1e-3


_turn_between = inner(turn_between)


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
def placed(x: float, y: float, yaw_rad: float, table: Floats) -> tuple[float, float, float]:
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


@inner
def _put(knots: Floats, row: int, t_s: float, x: float, y: float, yaw_rad: float, dx: float, dy: float) -> None:
    """A knot of the envelope's centre, which lies `dx` before the location and `dy` to its left."""
    if dx != 0.0 or dy != 0.0:
        c, s = cos(yaw_rad), sin(yaw_rad)
        x, y = x + c * dx - s * dy, y + s * dx + c * dy
    knots[row, 0], knots[row, 1], knots[row, 2], knots[row, 3] = t_s, x, y, yaw_rad


@inner
def _along(
    points: Floats,
    here: tuple[float, float, float, float],
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
    """How many knots there are from `here` on, at most one more than `points`; 0 where they are left to others."""
    t_s, x, y, yaw_rad = here
    _put(knots, 0, t_s, x, y, yaw_rad, dx, dy)
    count, before_s, last_s = 1, -inf, t_s
    for i in range(len(points)):
        at_s = points[i, 0] + clock_offset_s
        if not at_s > before_s:
            return 0
        before_s = at_s
        if at_s <= t_s or last_s >= until_s:
            continue
        to_x, to_y, to_rad = placed(points[i, 1], points[i, 2], points[i, 3], table)
        way_m = most_mps * (at_s - last_s) + (first_slack_m if count == 1 else slack_m)
        if not (to_x - x) * (to_x - x) + (to_y - y) * (to_y - y) < way_m * way_m * NEARLY:
            return 0
        _put(knots, count, at_s, to_x, to_y, to_rad, dx, dy)
        count, last_s, x, y = count + 1, at_s, to_x, to_y
    return count if count > 1 else 0


@inner
def _by_velocity(
    here: tuple[float, float, float, float],
    speed_mps: float,
    turn_radps: float,
    horizon_s: float,
    dx: float,
    dy: float,
    knots: Floats,
) -> int:
    """As `forecast._by_velocity`; how many knots there are."""
    at_s, x, y, heading = here
    _put(knots, 0, at_s, x, y, heading, dx, dy)
    if abs(turn_radps) <= STRAIGHT_RADPS:
        reach_m = speed_mps * horizon_s
        _put(knots, 1, at_s + horizon_s, x + reach_m * cos(heading), y + reach_m * sin(heading), heading, dx, dy)
        return 2
    steps, radius_m = ceil(horizon_s), speed_mps / turn_radps
    for step in range(steps + 1):
        t_s = horizon_s * step / steps
        yaw_rad = heading + turn_radps * t_s
        to_x = x + radius_m * (sin(yaw_rad) - sin(heading))
        to_y = y - radius_m * (cos(yaw_rad) - cos(heading))
        _put(knots, step, at_s + t_s, to_x, to_y, yaw_rad, dx, dy)
    return steps + 1


@inner
def _bears_out(
    before: tuple[float, float, float, float],
    now: tuple[float, float, float, float],
    speed: float,
    turn: float,
    limits: Floats,
) -> bool:
    """Whether `watch.reconcile` has nothing to mend or to find, and `claims.Claims.seen` no jump, for certain."""
    gap_s, dx, dy = now[0] - before[0], now[1] - before[1], now[2] - before[2]
    moved2, showing_m = dx * dx + dy * dy, limits[SHOWING_M]
    if not 0.0 < gap_s <= limits[COMPARABLE_S] or not moved2 < limits[JUMP_M] * limits[JUMP_M] * NEARLY:
        return False
    turned, told = _turn_between(before[3], now[3]), turn * gap_s
    if (
        isnan(speed)
        or not abs(turn) <= limits[MOST_TURN]
        or not abs(told - turned) <= limits[SLOW_TURN] + abs(told) / 2
    ):
        return False
    if speed == 0.0 or moved2 < showing_m * showing_m * NEARLY:
        return True
    astray = abs(_turn_between(now[3], atan2(dy, dx)))
    return bool(astray <= pi / 4 or (astray >= 3 * pi / 4 and speed < 0.0))


@inner
def _stops_ahead(
    points: Floats, clock_offset_s: float, latest_s: float, floor: float, table: Floats, rows: Floats
) -> int:
    """How many of the destinations are not later than that: `forecast.stops`, all on one floor, into `rows`."""
    count = 0
    for i in range(len(points)):
        at_s = points[i, 0] + clock_offset_s
        if at_s <= latest_s:
            x, y, _ = placed(points[i, 1], points[i, 2], 0.0, table)
            rows[count, 0], rows[count, 1], rows[count, 2], rows[count, 3] = at_s, x, y, floor
            count += 1
    return count


@inner
def _is_odd(stamp_s: float, points: Floats, stops: Floats, limits: Floats) -> bool:
    """Whether `paths` finds something in the number and the times of a path or of destinations."""
    slack_s, most = limits[SLACK_S], limits[MOST_POINTS]
    if len(points) and (
        len(points) > most
        or points[len(points) - 1, 0] > stamp_s + limits[PATH_S] + slack_s
        or points[0, 0] < stamp_s - slack_s
    ):
        return True
    if len(stops) == 0:
        return False
    latest_s = stops[len(stops) - 1, 0]
    return bool(len(stops) > most or latest_s > stamp_s + limits[STOPS_S] + slack_s or latest_s < stamp_s - slack_s)


@kernel(_GONE(*[_ROWS] * 3, types.float64[::1], *[types.int64] * 4, *[_NUMBER] * 5))
def go_on(
    told: Floats,
    rows: Floats,
    table: Floats,
    limits: Floats,
    first_point: int,
    end_of_path: int,
    first_stop: int,
    end_of_stops: int,
    before_s: float,
    before_x: float,
    before_y: float,
    before_rad: float,
    event_s: float,
) -> Gone:
    """The forecast of a robot whose status repeats its last, from the rows `told` of `scanner_kernels`.

    Into `rows` go the knots of its forecast, and behind room for all of them the stops ahead. Returns how many of each
    there are, no knots where it is left to others; whether its points are odd; and what is seen: x_m, y_m, yaw_rad,
    speed and turn, and with them its height and stamp.
    """
    points, stops = told[first_point:end_of_path], told[first_stop:end_of_stops]
    stamp_s, speed, z_m, turn = told[0, 0], told[1, 1], told[1, 0], told[1, 2]
    x, y, yaw_rad = placed(told[0, 1], told[0, 2], told[0, 3], table)
    if isnan(turn) or turn == 0.0:
        turn = 0.0
    elif limits[MIRRORED] != 0.0:
        turn = -turn
    here, offset_s, knots = (event_s, x, y, yaw_rad), event_s - stamp_s, 0
    loaded = not isnan(told[2, 2]) and told[2, 2] != 100.0
    if loaded == (limits[LOADED] != 0.0) and _bears_out(
        (before_s, before_x, before_y, before_rad), here, speed, turn, limits
    ):
        dx, dy = limits[CENTRE_X], limits[CENTRE_Y]
        if limits[BASIS] == BY_VELOCITY:
            knots = _by_velocity(here, speed, turn, limits[HORIZON_S], dx, dy, rows)
        elif limits[BASIS] == BY_PATH:
            until_s = event_s + limits[HORIZON_S] + limits[QUIET_S]
            knots = _along(
                points,
                here,
                offset_s,
                until_s,
                limits[MOST_MPS],
                limits[LEEWAY_M],
                limits[LEEWAY_M],
                dx,
                dy,
                table,
                rows,
            )
        else:
            _put(rows, 0, event_s, x, y, yaw_rad, dx, dy)
            knots = 1
    latest_s = event_s + limits[STOPS_AHEAD_S]
    ahead = _stops_ahead(stops, offset_s, latest_s, limits[STOPS_FLOOR], table, rows[len(points) + 1 :])
    return knots, ahead, _is_odd(stamp_s, points, stops, limits), x, y, yaw_rad, speed, turn, z_m, stamp_s
