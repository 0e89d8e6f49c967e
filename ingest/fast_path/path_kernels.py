"""The forecast of a robot whose status repeats its last one, in one kernel.

`ingest/fleet/prediction` computes the same forecast knot by knot. The kernel leaves a status to it if a time is past or
out of order, if the path contradicts the robot's motion, if the motion needs a correction, or if the last status is too
old to show any motion. A status that is late is no exception: a service that is behind reads many of them.

`forecast_repeat` is long because it has thirteen arguments, each on its own line.
"""

from math import atan2, ceil, cos, hypot, inf, isnan, pi, sin
from typing import Any

import numpy as np
from numba import types

from ingest.batch import Basis, Floats
from ingest.frames.angles import turn_between
from ingest.frames.transforms import map_point
from ingest.kernels import inner, kernel

NEARLY = 1 - 1e-9
"""Share of the longest possible move that is certainly no jump, whatever the rounding of lengths."""
STRAIGHT_RADPS = 1e-3
"""A slower turn is straight, as in `forecast._by_velocity`."""
BY_PATH, BY_VELOCITY = int(Basis.PATH), int(Basis.VELOCITY)
"""The bases of forecasts that move. All other robots stand."""
NO_TRANSFORM = np.empty((0, 12))
"""The table of a frame without transform."""
LIMITS = np.dtype(
    [
        ("basis", np.float64),  # `Basis` of the robot's forecasts
        ("loaded", np.float64),  # whether the robot is loaded
        ("mirrored", np.float64),  # whether its frame is left-handed
        ("stops_floor", np.float64),  # floor index of its destinations
        ("centre_x_m", np.float64),  # envelope centre before the location, along the heading
        ("centre_y_m", np.float64),  # envelope centre to the left of the location
        ("jump_mps", np.float64),  # a path that needs a higher speed than this contradicts the motion
        ("jump_slack_m", np.float64),  # length that a path may jump in addition
        ("late_s", np.float64),  # `path_forecast.LATE_S`
        ("horizon_s", np.float64),  # `Reading.horizon_s`
        ("quiet_after_s", np.float64),  # `Reading.quiet_after_s`
        ("whole_path_s", np.float64),  # a path that ends sooner goes on, see `way_on`
        ("destination_horizon_s", np.float64),  # `Reading.destination_horizon_s`
        ("most_points", np.float64),  # `path_points.MOST_POINTS`
        ("path_s", np.float64),  # `path_points.PATH_S`
        ("destinations_s", np.float64),  # `path_points.DESTINATIONS_S`
        ("slack_s", np.float64),  # `path_points.SLACK_S`
        ("regular_s", np.float64),  # `plausibility.REGULAR_S`
        ("comparable_s", np.float64),  # `plausibility.COMPARABLE_S`
        ("observable_s", np.float64),  # `plausibility.OBSERVABLE_S`
        ("stands_mps", np.float64),  # `assumed_motion.MOVING_MPS`
        ("turns_radps", np.float64),  # `assumed_motion.TURNS_RADPS`
        ("drives_mps", np.float64),  # `assumed_motion.DRIVES_MPS`
        ("moved_m", np.float64),  # `plausibility.MOVED_M`
        ("robot_jump_mps", np.float64),  # `ownership_claims.JUMP_MPS`
        ("robot_jump_s", np.float64),  # `ownership_claims.JUMP_S`
        ("max_turn_radps", np.float64),  # `plausibility.MAX_TURN_RADPS`
        ("slow_turn_rad", np.float64),  # `plausibility.SLOW_TURN_RAD`
        ("turned_rad", np.float64),  # `plausibility.TURNED_RAD`
        ("drift_rad", np.float64),  # `plausibility.DRIFT_RAD`
        ("corner_rad", np.float64),  # `plausibility.CORNER_RAD`
        ("least_as_moved", np.float64),  # `plausibility.SPEED_AS_MOVED`
        ("most_as_moved", np.float64),
    ]
)
"""The robot's facts and the limits of the rules that the kernel needs, all of one type.

The kernel gets them as an array of floats and views them as this record: numba takes twice as long to accept a record
array.
"""
Limits = Any
"""One record of `LIMITS`."""
Pose = tuple[float, float, float, float]
"""t_s, x_m, y_m, yaw_rad"""
Result = tuple[int, int, bool, float, float, float, float, float, float, float]
_NUMBER, _ROWS = types.float64, types.float64[:, ::1]
_RESULT = types.Tuple((*[types.int64] * 2, types.boolean, *[_NUMBER] * 7))  # type: ignore[no-untyped-call]
_turn_between = inner(turn_between)
_map_point = inner(map_point)


