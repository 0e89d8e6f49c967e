"""Waiting as an action: holds that are long enough for people to pass on."""

from collections.abc import Iterator

from deconflict.advice.actions.person_times import SHORTEST_WAIT_S
from deconflict.advice.holds.hold_problem import Plan
from deconflict.advice.holds.hold_windows import STEP_S
from deconflict.advice.holds.plan_parts import PlanParts
from deconflict_client.advisory import Action
from ingest.batch import Pair

STEPS_A_SECOND = round(1 / STEP_S)
SHORTEST_STEPS = round(SHORTEST_WAIT_S / STEP_S)


def waits(parts: PlanParts, pair: Pair, holds: Plan) -> tuple[Action, ...]:
    """Who of a pair waits, and those that have to wait because of them; then who goes first.

    Empty if the holds are too short for people, and longer ones do not keep the pair apart.
    """
    long = _long_enough(parts, pair, holds)
    if not long:
        return ()
    name_of = {robot: parts.plan.problem.planned[robot].name for robot in {*pair, *long}}
    own = [robot for robot in pair if robot in long]
    others = sorted(long.keys() - set(own))
    first = [robot for robot in pair if robot not in long]
    because = f"it would come too near to {name_of[own[0]]} otherwise" if own else ""
    return (
        *(Action(robot=robot, name=name_of[robot], action="wait", seconds=long[robot] * STEP_S) for robot in own),
        *(
            Action(robot=robot, name=name_of[robot], action="wait", seconds=long[robot] * STEP_S, reason=because)
            for robot in others
        ),
        *(
            Action(robot=robot, name=name_of[robot], action="go_first", reason=f"{name_of[own[0]]} waits for it")
            for robot in first
            if own
        ),
    )


def _long_enough(parts: PlanParts, pair: Pair, holds: Plan) -> Plan:
    """Holds of which none is too short for people, and which are proven; none if there are none."""
    return next((plan for plan in _longer(parts, pair, holds) if plan == holds or parts.is_kept_apart(pair, plan)), {})


def _longer(parts: PlanParts, pair: Pair, holds: Plan) -> Iterator[Plan]:
    """The holds in whole seconds, the short ones made longer; the holds as they are; for one robot also the shortest
    hold that is long enough.

    They hold nobody else: a machine may follow the holds of the same advice.
    """
    problem = parts.plan.problem
    longer = {robot: max(hold + hold % STEPS_A_SECOND, SHORTEST_STEPS) for robot, hold in holds.items()}
    if max(longer.values()) <= problem.window.steps:
        yield longer
    if min(holds.values()) >= SHORTEST_STEPS:
        yield holds
    if len(holds) == 1 and pair in problem.allowed:
        sign = 1 if pair[0] in holds else -1
        steps = sign * (problem.allowed[pair].nonzero()[0] - problem.window.steps)
        long_enough = steps[steps > SHORTEST_STEPS]
        if len(long_enough):
            yield dict.fromkeys(holds, int(long_enough.min()))
