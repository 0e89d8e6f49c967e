"""Slots: in which order, and at which of several like resources, robots are served at the least waiting in all."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from heapq import heapify, heappop, heappush
from operator import attrgetter

from ortools.sat.python import cp_model

from deconflict.advice.solver import LeanModel, solve
from deconflict.advisory import Recommendation, Slot
from deconflict.contention.queues.lower_bounds import Task, least_weighted_ends
from deconflict.contention.queues.queue_forecast import Request

EFFORT = 0.1
SWITCH_S = 2.0
TIE_S = 0.1
"""Costs nearer than this are the same: no arrival is known better."""
PASSES, FAR = 3, 6
"""An order is improved before it is searched: so often, and by moves of no more ranks."""
LONG, LONG_SHARE = 12, 0.02
"""A queue of more robots is not searched where its order is within this share of the bound: a search gains less. One of
fewer is not within `TIE_S` of it."""
WEIGHT = 100
"""Priorities count in hundredths."""


@dataclass(frozen=True, slots=True)
class Queue:
    """One resource and the robots that have it or are on their way to it."""

    resource: str
    capacity: int
    requests: tuple[Request, ...]
    changeover_s: float = 0.0
    """From the end of one robot's turn to the beginning of the next one's."""


@dataclass(frozen=True, slots=True)
class Job:
    """One robot that is to be served. Times are whole milliseconds from now."""

    request: Request
    asked: int
    """Queue that it is on its way to."""
    arrival: int
    service: int
    weight: int
    keeps: int
    """Service and changeover: until the next one can begin."""


@dataclass(frozen=True, slots=True)
class Served:
    """One robot's turn at a place."""

    job: Job
    place: int
    start: int

    @property
    def cost(self) -> int:
        return self.job.weight * (self.start - self.job.arrival)


Order = list[tuple[Job, int]]
"""Jobs with their places, in the order of service."""


class Group:
    """Interchangeable places, who is inside until when, and the jobs that wait."""

    def __init__(self, places: Sequence[Queue], now_s: float) -> None:
        self.places, self.now_s = places, now_s
        self.inside = [self._ends(place) for place in places]
        self.changeover_s = max((place.changeover_s for place in places), default=0.0)
        self.jobs = [
            self._job(one, asked) for asked, place in enumerate(places) for one in place.requests if not one.inside
        ]

    def _ends(self, place: Queue) -> list[int]:
        """When the last of those inside leave, as many as the place holds; the others leave before it has room."""
        ends = sorted(_ms(one.service_s + place.changeover_s) for one in place.requests if one.inside)
        return ends[-place.capacity :]

    def _job(self, one: Request, asked: int) -> Job:
        weight = max(round(one.priority * WEIGHT), 0)
        service = max(_ms(one.service_s), 0)
        keeps = service + _ms(self.changeover_s)
        return Job(one, asked, _ms(one.arrival_s - self.now_s), service, weight, keeps)

    def served(self, order: Order) -> list[Served]:
        """Each as early as its arrival and those before it allow."""
        free = [ends + [0] * (place.capacity - len(ends)) for ends, place in zip(self.inside, self.places, strict=True)]
        for ends in free:
            heapify(ends)
        turns = []
        for job, place in order:
            start = max(heappop(free[place]), job.arrival, 0)
            heappush(free[place], start + job.keeps)
            turns.append(Served(job, place, start))
        return turns

    def bound(self) -> int:
        """No order of service costs less."""
        free = min(
            min(ends) if len(ends) == place.capacity else 0
            for ends, place in zip(self.inside, self.places, strict=True)
        )
        tasks = [Task(max(job.arrival, free, 0), job.keeps, job.weight) for job in self.jobs]
        ends = least_weighted_ends([one for one in tasks if one.length], sum(place.capacity for place in self.places))
        at_once = sum(one.weight * one.release for one in tasks if not one.length)
        return max(ends + at_once - sum(job.weight * (job.keeps + job.arrival) for job in self.jobs), 0)

    def first_come(self) -> list[Served]:
        """Each at the place that it is on its way to, by arrival: what happens without advice."""
        jobs = {job.request.robot: job for job in self.jobs}
        order = []
        for asked, place in enumerate(self.places):
            by_arrival = sorted(place.requests, key=attrgetter("arrival_s", "robot"))
            order += [(jobs[one.robot], asked) for one in by_arrival if not one.inside]
        return self.served(order)

    def dispatched(self) -> list[Served]:
        """Each at the place free first; of those that wait, the one that counts most for its time goes first.

        The rule of Smith (1956), which is optimal where one place serves jobs that are all there.
        """
        free = [
            (end, place)
            for place, ends in enumerate(self.inside)
            for end in ends + [0] * (self.places[place].capacity - len(ends))
        ]
        heapify(free)
        waiting, order = list(self.jobs), []
        while waiting:
            at, place = heappop(free)
            at = max(at, min(job.arrival for job in waiting))
            there = [job for job in waiting if job.arrival <= at]
            job = min(there, key=lambda one: (one.keeps / (one.weight or 0.5), one.asked != place, one.request.robot))
            waiting.remove(job)
            order.append((job, place))
            heappush(free, (at + job.keeps, place))
        return self.served(order)

    def standing(self, advice: Recommendation) -> list[Served]:
        """An earlier advice, followed now; whoever it does not name comes last, by arrival."""
        index = {place.resource: row for row, place in enumerate(self.places)}
        told = {slot.robot: (rank, index.get(slot.resource)) for rank, slot in enumerate(advice.slots)}
        unnamed = len(told)

        def key(job: Job) -> tuple[int, int, str]:
            return told.get(job.request.robot, (unnamed, None))[0], job.arrival, job.request.robot

        def place(job: Job) -> int:
            advised = told.get(job.request.robot, (unnamed, None))[1]
            return job.asked if advised is None else advised

        return self.served([(job, place(job)) for job in sorted(self.jobs, key=key)])


