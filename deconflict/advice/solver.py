"""The one way in which CP-SAT is called: with bounded effort, on one worker, with a fixed seed.

OR-Tools is loaded with the first model. It brings pandas, which costs 0.3 s and 40 MB, and few questions need it.
"""

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ortools.sat.python import cp_model


@dataclass(frozen=True, slots=True)
class Solution:
    """The result of one solve."""

    found: bool
    """Whether the solver has values."""
    proven: bool
    """Whether they are optimal; or, if none were found, whether there are none."""
    bound: float
    """No solution costs less, in units of the objective."""
    solver: "cp_model.CpSolver"


def new_model() -> "cp_model.CpModel":
    """An empty model."""
    return _lean_model()()


@cache
def _lean_model() -> "type[cp_model.CpModel]":
    from ortools.sat.python import cp_model  # noqa: PLC0415 - brings pandas

    class LeanModel(cp_model.CpModel):
        """A model without the old names of its methods: adding them takes longer than solving a small problem."""

        def _add_pre_pep8_methods(self) -> None:
            pass

    return LeanModel


def solve(model: "cp_model.CpModel", effort: float, *, presolve: bool = True) -> Solution:
    """The best solution that `effort` finds.

    `effort` is in the solver's deterministic time, about seconds of one processor: the same model and effort give the
    same solution on every machine. Use `presolve=False` for differences with gaps beside a bound on a sum: presolve of
    OR-Tools 9.15 "proves" expensive plans optimal there.
    """
    from ortools.sat.python import cp_model  # noqa: PLC0415 - brings pandas

    solver = cp_model.CpSolver()
    solver.parameters.max_deterministic_time = effort
    solver.parameters.num_workers = 1
    solver.parameters.random_seed = 1
    solver.parameters.cp_model_presolve = presolve
    status = solver.solve(model)
    found = status in (cp_model.OPTIMAL, cp_model.FEASIBLE)
    proven = status in (cp_model.OPTIMAL, cp_model.INFEASIBLE)
    return Solution(found, proven, solver.best_objective_bound if found else 0.0, solver)
