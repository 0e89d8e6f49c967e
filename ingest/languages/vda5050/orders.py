"""Orders: where a robot is to drive, as its fleet manager sent it.

A state names the nodes and edges that remain. Only the order says where they are, how fast the robot may drive and
where it stops. An update of an order replaces its horizon and continues its base (stitching).
"""

from collections.abc import Iterator, Sequence
from operator import itemgetter
from typing import NamedTuple

import msgspec

from ingest.languages.geometry.trajectories import Curve, curve_to
from ingest.languages.model import MAX_POSITION
from ingest.languages.rules import Findings
from ingest.languages.vda5050.order_numbers import edges_by_end, last_between, numbers_of, plain_id
from ingest.languages.vda5050.vda_messages import Edge, NodePlace, NodeState, OrderMessage, StateMessage, VdaNode

MOST_NODES = 3000
"""Nodes of an order that are kept."""
MOST_CURVE_POINTS = 4 * MOST_NODES
"""Control points of an order's curves that are kept. Further edges count as straight."""
_NUMBER = itemgetter(0)
DRIVING_STOPS = frozenset(("SOFT", "HARD"))
"""Blocking types of actions during which a robot does not drive."""


class OrderNode(msgspec.Struct, frozen=True, gc=False):
    """A node of an order."""

    released: bool
    place: NodePlace | None
    stops: tuple[str, ...]
    """Ids of the actions for which the robot stops there."""
    node_id: str = ""
    """As `plain_id` has it."""

    def is_meant_by(self, node_id: str) -> bool:
        """Whether a state with this id is about it. Without an id on either side it may be."""
        return self.node_id == plain_id(node_id) or not (self.node_id and node_id)


class OrderEdge(msgspec.Struct, frozen=True, gc=False):
    """An edge of an order."""

    max_speed_mps: float | None
    max_turn_radps: float | None
    orientation_rad: float | None
    is_global: bool
    """Whether the orientation is that of the map, not of the edge."""
    curve: Curve | None
    """None if it is straight."""


NO_EDGE = OrderEdge(None, None, None, False, None)


class OrderLeg(NamedTuple):
    """One node that is ahead of a robot, and the edge to it."""

    is_released: bool
    place: NodePlace | None
    stops: tuple[str, ...]
    """Ids of the actions for which the robot stops there."""
    edge: OrderEdge


class Order(msgspec.Struct, frozen=True, gc=False):
    """The newest state of an order. The numbers of its nodes are their sequence ids, if these rise."""

    order_id: str
    """As `plain_id` has it."""
    update_id: int | None
    """None if none was sent that can be read."""
    nodes: dict[int, OrderNode]
    """By number, in the order of the way."""
    edges: dict[int, OrderEdge]
    """By the number of the node to which they lead."""

    def is_meant_by(self, order_id: str | None) -> bool:
        """Whether a state with this id is about it. Without an id on either side it may be, so that the newest is."""
        return order_id is None or self.order_id in ("", plain_id(order_id))

    def legs(self) -> Iterator[tuple[int, OrderLeg]]:
        """The legs of the way, with the numbers of their nodes."""
        for number, node in self.nodes.items():
            yield number, OrderLeg(node.released, node.place, node.stops, self.edges.get(number, NO_EDGE))

    def number_of(self, node_id: str | None, sequence_id: int | None) -> int:
        """The number of a node that a robot has passed. -1 if it has passed none."""
        sent = -1 if sequence_id is None else sequence_id
        known, node_id = self.nodes.get(sent), plain_id(node_id or "")
        if not node_id or known is None or known.node_id == node_id:
            return sent
        return next((number for number, node in self.nodes.items() if node.node_id == node_id), sent)

    def passed_by(self, state: StateMessage) -> int:
        """The number of the last node of a state. -1 unless the order has this node there."""
        number = -1 if state.last_node_sequence_id is None else state.last_node_sequence_id
        last = self.nodes.get(number)
        return number if last and last.node_id and last.node_id == plain_id(state.last_node_id or "") else -1


def order_of(message: OrderMessage, state: StateMessage | None, findings: Findings) -> Order:
    """The nodes and edges of one message. Of a very long order, those from where the robot is by its state."""
    nodes, edges = message.nodes or [], message.edges or []
    of_edges = findings
    if len(nodes) > MOST_NODES:
        findings.note("order-too-long", "nodes", len(nodes), f"{MOST_NODES} from where the robot is")
        nodes, of_edges = _from_robot_on(nodes, state), Findings()
    if len(edges) > MOST_NODES:
        findings.note("order-too-long", "edges", len(edges), f"{MOST_NODES} that lead to the nodes")
        edges, of_edges = _to_nodes(edges, nodes), Findings()
    numbered = sorted(zip(numbers_of(nodes, edges, findings), nodes, strict=True), key=_NUMBER)
    order_nodes = {number: _node(node) for number, node in numbered}
    order_edges, curve_points = {}, 0
    for number, edge in edges_by_end(numbered, edges, of_edges).items():
        ordered = order_nodes[number]
        order_edges[number] = read = _edge(edge, ordered.place, curve_points < MOST_CURVE_POINTS, findings)
        if read.curve:
            curve_points += len(read.curve.points)
            place = ordered.place or NodePlace(*read.curve.points[-1][:2])
            order_nodes[number] = msgspec.structs.replace(ordered, place=place)
    return Order(plain_id(message.order_id or ""), message.order_update_id, order_nodes, order_edges)


