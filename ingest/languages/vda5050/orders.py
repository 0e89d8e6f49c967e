"""Orders: where a robot is to drive, as its fleet manager sent it.

A state names the nodes and edges that remain. Only the order says where they are, how fast the robot may drive and
where it stops. An update of an order replaces its horizon and continues its base (stitching).
"""

import msgspec

from ingest.languages.rules import Findings
from ingest.languages.vda5050.trajectories import Polyline, polyline
from ingest.languages.vda5050.vda_messages import Edge, NodePlace, OrderMessage, VdaNode

MOST_PARTS = 1000
"""Nodes and edges of an order that are kept."""
MOST_CURVE_POINTS = 4000
"""Points of an order's curves that are kept. Further edges count as straight."""
MAX_POSITION_M = 1e7
DRIVING_STOPS = frozenset(("SOFT", "HARD"))
"""Blocking types of actions during which a robot does not drive."""


class OrderNode(msgspec.Struct, frozen=True, gc=False):
    """A node of an order."""

    released: bool
    place: NodePlace | None
    stops: tuple[str, ...]
    """Ids of the actions for which the robot stops there."""


class OrderEdge(msgspec.Struct, frozen=True, gc=False):
    """An edge of an order, to the node with the next sequence id."""

    max_speed_mps: float | None
    max_turn_radps: float | None
    orientation_rad: float | None
    is_global: bool
    """Whether the orientation is that of the map, not of the edge."""
    curve: Polyline | None
    """None if it is straight."""


class Order(msgspec.Struct, frozen=True, gc=False):
    """The newest state of an order. Nodes and edges are by their sequence ids."""

    order_id: str
    update_id: int
    nodes: dict[int, OrderNode]
    edges: dict[int, OrderEdge]


def order_of(message: OrderMessage, findings: Findings) -> Order:
    """The nodes and edges of one message."""
    nodes, edges = message.nodes or [], message.edges or []
    if len(nodes) + len(edges) > MOST_PARTS:
        findings["order-too-long"] = None
    order_nodes = {node.sequence_id: _node(node) for node in nodes[:MOST_PARTS]}
    order_edges, curve_points = {}, 0
    for edge in edges[:MOST_PARTS]:
        order_edges[edge.sequence_id] = read = _edge(edge, curve_points < MOST_CURVE_POINTS, findings)
        curve_points += len(read.curve or ())
    return Order(message.order_id or "", message.order_update_id or 0, order_nodes, order_edges)


def with_update(known: tuple[Order, ...], newest: Order, findings: Findings) -> tuple[Order, ...]:
    """The last two orders of a robot after a message. An update takes the place of the order that it continues."""
    before = next((order for order in known if order.order_id == newest.order_id), None)
    if before is None:
        return (*known[-1:], newest)
    if newest.update_id < before.update_id:
        findings["order-outdated"] = None
        return known
    first = min(newest.nodes, default=0)
    if first > 0 and first not in before.nodes:
        findings["order-gap"] = None
    kept = {number: node for number, node in before.nodes.items() if number < first and node.released}
    kept_edges = {number: edge for number, edge in before.edges.items() if number < first}
    nodes = dict(sorted((kept | newest.nodes).items())[-MOST_PARTS:])
    edges = dict(sorted((kept_edges | newest.edges).items())[-MOST_PARTS:])
    merged = Order(newest.order_id, newest.update_id, nodes, edges)
    return (*(order for order in known if order is not before), merged)


def is_base_extended(known: tuple[Order, ...], newest: Order) -> bool:
    """Whether an order releases more of an order that was known."""
    before = next((order for order in known if order.order_id == newest.order_id), None)
    return before is not None and _base_end(newest) > _base_end(before)


def _base_end(order: Order) -> int:
    return max((number for number, node in order.nodes.items() if node.released), default=-1)


def _node(node: VdaNode) -> OrderNode:
    stops = tuple(action.action_id for action in node.actions or () if action.blocking_type in DRIVING_STOPS)
    return OrderNode(node.released, on_earth(node.node_position), stops)


def on_earth(place: NodePlace | None) -> NodePlace | None:
    """The place of a node. None if it lies off any floor."""
    return place if place and abs(place.x) <= MAX_POSITION_M and abs(place.y) <= MAX_POSITION_M else None


def _edge(edge: Edge, is_curve_kept: bool, findings: Findings) -> OrderEdge:
    curve = None
    if edge.trajectory and is_curve_kept:
        curve = polyline(edge.trajectory)
        if curve is None:
            findings["trajectory-unreadable"] = None
    speed_mps = edge.maximum_speed if edge.maximum_speed is not None else edge.max_speed
    turn_radps, is_global = edge.max_rotation_speed, edge.orientation_type == "GLOBAL"
    return OrderEdge(_positive(speed_mps), _positive(turn_radps), edge.orientation, is_global, curve)


def _positive(value: float | None) -> float | None:
    return value if value is not None and value > 0.0 else None
