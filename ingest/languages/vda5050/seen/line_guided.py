"""Where a robot is that does not say it, as many that follow a line: along the edge from the last node it passed."""

from collections.abc import Sequence
from itertools import pairwise
from math import atan2, hypot, isfinite, isnan, nan, pi, remainder

import msgspec

from ingest.languages.geometry.trajectories import Point, curve_ahead
from ingest.languages.rules import Findings
from ingest.languages.vda5050.orders import Order, legs_of_state
from ingest.languages.vda5050.seen.base_ends import speed_mps
from ingest.languages.vda5050.seen.known_ways import KnownWays
from ingest.languages.vda5050.vda_messages import NodePlace, Position, StateMessage

AT_NODE_M = 0.1
"""A robot that is nearer to a node is at it."""
LONGEST_STEP_S = 35.0
"""How far a robot drove in a longer time, its speed does not say."""


class Along(msgspec.Struct, frozen=True, gc=False):
    """How far a robot was after a node."""

    t_s: float
    node: tuple[str | None, int | None]
    """Its ids."""
    since_m: float
    """nan if that is not known."""
    stands: bool


def along_now(before: Along | None, state: StateMessage, t_s: float) -> Along:
    """How far a robot is after its last node.

    0 in place of a distance is believed only at a new node, since some never fill it in.
    """
    node, stands = (state.last_node_id, state.last_node_sequence_id), state.driving is False
    sent_m = state.distance_since_last_node
    if sent_m is not None and isfinite(sent_m) and sent_m > 0.0:
        return Along(t_s, node, sent_m, stands)
    if before is None or before.node != node:
        return Along(t_s, node, 0.0, stands)
    if state.velocity and state.velocity.vx is not None and 0.0 <= t_s - before.t_s <= LONGEST_STEP_S:
        return Along(t_s, node, before.since_m + speed_mps(state.velocity) * (t_s - before.t_s), stands)
    return Along(t_s, node, before.since_m if stands and before.stands else nan, stands)


def placed(
    state: StateMessage, order: Order | None, ways: KnownWays, since_m: float, before: Position | None
) -> Position | None:
    """The position so far after the last node, along the edge to the next. None if nobody said where they are.

    At a node the robot heads as it did `before`: it may have to turn yet.
    """
    last = _last_place(state, order) or ways.place(state.last_node_id)
    if last is None or isnan(since_m):
        return None
    leg = next(legs_of_state(state, order, Findings()), None)
    start = last.x, last.y
    if leg is None or leg.place is None:
        theta = before.theta if before else last.theta
        return Position(*start, theta, last.map_id) if since_m == 0.0 or leg is None else None
    point, direction_rad = _at((start, *curve_ahead(leg.edge.curve, start), (leg.place.x, leg.place.y)), since_m)
    if since_m <= AT_NODE_M and before is not None:
        return Position(*point, before.theta, last.map_id)
    is_backwards = bool(state.velocity and (state.velocity.vx or 0.0) < 0.0)
    theta = None if isnan(direction_rad) else remainder(direction_rad + (pi if is_backwards else 0.0), 2 * pi)
    return Position(*point, theta, last.map_id)


def _last_place(state: StateMessage, order: Order | None) -> NodePlace | None:
    last = order.nodes.get(order.number_of(state.last_node_id, state.last_node_sequence_id)) if order else None
    return last.place if last and last.is_meant_by(state.last_node_id or "") else None


def _at(way: Sequence[Point], along_m: float) -> tuple[Point, float]:
    """The point so far along a way, at most at its end, and the direction there; nan if the way has no length."""
    direction_rad = nan
    for (ax, ay), (bx, by) in pairwise(way):
        if not (length_m := hypot(bx - ax, by - ay)):
            continue
        direction_rad = atan2(by - ay, bx - ax)
        if along_m < length_m:
            share = along_m / length_m
            return (ax + share * (bx - ax), ay + share * (by - ay)), direction_rad
        along_m -= length_m
    return way[-1], direction_rad
