"""Ways out of a ring if no order of waiting ends it: one robot goes elsewhere first, or backs out of a lane."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from heapq import nsmallest
from math import hypot
from operator import itemgetter

from deconflict.contention.robots.destinations import PlannedStop
from deconflict.contention.robots.place_geometry import CHANGEOVER_S
from deconflict.contention.robots.robot_view import RobotView
from deconflict.contention.waiting.deadlocks import RingLink
from deconflict_client.advisory import Recommendation, Slot, moment

SPEED_MPS = 1.0
"""Robots are taken to drive from place to place in a straight line at this speed."""
CLEAR_S = 2.0
"""From when a robot departs until the next one may depart for its place."""
MOST_MOVES, MOST_REFUGES = 16, 50
"""Rings of more robots are not planned for, and of more refuges the nearest to a robot come into question."""


@dataclass(frozen=True, slots=True)
class Refuge:
    """A resource with room left."""

    resource: str
    """Id."""
    datum: str
    """Datum of its floor."""
    x_m: float
    """A point inside it, in the floor's frame."""
    y_m: float


@dataclass(frozen=True, slots=True)
class RingMove:
    """One robot of a ring, and where it goes next."""

    robot: str
    """UUID."""
    at: tuple[float, float]
    """Centre of its envelope in the floor's frame: x and y in metres."""
    to: PlannedStop
    leaves_s: float
    """When it means to depart, seconds since the epoch."""
    priority: float
    """Weight of a second of its delay."""

    @property
    def way_s(self) -> float:
        """How long it drives to its stop."""
        return hypot(self.to.x_m - self.at[0], self.to.y_m - self.at[1]) / SPEED_MPS


def detour(
    ring: Sequence[RingLink],
    robots: Mapping[str, RobotView],
    refuges: Sequence[Refuge],
    now_s: float,
    priority: Callable[[str], float],
    standing: Recommendation | None,
    switch_s: float,
) -> Recommendation | None:
    """The cheapest plan in which one robot goes to a refuge, the others move on one after another, and then itself.

    The cost is the sum of delays at what the robots want, weighted by priority. The robot that `standing` sent to a
    refuge is sent there again, unless another plan saves `switch_s`. None if robots of the ring wait for more than
    places, are too many, or no refuge is on their floor.
    """
    moves = _moves(ring, robots, now_s, priority)
    if not moves or len(moves) > MOST_MOVES:
        return None
    datum = robots[ring[0].waiter].datum
    plans = [
        _plan([*moves[row::-1], *moves[:row:-1]], refuge)
        for row in range(len(moves))
        for refuge in _nearest([refuge for refuge in refuges if refuge.datum == datum], moves[row])
        if not robots[moves[row].robot].on_foot
    ]
    if not plans:
        return None
    best = min(plans, key=lambda plan: (plan.cost_s, _first_move(plan)))
    kept = [plan for plan in plans if standing and standing.slots and _first_move(plan) == _first_move(standing)]
    return kept[0] if kept and kept[0].cost_s <= best.cost_s + switch_s else best


def back_out(
    ring: Sequence[RingLink],
    robots: Mapping[str, RobotView],
    lane_m: float,
    now_s: float,
    priority: Callable[[str], float],
) -> tuple[Recommendation, str, float]:
    """For two robots towards each other in a lane: of the waiters of `ring`, which can back, the one for which it costs
    less backs out and comes again.

    It waits before the lane until the other robot is out of it, and then drives the way back. Returns the advice, the
    robot that backs out, and how far.
    """
    plans = []
    for link in ring:
        robot, other = robots[link.waiter], robots[link.holder]
        back_m, other_m = _depths_m(robot, other, link.where, lane_m, now_s)
        out_s = max(lane_m + other.length_m - other_m, back_m) / SPEED_MPS
        starts_s = now_s + out_s + CHANGEOVER_S
        cost_s = priority(robot.uuid) * (starts_s - now_s + back_m / SPEED_MPS)
        first = _slot(other.uuid, link.where, now_s, now_s + out_s, 0.0)
        second = _slot(robot.uuid, link.where, starts_s, starts_s + lane_m / SPEED_MPS, starts_s - now_s)
        plans.append((cost_s, robot.uuid, back_m, _advice((first, second), cost_s)))
    _, uuid, back_m, advice = min(plans, key=itemgetter(0, 1))
    return advice, uuid, back_m


