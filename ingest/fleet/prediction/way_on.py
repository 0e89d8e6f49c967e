"""Where a robot goes on beyond the end of what it has told: as it was going, and towards its destination.

A path of three seconds is not a plan to stop after three seconds. A robot stops at the end of its path only if it says
so: the path slows to a stop there, or a destination lies there.
"""

from collections.abc import Sequence
from itertools import pairwise
from math import atan2, cos, hypot, pi, sin
from typing import NamedTuple

from ingest.fleet.prediction.forecast_model import Knot, Sighting
from ingest.frames.angles import turn_between
from ingest.frames.assumed_motion import CORNER_RAD, LEAST_STEP_S, turn_in_parts

SHORT_BY_S = 1.0
"""A path that reaches the horizon but for this time is whole."""
STOPS_MPS = 0.1
"""A path that ends slower than this ends in a stop."""
THERE_M = 0.5
"""A robot this near to a destination is there. It drives on straight if it is this far beside its way or nearer."""
TURNS_RAD = 0.1
"""A robot whose last piece is a turn of more than this is not at its stop."""
LASTING_S = 0.9
"""A speed shows on parts of a route that last so long, whatever the noise of its points."""
SLOWING = 0.9
"""A robot whose speed falls to less than this share on the last piece slows down."""
AWAY_M = 0.1
"""A robot that is to go no further than this stands."""
PASSING = (0.5, 3.0)
"""A robot passes a destination if it is to be at the next one at a speed between these shares of its own. If it is to
be slower, it stops; if it is to be faster, the times are not meant."""


class End(NamedTuple):
    """How a route ends, if the robot goes on."""

    direction_rad: float
    mps: float


def end_of(knots: Sequence[Knot], now_mps: float, destination: Knot | None) -> End | None:
    """The direction and speed with which a robot goes on after a route. None if the route says that it stops there.

    A robot that turns on the spot at the end of its route goes on in the direction that it turns to. One that is not
    slowing down goes on at the greatest speed of the route behind its first part, and at least at its speed now.
    """
    _, x, y, yaw_rad = knots[-1]
    if destination is not None and hypot(destination[1] - x, destination[2] - y) <= THERE_M:
        return None
    speeds = _lasting_speeds(knots)
    cruise_mps = max(*(speeds[1:] or speeds), now_mps)
    if _speed(knots[-2:]) < STOPS_MPS:
        turned_rad = turn_between(knots[-2][3], yaw_rad)
        backwards = pi if _is_backwards(knots) else 0.0
        return End(yaw_rad + backwards, cruise_mps) if abs(turned_rad) > TURNS_RAD and cruise_mps > STOPS_MPS else None
    is_slowing = len(speeds) > 1 and speeds[-1] < SLOWING * speeds[-2]
    direction_rad = atan2(y - knots[-2][2], x - knots[-2][1])
    return End(direction_rad, speeds[-1] if is_slowing else cruise_mps)


def _lasting_speeds(knots: Sequence[Knot]) -> list[float]:
    """The speeds on the parts of a route that last for `LASTING_S`. The first has the leg from where the robot is to
    where its path begins, and what else is left: it shows how far these are apart."""
    parts, end = list[float](), len(knots) - 1
    for begin in range(len(knots) - 2, -1, -1):
        if begin == 0 or knots[end][0] - knots[begin][0] >= LASTING_S:
            parts.append(_speed(knots[begin : end + 1]))
            end = begin
    return parts[::-1]


def _speed(knots: Sequence[Knot]) -> float:
    """The mean speed on a part of a route."""
    length_m = sum(hypot(after[1] - before[1], after[2] - before[2]) for before, after in pairwise(knots))
    return length_m / max(knots[-1][0] - knots[0][0], LEAST_STEP_S)


def _is_backwards(knots: Sequence[Knot]) -> bool:
    """Whether the last piece on which the robot drives is driven backwards."""
    for before, after in pairwise(reversed(knots)):
        dx, dy = before[1] - after[1], before[2] - after[2]
        if hypot(dx, dy) > AWAY_M:
            return dx * cos(before[3]) + dy * sin(before[3]) < 0.0
    return False


