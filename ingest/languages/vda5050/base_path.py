"""The path of a robot along the released base of its order, at the speed that the order and the robot allow.

The robot drives from where it is along the remaining edges. It turns on the spot at corners, and stops at the first
node with an action during which it does not drive: how long that takes, nobody says. The unreleased horizon is no path,
since the robot may not drive there yet. Its end is a destination.
"""

from collections.abc import Iterator
from itertools import pairwise
from math import atan2, hypot, inf, isnan, nan, pi, remainder
from typing import NamedTuple

import msgspec

from ingest.frames.angles import turn_between
from ingest.languages.model import NO_PATH, Path, Row
from ingest.languages.rules import Findings
from ingest.languages.vda5050.order_numbers import last_between
from ingest.languages.vda5050.orders import Order, OrderEdge, OrderNode, numbered_states, on_earth
from ingest.languages.vda5050.trajectories import Polyline, polyline
from ingest.languages.vda5050.vda_memory import VdaMemory, VdaPose
from ingest.languages.vda5050.vda_messages import NodePlace, StateMessage

ASSUMED_MPS = 1.0
"""Speed of a robot if neither its order nor its factsheet nor its motion says one."""
ASSUMED_TURN_RADPS = 1.0
"""Turn rate on the spot, if nothing says one."""
CORNER_RAD = 0.35
"""A robot turns on the spot where its direction changes by more than this."""
LONGEST_S = 40.0
MOST_ROWS = 150
"""A path ends when it is this long."""
UNDER_WAY_MPS = 0.1
"""A robot that is this fast drives on in an arc, whatever its heading. It does not turn on the spot first."""
LEAST_STEP_S = 1e-3
ON_CURVE_M = 2.0
"""A robot this near to the curve of its edge drives on along it. One further off drives straight to the next node."""
DONE = frozenset(("FINISHED", "FAILED"))
NO_EDGE = OrderEdge(None, None, None, False, None)


class OrderLeg(NamedTuple):
    """One node that is ahead of a robot, and the edge to it."""

    is_released: bool
    place: NodePlace | None
    stops: tuple[str, ...]
    """Ids of the actions for which the robot stops there."""
    edge: OrderEdge


class OrderedDrive(msgspec.Struct, frozen=True, gc=False):
    """Where a robot will drive by its order."""

    path: Path
    destinations: Path


NO_DRIVE = OrderedDrive(NO_PATH, NO_PATH)


def drive(memory: VdaMemory, state: StateMessage, pose: VdaPose, findings: Findings) -> OrderedDrive:
    """The path along the base, and the ends of base and horizon as destinations."""
    legs = _legs_ahead(memory, state, findings)
    if not legs:
        return NO_DRIVE
    walk = _Walk(memory, pose)
    done = {action.action_id for action in state.action_states or () if action.action_status in DONE}
    driven = 0
    for leg in legs:
        if leg.place is None and leg.is_released:
            findings["node-without-place"] = None
        if leg.place is None or not leg.is_released or walk.is_long:
            break
        walk.along(leg.edge, leg.place)
        driven += 1
        if leg.stops and not done.issuperset(leg.stops):
            break
    return OrderedDrive(_path(walk.rows[1:], walk.datums[1:]), walk.destinations(legs, driven))


def _path(rows: list[Row], datums: list[str]) -> Path:
    if not rows:
        return NO_PATH
    return Path(tuple(rows), tuple(datums), in_order=True, ends_s=(rows[0][0], rows[-1][0]))


def _legs_ahead(memory: VdaMemory, state: StateMessage, findings: Findings) -> list[OrderLeg]:
    """The legs that remain, in their order. The state says which, except while the newest order is newer than it."""
    order = next((order for order in reversed(memory.orders) if order.order_id == state.order_id), None)
    if order and memory.is_order_newer and order is memory.orders[-1]:
        passed = order.number_of(state.last_node_id, state.last_node_sequence_id)
        return [_leg(order, number, node) for number, node in order.nodes.items() if number > passed]
    if state.node_states and order is None:
        findings["order-unseen"] = None
    return list(_legs_of_state(state, order, findings))


def _leg(order: Order, number: int, node: OrderNode) -> OrderLeg:
    return OrderLeg(node.released, node.place, node.stops, order.edges.get(number, NO_EDGE))


def _legs_of_state(state: StateMessage, order: Order | None, findings: Findings) -> Iterator[OrderLeg]:
    edge_states = state.edge_states
    curves = {edge.sequence_id: edge.trajectory for edge in edge_states if edge.trajectory} if edge_states else {}
    curved = sorted(curves)
    nodes, edges = (order.nodes, order.edges) if order else ({}, {})
    last_number, last_id = state.last_node_sequence_id, state.last_node_id
    before = -1 if last_number is None else last_number
    for number, node in numbered_states(state.node_states or (), order, findings):
        first, before = before, node.sequence_id
        if node.sequence_id == last_number and node.node_id == last_id:
            continue
        ordered, edge = nodes.get(number), edges.get(number)
        place = on_earth(node.node_position) if node.node_position else None
        place = place or (ordered.place if ordered else None)
        between = last_between(curved, first, node.sequence_id) if edge is None and curved else None
        if between is not None:
            edge = OrderEdge(None, None, None, False, polyline(curves[between]))
        yield OrderLeg(node.released, place, ordered.stops if ordered else (), edge or NO_EDGE)