def advise_slots(
    places: Sequence[Queue],
    now_s: float,
    *,
    burdens_s: Mapping[str, float] | None = None,
    standing: Recommendation | None = None,
    effort: float = EFFORT,
    switch_s: float = SWITCH_S,
) -> Recommendation:
    """The order and the slots that cost least in total at interchangeable places (often just one).

    The cost of an advice is the seconds of waiting from each arrival on, weighted by priority. Never dearer than first
    come, first served. `burdens_s` says how long each vendor's robots were advised to yield before: of orders that
    cost the same the least burdened yields. `standing` is what was advised before: it is kept, at today's times, while
    nothing saves more than `switch_s`. Robots inside are fixed and have no slot.
    """
    group = Group(places, now_s)
    first = group.first_come()
    best = min((first, group.dispatched()), key=_cost)
    best, bound, proven = _improved(group, best, effort, _burden(burdens_s or {}, group))
    if _cost(best) > _cost(first):
        best = first
    if standing is not None:
        kept = group.standing(standing)
        if _cost(kept) <= min(_cost(best) + _units(switch_s), _cost(first)):
            best, proven = kept, proven and _cost(kept) <= _cost(best) + _units(TIE_S)
    return _recommended(group, best, _cost(first), min(bound, _cost(best)), proven)


def _burden(burdens_s: Mapping[str, float], group: Group) -> Callable[[Job], int]:
    """How little a job should yield: the place of its vendor among the burdened, the least burdened first."""
    ranks = {burden: rank for rank, burden in enumerate(sorted({burdens_s.get(v, 0.0) for v in _vendors(group)}))}
    return lambda job: ranks[burdens_s.get(job.request.vendor, 0.0)]


def _vendors(group: Group) -> set[str]:
    return {job.request.vendor for job in group.jobs}


def _improved(
    group: Group, best: list[Served], effort: float, burden: Callable[[Job], int]
) -> tuple[list[Served], int, bool]:
    """The best order that the solver finds from `best` on, its bound, and whether it is proven."""
    if not group.jobs:
        return best, 0, True
    least, best = group.bound(), _climbed(group, best)
    fair_already = not any(burden(job) for job in group.jobs)
    worth = LONG_SHARE * _cost(best) if len(group.jobs) > LONG else _units(TIE_S)
    if fair_already and _cost(best) - least <= worth:
        return best, least, _cost(best) - least <= _units(TIE_S)
    model = SlotModel(group, best)
    cost = sum(job.weight * (start - job.arrival) for job, start in zip(group.jobs, model.starts, strict=True))
    model.model.add(cost >= least)
    model.model.minimize(cost)
    solved = solve(model.model, effort)
    found = model.order(solved.solver) if solved.found else best
    best = min((best, found), key=_cost)
    if not fair_already:
        model.model.clear_objective()  # type: ignore[no-untyped-call]
        model.model.add(cost <= _cost(best) + _units(TIE_S))
        model.hint(best)
        model.model.minimize(
            sum(burden(job) * (start - job.arrival) for job, start in zip(group.jobs, model.starts, strict=True))
        )
        fair = solve(model.model, effort)
        best = model.order(fair.solver) if fair.found else best
    bound = int(solved.bound) if solved.found else 0
    return best, max(bound, least), solved.found and solved.proven


