"""The forecast of a robot along the path that it sent."""

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Sequence
from itertools import chain, groupby, pairwise
from math import atan2, hypot, inf, isfinite, isnan, pi
from operator import itemgetter, lt

from ingest.fleet.prediction.forecast_model import ForecastContext, Knot, RobotBody, Route, Sighting
from ingest.fleet.prediction.pace import Pace, Paces, allowance
from ingest.fleet.prediction.paced_way import driven_s, paced
from ingest.fleet.prediction.way_on import THERE_M
from ingest.frames.angles import turn_between
from ingest.frames.assumed_motion import LEAST_STEP_S, SPOT_M
from ingest.frames.frame_registry import Frame
from ingest.frames.way_pieces import nearest_piece
from ingest.languages.model import Path

JUMP_FACTOR, JUMP_SLACK_M = 2.0, 0.5
"""A path that asks for more than this times the robot's greatest speed, plus this length, contradicts its motion."""
PLAUSIBLE_SPEED_MPS = 5.0
"""Greatest speed of a robot that has not stated one."""
LATE_S = 2.0
"""A robot that drives is to lose no more than this on its way to the next point of its path."""
FAR_M, ELSEWHERE_RAD = 5.0, 0.5
"""A robot that drives to a place further off than this drives within this angle towards it, but for corners."""
AWAY_RAD = 3 * pi / 4
"""A robot that drives in a direction this far off that of a point drives away from it."""


def route_by_path(
    path: Path, here: Sighting, context: ForecastContext, paces: Paces, findings: list[str]
) -> Route | None:
    """The route along a path from `here` on, with unknown headings left as nan. None if the path can't be used.

    A path whose times are limits, are equal or out of order without a clear meaning, or are not those of how the robot
    drives, gets new times by its pace, from where the robot is on it; it is over where it ends. A path that
    jumps is used up to the jump. It is used a little beyond the horizon, so that it still reaches it when the next
    status is late.
    """
    points: list[Knot] = []
    floors: list[int] = []
    for floor, placed in on_floors(path, here, context):
        points += placed
        floors += [floor] * len(placed)
    if not points:
        return None
    times = [point[0] for point in points]
    in_order = (path.in_order and not here.clock_offset_s) or all(map(lt, times, times[1:]))
    if path.most and len(path.most) == len(points):
        points = paced(points, path.most, here, paces)
    else:
        points, floors, is_retimed = _with_times(points, floors, here, context.body, paces, in_order=in_order)
        findings += ["path-retimed"] if is_retimed else []
        if not points:
            return None
    times = [point[0] for point in points]
    ahead = bisect_right(times, here.t_s)
    within = bisect_left(times, here.t_s + context.reading.horizon_s + context.reading.quiet_after_s) + 1
    knots, all_floors = [knot_at(here), *points[ahead:within]], (here.floor, *floors[ahead:within])
    reachable = _knots_before_jump(knots, all_floors, context.body)
    if reachable < len(knots):
        findings.append("path-contradicts-motion")
    if reachable < 2:
        return None
    return knots[:reachable], all_floors[:reachable]


def _with_times(
    points: list[Knot], floors: list[int], here: Sighting, body: RobotBody, paces: Paces, *, in_order: bool
) -> tuple[list[Knot], list[int], bool]:
    """The points and their floors, with times that the robot may keep, and whether these are new."""
    share, is_retimed = paces.pace.path_share, False
    if not in_order:
        points, floors, in_order = _in_order(points, floors, here)
    elif here.is_driving and share != 1.0:
        points, floors = _at_pace(points, floors, here, share)
        is_retimed = True
    if not in_order or _is_of_another_drive(points, floors, here, paces.pace):
        begin = _next_point(points, here)
        points, floors, is_retimed = _retimed(points[begin:], here, body, paces), floors[begin:], True
    return points, floors, is_retimed


def knot_at(here: Sighting) -> Knot:
    """The first knot of a route."""
    return here.t_s, here.x_m, here.y_m, here.yaw_rad