def _depths_m(robot: RobotView, other: RobotView, lane: str, lane_m: float, now_s: float) -> tuple[float, float]:
    """How far each of two robots that face each other has to back up until its front is out of the lane."""
    along_m, other_m = (each.passages[lane].at_m(now_s) for each in (robot, other))
    if along_m > other_m:
        along_m, other_m = lane_m - along_m, lane_m - other_m
    return max(along_m + robot.length_m / 2, 0.0), max(lane_m - other_m + other.length_m / 2, 0.0)


def _first_move(advice: Recommendation) -> tuple[str, str]:
    """The robot that moves first, and where to."""
    return advice.slots[0].robot, advice.slots[0].resource


def _nearest(refuges: Sequence[Refuge], move: RingMove) -> Sequence[Refuge]:
    """The `MOST_REFUGES` that are nearest to a robot."""
    if len(refuges) <= MOST_REFUGES:
        return refuges
    return nsmallest(MOST_REFUGES, refuges, lambda refuge: hypot(refuge.x_m - move.at[0], refuge.y_m - move.at[1]))


def _moves(
    ring: Sequence[RingLink], robots: Mapping[str, RobotView], now_s: float, priority: Callable[[str], float]
) -> list[RingMove]:
    """In the order of the ring; empty if a robot waits for more than the place that the next robot has now."""
    moves = []
    for link in ring:
        robot, holder = robots[link.waiter], robots[link.holder]
        if not robot.stops or robot.stops[0].resource != link.where or holder.here != link.where:
            return []
        to, at = robot.stops[0], (robot.x_m, robot.y_m)
        away_s = hypot(to.x_m - robot.x_m, to.y_m - robot.y_m) / SPEED_MPS
        moves.append(RingMove(robot.uuid, at, to, max(to.t_s - away_s, now_s), priority(robot.uuid)))
    return moves


def _plan(chain: Sequence[RingMove], refuge: Refuge) -> Recommendation:
    """The plan in which the first of a chain goes to the refuge; each other robot wants the place of the one before."""
    first, *others = chain
    at_refuge_s = first.leaves_s + hypot(refuge.x_m - first.at[0], refuge.y_m - first.at[1]) / SPEED_MPS
    left_s, cost_s, slots = first.leaves_s, 0.0, []
    for move in others:
        leaves_s = max(move.leaves_s, left_s + CLEAR_S)
        late_s = leaves_s - move.leaves_s
        slots.append(_arrival(move, leaves_s + move.way_s, late_s))
        cost_s, left_s = cost_s + move.priority * late_s, leaves_s
    moves_on_s = max(at_refuge_s, left_s + CLEAR_S)
    arrives_s = moves_on_s + hypot(first.to.x_m - refuge.x_m, first.to.y_m - refuge.y_m) / SPEED_MPS
    late_s = max(arrives_s - first.leaves_s - first.way_s, 0.0)
    stay = _slot(first.robot, refuge.resource, at_refuge_s, moves_on_s, 0.0)
    return _advice((stay, *slots, _arrival(first, arrives_s, late_s)), cost_s + first.priority * late_s)


def _arrival(move: RingMove, arrives_s: float, late_s: float) -> Slot:
    return _slot(move.robot, move.to.resource or "", arrives_s, arrives_s, late_s)


def _slot(robot: str, resource: str, start_s: float, end_s: float, wait_s: float) -> Slot:
    start_at, end_at = moment(start_s), moment(end_s)
    return Slot(robot=robot, resource=resource, start_at=start_at, end_at=end_at, wait_s=round(wait_s, 3))


def _advice(slots: tuple[Slot, ...], cost_s: float) -> Recommendation:
    return Recommendation(slots=slots, cost_s=round(cost_s, 3), bound_s=0.0, proven_optimal=False)
