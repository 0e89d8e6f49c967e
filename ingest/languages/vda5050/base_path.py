"""The path of a robot along the released base of its order, at the speed that the order and the robot allow.

The robot drives from where it is along the remaining edges. It turns on the spot at corners, and stops at the first
node with an action during which it does not drive: how long that takes, nobody says. The unreleased horizon is no path,
since the robot may not drive there yet. Its end is a destination.
"""

from collections.abc import Iterator
from itertools import pairwise
from math import atan2, hypot, inf, isnan, nan, pi, remainder

import msgspec

from ingest.frames.angles import turn_between
from ingest.languages.model import NO_PATH, Path, Row
from ingest.languages.rules import Findings
from ingest.languages.vda5050.orders import Order, OrderEdge, OrderNode, on_earth
from ingest.languages.vda5050.trajectories import Polyline, polyline
from ingest.languages.vda5050.vda_memory import VdaMemory, VdaPose
from ingest.languages.vda5050.vda_messages import NodePlace, StateMessage

ASSUMED_MPS = 1.0
"""Speed of a robot if neither its order nor its factsheet nor its motion says one."""
ASSUMED_TURN_RADPS = 1.0
"""Turn rate on the spot, if nothing says one."""
CORNER_RAD = 0.35
"""A robot turns on the spot where its direction changes by more than this."""
LONGEST_S = 60.0
MOST_ROWS = 150
"""A path ends when it is this long."""
UNDER_WAY_MPS = 0.1
"""A robot that is this fast drives on in an arc, whatever its heading. It does not turn on the spot first."""
LEAST_STEP_S = 1e-3
ON_CURVE_M = 2.0
"""A robot this near to the curve of its edge drives on along it. One further off drives straight to the next node."""
DONE = frozenset(("FINISHED", "FAILED"))
NO_EDGE = OrderEdge(None, None, None, False, None)


class OrderLeg(msgspec.Struct, frozen=True, gc=False):
    """One node that is ahead of a robot, and the edge to it."""

    node: OrderNode
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
        if leg.node.place is None and leg.node.released:
            findings["node-without-place"] = None
        if leg.node.place is None or not leg.node.released or walk.is_long:
            break
        walk.along(leg.edge, leg.node.place)
        driven += 1
        if not done.issuperset(leg.node.stops):
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
        passed = state.last_node_sequence_id if state.last_node_sequence_id is not None else -1
        ahead = ((number, node) for number, node in order.nodes.items() if number > passed)
        return [OrderLeg(node, order.edges.get(number - 1, NO_EDGE)) for number, node in ahead]
    if state.node_states and order is None:
        findings["order-unseen"] = None
    return list(_legs_of_state(state, order))


def _legs_of_state(state: StateMessage, order: Order | None) -> Iterator[OrderLeg]:
    curves = {edge.sequence_id: edge.trajectory for edge in state.edge_states or () if edge.trajectory}
    for node in sorted(state.node_states or (), key=lambda node: node.sequence_id):
        number = node.sequence_id
        if number == state.last_node_sequence_id and node.node_id == state.last_node_id:
            continue
        ordered = order.nodes.get(number) if order else None
        place = on_earth(node.node_position) or (ordered.place if ordered else None)
        edge = order.edges.get(number - 1) if order else None
        if edge is None and (trajectory := curves.get(number - 1)):
            edge = OrderEdge(None, None, None, False, polyline(trajectory))
        yield OrderLeg(OrderNode(node.released, place, ordered.stops if ordered else ()), edge or NO_EDGE)


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
        """OrderedDrive along an edge to its node."""
        datum = (place.map_id or self.datums[-1]).lower()
        for x, y in (*_curve_ahead(edge.curve, self.rows[-1]), (place.x, place.y)):
            self._turn_and_drive(x, y, edge, datum)
        self._is_backwards = False  # an order says for each further edge if it is driven backwards

    def destinations(self, legs: list[OrderLeg], driven: int) -> Path:
        """The ends of base and horizon, for a robot that has driven the first legs when the path ends."""
        (t_s, x, y, _), datum = self.rows[-1], self.datums[-1]
        last_released = max((row for row, leg in enumerate(legs) if leg.node.released), default=-1)
        rows, datums = [], []
        for row, leg in enumerate(legs):
            place = leg.node.place
            if place and row >= driven:
                t_s += hypot(place.x - x, place.y - y) / self._limit_mps(leg.edge)
                x, y, datum = place.x, place.y, (place.map_id or datum).lower()
            if row == last_released or row == len(legs) - 1:
                t_s += LEAST_STEP_S
                rows.append((t_s, x, y, nan))
                datums.append(datum)
        return _path(rows, datums)

    def _turn_and_drive(self, x: float, y: float, edge: OrderEdge, datum: str) -> None:
        t_s, from_x, from_y, from_rad = self.rows[-1]
        length_m = hypot(x - from_x, y - from_y)
        if length_m < 1e-3:
            return
        yaw_rad = self._heading(atan2(y - from_y, x - from_x), from_rad, edge)
        turn_rad = abs(turn_between(from_rad, yaw_rad))
        is_under_way = len(self.rows) == 1 and self._speed_mps > UNDER_WAY_MPS
        if turn_rad > CORNER_RAD and not is_under_way:
            rate_radps = min(edge.max_turn_radps or inf, self._abilities.max_turn_radps or ASSUMED_TURN_RADPS)
            t_s += turn_rad / rate_radps
            self._add((t_s, from_x, from_y, yaw_rad), self.datums[-1])
        self._add((t_s + length_m / self._limit_mps(edge), x, y, yaw_rad), datum)

    def _add(self, row: Row, datum: str) -> None:
        self.rows.append(row)
        self.datums.append(datum)

    def _heading(self, direction_rad: float, before_rad: float, edge: OrderEdge) -> float:
        """The heading on a straight piece of an edge."""
        orientation_rad = edge.orientation_rad
        if orientation_rad is None:
            if self._abilities.is_omnidirectional and not isnan(before_rad):
                return before_rad
            orientation_rad = pi if self._is_backwards else 0.0
        return remainder(orientation_rad if edge.is_global else direction_rad + orientation_rad, 2 * pi)

    def _limit_mps(self, edge: OrderEdge) -> float:
        """The least of the edge's and the robot's speed."""
        limits = [limit for limit in (edge.max_speed_mps, self._abilities.max_speed_mps) if limit]
        return min(limits) if limits else max(self._speed_mps, ASSUMED_MPS)


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