def on_floors(path: Path, here: Sighting, context: ForecastContext) -> list[tuple[int, Sequence[Knot]]]:
    """The poses of a path in the order sent, in service time and the floors' frames, grouped by floor index.

    Only neighbours share a group. Points that have no place, such as degrees that no latitude has, are left out.
    """
    groups: list[tuple[int, Sequence[Knot]]] = []
    for datum, poses in _by_datum(path) if path.datums else ():
        frame, floor = context.frame_of(datum)
        groups.append((floor, _placed(poses, frame, here.clock_offset_s)))
    return groups


def leads_elsewhere(path: Path, here: Sighting, context: ForecastContext) -> bool:
    """Whether an order leads a robot that drives to a place far off, in another direction than it drives in."""
    if not (path.most and here.is_driving):
        return False
    points = chain.from_iterable(placed for _, placed in on_floors(path, here, context))
    steps = ((x - here.x_m, y - here.y_m) for _, x, y, _ in points)
    dx, dy = next((step for step in steps if hypot(*step) > SPOT_M), (0.0, 0.0))
    return hypot(dx, dy) > FAR_M and abs(turn_between(here.direction_rad, atan2(dy, dx))) > ELSEWHERE_RAD


def _by_datum(path: Path) -> Iterable[tuple[str, Sequence[Knot]]]:
    """The poses in the order sent. Neighbours on one datum share a group."""
    datums = path.datums
    if datums.count(datums[0]) == len(datums):
        return ((datums[0], path.poses),)
    groups = groupby(zip(datums, path.poses, strict=True), itemgetter(0))
    return [(datum, [pose for _, pose in group]) for datum, group in groups]


def _placed(poses: Sequence[Knot], frame: Frame, clock_offset_s: float) -> Sequence[Knot]:
    if frame.transform is not None:
        return [(t_s + clock_offset_s, *frame.transform.pose(x, y, yaw_rad)) for t_s, x, y, yaw_rad in poses]
    if frame.projection is not None:
        placed = zip(poses, frame.projection.poses([pose[1:] for pose in poses]), strict=True)
        return [(pose[0] + clock_offset_s, x, y, yaw) for pose, (x, y, yaw) in placed if isfinite(x) and isfinite(y)]
    if not clock_offset_s:
        return poses
    return [(t_s + clock_offset_s, x, y, yaw_rad) for t_s, x, y, yaw_rad in poses]


def _in_order(points: list[Knot], floors: list[int], here: Sighting) -> tuple[list[Knot], list[int], bool]:
    """The points and their floors, and whether each is later than the one before.

    If all times differ, apart from those of repeated points, these are left out; the others are sorted if that shortens
    the way.
    """
    placed = {
        (*point[:3], None if isnan(point[3]) else point[3], floor): (point, floor)
        for point, floor in zip(points, floors, strict=True)
    }
    sent = list(placed.values())
    in_order = sorted(sent, key=itemgetter(0))
    differ = all(before[0][0] < after[0][0] for before, after in pairwise(in_order))
    if differ and (in_order == sent or _length_m(here, in_order) < _length_m(here, sent)):
        return [point for point, _ in in_order], [floor for _, floor in in_order], True
    return points, floors, False


def _is_of_another_drive(points: Sequence[Knot], floors: Sequence[int], here: Sighting, pace: Pace) -> bool:
    """Whether the times of points in order are not of how the robot drives: all are past, or one that drives, twice in
    a row and without braking, would have to lose more than `LATE_S` on its way to the next point."""
    following = next((row for row, point in enumerate(points) if point[0] > here.t_s), None)
    if following is None or floors[following] != here.floor or not (here.is_driving and here.linear_mps):
        return following is None
    t_s, x, y, _ = points[following]
    is_held_back = t_s - here.t_s > hypot(x - here.x_m, y - here.y_m) / abs(here.linear_mps) + LATE_S
    return is_held_back and pace.keeps_speed(here)


