"""How much the solver may do, and the one way in which it is asked: bounded, on one worker, with a fixed seed."""

from dataclasses import dataclass

from ortools.sat.python import cp_model


@dataclass(frozen=True, slots=True)
class Solved:
    """What came of one solve."""

    found: bool
    """Whether `value` may be asked of the solver."""
    proven: bool
    """The best there is, or, where nothing is found, proof that there is nothing."""
    bound: float
    """Nothing costs less than this, in the units of the objective."""
    solver: cp_model.CpSolver


class Model(cp_model.CpModel):
    """A model without its methods' old names, which take longer to make than a small problem to solve."""

    def _add_pre_pep8_methods(self) -> None:
        pass


def solve(model: cp_model.CpModel, effort: float, *, presolve: bool = True) -> Solved:
    """The best that `effort` finds.

    `effort` is in the solver's deterministic time, about seconds of one processor: the same model and effort give the
    same answer on every machine. Without `presolve` the model is taken as it stands: OR-Tools 9.15 "proves" dear plans
    optimal where differences with gaps stand beside a bound on a sum, once it has simplified them.
    """
    solver = cp_model.CpSolver()
    solver.parameters.max_deterministic_time = effort
    solver.parameters.num_workers = 1
    solver.parameters.random_seed = 1
    solver.parameters.cp_model_presolve = presolve
    status = solver.solve(model)
    found = status in (cp_model.OPTIMAL, cp_model.FEASIBLE)
    proven = status in (cp_model.OPTIMAL, cp_model.INFEASIBLE)
    return Solved(found, proven, solver.best_objective_bound if found else 0.0, solver)
