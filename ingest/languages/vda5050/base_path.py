"""The path of a robot along its order, with the speed that the order and the robot allow.

The robot drives from where it is along the remaining edges, by its own plan where that leads to their nodes. It turns
on the spot at corners and as nodes say, and stops at the first node with an action during which it does not drive: how
long that takes, nobody says. It goes on into the unreleased horizon if its bases are usually extended before it reaches
their ends. Where the robot has sent a path with times of its own, the order goes on from its end.
"""

from collections.abc import Sequence
from itertools import pairwise
from math import atan2, dist, hypot, inf, isfinite, isnan, nan, pi, remainder

import msgspec

from ingest.frames.angles import turn_between
from ingest.frames.assumed_motion import (
    ASSUMED_MPS,
    ASSUMED_TURN_RADPS,
    CORNER_RAD,
    DRIVES_MPS,
    LEAST_STEP_S,
    SPOT_M,
    TURNS_RADPS,
    turn_in_parts,
)
from ingest.frames.way_pieces import Nearest, nearest_place
from ingest.languages.geometry.trajectories import (
    BEND_RAD,
    Polyline,
    curve_ahead,
    is_needless,
)
from ingest.languages.model import BESIDE_M, NO_PATH, Path, Row, datum_name
from ingest.languages.rules import Findings
from ingest.languages.vda5050.orders import NO_EDGE, Order, OrderEdge, OrderLeg, legs_of_state
from ingest.languages.vda5050.seen.base_ends import speed_mps
from ingest.languages.vda5050.seen.leg_ahead import leg_of
from ingest.languages.vda5050.vda_memory import VdaMemory, VdaPose
from ingest.languages.vda5050.vda_messages import NodePlace, Position, StateMessage, Velocity2d

LONGEST_S = 40.0
MOST_ROWS = 150
"""A path ends when it is this long."""
AT_NODE_M = 0.1
"""A robot that stands is at a node that is nearer than this."""
NOISE_M = 0.2
"""Positions may be off by as much: the direction to a nearer place shows no corner."""
TURN_RAD = 0.1
"""A node's or an edge's orientation is taken by a turn if it differs by more than this."""
SHOWS_M = 0.5
"""A path with times that is longer shows how fast the robot drives."""
PASSED_BY = 5
"""A plan may pass so many nodes at a distance before one to which it leads."""
DONE = frozenset(("FINISHED", "FAILED"))


class OrderedDrive(msgspec.Struct, frozen=True, gc=False):
    """Where a robot will drive by its order."""

    path: Path
    """After the robot's own path, if it sent one. `NO_PATH` if the order does not say how that goes on."""
    destinations: Path


NO_DRIVE = OrderedDrive(NO_PATH, NO_PATH)


def drive(memory: VdaMemory, state: StateMessage, pose: VdaPose, findings: Findings) -> OrderedDrive:
    """The path along the order, and the ends of base and horizon as destinations."""
    walk, legs = _Walk(memory, pose), _legs_ahead(memory, state, findings)
    if walk.plan and not any(leg.place for leg in legs):
        legs = [OrderLeg(True, NodePlace(*walk.plan[-1]), (), NO_EDGE)]
    row = walk.leg_on(legs, state.position, _passed_place(memory, state))
    start, here = state.position, pose.position
    if row and walk.own is NO_PATH and start and (start.x, start.y) == (here.x, here.y):
        findings["node-passed"] = None
    legs = legs[row or 0 :]
    if not legs:
        return NO_DRIVE
    done = {action.action_id for action in state.action_states or () if action.action_status in DONE}
    goes_on = memory.bases.are_extended(has_horizon=not legs[-1].is_released)
    ends_in_stop = not goes_on
    base_end, base_legs, reached, near = walk.end, 0, 0, None
    for count, leg in enumerate(legs, 1):
        if leg.place is None and leg.is_released:
            findings["node-without-place"] = None
        if not (leg.is_released or goes_on):
            break
        if leg.place is None or walk.is_long or (walk.plan and count > MOST_ROWS):
            ends_in_stop = False
            break
        if count > reached:
            passed, near = walk.next_on_plan(legs[count - 1 : count + PASSED_BY])
            reached = count + passed
        if count < reached:
            continue
        walk.go_along(leg.edge, leg.place, near)
        if leg.is_released:
            base_end, base_legs = walk.end, count
        if leg.stops and not done.issuperset(leg.stops):
            ends_in_stop = True
            break
    path = _path(walk.rows[1:], walk.datums[1:], walk.most[1:], ends_in_stop=ends_in_stop)
    if pose.path is not NO_PATH:
        path = _joined(walk.own, path) if row is not None else NO_PATH
    return OrderedDrive(path, walk.destinations(legs, base_end, base_legs))