@inner
def placed(x: float, y: float, yaw_rad: float, table: Floats) -> tuple[float, float, float]:
    """As `Map.pose`, for the `table` of a map. An empty table leaves the pose as it is."""
    if len(table) == 0:
        return x, y, yaw_rad
    to_x, to_y, a, b, c, d = _map_point(x, y, table)
    along, across = cos(yaw_rad), sin(yaw_rad)
    return to_x, to_y, atan2(c * along + d * across, a * along + b * across)


@inner
def _write_knot(knots: Floats, row: int, t_s: float, x: float, y: float, yaw_rad: float, limits: Limits) -> None:
    """Write the knot of the envelope centre for a location into `knots[row]`."""
    dx, dy = limits.centre_x_m, limits.centre_y_m
    if dx != 0.0 or dy != 0.0:
        c, s = cos(yaw_rad), sin(yaw_rad)
        x, y = x + c * dx - s * dy, y + s * dx + c * dy
    knots[row, 0], knots[row, 1], knots[row, 2], knots[row, 3] = t_s, x, y, yaw_rad


@inner
def _by_path(
    points: Floats,
    here: Pose,
    speed_mps: float,
    gap_s: float,
    offset_s: float,
    limits: Limits,
    table: Floats,
    knots: Floats,
) -> int:
    """Write the knots from `here` along the path. Returns their number, at most one more than `points`.

    As `path_forecast.route_by_path`. Path times plus `offset_s` are service time. Returns 0 if the path may have to be
    retimed, jumps, or is short, see `forecast._beyond`.
    """
    t_s, x, y, yaw_rad = here
    until_s = t_s + limits.horizon_s + limits.quiet_after_s
    _write_knot(knots, 0, t_s, x, y, yaw_rad, limits)
    count, before_s, last_s = 1, -inf, t_s
    for i in range(len(points)):
        at_s = points[i, 0] + offset_s
        if not at_s > before_s:
            return 0
        before_s = at_s
        if at_s <= t_s or last_s >= until_s:
            continue
        to_x, to_y, to_rad = placed(points[i, 1], points[i, 2], points[i, 3], table)
        reach_m = limits.jump_mps * (at_s - last_s) + limits.jump_slack_m
        if not (to_x - x) * (to_x - x) + (to_y - y) * (to_y - y) < reach_m * reach_m * NEARLY:
            return 0
        lost_m = (at_s - t_s - limits.late_s) * abs(speed_mps)
        if count == 1 and abs(speed_mps) > limits.drives_mps and lost_m > hypot(to_x - x, to_y - y) * NEARLY:
            return 0
        _write_knot(knots, count, at_s, to_x, to_y, to_rad, limits)
        count, last_s, x, y = count + 1, at_s, to_x, to_y
    reaches = last_s >= limits.whole_path_s + t_s + max(gap_s - limits.horizon_s / 2, 0.0)
    return count if count > 1 and reaches else 0