def way_on(
    end: Knot, direction_rad: float, mps: float, destination: Knot | None, until_s: float, turn_radps: float
) -> list[Knot]:
    """The knots of a robot after `end`, where it drives in a direction at a speed, up to a time.

    It drives straight on. With a destination ahead, or beside its end, it turns on the spot where that lies beside it,
    drives there, turns as the destination says, and stands.
    """
    t_s, x, y, yaw_rad = end
    off_rad = turn_between(direction_rad, yaw_rad)
    straight_m, aside_m = mps * (until_s - t_s), 0.0
    if destination:
        dx, dy = destination[1] - x, destination[2] - y
        ahead_m = dx * cos(direction_rad) + dy * sin(direction_rad)
        beside_m = dy * cos(direction_rad) - dx * sin(direction_rad)
        if 0.0 < ahead_m < straight_m or (-THERE_M < ahead_m <= 0.0 and abs(beside_m) > THERE_M):
            straight_m, aside_m = max(ahead_m, 0.0), beside_m
        else:
            destination = None
    knots = [_moved(end, direction_rad, straight_m, mps)]
    if destination is None:
        return knots
    if abs(aside_m) > THERE_M:
        aside_rad = direction_rad + (pi / 2 if aside_m > 0.0 else -pi / 2)
        knots += turned(knots[-1], aside_rad + off_rad, turn_radps)
        knots.append(_moved(knots[-1], aside_rad, abs(aside_m), mps))
    return knots + _corner(knots[-1], destination[3], turn_radps)


def is_passed(stop: Knot, following: Knot, mps: float) -> bool:
    """Whether the times of two destinations leave no time for a stop at the first."""
    least, most = PASSING
    after_s = following[0] - stop[0]
    length_m = hypot(following[1] - stop[1], following[2] - stop[2])
    return after_s > 0.0 and least * mps <= length_m / after_s <= most * mps


def lets_stand(stop: Knot, following: Knot, mps: float) -> bool:
    """Whether the times of two destinations leave time to stand at the first."""
    length_m = hypot(following[1] - stop[1], following[2] - stop[2])
    return length_m < PASSING[0] * mps * (following[0] - stop[0])


def is_behind(stop: Knot, following: Knot, here: Sighting) -> bool:
    """Whether a robot is late for a destination because it has passed it on its way to the next."""
    dx, dy = following[1] - stop[1], following[2] - stop[2]
    return stop[0] < here.t_s and dx * (here.x_m - stop[1]) + dy * (here.y_m - stop[2]) > 0.0


def _moved(knot: Knot, direction_rad: float, length_m: float, mps: float) -> Knot:
    t_s, x, y, yaw_rad = knot
    to_x, to_y = x + length_m * cos(direction_rad), y + length_m * sin(direction_rad)
    return t_s + max(length_m / mps, LEAST_STEP_S), to_x, to_y, yaw_rad


def _corner(knot: Knot, to_rad: float, turn_radps: float) -> list[Knot]:
    """The knots of a robot that turns on the spot if its direction changes by more than `CORNER_RAD`."""
    return turned(knot, to_rad, turn_radps) if abs(turn_between(knot[3], to_rad)) > CORNER_RAD else []


def turned(knot: Knot, to_rad: float, turn_radps: float) -> list[Knot]:
    """The knots of a robot that turns on the spot after `knot`, one for each part of a turn."""
    t_s, x, y, from_rad = knot
    parts = turn_in_parts(from_rad, to_rad)
    return [(t_s + max(turn_rad / turn_radps, LEAST_STEP_S), x, y, yaw_rad) for turn_rad, yaw_rad in parts]


def driven_to(here: Knot, destination: Knot, mps: float, turn_radps: float) -> list[Knot]:
    """The knots of a robot that turns towards a destination, drives there straight, and turns as it says."""
    knots = [here]
    dx, dy = destination[1] - here[1], destination[2] - here[2]
    length_m = hypot(dx, dy)
    if length_m > AWAY_M:
        direction_rad = atan2(dy, dx)
        knots += _corner(here, direction_rad, turn_radps)
        t_s = knots[-1][0] + max(length_m / mps, LEAST_STEP_S)
        knots.append((t_s, destination[1], destination[2], direction_rad))
    return knots + _corner(knots[-1], destination[3], turn_radps)
