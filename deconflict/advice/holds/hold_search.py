"""The best plan of holds for a group of conflicts: a few robots by trying, others by CP-SAT."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from deconflict.advice.holds.exhaustive_search import NO_PLAN, UNKNOWN, HoldChoice, cheapest_plan, plan_in_order
from deconflict.advice.holds.hold_problem import HoldProblem, Plan
from deconflict.advice.holds.hold_windows import SHORTEST_STEPS
from deconflict.advice.solver import new_model, solve
from ingest.batch import Bools, Ints

if TYPE_CHECKING:
    from ortools.sat.python import cp_model

NO_BUDGET = 1 << 60
"""Above the cost of any plan."""


class FoundPlan(NamedTuple):
    """A plan, and how good it is."""

    plan: Plan
    bound: int
    """No plan costs less."""
    proven: bool
    """Whether no plan is better."""


@dataclass(slots=True)
class HoldSearch:
    """Finds holds: a whole number of steps each, the difference of each pair among those allowed.

    The cheapest plan; of these the one that holds fewest robots, then the one that holds the least burdened vendors.
    """

    problem: HoldProblem
    ranks: Mapping[str, int]
    """By vendor, its rank by burden: the more it waited before, the less its robots should wait."""
    standing: frozenset[str]
    """Robots that are held by the advice they have now."""
    effort: float
    """Of the solver; see `solve`."""
    switch: int
    """Added to the cost of each newly held robot, if others are held by the advice they have now."""

    def best(self) -> tuple[FoundPlan, Plan | None] | None:
        """The best plan, and the one by first come, first served if there is one; None if there is no plan at all.

        The best plan costs no more than the one by first come, first served.
        """
        robots = self.problem.robots()
        choice = self._choice(robots)
        first_come = self._first_come(choice, robots)
        found = self._cheapest(choice, robots, first_come)
        return None if found is None else (found, first_come)

    def _first_come(self, choice: HoldChoice, robots: list[str]) -> Plan | None:
        """The plan in which each robot waits for those with an earlier contact; None if one then has no hold."""
        contact_s: dict[str, float] = {}
        for pair, at_s in self.problem.without_holds_s.items():
            for robot in pair:
                contact_s[robot] = min(at_s, contact_s.get(robot, inf))

        def rank(row: int) -> tuple[bool, float]:
            return self.problem.planned[robots[row]].holdable, contact_s.get(robots[row], 0.0)

        holds = plan_in_order(choice, sorted(range(len(robots)), key=rank))
        return None if holds is None else dict(zip(robots, holds, strict=True))

    def _cheapest(self, choice: HoldChoice, robots: list[str], first_come: Plan | None) -> FoundPlan | None:
        score, holds = cheapest_plan(choice, NO_BUDGET if first_come is None else self.problem.cost(first_come))
        if score == UNKNOWN:
            return self._solved(first_come)
        if score == NO_PLAN:
            return None
        plan = dict(zip(robots, holds, strict=True))
        cost = bound = self.problem.cost(plan)
        if self.standing:
            bound, _ = cheapest_plan(choice._replace(step=choice.weight, held=np.zeros_like(choice.held)), cost)
            bound = 0 if bound == UNKNOWN else bound
        return FoundPlan(plan, bound, bound == cost)

    def _solved(self, hint: Plan | None) -> FoundPlan | None:
        """By CP-SAT in two steps: the cheapest plan, then the fairest of these."""
        model, holds = hold_model(self.problem, self.problem.robots())
        held = {robot: model.new_bool_var(f"{robot} held") for robot in holds}
        for robot, hold in holds.items():
            model.add(hold == 0).only_enforce_if(~held[robot])
            if hint is not None:
                model.add_hint(hold, hint.get(robot, 0))
        cost = sum(self.problem.weight(robot) * hold for robot, hold in holds.items())
        change = sum(self._change(robot) * held[robot] for robot in holds)
        if hint is not None:
            model.add(cost <= self.problem.cost(hint))
        model.minimize(cost + change)
        solved = solve(model, self.effort, presolve=False)
        if not solved.found:
            return None if hint is None or solved.proven else FoundPlan(hint, 0, proven=False)
        best = {robot: solved.solver.value(hold) for robot, hold in holds.items()}
        proven = solved.proven and not self.standing
        model.add(cost + change <= round(solved.solver.objective_value))
        model.clear_objective()  # type: ignore[no-untyped-call]
        rank = {robot: self.ranks[self.problem.planned[robot].vendor] for robot in holds}
        most = 1 + sum(rank.values()) * self.problem.window.steps
        waits = sum(rank[robot] * hold for robot, hold in holds.items())
        model.minimize(sum(most * held[robot] for robot in holds) + waits)
        fairer = solve(model, self.effort, presolve=False)
        if fairer.found:
            best = {robot: fairer.solver.value(hold) for robot, hold in holds.items()}
        bound = self.problem.cost(best) if proven else max(int(solved.bound), 0)
        return FoundPlan(best, min(bound, self.problem.cost(best)), proven)

    def _choice(self, robots: list[str]) -> HoldChoice:
        """Scores count costs first, then the number of held robots, then the waits of the burdened."""
        weights = [self.problem.weight(robot) for robot in robots]
        ranks = [self.ranks[self.problem.planned[robot].vendor] for robot in robots]
        most = 1 + sum(ranks) * self.problem.window.steps
        after = most * (1 + len(robots))
        steps = [after * weight + rank for weight, rank in zip(weights, ranks, strict=True)]
        changes = [after * self._change(robot) + most for robot in robots]
        longest, pairs, allowed = hold_constraints(self.problem, robots)
        weight, step, held = np.array([weights, steps, changes], np.int64)
        return HoldChoice(longest, np.full_like(longest, SHORTEST_STEPS), weight, step, held, pairs, allowed)

    def _change(self, robot: str) -> int:
        """What holding a robot adds to its cost if it is not held by the advice it has now."""
        return self.switch if self.standing and robot not in self.standing else 0


def hold_constraints(problem: HoldProblem, robots: Sequence[str]) -> tuple[Ints, Ints, Bools]:
    """`HoldChoice.longest`, `pairs` and `allowed` of some robots."""
    steps, row_of = problem.window.steps, {robot: row for row, robot in enumerate(robots)}
    pairs = [pair for pair in problem.allowed if pair[0] in row_of and pair[1] in row_of]
    allowed = np.array([problem.allowed[pair] for pair in pairs], bool).reshape(-1, 2 * steps + 1)
    longest = np.array([steps * problem.planned[robot].holdable for robot in robots], np.int64)
    return longest, np.array([(row_of[a], row_of[b]) for a, b in pairs], np.int64).reshape(-1, 2), allowed


def hold_model(problem: HoldProblem, robots: Sequence[str]) -> "tuple[cp_model.CpModel, dict[str, cp_model.IntVar]]":
    """The holds of some robots as variables, and every constraint between them."""
    from ortools.sat.python import cp_model  # noqa: PLC0415 - brings pandas

    model, steps = new_model(), problem.window.steps
    held, free = (cp_model.Domain.from_values(values) for values in ([0, *range(SHORTEST_STEPS, steps + 1)], [0]))
    holds = {
        robot: model.new_int_var_from_domain(held if problem.planned[robot].holdable else free, robot)
        for robot in robots
    }
    for (a, b), allowed in problem.allowed.items():
        if a in holds and b in holds:
            differences = (np.flatnonzero(allowed) - steps).tolist()
            model.add_linear_expression_in_domain(holds[a] - holds[b], cp_model.Domain.from_values(differences))
    return model, holds