@inner
def _by_velocity(here: Pose, speed_mps: float, turn_radps: float, gap_s: float, limits: Limits, knots: Floats) -> int:
    """Write the knots at constant speed and turn rate, as `forecast._by_velocity`. Returns their number."""
    at_s, x, y, heading = here
    horizon_s: float = limits.horizon_s
    _write_knot(knots, 0, at_s, x, y, heading, limits)
    if abs(turn_radps) <= STRAIGHT_RADPS:
        until_s = at_s + horizon_s + (gap_s if gap_s > limits.regular_s else 0.0)
        reach_m = speed_mps * (until_s - at_s)
        end_x, end_y = x + reach_m * cos(heading), y + reach_m * sin(heading)
        _write_knot(knots, 1, until_s, end_x, end_y, heading, limits)
        return 2
    steps, radius_m = ceil(horizon_s), speed_mps / turn_radps
    for step in range(steps + 1):
        t_s = horizon_s * step / steps
        yaw_rad = heading + turn_radps * t_s
        to_x = x + radius_m * (sin(yaw_rad) - sin(heading))
        to_y = y - radius_m * (cos(yaw_rad) - cos(heading))
        _write_knot(knots, step, at_s + t_s, to_x, to_y, yaw_rad, limits)
    return steps + 1


@inner
def _is_plausible(before: Pose, now: Pose, speed_mps: float, turn_radps: float, limits: Limits) -> bool:
    """Whether the motion certainly needs no check: `plausibility.reconcile` would correct nothing and report no
    deviation, `ownership_claims` would see no jump, and `position_unit` no other unit."""
    gap_s, dx, dy = now[0] - before[0], now[1] - before[1], now[2] - before[2]
    moved2 = dx * dx + dy * dy
    no_jump_m = limits.robot_jump_mps * min(gap_s, limits.robot_jump_s)
    is_seen = 0.0 < gap_s <= limits.observable_s and moved2 < no_jump_m * no_jump_m * NEARLY
    is_stated = not (isnan(speed_mps) or isnan(now[3])) and abs(turn_radps) <= limits.max_turn_radps
    if not (is_seen and is_stated):
        return False
    if gap_s > limits.comparable_s:
        return True
    observed_rad, reported_rad = _turn_between(before[3], now[3]), turn_radps * gap_s
    if turn_radps != 0.0 and not abs(reported_rad - observed_rad) <= limits.slow_turn_rad + abs(reported_rad) / 2:
        return False
    if abs(reported_rad - observed_rad) > limits.turned_rad and abs(observed_rad) < abs(reported_rad) / 2:
        return False
    if moved2 < limits.moved_m * limits.moved_m * NEARLY:
        least_m = max(limits.moved_m, limits.drives_mps * gap_s)
        return bool(abs(speed_mps) * gap_s <= limits.most_as_moved * least_m * NEARLY)
    return abs(speed_mps) > limits.stands_mps and _is_along(before, now, speed_mps, limits)


@inner
def _turned_on_spot(before: Pose, now: Pose, limits: Limits) -> bool:
    """Whether the robot may have turned and not moved, as far as headings and positions show."""
    turned_rad, moved_m = abs(_turn_between(before[3], now[3])), hypot(now[1] - before[1], now[2] - before[2])
    return bool(turned_rad > limits.turned_rad and moved_m * NEARLY <= limits.moved_m)


@inner
def _is_along(before: Pose, now: Pose, speed_mps: float, limits: Limits) -> bool:
    """Whether a move certainly is as fast as stated, along the heading, and the sign of the speed is right."""
    dx, dy, turned_rad = now[1] - before[1], now[2] - before[2], _turn_between(before[3], now[3])
    travel_rad, moved_m, drives_rad = atan2(dy, dx), hypot(dx, dy), now[3] + (0.0 if speed_mps > 0.0 else pi)
    drift_rad = abs(_turn_between(drives_rad - turned_rad / 2, travel_rad))
    drifts = drift_rad > limits.drift_rad and moved_m * drift_rad > limits.moved_m
    stated_m = abs(speed_mps) * (now[0] - before[0])
    is_as_fast = limits.least_as_moved * moved_m <= stated_m <= limits.most_as_moved * moved_m
    drifts &= abs(turned_rad) <= limits.corner_rad
    return bool(is_as_fast and abs(_turn_between(drives_rad, travel_rad)) <= pi / 4 and not drifts)