def _from_robot_on(nodes: list[VdaNode], state: StateMessage | None) -> list[VdaNode]:
    """As many nodes as are kept, from the last one that the robot has passed."""
    passed = (plain_id(state.last_node_id or ""), state.last_node_sequence_id) if state else None
    row = next((row for row, node in enumerate(nodes) if (plain_id(node.node_id), node.sequence_id) == passed), 0)
    return nodes[row : row + MOST_NODES]


def _to_nodes(edges: list[Edge], nodes: list[VdaNode]) -> list[Edge]:
    """As many edges as are kept, of those that lead to any of the nodes."""
    ends = {"", *(plain_id(node.node_id) for node in nodes)}
    return [edge for edge in edges if plain_id(edge.end_node_id) in ends][:MOST_NODES]


def with_update(known: tuple[Order, ...], newest: Order, findings: Findings) -> tuple[Order, ...]:
    """The last two orders of a robot after a message. An update takes the place of the order that it continues."""
    before = next((order for order in known if order.order_id == newest.order_id), None)
    if before is None:
        return (*known[-1:], newest)
    if newest.update_id is None:
        newest = msgspec.structs.replace(newest, update_id=before.update_id)
    elif before.update_id is not None and newest.update_id < before.update_id:
        findings.note("order-outdated", "orderUpdateId", newest.update_id, "used once a state names it")
        return known
    newest = _continuing(before, newest, findings)
    first = min(newest.nodes, default=0)
    if first > 0 and first not in before.nodes:
        findings.note("order-gap", "nodes[0].sequenceId", first, "used from there on")
    kept = {number: _passable(node) for number, node in before.nodes.items() if number < first}
    kept_edges = {number: edge for number, edge in before.edges.items() if number <= first}
    nodes = dict(sorted((kept | newest.nodes).items())[-MOST_NODES:])
    edges = dict(sorted((kept_edges | newest.edges).items())[-MOST_NODES:])
    merged = Order(newest.order_id, newest.update_id, nodes, edges)
    return (*(order for order in known if order is not before), merged)


def _passable(node: OrderNode) -> OrderNode:
    """A node before those of an update, which is released by it."""
    return node if node.released else msgspec.structs.replace(node, released=True)


def swapped(
    known: tuple[Order, ...], outdated: Order | None, state: StateMessage
) -> tuple[tuple[Order, ...], Order | None]:
    """The last two orders and the outdated one, which change places if the robot's state names the outdated one."""
    named = plain_id(state.order_id or ""), state.order_update_id
    if outdated is None or named != (outdated.order_id, outdated.update_id):
        return known, outdated
    before = next((order for order in known if order.order_id == outdated.order_id), None)
    return (*(order for order in known if order is not before), outdated), before


def is_base_extended(known: tuple[Order, ...], newest: Order) -> bool:
    """Whether an order releases more of an order that was known."""
    before = next((order for order in known if order.order_id == newest.order_id), None)
    return before is not None and _base_end(newest) > _base_end(before)


def _base_end(order: Order) -> int:
    return max((number for number, node in order.nodes.items() if node.released), default=-1)


def _continuing(before: Order, newest: Order, findings: Findings) -> Order:
    """The update, with the number that its first node has in the order before, if its sender began to count anew."""
    first = min(newest.nodes, default=0)
    known, node_id = before.nodes.get(first), newest.nodes[first].node_id if newest.nodes else ""
    if not node_id or known is None or known.node_id == node_id:
        return newest
    begin = next((number for number in reversed(before.nodes) if before.nodes[number].node_id == node_id), first)
    if begin == first:
        return newest
    findings.note("sequence-ids-odd", "nodes[0].sequenceId", first, f"{begin}, as before the update")
    nodes = {number - first + begin: node for number, node in newest.nodes.items()}
    return Order(
        newest.order_id,
        newest.update_id,
        nodes,
        {number - first + begin: edge for number, edge in newest.edges.items()},
    )


def numbered_states(
    states: Sequence[NodeState], order: Order | None, findings: Findings
) -> Sequence[tuple[int, NodeState]]:
    """The nodes that remain by a state, in the order of the way, with the numbers that the order has for them."""
    nodes = order.nodes if order else {}
    by_sequence = []
    odd: NodeState | None = None
    for state in states:
        number = state.sequence_id
        if odd is None and (number not in nodes or nodes[number].node_id != plain_id(state.node_id)):
            odd = state
        by_sequence.append((number, state))
    numbered = _by_node_id(states, order) if order and odd else None
    if numbered and odd:
        findings.note(
            "sequence-ids-odd", f"nodeStates[{states.index(odd)}].sequenceId", odd.sequence_id, "by its nodeId"
        )
        return numbered
    by_sequence.sort(key=_NUMBER)
    return by_sequence


