"""Advice that stands: it is proven again before other advice takes its place, and a change says why."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from math import ceil
from typing import NamedTuple

from deconflict.advice.document_limits import listed
from deconflict.advice.holds.hold_planner import HoldPlan
from deconflict.advice.holds.hold_problem import HoldProblem, Plan
from deconflict.advice.holds.hold_search import FoundPlan
from deconflict.advice.holds.hold_windows import STEP_S
from deconflict.advice.priorities import WEIGHT
from deconflict_client.advisory import Recommendation
from ingest.batch import Pair

DONE = "the waiting that was advised is over"


class Decision(NamedTuple):
    """The plan to give advice by."""

    plan: HoldPlan
    stands: bool
    """Whether it is the plan of the standing advice."""
    because: str = ""
    """Why standing advice does not stand; empty if there was none."""


class StandingHold(NamedTuple):
    """A hold that was advised before, in steps."""

    whole: int
    left: int
    given_s: float


NO_HOLD = StandingHold(0, 0, 0.0)


def decide(
    plan: HoldPlan, conflicts: Collection[Pair], standing: Mapping[Pair, Recommendation], switch_s: float
) -> Decision:
    """The plan of the `standing` advice on `conflicts` if it still works, else the newest `plan`.

    A robot that stands carries its hold out. One that still drives may begin to wait now, for the rest of its time or
    for the whole of it: people take a while. The standing plan is beaten if the newest saves more than `switch_s`.
    """
    holds = _standing_holds(standing, plan.problem)
    if not holds:
        return Decision(plan, stands=False)
    planned = plan.problem.planned
    driving = {robot: hold for robot, hold in holds.items() if planned[robot].holdable}
    waiting = [robot for robot in driving if planned[robot].waited_s < holds[robot].given_s]
    if not waiting and all(hold.left <= 0 for hold in holds.values()):
        return Decision(plan, stands=False, because=DONE)
    refused = ""
    for candidate in _candidates(driving, plan.problem.window.steps):
        refusal = _refusal(plan, conflicts, candidate, list(holds))
        if refusal is None:
            return _unless_beaten(plan, candidate, switch_s)
        refused = refused or refusal
    return Decision(plan, stands=False, because=refused)


def _standing_holds(standing: Mapping[Pair, Recommendation], problem: HoldProblem) -> dict[str, StandingHold]:
    """By robot that is still near, its longest hold."""
    holds: dict[str, StandingHold] = {}
    for advice in standing.values():
        given_s = advice.given_at.timestamp() if advice.given_at else problem.window.start_s
        for hold in advice.holds:
            whole, left = ceil(hold.hold_s / STEP_S), ceil((given_s + hold.hold_s - problem.window.start_s) / STEP_S)
            holds[hold.robot] = max(StandingHold(whole, left, given_s), holds.get(hold.robot, NO_HOLD))
    return {robot: hold for robot, hold in holds.items() if robot in problem.planned.present}


def _candidates(driving: Mapping[str, StandingHold], most: int) -> Iterator[Plan]:
    """The holds that robots which still drive would have to begin, none longer than `most`."""
    yield {robot: min(hold.left, most) for robot, hold in driving.items() if hold.left > 0}
    if any(hold.left < hold.whole for hold in driving.values()):
        yield {robot: min(hold.whole, most) for robot, hold in driving.items()}


def _refusal(plan: HoldPlan, conflicts: Collection[Pair], holds: Plan, held: Sequence[str]) -> str | None:
    """Why holds no longer work; None if they do."""
    problem, held_s = plan.problem, {robot: hold * STEP_S for robot, hold in holds.items()}
    found = problem.delays.contacts_s(held_s, {*holds, *(robot for pair in conflicts for robot in pair)})
    together = problem.pairs_together()
    for pair in sorted({*found, *conflicts}):
        meets = pair in found or (pair in problem.allowed and not problem.keeps_apart(pair, holds))
        is_new = pair not in together and not holds.keys().isdisjoint(pair)
        if meets and pair not in plan.unplanned and (pair in conflicts or is_new):
            a, b, *names = (problem.planned[robot].name for robot in (*pair, *held))
            return f"{a} and {b} would meet even if {listed(names)} waited as advised"
    return None


def _unless_beaten(plan: HoldPlan, holds: Plan, switch_s: float) -> Decision:
    problem, found = plan.problem, plan.found
    saved_s = (problem.cost(holds) - problem.cost(found.plan)) * STEP_S / WEIGHT
    if saved_s > switch_s and (found.plan or not plan.unplanned):
        return Decision(plan, stands=False, because=f"other advice saves {saved_s:.0f} s")
    standing = FoundPlan(holds, min(found.bound, problem.cost(holds)))
    return Decision(plan._replace(found=standing), stands=True)
