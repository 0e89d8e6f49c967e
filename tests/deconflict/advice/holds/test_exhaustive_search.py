"""The cheapest plan by search, compared with all plans there are."""

from itertools import product
from random import Random

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from deconflict.advice.holds.exhaustive_search import NO_PLAN, UNKNOWN, HoldChoice, cheapest_plan, plan_in_order

BUDGET = 1 << 60
STEPS = 3


@st.composite
def choices(draw: st.DrawFn) -> HoldChoice:
    robots = draw(st.integers(1, 5))

    def each(low: int, high: int) -> np.ndarray:
        return np.array(draw(st.lists(st.integers(low, high), min_size=robots, max_size=robots)), np.int64)

    every = [(a, b) for a in range(robots) for b in range(a + 1, robots)]
    pairs = draw(st.permutations(every).map(lambda some: some[: draw(st.integers(0, len(every)))]))
    rows = st.lists(st.booleans(), min_size=2 * STEPS + 1, max_size=2 * STEPS + 1)
    allowed = np.array([draw(rows) for _ in pairs], bool).reshape(-1, 2 * STEPS + 1)
    return HoldChoice(
        each(0, STEPS),
        each(1, 2),
        each(1, 3),
        each(1, 3),
        each(0, 2),
        np.array(pairs, np.int64).reshape(-1, 2),
        allowed,
    )


def fits(choice: HoldChoice, plan: tuple[int, ...]) -> bool:
    """Whether those that have a hold in `plan`, the last of all robots, keep apart."""
    first = len(choice.longest) - len(plan)
    return all(
        choice.allowed[row, plan[a - first] - plan[b - first] + STEPS]
        for row, (a, b) in enumerate(choice.pairs.tolist())
        if a >= first and b < first + len(plan)
    )


def score(choice: HoldChoice, plan: tuple[int, ...]) -> int:
    return sum(
        step * number + held * (number > 0) for step, held, number in zip(choice.step, choice.held, plan, strict=True)
    )


def plans(choice: HoldChoice, budget: int) -> list[tuple[int, tuple[int, ...]]]:
    """The score of each plan, the lowest and then the first in order before others."""
    limits = zip(choice.shortest.tolist(), choice.longest.tolist(), strict=True)
    every = product(*((0, *range(shortest, longest + 1)) for shortest, longest in limits))
    within = (plan for plan in every if fits(choice, plan) and sum(np.multiply(choice.weight, plan)) <= budget)
    return sorted((score(choice, plan), plan) for plan in within)


def tries(choice: HoldChoice, budget: int) -> int:
    """How many holds are tried if none is skipped."""
    robots, tried, rest = len(choice.longest), 0, [0] * (len(choice.longest) + 1)
    middle, best = choice.allowed.shape[1] // 2, None

    def goes_on(first: int, before: list[int], cost: int, count: int) -> None:
        nonlocal tried, best
        robot = first + len(before)
        for hold in range(choice.longest[robot] + 2):
            tried += 1
            costs = cost + choice.weight[robot] * hold
            counts = count + choice.step[robot] * hold + choice.held[robot] * (hold > 0)
            if (
                hold > choice.longest[robot]
                or costs > budget
                or (best is not None and counts + rest[robot + 1] >= best)
            ):
                return
            held = dict(enumerate([*before, hold], first))
            if not 0 < hold < choice.shortest[robot] and all(
                choice.allowed[row, held[a] - held[b] + middle]
                for row, (a, b) in enumerate(choice.pairs.tolist())
                if a in held and b == robot
            ):
                if robot + 1 == robots:
                    best = counts
                else:
                    goes_on(first, [*before, hold], costs, counts)

    for first in reversed(range(robots)):
        best = None
        goes_on(first, [], 0, 0)
        if best is None:
            break
        rest[first] = best
    return tried


@given(choices(), st.sampled_from([0, 3, BUDGET]))
def test_the_search_finds_the_first_of_the_cheapest_plans(choice: HoldChoice, budget: int) -> None:
    every = plans(choice, budget)
    count, holds = cheapest_plan(choice, budget)
    assert (count, tuple(holds)) == every[0] if every else count == NO_PLAN


@given(choices(), st.sampled_from([0, 3, BUDGET]))
def test_skipped_holds_count_as_tried(choice: HoldChoice, budget: int) -> None:
    most = tries(choice, budget)
    assert cheapest_plan(choice, budget, most)[0] != UNKNOWN
    assert cheapest_plan(choice, budget, most - 1)[0] == UNKNOWN


@given(choices(), st.randoms())
def test_each_robot_waits_for_those_before_it_in_order(choice: HoldChoice, random: Random) -> None:
    order = random.sample(range(len(choice.longest)), len(choice.longest))
    plan: dict[int, int] = {}
    for robot in order:
        for hold in range(choice.longest[robot] + 1):
            if 0 < hold < choice.shortest[robot]:
                continue
            held = plan | {robot: hold}
            met = [choice.pairs[row].tolist() for row in range(len(choice.pairs))]
            rows = [row for row, pair in enumerate(met) if held.keys() >= set(pair)]
            if all(choice.allowed[row, held[met[row][0]] - held[met[row][1]] + STEPS] for row in rows):
                plan = held
                break
    waits = len(plan) == len(order)
    assert plan_in_order(choice, order) == ([plan[robot] for robot in sorted(plan)] if waits else None)
