"""Where a robot goes on beyond the end of what it has told: as it was going, and towards its destination.

A path of three seconds is not a plan to stop after three seconds. A robot stops at the end of its path only if it says
so: the path slows to a stop there, or a destination lies there.
"""

from collections.abc import Sequence
from math import atan2, ceil, cos, hypot, isfinite, pi, remainder, sin

from ingest.fleet.prediction.forecast_model import Knot
from ingest.frames.angles import turn_between

SHORT_BY_S = 1.0
"""A path that reaches the horizon but for this time is whole."""
STOPS_MPS = 0.1
"""A path that ends slower than this ends in a stop."""
THERE_M = 0.5
"""A robot this near to a destination is there. It drives on straight if it is this far beside its way or nearer."""
CORNER_RAD = 0.35
"""A robot turns on the spot where its direction changes by more than this."""
STEP_RAD = 0.5
"""A turn has a knot for each part of this size, since an envelope off the centre moves straight between knots."""
AWAY_M = 0.1
"""A robot that is to go no further than this stands."""


def speed_at_end(knots: Sequence[Knot]) -> float:
    """Metres a second on the last piece, 0 if it is none."""
    if len(knots) < 2:
        return 0.0
    (from_s, from_x, from_y, _), (to_s, to_x, to_y, _) = knots[-2], knots[-1]
    return hypot(to_x - from_x, to_y - from_y) / max(to_s - from_s, 1e-3)


def is_stop(knots: Sequence[Knot], destination: Knot | None) -> bool:
    """Whether a route says that the robot stops at its end."""
    if speed_at_end(knots) < STOPS_MPS:
        return True
    _, x, y, _ = knots[-1]
    return destination is not None and hypot(destination[1] - x, destination[2] - y) <= THERE_M


def way_on(
    end: Knot, direction_rad: float, mps: float, destination: Knot | None, until_s: float, turn_radps: float
) -> list[Knot]:
    """The knots of a robot after `end`, where it drives in a direction at a speed, up to a time.

    It drives straight on. With a destination ahead it turns on the spot where that lies beside it, drives there, turns
    as the destination says, and stands.
    """
    t_s, x, y, yaw_rad = end
    off_rad = turn_between(direction_rad, yaw_rad)
    straight_m, aside_m = mps * (until_s - t_s), 0.0
    if destination:
        dx, dy = destination[1] - x, destination[2] - y
        ahead_m = dx * cos(direction_rad) + dy * sin(direction_rad)
        if 0.0 < ahead_m < straight_m:
            straight_m, aside_m = ahead_m, dy * cos(direction_rad) - dx * sin(direction_rad)
        else:
            destination = None
    knots = [_moved(end, direction_rad, straight_m, mps)]
    if destination is None:
        return knots
    if abs(aside_m) > THERE_M:
        aside_rad = direction_rad + (pi / 2 if aside_m > 0.0 else -pi / 2)
        knots += turned(knots[-1], aside_rad + off_rad, turn_radps)
        knots.append(_moved(knots[-1], aside_rad, abs(aside_m), mps))
    if abs(turn_between(knots[-1][3], destination[3])) > CORNER_RAD:
        knots += turned(knots[-1], destination[3], turn_radps)
    return knots


def _moved(knot: Knot, direction_rad: float, length_m: float, mps: float) -> Knot:
    t_s, x, y, yaw_rad = knot
    to_x, to_y = x + length_m * cos(direction_rad), y + length_m * sin(direction_rad)
    return t_s + max(length_m / mps, 1e-3), to_x, to_y, yaw_rad


def turned(knot: Knot, to_rad: float, turn_radps: float) -> list[Knot]:
    """The knots of a robot that turns on the spot after `knot`, one for each part of a turn."""
    t_s, x, y, from_rad = knot
    turn_rad = turn_between(from_rad, to_rad)
    steps = ceil(abs(turn_rad) / STEP_RAD) if isfinite(turn_rad) else 0
    parts = [step / steps * turn_rad for step in range(1, steps + 1)]
    return [(t_s + max(abs(part) / turn_radps, 1e-3), x, y, remainder(from_rad + part, 2 * pi)) for part in parts]


def driven_to(here: Knot, destination: Knot, mps: float, turn_radps: float) -> list[Knot]:
    """The knots of a robot that turns towards a destination, drives there straight, and turns as it says."""
    knots = [here]
    dx, dy = destination[1] - here[1], destination[2] - here[2]
    length_m = hypot(dx, dy)
    if length_m > AWAY_M:
        direction_rad = atan2(dy, dx)
        if abs(turn_between(here[3], direction_rad)) > CORNER_RAD:
            knots += turned(here, direction_rad, turn_radps)
        t_s = knots[-1][0] + max(length_m / mps, 1e-3)
        knots.append((t_s, destination[1], destination[2], direction_rad))
    if abs(turn_between(knots[-1][3], destination[3])) > CORNER_RAD:
        knots += turned(knots[-1], destination[3], turn_radps)
    return knots
