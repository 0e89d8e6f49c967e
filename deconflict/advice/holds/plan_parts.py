"""The part of a plan that one conflict needs: the holds of its own robots, and of those that these would meet."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from deconflict.advice.holds.hold_planner import HoldPlan
from deconflict.advice.holds.hold_problem import Plan
from deconflict.advice.holds.hold_windows import STEP_S
from ingest.batch import Pair


@dataclass(slots=True)
class PlanParts:
    """The parts of one plan."""

    plan: HoldPlan
    _known: dict[frozenset[str], frozenset[str]] = field(default_factory=dict)

    def of(self, pair: Pair) -> Plan:
        """The holds that keep a pair apart and bring no other pair together."""
        holds = {robot: hold for robot, hold in self.plan.found.plan.items() if hold}
        own = frozenset(holds).intersection(pair)
        part = self._known.get(own)
        if part is None:
            part = self._known[own] = frozenset(self._closed(own, holds))
        return {robot: holds[robot] for robot in sorted(part)}

    def _closed(self, own: frozenset[str], holds: Plan) -> set[str]:
        """Some held robots, and those that also have to be held because of them."""
        part = set(own)
        while part and part != holds.keys():
            met = self.brought_together({robot: holds[robot] for robot in part})
            more = {robot for pair in met for robot in pair if robot in holds} - part
            if not more:
                return part if not met else set(holds)
            part |= more
        return part

    def brought_together(self, holds: Plan) -> set[Pair]:
        """The pairs that keep apart without these holds and meet with them, by another sweep."""
        problem, held_s = self.plan.problem, {robot: hold * STEP_S for robot, hold in holds.items()}
        found = problem.delays.contacts_s(held_s, held_s.keys())
        return (found.keys() - problem.pairs_together()) | set(self._forbidden(holds))

    def _forbidden(self, holds: Plan) -> Iterable[Pair]:
        """The pairs of which the grid of differences says so, also those that begin near each other."""
        problem = self.plan.problem
        for pair in problem.allowed:
            if problem.keeps_apart(pair, {}) and not problem.keeps_apart(pair, holds):
                yield pair

    def is_kept_apart(self, pair: Pair, holds: Plan) -> bool:
        """Whether these holds keep a pair apart, and bring no other pair together."""
        problem = self.plan.problem
        return pair in problem.allowed and problem.keeps_apart(pair, holds) and not self.brought_together(holds)