def _next_point(points: Sequence[Knot], here: Sighting) -> int:
    """The row of the point that comes next on a way without usable times: the end of its nearest piece, if the robot is
    on it, else the first. Behind the last row, if the robot is there, or drives away from that point."""
    nearest_m, end = nearest_piece([(x, y) for _, x, y, _ in points], here.x_m, here.y_m)
    begin, (_, from_x, from_y, _) = (end, points[end - 1]) if nearest_m < THERE_M else (0, knot_at(here))
    _, x, y, _ = points[begin]
    is_over = begin == len(points) - 1 and hypot(x - here.x_m, y - here.y_m) <= THERE_M
    off_rad = turn_between(here.direction_rad, atan2(y - from_y, x - from_x))
    leaves = here.is_driving and hypot(x - from_x, y - from_y) > SPOT_M and abs(off_rad) > AWAY_RAD
    return len(points) if is_over or leaves else begin


def _length_m(here: Sighting, placed: list[tuple[Knot, int]]) -> float:
    places = [(here.x_m, here.y_m), *((x, y) for (_, x, y, _), _ in placed)]
    return sum(hypot(x - last_x, y - last_y) for (last_x, last_y), (x, y) in pairwise(places))


def _retimed(points: list[Knot], here: Sighting, body: RobotBody, paces: Paces) -> list[Knot]:
    """The points in the order sent, with times by the robot's pace. It starts at its present speed."""
    allowed = allowance(body.max_speed_mps or inf)
    paces.pace.kind = allowed.kind
    mps, now_mps = paces.of(allowed), abs(here.linear_mps) if here.linear_mps is not None else inf
    retimed: list[Knot] = []
    t_s, last_x, last_y, last_rad = knot_at(here)
    for _, x, y, yaw_rad in points:
        length_m = hypot(x - last_x, y - last_y)
        lasted_s, now_mps = driven_s(length_m, now_mps, mps)
        turn_rad = abs(turn_between(last_rad, yaw_rad)) if length_m < SPOT_M else 0.0
        t_s += max(lasted_s, turn_rad / paces.turn_radps if turn_rad > 0.0 else 0.0, LEAST_STEP_S)
        retimed.append((t_s, x, y, yaw_rad))
        last_x, last_y, last_rad = x, y, yaw_rad
    return retimed


def _at_pace(points: list[Knot], floors: list[int], here: Sighting, share: float) -> tuple[list[Knot], list[int]]:
    """The points ahead on a way on which the robot drives this share of what its times say, with the times of that."""
    end = nearest_piece([(x, y) for _, x, y, _ in points], here.x_m, here.y_m)[1]
    (t_s, x, y, _), (end_s, end_x, end_y, _) = points[max(end - 1, 0)], points[end]
    dx, dy = end_x - x, end_y - y
    square = dx * dx + dy * dy
    along = ((here.x_m - x) * dx + (here.y_m - y) * dy) / square if square else 0.0
    passed_s = t_s + min(along, 1.0) * (end_s - t_s) if square else min(t_s, here.t_s)
    begin = end if along > 0.0 else max(end - 1, 0)
    timed: list[Knot] = []
    for row, (at_s, to_x, to_y, yaw_rad) in enumerate(points[begin:], 1):
        ahead_s = max((at_s - passed_s) / share, 0.0) + LEAST_STEP_S * row
        timed.append((here.t_s + ahead_s, to_x, to_y, yaw_rad))
    return timed, floors[begin:]


def jump_mps(body: RobotBody) -> float:
    """The speed beyond which a path contradicts the robot's motion."""
    return JUMP_FACTOR * (body.max_speed_mps or PLAUSIBLE_SPEED_MPS)


def _knots_before_jump(knots: Sequence[Knot], floors: tuple[int, ...], body: RobotBody) -> int:
    """How many knots the robot can reach one after the other. A change of floor is never a jump."""
    limit_mps = jump_mps(body)
    t, x, y, _ = knots[0]
    for row, (next_t, next_x, next_y, _) in enumerate(knots):
        if hypot(next_x - x, next_y - y) > limit_mps * (next_t - t) + JUMP_SLACK_M and floors[row - 1] == floors[row]:
            return row
        t, x, y = next_t, next_x, next_y
    return len(knots)