def states_ahead(
    state: StateMessage, order: Order | None, findings: Findings
) -> Iterator[tuple[int, NodeState, int | None]]:
    """The nodes that a state names and the robot has not passed: number, node, and sequence id of the node before.

    What the order says is passed is left out only where a number is surely the order's.
    """
    nodes, passed = (order.nodes, order.passed_by(state)) if order else ({}, -1)
    last = before = state.last_node_sequence_id
    for number, node in numbered_states(state.node_states or (), order, findings):
        first, before = before, node.sequence_id
        ordered = nodes.get(number)
        is_passed = number <= passed and ordered is not None and ordered.is_meant_by(node.node_id)
        if is_passed and number < passed:
            findings.note("node-passed", "nodeStates[].sequenceId", node.sequence_id, "left out")
        if not (is_passed or (node.sequence_id == last and node.node_id == state.last_node_id)):
            yield number, node, first


def _by_node_id(states: Sequence[NodeState], order: Order) -> list[tuple[int, NodeState]] | None:
    """The states as the end of the order. None if they are not."""
    numbered = []
    numbers = iter(reversed(order.nodes))
    for state in reversed(states):
        node_id = plain_id(state.node_id)
        found = next((number for number in numbers if order.nodes[number].node_id == node_id), None)
        if found is None:
            return None
        numbered.append((found, state))
    return numbered[::-1]


def _node(node: VdaNode) -> OrderNode:
    stops = tuple(action.action_id for action in node.actions or () if action.blocking_type in DRIVING_STOPS)
    return OrderNode(node.released is not False, on_earth(node.node_position), stops, plain_id(node.node_id))


def is_released(state: NodeState, ordered: OrderNode | None) -> bool:
    """Whether a node is released by a state, or by the order if the state does not say it."""
    if state.released is None and ordered and ordered.is_meant_by(state.node_id):
        return ordered.released
    return state.released is not False


def on_earth(place: NodePlace | None) -> NodePlace | None:
    """The place of a node. None if it lies off any floor."""
    return place if place and abs(place.x) <= MAX_POSITION and abs(place.y) <= MAX_POSITION else None


def legs_of_state(state: StateMessage, order: Order | None, findings: Findings) -> Iterator[OrderLeg]:
    edge_states = state.edge_states
    curves = {edge.sequence_id: edge.trajectory for edge in edge_states if edge.trajectory} if edge_states else {}
    curved = sorted(curves)
    nodes, edges = (order.nodes, order.edges) if order else ({}, {})
    for number, node, before in states_ahead(state, order, findings):
        ordered, edge = nodes.get(number), edges.get(number)
        if ordered and not ordered.is_meant_by(node.node_id):
            findings.note("order-unseen", "nodeStates[*].nodeId", node.node_id, "as the state has it")
            ordered = edge = None
        place = _place(node, ordered, findings)
        first = -1 if before is None else before
        between = last_between(curved, first, node.sequence_id) if curved and not (edge and edge.curve) else None
        if between is not None:
            edge = msgspec.structs.replace(edge or NO_EDGE, curve=curve_to(place, curves[between], findings))
        yield OrderLeg(is_released(node, ordered), place, ordered.stops if ordered else (), edge or NO_EDGE)


def _place(node: NodeState, ordered: OrderNode | None, findings: Findings) -> NodePlace | None:
    """Where a node is by a state, or else by the order, also if the state's place is not filled in."""
    place, known = on_earth(node.node_position), ordered.place if ordered else None
    if place is None or known is None:
        return place or known
    if place.x or place.y or place.theta:
        return place
    if known.x or known.y:
        findings.note("node-place-zero", "nodeStates[].nodePosition", 0.0, "where the order says")
    return known


def _edge(edge: Edge, end: NodePlace | None, is_curve_kept: bool, findings: Findings) -> OrderEdge:
    """The edge that leads to a node which is at `end`."""
    curve = None
    if edge.trajectory and is_curve_kept:
        curve = curve_to(end, edge.trajectory, findings)
    elif edge.trajectory:
        findings.note("curves-too-many", "edges[*].trajectory", edge.sequence_id, "straight")
    speed_mps = edge.maximum_speed if edge.maximum_speed is not None else edge.max_speed
    turn_radps, is_global = edge.max_rotation_speed, edge.orientation_type == "GLOBAL"
    return OrderEdge(_positive(speed_mps), _positive(turn_radps), edge.orientation, is_global, curve)


def _positive(value: float | None) -> float | None:
    return value if value is not None and value > 0.0 else None


def without_far(state: StateMessage, findings: Findings) -> StateMessage:
    """The state without nodes and edges that lie too far ahead to be used."""
    nodes, edges = state.node_states or [], state.edge_states or []
    longest, part = max((len(nodes), "nodeStates"), (len(edges), "edgeStates"))
    if longest <= MOST_NODES:
        return state
    findings.note("order-too-long", part, longest, f"the first {MOST_NODES}")
    return msgspec.structs.replace(state, node_states=nodes[:MOST_NODES], edge_states=edges[:MOST_NODES])
