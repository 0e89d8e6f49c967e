"""How robots move by the places that they report, for those that do not report how fast."""

from math import atan2, hypot, nan, pi

import msgspec

from ingest.frames.angles import turn_between
from ingest.frames.assumed_motion import CORNER_RAD
from ingest.languages.model import MAX_SPEED_MPS, datum_name
from ingest.languages.vda5050.vda_messages import Position

MOVED_M = 0.2
"""A displacement of this length shows a direction despite the noise of positions."""
STANDS_S, OBSERVABLE_S = 2.0, 35.0
"""A robot that has not moved so far for the first time stands. Places further apart in time show no motion."""
NEAR_M, REACH_MPS = 2.0, 5.0
"""How far from 0, 0 a robot may have been that is there."""
BACKWARDS_RAD = 3 * pi / 4
"""A robot that moves further off its heading than this drives backwards."""


class Travel(msgspec.Struct, frozen=True, gc=False):
    """How a robot was seen to move."""

    t_s: float
    """Since when, and from where, it is watched next."""
    position: Position
    direction_rad: float = nan
    """In which it moved last; nan if it was not seen to move."""
    mps: float = 0.0
    is_backwards: bool = False
    """Whether it moved against its heading."""


def travel_to(seen: Travel | None, t_s: float, position: Position) -> Travel:
    """What was seen of a robot that is at a position."""
    new = Travel(t_s, position)
    if seen is None or datum_name(seen.position.map_id) != datum_name(position.map_id):
        return new
    lasted_s, before = t_s - seen.t_s, seen.position
    if not 0.0 < lasted_s <= OBSERVABLE_S:
        return seen if lasted_s == 0.0 else new
    dx, dy = position.x - before.x, position.y - before.y
    moved_m, direction_rad = hypot(dx, dy), atan2(dy, dx)
    if moved_m > MAX_SPEED_MPS * lasted_s:
        return new
    if moved_m <= MOVED_M:
        return seen if lasted_s <= STANDS_S else Travel(t_s, position, seen.direction_rad)
    before_rad, now_rad = (nan if each.theta is None else each.theta for each in (before, position))
    has_turned = not abs(turn_between(before_rad, now_rad)) <= CORNER_RAD
    is_backwards = not has_turned and abs(turn_between(now_rad, direction_rad)) > BACKWARDS_RAD
    return Travel(t_s, position, direction_rad, moved_m / lasted_s, is_backwards)


def is_unfilled(position: Position, seen: Travel | None, t_s: float) -> bool:
    """Whether a position may be zeros that nobody filled in: the robot was elsewhere, or was not seen before."""
    if position.x or position.y or position.theta:
        return False
    if seen is None:
        return True
    reach_m = NEAR_M + REACH_MPS * max(t_s - seen.t_s, 0.0)
    return hypot(seen.position.x, seen.position.y) > reach_m
