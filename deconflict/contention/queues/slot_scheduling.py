"""Slots: in which order, and at which of several interchangeable resources, robots wait least in total."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from deconflict.advice.priorities import WEIGHT
from deconflict.advice.solver import new_model, solve
from deconflict.advice.vendor_burden import burden_ranks
from deconflict.contention.queues.place_group import PlaceGroup, PlaceQueue, ScheduledJob, total_cost
from deconflict.settings.site import USUAL_ADVICE, Advice
from deconflict_client.advisory import Recommendation, Slot, moment

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


TIE_S = 0.1
"""Costs that differ by less are equal: no arrival is known better."""
PASSES, FARTHEST_MOVE = 3, 6
"""How often an order is improved by moving jobs before the solver searches, and by how many ranks at most."""
LONG, LONG_SHARE = 12, 0.02
"""A queue of more robots is not searched if its order is within this share of the bound: a search would gain less. A
shorter queue is not searched within `TIE_S` of the bound."""


def advise_slots(
    places: Sequence[PlaceQueue],
    now_s: float,
    *,
    burdens_s: Mapping[str, float] | None = None,
    standing: Recommendation | None = None,
    settings: Advice = USUAL_ADVICE,
) -> Recommendation:
    """The order and the slots that cost least in total at interchangeable places (often just one).

    The cost of an advice is the seconds of waiting from each arrival on, weighted by priority. It never costs more than
    first come, first served. `burdens_s` says how long each vendor's robots waited by advice before: of orders that
    cost the same, the least burdened vendor waits. `standing` is the advice from before: it is kept, at the times of
    now, while no other saves more than `settings.switch_s`. Robots inside are fixed and have no slot.
    """
    group = PlaceGroup(places, now_s)
    first = group.first_come()
    best = min((first, group.dispatched()), key=total_cost)
    ranks = burden_ranks(burdens_s or {}, (job.request.vendor for job in group.jobs))
    best, bound, proven = _improve(group, best, settings.effort, ranks)
    if total_cost(best) > total_cost(first):
        best = first
    if standing is not None:
        kept = group.standing(standing)
        if total_cost(kept) <= min(total_cost(best) + _units(settings.switch_s), total_cost(first)):
            best, proven = kept, proven and total_cost(kept) <= total_cost(best) + _units(TIE_S)
    return _recommendation(group, best, total_cost(first), min(bound, total_cost(best)), proven)


def _improve(
    group: PlaceGroup, best: list[ScheduledJob], effort: float, ranks: Mapping[str, int]
) -> tuple[list[ScheduledJob], int, bool]:
    """The best order that the solver finds from `best` on, its bound, and whether it is proven optimal. `ranks` of
    vendors are as of `burden_ranks`."""
    if not group.jobs:
        return best, 0, True
    least, best = group.bound(), _move_jobs(group, best)
    is_fair = not any(ranks.values())
    worthwhile = LONG_SHARE * total_cost(best) if len(group.jobs) > LONG else _units(TIE_S)
    if is_fair and total_cost(best) - least <= worthwhile:
        return best, least, total_cost(best) - least <= _units(TIE_S)
    model = SlotModel(group, best)
    cost = sum(job.weight * (start - job.arrival) for job, start in zip(group.jobs, model.starts, strict=True))
    model.model.add(cost >= least)
    model.model.minimize(cost)
    solved = solve(model.model, effort)
    found = model.order(solved.solver) if solved.found else best
    best = min((best, found), key=total_cost)
    if not is_fair:
        model.model.clear_objective()  # type: ignore[no-untyped-call]
        model.model.add(cost <= total_cost(best) + _units(TIE_S))
        model.hint(best)
        model.model.minimize(
            sum(
                ranks[job.request.vendor] * (start - job.arrival)
                for job, start in zip(group.jobs, model.starts, strict=True)
            )
        )
        fair = solve(model.model, effort)
        best = model.order(fair.solver) if fair.found else best
    bound = int(solved.bound) if solved.found else 0
    return best, max(bound, least), solved.found and solved.proven


def _move_jobs(group: PlaceGroup, turns: list[ScheduledJob]) -> list[ScheduledJob]:
    """The best order by moving one job at a time to another rank; bounded and deterministic."""
    best, order = turns, [(turn.job, turn.place) for turn in turns]
    for _ in range(PASSES):
        before = total_cost(best)
        for row in range(len(order)):
            rest = [*order[:row], *order[row + 1 :]]
            ranks = range(max(row - FARTHEST_MOVE, 0), min(row + FARTHEST_MOVE, len(rest)) + 1)
            tried = [[*rest[:to], order[row], *rest[to:]] for to in ranks]
            costs = [total_cost(group.schedule(candidate)) for candidate in tried]
            least = min(range(len(tried)), key=costs.__getitem__)
            if costs[least] < total_cost(best):
                order = tried[least]
                best = group.schedule(order)
        if total_cost(best) == before:
            break
    return best


def _recommendation(
    group: PlaceGroup, turns: list[ScheduledJob], first_cost: int, bound: int, proven: bool
) -> Recommendation:
    cost = total_cost(turns)
    return Recommendation(
        slots=tuple(
            Slot(
                robot=turn.job.request.robot,
                resource=group.places[turn.place].resource,
                start_at=moment(group.now_s + turn.start / 1000),
                end_at=moment(group.now_s + (turn.start + turn.job.service) / 1000),
                wait_s=(turn.start - turn.job.arrival) / 1000,
            )
            for turn in sorted(turns, key=lambda turn: (turn.start, turn.job.request.robot))
        ),
        cost_s=_seconds(cost),
        bound_s=_seconds(cost if proven else bound),
        first_come_cost_s=_seconds(first_cost),
        expected_saving_s=_seconds(first_cost - cost),
        proven_optimal=proven,
    )


def _units(cost_s: float) -> int:
    return round(cost_s * 1000 * WEIGHT)


def _seconds(cost: int) -> float:
    return cost / (1000 * WEIGHT)
