"""What ends a ring where no order of waiting does: one robot goes elsewhere first, or backs out of a lane."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import hypot
from operator import itemgetter

from deconflict.advisory import Recommendation, Slot, moment
from deconflict.contention.robots.destinations import Stop
from deconflict.contention.robots.place_geometry import CHANGEOVER_S
from deconflict.contention.robots.robot_view import Seen
from deconflict.contention.waiting.deadlocks import Link

PACE_MPS = 1.0
"""At which robots are taken to drive from place to place, in a straight line."""
CLEAR_S = 2.0
"""From when a robot sets out until the next one may set out for its place."""


@dataclass(frozen=True, slots=True)
class Refuge:
    """A free place that nobody wants."""

    resource: str
    datum: str
    x_m: float
    y_m: float


@dataclass(frozen=True, slots=True)
class Move:
    """One robot of a ring, as it means to go on."""

    robot: str
    at: tuple[float, float]
    to: Stop
    leaves_s: float
    priority: float

    @property
    def way_s(self) -> float:
        return hypot(self.to.x_m - self.at[0], self.to.y_m - self.at[1]) / PACE_MPS


def detour(
    ring: Sequence[Link],
    robots: Mapping[str, Seen],
    refuges: Sequence[Refuge],
    now_s: float,
    priority: Callable[[str], float],
    standing: Recommendation | None = None,
    switch_s: float = 2.0,
) -> Recommendation | None:
    """The cheapest way in which one robot goes to a refuge and the others go on one after the other, then itself.

    The cost is how much later than they mean to they all come to what they want, weighted by priority. What `standing`
    sent somewhere is sent there again, unless another saves `switch_s`. None where the ring is of more than places,
    or nothing is free.
    """
    moves = _moves(ring, robots, now_s, priority)
    if not moves:
        return None
    datum = robots[ring[0].waiter].datum
    plans = [
        _plan([*moves[row::-1], *moves[:row:-1]], refuge)
        for row in range(len(moves))
        for refuge in refuges
        if refuge.datum == datum
    ]
    if not plans:
        return None
    best = min(plans, key=lambda one: (one.cost_s, _sent(one)))
    kept = [one for one in plans if standing and standing.slots and _sent(one) == _sent(standing)]
    return kept[0] if kept and kept[0].cost_s <= best.cost_s + switch_s else best


def back_out(
    ring: Sequence[Link], robots: Mapping[str, Seen], lane_m: float, now_s: float, priority: Callable[[str], float]
) -> tuple[Recommendation, str, float]:
    """Of two in a lane towards each other, the one for which it costs least backs out and comes again; who, how far.

    It waits before the lane until the other one is out of it, and then has the way back to go.
    """
    plans = []
    for link in ring:
        one, other = robots[link.waiter], robots[link.holder]
        back_m, other_m = (_depth_m(each, link.where, lane_m, now_s) for each in (one, other))
        out_s = max(lane_m + other.length_m - other_m, back_m) / PACE_MPS
        starts_s = now_s + out_s + CHANGEOVER_S
        cost_s = priority(one.uuid) * (starts_s - now_s + back_m / PACE_MPS)
        first = Slot(
            robot=other.uuid,
            resource=link.where,
            start_at=moment(now_s),
            end_at=moment(now_s + out_s),
            wait_s=0.0,
        )
        second = first.model_copy(
            update={"robot": one.uuid, "wait_s": round(starts_s - now_s, 3), "start_at": moment(starts_s)}
        )
        second = second.model_copy(update={"end_at": moment(starts_s + lane_m / PACE_MPS)})
        advice = Recommendation(
            slots=(first, second),
            cost_s=round(cost_s, 3),
            bound_s=0.0,
            proven_optimal=False,
        )
        plans.append((cost_s, one.uuid, back_m, advice))
    _, robot, back_m, advice = min(plans, key=itemgetter(0, 1))
    return advice, robot, back_m


def _depth_m(one: Seen, lane: str, lane_m: float, now_s: float) -> float:
    """How far its back has to go until its front is out where it came in."""
    passage = one.passages[lane]
    along_m = passage.at_m(now_s)
    return max((along_m if passage.direction > 0 else lane_m - along_m) + one.length_m / 2, 0.0)


def _sent(advice: Recommendation) -> tuple[str, str]:
    """Who goes where first."""
    return advice.slots[0].robot, advice.slots[0].resource


def _moves(
    ring: Sequence[Link], robots: Mapping[str, Seen], now_s: float, priority: Callable[[str], float]
) -> list[Move]:
    """In the order of the ring; empty where somebody waits for more than the place that the next one has now."""
    moves = []
    for link in ring:
        one, holder = robots[link.waiter], robots[link.holder]
        if not one.stops or one.stops[0].resource != link.where or holder.here != link.where:
            return []
        to = one.stops[0]
        away_s = hypot(to.x_m - one.x_m, to.y_m - one.y_m) / PACE_MPS
        moves.append(Move(one.uuid, (one.x_m, one.y_m), to, max(to.t_s - away_s, now_s), priority(one.uuid)))
    return moves


def _plan(chain: Sequence[Move], refuge: Refuge) -> Recommendation:
    """The first of a chain goes to the refuge; each of the others wants the place of the one before it."""
    first, *others = chain
    at_refuge_s = first.leaves_s + hypot(refuge.x_m - first.at[0], refuge.y_m - first.at[1]) / PACE_MPS
    left_s, cost_s, slots = first.leaves_s, 0.0, []
    for move in others:
        leaves_s = max(move.leaves_s, left_s + CLEAR_S)
        late_s = leaves_s - move.leaves_s
        slots.append(_slot(move, leaves_s + move.way_s, late_s))
        cost_s, left_s = cost_s + move.priority * late_s, leaves_s
    goes_on_s = max(at_refuge_s, left_s + CLEAR_S)
    arrives_s = goes_on_s + hypot(first.to.x_m - refuge.x_m, first.to.y_m - refuge.y_m) / PACE_MPS
    late_s = max(arrives_s - first.leaves_s - first.way_s, 0.0)
    stay = Slot(
        robot=first.robot,
        resource=refuge.resource,
        start_at=moment(at_refuge_s),
        end_at=moment(goes_on_s),
        wait_s=0.0,
    )
    return Recommendation(
        slots=(stay, *slots, _slot(first, arrives_s, late_s)),
        cost_s=round(cost_s + first.priority * late_s, 3),
        bound_s=0.0,
        proven_optimal=False,
    )


def _slot(move: Move, arrives_s: float, late_s: float) -> Slot:
    at = moment(arrives_s)
    return Slot(robot=move.robot, resource=move.to.resource or "", start_at=at, end_at=at, wait_s=round(late_s, 3))