def _joined(own: Path, further: Path) -> Path:
    """A path with times of the robot's own, and how it goes on. `NO_PATH` if it does not."""
    if NO_PATH in (own, further):
        return NO_PATH
    ends_s = own.ends_s[0], further.ends_s[1]
    return Path(own.poses + further.poses, own.datums + further.datums, True, ends_s, (), further.ends_in_stop)


def _path(rows: list[Row], datums: list[str], most: Sequence[float] = (), *, ends_in_stop: bool = True) -> Path:
    if not rows:
        return NO_PATH
    ends_s = rows[0][0], rows[-1][0]
    return Path(tuple(rows), tuple(datums), True, ends_s, tuple(most), ends_in_stop)


def order_by(memory: VdaMemory, state: StateMessage) -> Order | None:
    """The newest order that the newest state is about, or else what is known of its nodes."""
    order_id = state.order_id or None if state.node_states else state.order_id
    heard = next((order for order in reversed(memory.orders) if order.is_meant_by(order_id)), None)
    return heard or memory.unheard


def _legs_ahead(memory: VdaMemory, state: StateMessage, findings: Findings) -> list[OrderLeg]:
    """The legs that remain, in their order. The state says which, unless the order is newer or it never has nodes."""
    order = order_by(memory, state)
    is_newer = memory.is_order_newer and order is memory.orders[-1]
    is_left_out = state.driving and (state.node_states is None or not memory.lists_nodes)
    if order and (is_newer or (is_left_out and order.passed_by(state) >= 0)):
        passed = order.number_of(state.last_node_id, state.last_node_sequence_id)
        return [leg for number, leg in order.legs() if number > passed]
    if state.node_states and order is memory.unheard:
        findings.note("order-unseen", "orderId", state.order_id, "as the state, or earlier orders, have its nodes")
    return list(legs_of_state(state, order, findings))


def _passed_place(memory: VdaMemory, state: StateMessage) -> NodePlace | None:
    """Where the last node of a state is. None if its order does not say it."""
    order = order_by(memory, state)
    return order.nodes[passed].place if order and (passed := order.passed_by(state)) >= 0 else None


