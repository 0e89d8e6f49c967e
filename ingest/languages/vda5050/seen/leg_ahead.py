"""On which of the legs that remain a robot is, as its newest pose shows: it may have passed nodes that still remain."""

from collections.abc import Iterator, Sequence
from math import atan2, cos, inf, isnan, nan, pi, sin
from typing import NamedTuple

from ingest.frames.angles import turn_between
from ingest.frames.way_pieces import nearest_place
from ingest.languages.geometry.trajectories import Point, curve_ahead, is_in_box
from ingest.languages.model import BESIDE_M, Row
from ingest.languages.vda5050.orders import OrderLeg
from ingest.languages.vda5050.vda_messages import NodePlace, Position

MOST_LEGS = 150
"""Legs that are looked at. A path has no more."""
ALONG_RAD = pi / 3
"""A robot drives along a piece of its way if its direction differs by no more than this."""


class _Beside(NamedTuple):
    """A leg and a robot."""

    row: int
    away_m: float
    """How far the robot is from the way of the leg, inf if surely over `BESIDE_M`."""
    is_along: bool
    """Whether it drives along it."""


def leg_of(
    legs: Sequence[OrderLeg],
    start: Position,
    passed: NodePlace | None,
    now: Row,
    way_rad: float,
    *,
    is_under_way: bool,
) -> int | None:
    """The row of the leg on which a robot is, which was at `start` when they remained. None if it is on none.

    If it still is, they remain, unless it drives along a later leg, is not beside the first, which leads from the node
    `passed`, and drives away from its end: then the state names nodes that are passed.
    """
    here = now[1:3]
    if (start.x, start.y) == here:
        if not is_under_way or passed is None or not legs or not _leaves(legs[0], here, way_rad):
            return 0
        found = list(_besides(legs, (passed.x, passed.y), here, way_rad))
        if not found or found[0].away_m <= BESIDE_M:
            return 0
        return next((leg.row for leg in found if leg.is_along and leg.away_m <= BESIDE_M), 0)
    turn_rad = turn_between(nan if start.theta is None else start.theta, now[3])
    shows_direction = is_under_way or abs(turn_rad) > ALONG_RAD
    nearest: _Beside | None = None
    for leg in _besides(legs, (start.x, start.y), here, way_rad):
        if leg.row == 0 and leg.away_m <= BESIDE_M and not (leg.is_along or shows_direction):
            return 0
        if leg.is_along and leg.away_m <= (nearest.away_m if nearest else BESIDE_M):
            nearest = leg
        elif nearest:
            break
    return nearest.row if nearest else None


def _besides(legs: Sequence[OrderLeg], at: Point, here: Point, way_rad: float) -> Iterator[_Beside]:
    """The legs from a place on, as far as their places are known."""
    for row, leg in enumerate(legs[:MOST_LEGS]):
        if leg.place is None:
            break
        end, curve = (leg.place.x, leg.place.y), leg.edge.curve
        if is_in_box(here, (at, end, *(curve.points if curve else ())), BESIDE_M):
            way = (at, *curve_ahead(curve, at), end)
            near = nearest_place(way, *here)
            yield _Beside(row, near.away_m, _is_along(way_rad, way[near.end - 1], way[near.end]))
        else:
            yield _Beside(row, inf, False)
        at = end


def _is_along(way_rad: float, start: Point, end: Point) -> bool:
    off_rad = turn_between(way_rad, atan2(end[1] - start[1], end[0] - start[0]))
    return start != end and not abs(off_rad) > ALONG_RAD


def _leaves(leg: OrderLeg, here: Point, way_rad: float) -> bool:
    """Whether a robot drives away from the end of a leg."""
    if leg.place is None or isnan(way_rad):
        return False
    return (leg.place.x - here[0]) * cos(way_rad) + (leg.place.y - here[1]) * sin(way_rad) < 0.0