class _Walk:
    """The rows of a path while it grows leg by leg. The first row is the pose of the robot."""

    def __init__(self, memory: VdaMemory, pose: VdaPose) -> None:
        position, self._abilities = pose.position, memory.abilities
        yaw_rad = nan if position.theta is None else remainder(position.theta, 2 * pi)
        self.rows: list[Row] = [(pose.stamp.t_s, position.x, position.y, yaw_rad)]
        self.datums = [(position.map_id or "").lower()]
        velocity = pose.velocity
        self._speed_mps = hypot(velocity.vx or 0.0, velocity.vy or 0.0) if velocity else 0.0
        self._is_backwards = bool(velocity and (velocity.vx or 0.0) < 0.0)
        self._until_s = pose.stamp.t_s + LONGEST_S

    @property
    def is_long(self) -> bool:
        return self.rows[-1][0] > self._until_s or len(self.rows) > MOST_ROWS

    def along(self, edge: OrderEdge, place: NodePlace) -> None:
        """Drive along an edge to its node."""
        datum, limit_mps = (place.map_id or self.datums[-1]).lower(), self._limit_mps(edge)
        if edge.curve:
            for x, y in _curve_ahead(edge.curve, self.rows[-1]):
                self._turn_and_drive(x, y, edge, limit_mps, datum)
        self._turn_and_drive(place.x, place.y, edge, limit_mps, datum)
        self._is_backwards = False  # an order says for each further edge if it is driven backwards

    def destinations(self, legs: list[OrderLeg], driven: int) -> Path:
        """The ends of base and horizon, for a robot that has driven the first legs when the path ends."""
        (t_s, x, y, _), datum = self.rows[-1], self.datums[-1]
        last = len(legs) - 1
        base_end = next((row for row in range(last, -1, -1) if legs[row].is_released), last)
        rows, datums = [], []
        for row in range(min(driven, base_end), len(legs)):
            place = legs[row].place
            if place and row >= driven:
                t_s += hypot(place.x - x, place.y - y) / self._limit_mps(legs[row].edge)
                x, y, datum = place.x, place.y, (place.map_id or datum).lower()
            if row in {base_end, last}:
                t_s += LEAST_STEP_S
                rows.append((t_s, x, y, nan))
                datums.append(datum)
        return _path(rows, datums)

    def _turn_and_drive(self, x: float, y: float, edge: OrderEdge, limit_mps: float, datum: str) -> None:
        t_s, from_x, from_y, from_rad = self.rows[-1]
        dx, dy = x - from_x, y - from_y
        length_m = hypot(dx, dy)
        if length_m < 1e-3:
            return
        yaw_rad = self._heading(atan2(dy, dx), from_rad, edge)
        turn_rad = abs(turn_between(from_rad, yaw_rad))
        if turn_rad > CORNER_RAD and not (len(self.rows) == 1 and self._speed_mps > UNDER_WAY_MPS):
            t_s += turn_rad / min(edge.max_turn_radps or inf, self._abilities.max_turn_radps or ASSUMED_TURN_RADPS)
            self.rows.append((t_s, from_x, from_y, yaw_rad))
            self.datums.append(self.datums[-1])
        self.rows.append((t_s + length_m / limit_mps, x, y, yaw_rad))
        self.datums.append(datum)

    def _heading(self, direction_rad: float, before_rad: float, edge: OrderEdge) -> float:
        """The heading on a straight piece of an edge."""
        orientation_rad = edge.orientation_rad
        if orientation_rad is None:
            if self._abilities.is_omnidirectional and not isnan(before_rad):
                return before_rad
            return remainder(direction_rad + pi, 2 * pi) if self._is_backwards else direction_rad
        return remainder(orientation_rad if edge.is_global else direction_rad + orientation_rad, 2 * pi)

    def _limit_mps(self, edge: OrderEdge) -> float:
        """The least of the edge's and the robot's speed."""
        limit_mps, most_mps = edge.max_speed_mps, self._abilities.max_speed_mps
        if limit_mps is None:
            return most_mps or max(self._speed_mps, ASSUMED_MPS)
        return min(limit_mps, most_mps or inf)


def _curve_ahead(curve: Polyline | None, here: Row) -> Polyline:
    """The points of a curve that are ahead of a robot. Empty if there is no curve, or if the robot is far from it."""
    if not curve:
        return ()
    _, x, y, _ = here
    nearest_m, ahead = inf, 0
    for row, ((ax, ay), (bx, by)) in enumerate(pairwise(curve)):
        dx, dy = bx - ax, by - ay
        square = dx * dx + dy * dy
        along = min(max(((x - ax) * dx + (y - ay) * dy) / square, 0.0), 1.0) if square else 0.0
        away_m = hypot(ax + along * dx - x, ay + along * dy - y)
        if away_m < nearest_m:
            nearest_m, ahead = away_m, row + 1
    return curve[ahead:] if nearest_m <= ON_CURVE_M else ()