class _Walk:
    """The needed rows of a path while it grows leg by leg. The first is the robot's pose or the end of its own path."""

    def __init__(self, memory: VdaMemory, pose: VdaPose) -> None:
        position, self._abilities = pose.position, memory.abilities
        velocity = pose.motion
        yaw_rad = remainder(_heading_rad(pose) if position.theta is None else position.theta, 2 * pi)
        self.own = pose.path if pose.path.in_order and pose.path.ends_s[1] > pose.stamp.t_s else NO_PATH
        """The robot's own path, if its times are in order and reach beyond the pose."""
        before = ((pose.stamp.t_s, position.x, position.y, yaw_rad), *self.own.poses)
        self._way_rad, self._own_mps = _motion(before, velocity)
        """The direction in which the robot drives there, nan if unknown; its speed by its own path, 0 without one."""
        self.rows: list[Row] = [(*before[-1][:3], self._way_rad if isnan(before[-1][3]) else before[-1][3])]
        self.datums = [datum_name(position.map_id)]
        self.most = [inf]
        """The greatest speed to each row, or the greatest turn rate; inf if none is stated."""
        self._speed_mps = speed_mps(pose.velocity)
        self._is_moving = speed_mps(velocity) > DRIVES_MPS
        self._is_backwards = bool(velocity and (velocity.vx or 0.0) < 0.0)
        self._until_s = pose.stamp.t_s + LONGEST_S
        ahead = curve_ahead(pose.plan, self.rows[0][1:3])
        self.plan: Polyline = (self.rows[0][1:3], *ahead) if ahead else ()
        """The way that the robot plans, from the last row on."""
        self._turns_at_nodes = not memory.are_headings_default or memory.abilities.is_omnidirectional
        self._is_of_order = not memory.is_order_newer
        """Whether that can be for the newest order."""

    @property
    def end(self) -> tuple[Row, str]:
        return self.rows[-1], self.datums[-1]

    @property
    def is_long(self) -> bool:
        return self.rows[-1][0] > self._until_s or len(self.rows) > MOST_ROWS

    def leg_on(self, legs: Sequence[OrderLeg], start: Position | None, passed: NodePlace | None) -> int | None:
        """The row of the leg on which the robot is. None if it is on none. See `leg_of`.

        With a plan it is the first: `goes_along` leaves out what is passed.
        """
        if self.plan or start is None:
            return 0
        is_under_way = self.own is not NO_PATH or self._is_moving
        return leg_of(legs, start, passed, self.rows[0], self._way_rad, is_under_way=is_under_way)

    def next_on_plan(self, legs: Sequence[OrderLeg]) -> tuple[int, Nearest | None]:
        """How many of the legs the plan leads past, and where it comes to the node of the next for the first time.

        0 and None if it comes to none of them.
        """
        for row, leg in enumerate(legs if self.plan else ()):
            if leg.place:
                near = nearest_place(self.plan, leg.place.x, leg.place.y, BESIDE_M)
                if near.away_m <= BESIDE_M:
                    return row, near
        return 0, None

    def go_along(self, edge: OrderEdge, place: NodePlace, near: Nearest | None) -> None:
        """Drive along an edge to its node, which is `near` the plan if that leads there, and turn as the node says."""
        end, datum = (place.x, place.y), datum_name(place.map_id or self.datums[-1])
        if near:
            way, end, self.plan = self.plan[1 : near.end], near.point, (near.point, *self.plan[near.end :])
        else:
            is_nearer = bool(self.plan) and dist(self.plan[-1], end) < dist(self.plan[0], end)
            way, self.plan = self.plan[1:] if is_nearer and self._is_of_order else (), ()
            way = way or curve_ahead(edge.curve, self.rows[-1][1:3])
        for x, y in (*way, end):
            self._turn_and_drive(x, y, edge, datum)
        if place.theta is not None and self._turns_at_nodes:
            self._turn(place.theta, edge, max(place.allowed_deviation_theta or 0.0, TURN_RAD))

    def destinations(self, legs: list[OrderLeg], base_end: tuple[Row, str], driven: int) -> Path:
        """The ends of base and horizon, for a robot that has driven the first legs where the base ends."""
        (t_s, x, y, _), datum = base_end
        last = len(legs) - 1
        last_released = next((row for row in range(last, -1, -1) if legs[row].is_released), last)
        rows, datums = [], []
        for row in range(min(driven, last_released), len(legs)):
            place = legs[row].place
            if place and row >= driven:
                t_s += hypot(place.x - x, place.y - y) / self._assumed_mps(self._most_mps(legs[row].edge))
                x, y, datum = place.x, place.y, datum_name(place.map_id or datum)
            if row in {last_released, last}:
                t_s += LEAST_STEP_S
                rows.append((t_s, x, y, nan))
                datums.append(datum)
        return _path(rows, datums)

    def _turn_and_drive(self, x: float, y: float, edge: OrderEdge, datum: str) -> None:
        _, from_x, from_y, from_rad = self.rows[-1]
        dx, dy = x - from_x, y - from_y
        length_m, is_first = hypot(dx, dy), len(self.rows) == 1 and self.own is NO_PATH
        if length_m < (AT_NODE_M if is_first and self._speed_mps <= DRIVES_MPS else SPOT_M):
            if edge.orientation_rad is not None and edge.is_global:
                self._turn(edge.orientation_rad, edge, TURN_RAD)
            return
        yaw_rad = self._heading(atan2(dy, dx), from_rad, edge)
        is_under_way = is_first and self._speed_mps > DRIVES_MPS  # it drives on in an arc
        if not (is_under_way or self._goes_straight_on(yaw_rad)):
            self._turn(yaw_rad, edge, CORNER_RAD)
        most_mps = self._most_mps(edge)
        t_s = self.rows[-1][0] + length_m / self._assumed_mps(most_mps)
        if self._is_last_needless(x, y, yaw_rad) and (datum, most_mps) == (self.datums[-1], self.most[-1]):
            del self.rows[-1], self.datums[-1], self.most[-1]
        self._add((t_s, x, y, yaw_rad), datum, most_mps)

    def _goes_straight_on(self, yaw_rad: float) -> bool:
        """Whether a robot under way heads so already, with only a place before that is so near that this is noise."""
        if len(self.rows) != 2 or not self._is_moving or dist(self.rows[0][1:3], self.rows[1][1:3]) > NOISE_M:
            return False
        return abs(turn_between(self.rows[0][3], yaw_rad)) <= CORNER_RAD

    def _is_last_needless(self, x: float, y: float, yaw_rad: float) -> bool:
        """Whether the path is nearly the same without its last row, if it goes on to the given point."""
        if len(self.rows) < 3:
            return False
        before, last = ((row[1], row[2]) for row in self.rows[-2:])
        has_turned = before == last or abs(turn_between(self.rows[-1][3], yaw_rad)) > BEND_RAD
        return not has_turned and is_needless(before, last, (x, y))

    def _turn(self, to_rad: float, edge: OrderEdge, least_rad: float) -> None:
        """Turn on the spot, in parts, if the turn is larger than `least_rad`."""
        t_s, x, y, from_rad = self.rows[-1]
        turn_rad = turn_between(from_rad, to_rad)
        if isnan(turn_rad) or abs(turn_rad) <= least_rad:
            return
        most_radps = min(edge.max_turn_radps or inf, self._abilities.max_turn_radps or inf)
        radps = max(most_radps, TURNS_RADPS) if isfinite(most_radps) else ASSUMED_TURN_RADPS
        for part_rad, yaw_rad in turn_in_parts(from_rad, to_rad):
            self._add((t_s + part_rad / radps, x, y, yaw_rad), self.datums[-1], most_radps)

    def _add(self, row: Row, datum: str, most: float) -> None:
        self.rows.append(row)
        self.datums.append(datum)
        self.most.append(most)

    def _heading(self, direction_rad: float, before_rad: float, edge: OrderEdge) -> float:
        """The heading on a straight piece of an edge."""
        orientation_rad = edge.orientation_rad
        if orientation_rad is None:
            if self._abilities.is_omnidirectional and not isnan(before_rad):
                return before_rad
            backwards_rad = remainder(direction_rad + pi, 2 * pi)
            is_turned = abs(turn_between(before_rad, backwards_rad)) >= pi / 2 and len(self.rows) > 1
            return backwards_rad if self._is_backwards and not is_turned else direction_rad
        return remainder(orientation_rad if edge.is_global else direction_rad + orientation_rad, 2 * pi)

    def _most_mps(self, edge: OrderEdge) -> float:
        """The least of the edge's and the robot's greatest speed; inf if neither is stated."""
        return min(edge.max_speed_mps or inf, self._abilities.max_speed_mps or inf)

    def _assumed_mps(self, most_mps: float) -> float:
        """A speed for times that nobody has observed yet."""
        mps = min(most_mps, self._own_mps or inf)
        return max(mps, DRIVES_MPS) if isfinite(mps) else max(self._speed_mps, ASSUMED_MPS)


