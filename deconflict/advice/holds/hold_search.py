"""The best plan of holds for a group of conflicts: of all plans if there are few, else by CP-SAT.

Most groups are of two or three robots. At 1,000 robots CP-SAT alone would add a sixth to the engine's processor time.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from math import inf, prod
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from deconflict.advice.holds.hold_problem import HoldProblem, Plan
from deconflict.advice.holds.hold_windows import SHORTEST_STEPS
from deconflict.advice.solver import new_model, solve
from ingest.batch import Bools

if TYPE_CHECKING:
    from ortools.sat.python import cp_model

MOST_TRIED = 4_000
"""From so many plans on, the solver is as fast. A robot that can't be held counts as one with two holds."""
HIGHEST_SCORE = 1 << 62
"""Above the score of any plan."""


class FoundPlan(NamedTuple):
    """A plan, and how good it is."""

    plan: Plan
    bound: int
    """No plan costs less."""


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
        first_come = self._first_come()
        found = self._found(first_come)
        return None if found is None else (found, first_come)

    def _first_come(self) -> Plan | None:
        """The plan in which each robot waits for those with an earlier contact; None if one then has no hold."""
        contact_s: dict[str, float] = {}
        for pair, at_s in self.problem.without_holds_s.items():
            for robot in pair:
                contact_s[robot] = min(at_s, contact_s.get(robot, inf))

        def rank(robot: str) -> tuple[bool, float]:
            return self.problem.planned[robot].holdable, contact_s.get(robot, 0.0)

        plan: Plan = {}
        for robot in sorted(self.problem.robots(), key=rank):
            works = self._working_holds(robot, plan)
            if not works.any():
                return None
            plan[robot] = int(works.argmax())
        return plan

    def _working_holds(self, robot: str, plan: Plan) -> Bools:
        """(steps + 1,) whether each hold keeps a robot apart from those that have a hold in `plan`."""
        steps = self.problem.window.steps
        works = np.full(steps + 1, self.problem.planned[robot].holdable)
        works[:SHORTEST_STEPS] = False
        works[0] = True
        for (a, b), allowed in self.problem.allowed.items():
            if a == robot and b in plan:
                works &= allowed[steps - plan[b] :][: steps + 1]
            elif b == robot and a in plan:
                works &= allowed[plan[a] :][: steps + 1][::-1]
        return works

    def _found(self, first_come: Plan | None) -> FoundPlan | None:
        """The best plan; `first_come` if there is no effort left to find one, None if there is none either."""
        problem, most = self.problem, inf if first_come is None else self.problem.cost(first_come)
        choices: dict[str, list[int]] = {}
        for robot in problem.robots():
            longest = problem.window.steps if problem.planned[robot].holdable else 0
            choices[robot] = [0, *range(SHORTEST_STEPS, int(min(longest, most // problem.weight(robot))) + 1)]
        if prod(max(len(holds), 2) for holds in choices.values()) <= MOST_TRIED:
            return self._tried(choices, most)
        return self._solved(first_come)

    def _tried(self, choices: Mapping[str, Sequence[int]], most: float) -> FoundPlan | None:
        """The best of all plans of these holds that cost at most `most`, the first of several; None if there is none.

        There is an axis for each robot.
        """
        axes = np.meshgrid(*choices.values(), indexing="ij", sparse=True)
        holds, middle = dict(zip(choices, axes, strict=True)), self.problem.window.steps
        cost = self._cost(holds)
        works = cost <= most
        for (a, b), allowed in self.problem.allowed.items():
            works &= allowed[holds[a] - holds[b] + middle]
        if not works.any():
            return None
        scores = np.where(works, self._score(holds, {robot: hold > 0 for robot, hold in holds.items()}), HIGHEST_SCORE)
        best = np.unravel_index(scores.argmin(), scores.shape)
        plan = {robot: choices[robot][int(at)] for robot, at in zip(choices, best, strict=True)}
        return FoundPlan(plan, int(cost[works].min()))

    def _solved(self, first_come: Plan | None) -> FoundPlan | None:
        """By CP-SAT."""
        model, holds = hold_model(self.problem, self.problem.robots())
        held = {robot: model.new_bool_var(f"{robot} held") for robot in holds}
        for robot, hold in holds.items():
            model.add(hold == 0).only_enforce_if(~held[robot])
        cost = self._cost(holds)
        if first_come is not None:
            model.add(cost <= self.problem.cost(first_come))
        model.minimize(self._score(holds, held))
        solved = solve(model, self.effort, presolve=False)
        if not solved.found:
            return None if first_come is None else FoundPlan(first_come, 0)
        plan, bound = {robot: solved.solver.value(hold) for robot, hold in holds.items()}, solved.bound
        if self.standing:
            model.minimize(cost)
            bound = solve(model, self.effort, presolve=False).bound
        else:
            bound /= self._scores(plan)[1]
        return FoundPlan(plan, max(int(bound + 1e-6), 0))

    def _cost(self, holds: Mapping[str, Any]) -> Any:
        """The cost of holds, which are numbers, arrays or variables; see `HoldProblem.cost`."""
        return sum(self.problem.weight(robot) * hold for robot, hold in holds.items())

    def _scores(self, robots: Collection[str]) -> tuple[int, int]:
        """The score of holding one robot, and of one unit of cost: each is above any score of what counts less."""
        ranks = sum(self.ranks[self.problem.planned[robot].vendor] for robot in robots)
        held = 1 + ranks * self.problem.window.steps
        return held, held * (1 + len(robots))

    def _score(self, holds: Mapping[str, Any], held: Mapping[str, Any]) -> Any:
        """The best plan has the lowest. It counts the cost, then the held robots, then the waits of the burdened."""
        of_held, of_cost = self._scores(holds)
        changes = sum((of_cost * self._change(robot) + of_held) * is_held for robot, is_held in held.items())
        waits = sum(self.ranks[self.problem.planned[robot].vendor] * hold for robot, hold in holds.items())
        return of_cost * self._cost(holds) + changes + waits

    def _change(self, robot: str) -> int:
        """What holding a robot adds to its cost if it is not held by the advice it has now."""
        return self.switch if self.standing and robot not in self.standing else 0


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
