"""The plan that the solver finds, compared with all plans there are."""

from itertools import product
from math import inf
from random import Random
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from deconflict.advice.holds import hold_search
from deconflict.advice.holds.hold_problem import HoldProblem, Plan, PlannedRobots
from deconflict.advice.holds.hold_search import MOST_TRIED, FoundPlan, HoldSearch
from deconflict.advice.holds.hold_windows import SHORTEST_STEPS, STEP_S, DelayWindows, HoldWindow
from deconflict.advice.priorities import WEIGHT
from ingest.batch import Bools, Pair
from tests.deconflict.advice.made_near import SeenRobot, eastward, near
from tests.helpers.made_encounters import NOW_S

STEPS, EFFORT = 4, 1.0
RANKS = {"acme": 0, "bolt": 1, "cord": 2}
WINDOW = HoldWindow(NOW_S, 10.0, 0.3, STEPS * STEP_S)


class Score(NamedTuple):
    """What plans are chosen by; the lowest is best."""

    cost: float
    held: int
    burden: int


def seen_robot(name: str, vendor: str = "acme", *, holdable: bool = True, priority: float = 1.0) -> SeenRobot:
    return eastward(name, 0.0)._replace(vendor=vendor, holdable=holdable, priority=priority)


def problem_of(robots: list[SeenRobot], allowed: dict[Pair, Bools], contact_s: dict[Pair, float]) -> HoldProblem:
    """Without a sweep: which differences are allowed is given."""
    floor = near(robots)
    problem = HoldProblem(PlannedRobots(floor), WINDOW, DelayWindows(floor, WINDOW))
    problem.allowed, problem.without_holds_s = allowed, contact_s
    return problem


@st.composite
def searches(draw: st.DrawFn) -> HoldSearch:
    """Any two may meet if nobody or both wait, and keep apart at about two of three other differences."""
    random = Random(draw(st.integers(0, 1 << 32)))
    robots = "abcd"[: random.randint(2, 4)]
    every = [(a, b) for a in robots for b in robots if a < b]
    pairs = random.sample(every, random.randint(1, len(every)))
    seen = [
        seen_robot(
            name,
            random.choice(sorted(RANKS)),
            holdable=random.random() < 0.8,
            priority=random.choice([0.5, 1.0, 1.0, 2.0]),
        )
        for name in robots
    ]
    apart = {pair: [bool(step) and random.random() < 0.65 for step in range(-STEPS, STEPS + 1)] for pair in pairs}
    problem = problem_of(seen, {pair: np.array(row) for pair, row in apart.items()}, contacts_s(pairs, random))
    standing = frozenset(random.sample(robots, random.randint(0, 2)))
    return HoldSearch(problem, RANKS, standing, EFFORT, random.choice([0, WEIGHT, 3 * WEIGHT]))


def contacts_s(pairs: list[Pair], random: Random) -> dict[Pair, float]:
    return {pair: random.uniform(0.0, 9.0) for pair in pairs}


def best(search: HoldSearch, most_tried: int) -> tuple[FoundPlan, Plan | None] | None:
    """By the solver if no plans may be tried."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(hold_search, "MOST_TRIED", most_tried)
        return search.best()


def fits(problem: HoldProblem, plan: Plan) -> bool:
    """Whether those that have a hold in `plan` keep apart."""
    is_apart = all(
        allowed[plan[a] - plan[b] + STEPS] for (a, b), allowed in problem.allowed.items() if a in plan and b in plan
    )
    holdable = (problem.planned[robot].holdable and hold >= SHORTEST_STEPS for robot, hold in plan.items() if hold)
    return is_apart and all(holdable)


def plans(problem: HoldProblem) -> list[Plan]:
    """Every plan there is."""
    robots = problem.robots()
    every = (dict(zip(robots, holds, strict=True)) for holds in product(range(STEPS + 1), repeat=len(robots)))
    return [plan for plan in every if fits(problem, plan)]


def score(search: HoldSearch, plan: Plan) -> Score:
    held = [robot for robot, hold in plan.items() if hold]
    newly_held = [robot for robot in held if search.standing and robot not in search.standing]
    burden = sum(RANKS[search.problem.planned[robot].vendor] * plan[robot] for robot in held)
    return Score(search.problem.cost(plan) + search.switch * len(newly_held), len(held), burden)


def in_turn(problem: HoldProblem) -> Plan | None:
    """By first come, first served: those that can't be held come first."""
    first_s = {
        robot: min(at_s for pair, at_s in problem.without_holds_s.items() if robot in pair)
        for robot in problem.robots()
    }
    plan: Plan = {}
    for robot in sorted(first_s, key=lambda robot: (problem.planned[robot].holdable, first_s[robot])):
        holds = [hold for hold in range(STEPS + 1) if fits(problem, plan | {robot: hold})]
        if not holds:
            return None
        plan[robot] = holds[0]
    return plan


@settings(max_examples=150, deadline=None)
@given(searches(), st.sampled_from([0, MOST_TRIED]))
def test_the_plan_is_the_best_of_all_that_cost_no_more_than_first_come_first_served(
    search: HoldSearch, most_tried: int
) -> None:
    problem, every, first_come = search.problem, plans(search.problem), in_turn(search.problem)
    found = best(search, most_tried)
    if not every:
        assert found is None
        return
    assert found is not None
    assert found[1] == first_come
    most = inf if first_come is None else problem.cost(first_come)
    assert score(search, found[0].plan) == min(score(search, plan) for plan in every if problem.cost(plan) <= most)
    assert fits(problem, found[0].plan)
    assert found[0].bound == min(map(problem.cost, every))


def test_without_effort_the_plan_is_first_come_first_served_and_nothing_is_proven() -> None:
    apart = np.abs(np.arange(-STEPS, STEPS + 1)) >= SHORTEST_STEPS
    pairs: list[Pair] = [("a", "b"), ("a", "c"), ("b", "c")]
    contact_s = dict(zip(pairs, (1.0, 1.0, 2.0), strict=True))
    problem = problem_of(list(map(seen_robot, "abc")), dict.fromkeys(pairs, apart), contact_s)
    first_come = {"a": 0, "b": 2, "c": 4}
    found = best(HoldSearch(problem, RANKS, frozenset(), 1e-9, 0), 0)
    assert found == (FoundPlan(first_come, 0), first_come)