def _heading_rad(pose: VdaPose) -> float:
    """The heading of a robot that does not say it, as it moved last; nan if it was not seen to move."""
    backs_rad = pi if pose.velocity and (pose.velocity.vx or 0.0) < 0.0 else 0.0
    return pose.travel.direction_rad + backs_rad


def _motion(rows: Sequence[Row], velocity: Velocity2d | None) -> tuple[float, float]:
    """The direction in which a robot drives at the last of its rows, and its speed along them, 0 if unknown."""
    moves = [(b[1] - a[1], b[2] - a[2], b[0] - a[0]) for a, b in pairwise(rows)]
    drives = [(dx, dy, lasts_s) for dx, dy, lasts_s in moves if hypot(dx, dy) > DRIVES_MPS * lasts_s > 0.0]
    if drives:
        length_m, (dx, dy, _) = sum(hypot(dx, dy) for dx, dy, _ in drives), drives[-1]
        mps = length_m / sum(lasts_s for _, _, lasts_s in drives)
        return atan2(dy, dx), mps if length_m > SHOWS_M else 0.0
    if velocity and speed_mps(velocity) > DRIVES_MPS:
        return rows[-1][3] + atan2(velocity.vy or 0.0, velocity.vx or 0.0), 0.0
    return rows[-1][3], 0.0
