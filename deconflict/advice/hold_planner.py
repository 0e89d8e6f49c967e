"""Holds: which robots should wait where they are, and how long, so that a whole group of conflicts is cleared."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf

import numpy as np
from ortools.sat.python import cp_model

from deconflict.advice.delay_windows import STEP_S, Delays, Mover, Near, Window
from deconflict.advice.exhaustive_search import NONE, UNKNOWN, Choice, in_turn, least
from deconflict.advice.solver import Model, solve
from deconflict.advice.variable_elimination import folded
from deconflict.advisory import Hold, Recommendation
from ingest.batch import Bools, Ints, Pair

EFFORT = 0.1
SWITCH_S = 2.0
WEIGHT = 100
"""Priorities count in hundredths."""
_DEAREST = 1 << 60
ROUNDS = 8
"""So often a plan may turn out to bring others together before no hold is advised."""

Plan = dict[str, int]
"""Robot to its hold, in `STEP_S`."""


class Movers(dict[str, Mover]):
    """Those of the robots near each other that were asked for, by UUID: most never are."""

    def __init__(self, near: Near) -> None:
        self._near = near

    def __missing__(self, robot: str) -> Mover:
        mover = self[robot] = self._near.mover(self._near.uuids.index(robot))
        return mover


@dataclass(slots=True)
class Problem:
    """A connected group of conflicts, and the differences of hold at which each pair keeps apart."""

    movers: Movers
    window: Window
    delays: Delays
    allowed: dict[Pair, Bools] = field(default_factory=dict)
    """(2 steps + 1,) by pair and difference, from the least on."""
    hopeless: list[Pair] = field(default_factory=list)
    """Pairs that no hold keeps apart."""
    without: dict[Pair, float] = field(default_factory=dict)
    """When those first meet of which one is in `allowed`, where nobody is held."""
    _looked_at: set[str] = field(default_factory=set)

    def constrain(self, pairs: Sequence[Pair]) -> None:
        steps = self.window.steps
        for pair, allowed in zip(pairs, self.delays.allowed(pairs) if pairs else (), strict=True):
            first, second = (self.movers[robot].holdable for robot in pair)
            if not first:
                allowed[steps + 1 :] = False
            if not second:
                allowed[:steps] = False
            self._allow(pair, allowed)
        if new := set(self.robots()) - self._looked_at:
            self.without |= self.delays.meetings({}, new)
            self._looked_at |= new

    def forbid(self, pair: Pair, step: int) -> None:
        self.allowed[pair][step + self.window.steps] = False
        self._allow(pair, self.allowed[pair])

    def _allow(self, pair: Pair, allowed: Bools) -> None:
        self.allowed[pair] = allowed
        if not allowed.any():
            del self.allowed[pair]
            self.hopeless.append(pair)

    def robots(self) -> list[str]:
        return sorted({robot for pair in self.allowed for robot in pair})

    def cost(self, plan: Plan) -> int:
        return sum(_weight(self.movers[robot]) * hold for robot, hold in plan.items())


def advise_holds(
    near: Near,
    conflicts: Sequence[Pair],
    window: Window,
    *,
    burdens_s: Mapping[str, float] | None = None,
    standing: Recommendation | None = None,
    effort: float = EFFORT,
    switch_s: float = SWITCH_S,
) -> Recommendation:
    """The holds that clear `conflicts` at the least waiting in all, weighted by priority.

    `near` are the robots of the conflicts and everyone near: no hold may bring anyone together who keeps apart
    without. Of plans that cost the same, the one that holds fewest, then the one that holds the vendors least burdened
    before. To hold a robot that `standing` does not hold must save `switch_s`. Where no hold works, `note` says who
    needs another route.
    """
    problem = Problem(Movers(near), window, Delays(near, window))
    pairs = sorted({(min(pair), max(pair)) for pair in conflicts})
    problem.constrain(pairs)
    ranks, switch = _ranks(burdens_s or {}, near.vendors), round(switch_s / STEP_S * WEIGHT)
    planner = Planner(problem, ranks, _held(standing), effort, switch)
    for _ in range(ROUNDS):
        found = planner.plan()
        if found is None:
            return _no_hold(problem)
        plan, bound, proven, first = found
        made = _made(problem, plan)
        if not made:
            return _recommended(problem, plan, bound, proven, first)
        known = [pair for pair in made if pair in problem.allowed]
        for a, b in known:
            problem.forbid((a, b), plan.get(a, 0) - plan.get(b, 0))
        problem.constrain([pair for pair in made if pair not in known])
    return _no_hold(problem)


def _made(problem: Problem, plan: Plan) -> list[Pair]:
    """The plan swept again: pairs that it was to clear and did not, and pairs that it brings together."""
    if not problem.allowed:
        return []
    held = {robot: hold * STEP_S for robot, hold in plan.items() if hold}
    of = held.keys() | {pair[0] for pair in problem.allowed if held.keys().isdisjoint(pair)}
    found = problem.delays.meetings(held, of) if held else problem.without
    before = problem.without.keys() | set(problem.hopeless)
    return sorted(
        pair for pair in found if pair in problem.allowed or (pair not in before and not held.keys().isdisjoint(pair))
    )


class Planner:
    """Finds holds: a whole number of steps each, every pair's difference among those allowed.

    The cheapest; of those the plan that holds fewest, then the one that holds the least burdened.
    """

    def __init__(
        self, problem: Problem, ranks: Mapping[str, int], standing: frozenset[str], effort: float, switch: int
    ) -> None:
        self.problem, self.ranks, self.effort = problem, ranks, effort
        self.standing, self.switch = standing, switch

    def plan(self) -> tuple[Plan, int, bool, Plan | None] | None:
        """Holds, the bound of their cost, whether that is proven, and what would be first come, first served; None
        where there are none."""
        robots = self.problem.robots()
        if not robots:
            return {}, 0, True, {}
        choice = self._choice(robots)
        first = self._first_come(choice, robots)
        found = self._cheapest(choice, robots, first)
        return found and (*found, first)

    def _cheapest(self, choice: Choice, robots: list[str], first: Plan | None) -> tuple[Plan, int, bool] | None:
        count, holds = least(choice, _DEAREST if first is None else self.problem.cost(first))
        if count == UNKNOWN:
            return self._folded(choice, robots, first)
        if count == NONE:
            return None
        plan = dict(zip(robots, holds, strict=True))
        cost = bound = self.problem.cost(plan)
        if self.standing:
            bound, _ = least(choice._replace(step=choice.weight, held=np.zeros_like(choice.held)), cost)
            bound = 0 if bound == UNKNOWN else bound
        return plan, bound, bound == cost

    def _first_come(self, choice: Choice, robots: list[str]) -> Plan | None:
        """In the order of their first meetings each waits for those before it; None where one then has no hold."""
        met_s: dict[str, float] = {}
        for pair, at_s in self.problem.without.items():
            for robot in pair:
                met_s[robot] = min(at_s, met_s.get(robot, inf))
        movers = self.problem.movers
        order = sorted(range(len(robots)), key=lambda row: (movers[robots[row]].holdable, met_s.get(robots[row], 0.0)))
        holds = in_turn(choice, order)
        return None if holds is None else dict(zip(robots, holds, strict=True))

    def _folded(self, choice: Choice, robots: list[str], hint: Plan | None) -> tuple[Plan, int, bool] | None:
        """What trying takes too long for: folded up where that leaves one plan, else what CP-SAT finds."""
        count, holds = folded(choice)
        if count == NONE:
            return None
        plan = dict(zip(robots, holds, strict=True)) if holds else None
        if plan is None or (hint is not None and self.problem.cost(plan) > self.problem.cost(hint)):
            return self._solved(hint)
        return plan, self.problem.cost(plan), not self.standing

    def _choice(self, robots: list[str]) -> Choice:
        """Costs count before the number of those held, and that before what the burdened wait."""
        movers = [self.problem.movers[robot] for robot in robots]
        weights, ranks = [_weight(one) for one in movers], [self.ranks[one.vendor] for one in movers]
        most = 1 + sum(ranks) * self.problem.window.steps
        after = most * (1 + len(robots))
        steps = [after * weight + rank for weight, rank in zip(weights, ranks, strict=True)]
        changes = [after * self._change(robot) + most for robot in robots]
        longest, pairs, allowed = _bounds(self.problem, robots)
        weight, step, held = np.array([weights, steps, changes], np.int64)
        return Choice(longest, weight, step, held, pairs, allowed)

    def _change(self, robot: str) -> int:
        """What it counts besides its cost to hold a robot that was not held."""
        return self.switch if self.standing and robot not in self.standing else 0

    def _solved(self, hint: Plan | None) -> tuple[Plan, int, bool] | None:
        """What CP-SAT finds, in two steps: the cheapest, and the fairest of them."""
        model, holds = _model(self.problem, self.problem.robots())
        held = {robot: model.new_bool_var(f"{robot} held") for robot in holds}
        for robot, hold in holds.items():
            model.add(hold == 0).only_enforce_if(~held[robot])
            if hint is not None:
                model.add_hint(hold, hint.get(robot, 0))
        cost = sum(_weight(self.problem.movers[robot]) * hold for robot, hold in holds.items())
        change = sum(self._change(robot) * held[robot] for robot in holds)
        if hint is not None:
            model.add(cost <= self.problem.cost(hint))
        model.minimize(cost + change)
        solved = solve(model, self.effort, presolve=False)
        if not solved.found:
            return None if hint is None or solved.proven else (hint, 0, False)
        best = {robot: solved.solver.value(hold) for robot, hold in holds.items()}
        proven = solved.proven and not self.standing
        model.add(cost + change <= round(solved.solver.objective_value))
        model.clear_objective()  # type: ignore[no-untyped-call]
        rank = {robot: self.ranks[self.problem.movers[robot].vendor] for robot in holds}
        most = 1 + sum(rank.values()) * self.problem.window.steps
        model.minimize(
            sum(most * held[robot] for robot in holds) + sum(rank[robot] * hold for robot, hold in holds.items())
        )
        fairer = solve(model, self.effort, presolve=False)
        if fairer.found:
            best = {robot: fairer.solver.value(hold) for robot, hold in holds.items()}
        bound = self.problem.cost(best) if proven else max(int(solved.bound), 0)
        return best, min(bound, self.problem.cost(best)), proven


def _bounds(problem: Problem, robots: Sequence[str]) -> tuple[Ints, Ints, Bools]:
    """The longest holds of `robots`, their pairs, and which differences those allow, as `Choice` has them."""
    steps, row = problem.window.steps, {robot: row for row, robot in enumerate(robots)}
    pairs = [pair for pair in problem.allowed if pair[0] in row and pair[1] in row]
    allowed = np.array([problem.allowed[pair] for pair in pairs], bool).reshape(-1, 2 * steps + 1)
    longest = np.array([steps * problem.movers[robot].holdable for robot in robots], np.int64)
    return longest, np.array([(row[a], row[b]) for a, b in pairs], np.int64).reshape(-1, 2), allowed


def _model(problem: Problem, robots: Sequence[str]) -> tuple[cp_model.CpModel, dict[str, cp_model.IntVar]]:
    """The holds of `robots`, and every constraint between them."""
    model = Model()
    holds = {
        robot: model.new_int_var(0, problem.window.steps if problem.movers[robot].holdable else 0, robot)
        for robot in robots
    }
    for (a, b), allowed in problem.allowed.items():
        if a in holds and b in holds:
            differences = (np.flatnonzero(allowed) - problem.window.steps).tolist()
            model.add_linear_expression_in_domain(holds[a] - holds[b], cp_model.Domain.from_values(differences))
    return model, holds


def _no_hold(problem: Problem) -> Recommendation:
    """Says so, and who locks whom."""
    if problem.allowed and not problem.hopeless:
        ring = [problem.movers[robot].name for robot in _core(problem)]
        note = f"no hold works for {_listed(ring)}: one of them needs another route"
    else:
        note = _needs_another_route(problem)
    return Recommendation(cost_s=0.0, bound_s=0.0, proven_optimal=False, note=note)


def _core(problem: Problem) -> list[str]:
    """The fewest robots that already have no plan: without any one of them there is one."""
    core = problem.robots()
    for robot in list(core):
        rest = [one for one in core if one != robot]
        if not _has_plan(problem, rest):
            core = rest
    return core


def _has_plan(problem: Problem, robots: Sequence[str]) -> bool:
    """Whether there is a plan for some robots alone, or may be one."""
    longest, pairs, allowed = _bounds(problem, robots)
    nothing = np.zeros(len(robots), np.int64)
    count, _ = folded(Choice(longest, nothing, nothing, nothing, pairs, allowed))
    if count != UNKNOWN:
        return count != NONE
    solved = solve(_model(problem, robots)[0], EFFORT, presolve=False)
    return solved.found or not solved.proven


def _needs_another_route(problem: Problem) -> str:
    names = [tuple(problem.movers[robot].name for robot in pair) for pair in sorted(set(problem.hopeless))]
    return "; ".join(f"no hold keeps {a} and {b} apart: one of them needs another route" for a, b in names)


def _recommended(problem: Problem, plan: Plan, bound: int, proven: bool, first: Plan | None) -> Recommendation:
    cost, first_cost = problem.cost(plan), None if first is None else problem.cost(first)
    return Recommendation(
        holds=tuple(Hold(robot=robot, hold_s=hold * STEP_S) for robot, hold in sorted(plan.items()) if hold),
        cost_s=_seconds(cost),
        bound_s=_seconds(bound),
        first_come_cost_s=None if first_cost is None else _seconds(first_cost),
        expected_saving_s=0.0 if first_cost is None else _seconds(first_cost - cost),
        proven_optimal=proven,
        note=_needs_another_route(problem),
    )


def _ranks(burdens_s: Mapping[str, float], vendors: Sequence[str]) -> dict[str, int]:
    """By vendor, how little its robots should yield: its place among the burdened."""
    burden_s = {vendor: burdens_s.get(vendor, 0.0) for vendor in set(vendors)}
    place = {level: rank for rank, level in enumerate(sorted(set(burden_s.values())))}
    return {vendor: place[level] for vendor, level in burden_s.items()}


def _held(standing: Recommendation | None) -> frozenset[str]:
    return frozenset(one.robot for one in standing.holds) if standing else frozenset()


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def _weight(mover: Mover) -> int:
    return max(round(mover.priority * WEIGHT), 1)


def _seconds(cost: int) -> float:
    return cost * STEP_S / WEIGHT