def _climbed(group: Group, turns: list[Served]) -> list[Served]:
    """The best that moving one job at a time to another rank makes of an order; bounded, and without chance."""
    best, order = turns, [(turn.job, turn.place) for turn in turns]
    for _ in range(PASSES):
        before = _cost(best)
        for row in range(len(order)):
            rest = [*order[:row], *order[row + 1 :]]
            ranks = range(max(row - FAR, 0), min(row + FAR, len(rest)) + 1)
            tried = [[*rest[:to], order[row], *rest[to:]] for to in ranks]
            costs = [_cost(group.served(one)) for one in tried]
            least = min(range(len(tried)), key=costs.__getitem__)
            if costs[least] < _cost(best):
                order = tried[least]
                best = group.served(order)
        if _cost(best) == before:
            break
    return best


class SlotModel:
    """The choice of place and start for each job, as CP-SAT reads it."""

    def __init__(self, group: Group, hint: list[Served]) -> None:
        self.group, self.model = group, LeanModel()
        ends = [end for inside in group.inside for end in inside]
        last = max([0, *ends, *(job.arrival for job in group.jobs)]) + sum(job.keeps for job in group.jobs)
        self.starts = [
            self.model.new_int_var(max(job.arrival, 0), last, f"start {row}") for row, job in enumerate(group.jobs)
        ]
        self.at = [
            [self.model.new_bool_var(f"{row} at {place}") for place in range(len(group.places))]
            for row in range(len(group.jobs))
        ]
        for chosen in self.at:
            self.model.add_exactly_one(chosen)
        for place in range(len(group.places)):
            self._hold_capacity(place)
        self.hint(hint)

    def _hold_capacity(self, place: int) -> None:
        intervals = [
            self.model.new_optional_fixed_size_interval_var(start, job.keeps, chosen[place], f"{row} in {place}")
            for row, (job, start, chosen) in enumerate(zip(self.group.jobs, self.starts, self.at, strict=True))
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

    def hint(self, turns: list[Served]) -> None:
        """Begin the search at these turns."""
        self.model.clear_hints()  # type: ignore[no-untyped-call]
        by_robot = {turn.job.request.robot: turn for turn in turns}
        for job, start, chosen in zip(self.group.jobs, self.starts, self.at, strict=True):
            turn = by_robot[job.request.robot]
            self.model.add_hint(start, turn.start)
            for place, here in enumerate(chosen):
                self.model.add_hint(here, place == turn.place)

    def order(self, solver: cp_model.CpSolver) -> list[Served]:
        """What the solver found, each as early as that order allows."""
        rows = sorted(
            range(len(self.starts)), key=lambda row: (solver.value(self.starts[row]), self.group.jobs[row].arrival, row)
        )
        places = [next(p for p, here in enumerate(chosen) if solver.boolean_value(here)) for chosen in self.at]
        return self.group.served([(self.group.jobs[row], places[row]) for row in rows])


def _recommended(group: Group, turns: list[Served], first_cost: int, bound: int, proven: bool) -> Recommendation:
    cost = _cost(turns)
    return Recommendation(
        slots=tuple(
            Slot(
                robot=turn.job.request.robot,
                resource=group.places[turn.place].resource,
                start_at=_moment(group.now_s, turn.start),
                end_at=_moment(group.now_s, turn.start + turn.job.service),
                wait_s=(turn.start - turn.job.arrival) / 1000,
            )
            for turn in sorted(turns, key=lambda one: (one.start, one.job.request.robot))
        ),
        cost_s=_seconds(cost),
        bound_s=_seconds(cost if proven else bound),
        first_come_cost_s=_seconds(first_cost),
        expected_saving_s=_seconds(first_cost - cost),
        proven_optimal=proven,
    )


def _cost(turns: list[Served]) -> int:
    return sum(turn.cost for turn in turns)


def _ms(time_s: float) -> int:
    return round(time_s * 1000)


def _units(cost_s: float) -> int:
    return round(cost_s * 1000 * WEIGHT)


def _seconds(cost: int) -> float:
    return cost / (1000 * WEIGHT)


def _moment(now_s: float, after_ms: int) -> datetime:
    return datetime.fromtimestamp(now_s + after_ms / 1000, UTC)