@inner
def _write_stops(
    points: Floats, clock_offset_s: float, latest_s: float, floor: float, table: Floats, rows: Floats
) -> int:
    """Write the destinations up to `latest_s`, all on one floor, as `forecast.stops`. Returns their number."""
    count = 0
    for i in range(len(points)):
        at_s = points[i, 0] + clock_offset_s
        if at_s <= latest_s:
            x, y, _ = placed(points[i, 1], points[i, 2], 0.0, table)
            rows[count, 0], rows[count, 1], rows[count, 2], rows[count, 3] = at_s, x, y, floor
            count += 1
    return count


@inner
def _breaks_a_rule(stamp_s: float, points: Floats, stops: Floats, limits: Limits) -> bool:
    """Whether `path_points` would report a deviation: of the number of points, or of the times, of a path or of
    destinations."""
    slack_s, most = limits.slack_s, limits.most_points
    if len(points) and (
        len(points) > most
        or points[len(points) - 1, 0] > stamp_s + limits.path_s + slack_s
        or points[0, 0] < stamp_s - slack_s
    ):
        return True
    if len(stops) == 0:
        return False
    latest_s = stops[len(stops) - 1, 0]
    too_far = latest_s > stamp_s + limits.destinations_s + slack_s
    return bool(len(stops) > most or too_far or latest_s < stamp_s - slack_s)


@kernel(_RESULT(*[_ROWS] * 3, types.float64[::1], *[types.int64] * 4, *[_NUMBER] * 5))
def forecast_repeat(
    scanned: Floats,
    rows: Floats,
    table: Floats,
    limits_row: Floats,
    first_point: int,
    end_of_path: int,
    first_stop: int,
    end_of_stops: int,
    before_s: float,
    before_x: float,
    before_y: float,
    before_rad: float,
    event_s: float,
) -> Result:
    """The forecast of a robot whose status repeats its last one, from the rows that `scanner_kernels` made of it.

    Writes the knots into the first `rows`, and the destinations ahead into the rows after the last possible knot.
    Returns the number of knots, 0 if the status is left to the slow path; the number of destinations ahead; whether the
    points deviate from a rule; and x_m, y_m, yaw_rad, speed, turn rate, height and stamp.
    """
    limits: Limits = limits_row.view(LIMITS)[0]
    points, stops = scanned[first_point:end_of_path], scanned[first_stop:end_of_stops]
    stamp_s, speed_mps, z_m, turn_radps = scanned[0, 0], scanned[1, 1], scanned[1, 0], scanned[1, 2]
    x, y, yaw_rad = placed(scanned[0, 1], scanned[0, 2], scanned[0, 3], table)
    if isnan(turn_radps) or turn_radps == 0.0:
        turn_radps = 0.0
    elif limits.mirrored != 0.0:
        turn_radps = -turn_radps
    before, here = (before_s, before_x, before_y, before_rad), (event_s, x, y, yaw_rad)
    offset_s, knots = event_s - stamp_s, 0
    loaded = not isnan(scanned[2, 2]) and scanned[2, 2] != 100.0
    turns_on_spot = abs(speed_mps) <= limits.drives_mps and abs(turn_radps) > limits.turns_radps
    is_same = loaded == (limits.loaded != 0.0) and not turns_on_spot
    is_same &= not (isnan(scanned[1, 2]) and _turned_on_spot(before, here, limits))
    if is_same and _is_plausible(before, here, speed_mps, turn_radps, limits):
        gap_s = event_s - before_s
        if limits.basis == BY_VELOCITY:
            knots = _by_velocity(here, speed_mps, turn_radps, gap_s, limits, rows)
        elif limits.basis == BY_PATH:
            knots = _by_path(points, here, speed_mps, gap_s, offset_s, limits, table, rows)
        elif abs(speed_mps) <= limits.drives_mps:
            _write_knot(rows, 0, event_s, x, y, yaw_rad, limits)
            knots = 1
    latest_s = event_s + limits.destination_horizon_s
    ahead = _write_stops(stops, offset_s, latest_s, limits.stops_floor, table, rows[len(points) + 1 :])
    breaks_a_rule = _breaks_a_rule(stamp_s, points, stops, limits)
    return knots, ahead, breaks_a_rule, x, y, yaw_rad, speed_mps, turn_radps, z_m, stamp_s
