"""The choice of place and start for each job as a CP-SAT model."""

from typing import TYPE_CHECKING

from deconflict.advice.solver import new_model
from deconflict.contention.queues.place_group import PlaceGroup, ScheduledJob

if TYPE_CHECKING:
    from ortools.sat.python import cp_model


class SlotModel:
    """Variables, constraints and hints for the jobs of a group."""

    def __init__(self, group: PlaceGroup, hint: list[ScheduledJob]) -> None:
        self.group, self.model = group, new_model()
        ends = [end for inside in group.inside for end in inside]
        last = max([0, *ends, *(job.arrival for job in group.jobs)]) + sum(job.keeps for job in group.jobs)
        self.starts = [
            self.model.new_int_var(max(job.arrival, 0), last, f"start {row}") for row, job in enumerate(group.jobs)
        ]
        self.places = [
            [self.model.new_bool_var(f"{row} at {place}") for place in range(len(group.places))]
            for row in range(len(group.jobs))
        ]
        for chosen in self.places:
            self.model.add_exactly_one(chosen)
        for place in range(len(group.places)):
            self._limit_to_capacity(place)
        self.hint(hint)

    def _limit_to_capacity(self, place: int) -> None:
        intervals = [
            self.model.new_optional_fixed_size_interval_var(start, job.keeps, chosen[place], f"{row} in {place}")
            for row, (job, start, chosen) in enumerate(zip(self.group.jobs, self.starts, self.places, strict=True))
        ]
        intervals += [
            self.model.new_fixed_size_interval_var(0, end, f"inside {place}")
            for end in self.group.inside[place]
            if end > 0
        ]
        capacity = self.group.places[place].capacity
        if capacity == 1:
            self.model.add_no_overlap(intervals)
        else:
            self.model.add_cumulative(intervals, [1] * len(intervals), capacity)

    def hint(self, turns: list[ScheduledJob]) -> None:
        """Let the search begin at these turns."""
        self.model.clear_hints()  # type: ignore[no-untyped-call]
        by_robot = {turn.job.request.robot: turn for turn in turns}
        for job, start, chosen in zip(self.group.jobs, self.starts, self.places, strict=True):
            turn = by_robot[job.request.robot]
            self.model.add_hint(start, turn.start)
            for place, is_chosen in enumerate(chosen):
                self.model.add_hint(is_chosen, place == turn.place)

    def order(self, solver: "cp_model.CpSolver") -> list[ScheduledJob]:
        """The solution, with each job as early as its order allows."""
        rows = sorted(
            range(len(self.starts)), key=lambda row: (solver.value(self.starts[row]), self.group.jobs[row].arrival, row)
        )
        places = [list(map(solver.boolean_value, chosen)).index(True) for chosen in self.places]
        return self.group.schedule([(self.group.jobs[row], places[row]) for row in rows])
