"""Nodes and edges of a robot's orders by their ids, for states of which no order was heard."""

from collections.abc import Sequence
from itertools import pairwise
from math import dist
from typing import TypeVar

import msgspec

from ingest.frames.way_pieces import nearest_place
from ingest.languages.geometry.trajectories import curve_ahead
from ingest.languages.model import BESIDE_M, datum_name
from ingest.languages.vda5050.order_numbers import plain_id
from ingest.languages.vda5050.orders import MOST_CURVE_POINTS, MOST_NODES, NO_EDGE, Order, OrderEdge, OrderNode
from ingest.languages.vda5050.vda_messages import NodePlace, Position, StateMessage

Found = TypeVar("Found")
FAR_NODES = 200
"""Nodes of a state that are looked for. A path has fewer."""


class KnownWays(msgspec.Struct, frozen=True, gc=False):
    """The newest of them."""

    places: dict[str, NodePlace] = {}
    """By the id of the node, as `plain_id` has it."""
    edges: dict[str, OrderEdge] = {}
    """By the ids of both nodes, see `_edge_key`."""

    def after(self, order: Order) -> "KnownWays":
        """With an order. If it has known nodes elsewhere, ids say nothing of places: only its own nodes count then."""
        places = {node.node_id: node.place for node in order.nodes.values() if node.node_id and node.place}
        both = places.keys() & self.places.keys()
        if not all(_is_same(self.places[node_id], places[node_id]) for node_id in both):
            return KnownWays(places, _edges(order))
        return KnownWays(_newest(self.places | places), _with_newest_curves(_newest(self.edges | _edges(order))))

    def place(self, node_id: str | None) -> NodePlace | None:
        return self.places.get(plain_id(node_id or ""))

    def order_for(self, state: StateMessage, position: Position | None, heard: Sequence[Order]) -> Order | None:
        """The order that a state is about, by its nodes: one of those heard, whatever its id, or what is known of them.

        None if the robot is not on the way to the first node.
        """
        states = state.node_states or ()
        if not states:
            return None
        for order in (*(each for each in reversed(heard) if _fits(each, state)), self._made_for(state)):
            last, first = (order.nodes.get(each) for each in (order.passed_by(state), states[0].sequence_id))
            if last and first and last.place and first.place:
                known, edge = self.places.get(last.node_id), order.edges.get(states[0].sequence_id, NO_EDGE)
                is_stable = known is not None and _is_same(known, last.place)
                says_place = position is not None and not position.is_lost
                if _is_beside(position, last.place, edge, first.place) if position and says_place else is_stable:
                    return order
        return None

    def _made_for(self, state: StateMessage) -> Order:
        """An order of the nodes of a state. Those that are known have places."""
        states = (state.node_states or ())[:FAR_NODES]
        numbers, last_number = [each.sequence_id for each in states], state.last_node_sequence_id
        if last_number is None or last_number >= numbers[0] or numbers != sorted(set(numbers)):
            return Order("", None, {}, {})
        ids = [plain_id(state.last_node_id or ""), *(plain_id(each.node_id) for each in states)]
        released = [True, *(each.released is not False for each in states)]
        nodes = {
            number: OrderNode(is_free, self.places.get(node_id), (), node_id)
            for number, is_free, node_id in zip((last_number, *numbers), released, ids, strict=True)
        }
        steps = zip(numbers, pairwise(ids), strict=True)
        edges = {number: self.edges.get(_edge_key(*ends), NO_EDGE) for number, ends in steps}
        return Order(plain_id(state.order_id or ""), state.order_update_id, nodes, edges)


def _fits(order: Order, state: StateMessage) -> bool:
    """Whether an order has all nodes of a state, and the last node that it passed, where the state has them."""
    known = ((order.nodes.get(each.sequence_id), each.node_id) for each in state.node_states or ())
    return order.passed_by(state) >= 0 and all(node and node.node_id == plain_id(node_id) for node, node_id in known)


def _edges(order: Order) -> dict[str, OrderEdge]:
    """The edges between two nodes with ids."""
    steps = pairwise(order.nodes.items())
    return {
        _edge_key(before.node_id, after.node_id): order.edges[number]
        for (_, before), (number, after) in steps
        if number in order.edges and before.node_id and after.node_id
    }


def _edge_key(start_id: str, end_id: str) -> str:
    return f"{start_id}\n{end_id}"


def _newest(found: dict[str, Found]) -> dict[str, Found]:
    return found if len(found) <= MOST_NODES else dict(list(found.items())[-MOST_NODES:])


def _with_newest_curves(edges: dict[str, OrderEdge]) -> dict[str, OrderEdge]:
    """Edges of which the newest have curves: as many control points as an order may have. Others count as straight."""
    left, kept = MOST_CURVE_POINTS, dict[str, OrderEdge]()
    for key, edge in reversed(edges.items()):
        left -= len(edge.curve.points) if edge.curve else 0
        kept[key] = edge if left >= 0 or edge.curve is None else msgspec.structs.replace(edge, curve=None)
    return dict(reversed(kept.items()))


def _is_same(a: NodePlace, b: NodePlace) -> bool:
    """Whether two places of a node are one."""
    return _is_on_map(a.map_id, b) and dist((a.x, a.y), (b.x, b.y)) <= BESIDE_M


def _is_on_map(map_id: str | None, place: NodePlace) -> bool:
    """Whether a place may be on a map. One that names no map may be on any."""
    return not (map_id and place.map_id) or datum_name(map_id) == datum_name(place.map_id)


def _is_beside(position: Position, last: NodePlace, edge: OrderEdge, first: NodePlace) -> bool:
    """Whether a robot is on the edge between two nodes."""
    if not (_is_on_map(position.map_id, last) and _is_on_map(position.map_id, first)):
        return False
    start = last.x, last.y
    way = start, *curve_ahead(edge.curve, start), (first.x, first.y)
    return nearest_place(way, position.x, position.y).away_m <= BESIDE_M
