"""Interchangeable places and their queues, and what an order of service costs there.

Lower bounds of the cost of any order come from two relaxations that need no search. Both allow jobs to be interrupted.

The first replaces n places by one place that is n times as fast. It always serves the released job with the highest
weight for its length. The bound is the weighted sum, over all jobs, of the mean time at which the job is served plus
half its length (Goemans, Queyranne, Schulz, Skutella and Wang 2002, "Single machine scheduling with release dates"; for
several places, Schulz and Skutella 2002).

The second applies to one place and jobs of equal weight. To serve the job with the shortest remaining time first gives
the least sum of ends (Schrage 1968).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from heapq import heapify, heappop, heappush
from math import ceil
from operator import attrgetter

from deconflict.advice.priorities import WEIGHT
from deconflict.contention.queues.queue_forecast import ServiceRequest
from deconflict_client.advisory import Recommendation


@dataclass(frozen=True, slots=True)
class Task:
    """One job. Times are whole milliseconds."""

    release: int
    """Earliest time at which it may begin."""
    length: int
    """Duration, more than 0."""
    weight: int
    """Cost of each millisecond until it ends."""


def least_weighted_ends(tasks: Sequence[Task], places: int) -> int:
    """A lower bound of the sum of weight times end, for any schedule of `tasks` on equal places."""
    bound = sum(
        task.weight * (busy + task.length / 2) for task, busy in zip(tasks, _mean_busy(tasks, places), strict=True)
    )
    weights = {task.weight for task in tasks}
    if places == 1 and len(weights) == 1:
        bound = max(bound, weights.pop() * sum(_shortest_remaining_first(tasks)))
    return ceil(bound - 1e-6 * max(abs(bound), 1.0))


def _mean_busy(tasks: Sequence[Task], speed: int) -> list[float]:
    """The mean time at which each task is served, if the one with the most weight for its length always goes first."""
    left = [float(task.length) for task in tasks]
    moments = [0.0] * len(tasks)
    for row, begin, end in _served(tasks, left, speed, [-task.weight / task.length for task in tasks]):
        moments[row] += speed * (end * end - begin * begin) / 2
    return [moment / task.length for moment, task in zip(moments, tasks, strict=True)]


def _shortest_remaining_first(tasks: Sequence[Task]) -> list[float]:
    """When each task ends, if the one with the least left to do always goes first."""
    ends, now = [], 0.0
    waiting: list[float] = []
    releases = sorted((task.release, task.length) for task in tasks)
    while releases or waiting:
        if not waiting:
            now = max(now, releases[0][0])
        while releases and releases[0][0] <= now:
            heappush(waiting, releases.pop(0)[1])
        left = heappop(waiting)
        until = min(now + left, releases[0][0]) if releases else now + left
        if until < now + left:
            heappush(waiting, now + left - until)
        else:
            ends.append(until)
        now = until
    return ends


def _served(
    tasks: Sequence[Task], left: list[float], speed: int, rank: Sequence[float]
) -> list[tuple[int, float, float]]:
    """Row, begin and end of each interval in which a task is served. The released task with the lowest rank goes
    first."""
    order = sorted(range(len(tasks)), key=lambda row: tasks[row].release)
    waiting: list[tuple[float, int]] = []
    pieces, now, following = [], 0.0, 0
    while following < len(order) or waiting:
        if not waiting:
            now = max(now, tasks[order[following]].release)
        while following < len(order) and tasks[order[following]].release <= now:
            heappush(waiting, (rank[order[following]], order[following]))
            following += 1
        row = waiting[0][1]
        next_release = tasks[order[following]].release if following < len(order) else float("inf")
        until = min(now + left[row] / speed, next_release)
        pieces.append((row, now, until))
        left[row] -= (until - now) * speed
        if left[row] <= 1e-6:
            heappop(waiting)
        now = until
    return pieces


@dataclass(frozen=True, slots=True)
class PlaceQueue:
    """One resource, and the robots that have it or are on their way to it."""

    resource: str
    capacity: int
    requests: tuple[ServiceRequest, ...]
    changeover_s: float = 0.0
    """From the end of one turn to the beginning of the next."""


@dataclass(frozen=True, slots=True)
class Job:
    """One robot that is to be served. Times are whole milliseconds from now."""

    request: ServiceRequest
    asked: int
    """Index of the queue of the place that it is on its way to."""
    arrival: int
    """When the robot comes."""
    service: int
    """How long it keeps the place."""
    weight: int
    """Cost of each millisecond of its waiting."""
    keeps: int
    """Service and changeover: until the next turn can begin."""


@dataclass(frozen=True, slots=True)
class ScheduledJob:
    """One robot's turn at a place."""

    job: Job
    place: int
    """Index of the place's queue."""
    start: int
    """When the turn begins, milliseconds from now."""

    @property
    def cost(self) -> int:
        return self.job.weight * (self.start - self.job.arrival)


Order = list[tuple[Job, int]]
"""Jobs with the indexes of their places, in the order of service."""


class PlaceGroup:
    """Interchangeable places, until when robots are inside, and the jobs that wait."""

    def __init__(self, places: Sequence[PlaceQueue], now_s: float) -> None:
        self.places, self.now_s = places, now_s
        self.inside = [self._ends(place) for place in places]
        """By place, when its units of capacity are free."""
        self.changeover_s = max((place.changeover_s for place in places), default=0.0)
        self.jobs = [
            self._job(request, asked)
            for asked, place in enumerate(places)
            for request in place.requests
            if not request.inside
        ]

    def _ends(self, place: PlaceQueue) -> list[int]:
        """When the last of the robots inside leave, as many as the place holds; the others leave before it has room."""
        inside = [request for request in place.requests if request.inside]
        ends = sorted(milliseconds(request.service_s + place.changeover_s) for request in inside)
        return ends[-place.capacity :]

    def _job(self, request: ServiceRequest, asked: int) -> Job:
        weight = max(round(request.priority * WEIGHT), 0)
        service = max(milliseconds(request.service_s), 0)
        keeps = service + milliseconds(self.changeover_s)
        return Job(request, asked, milliseconds(request.arrival_s - self.now_s), service, weight, keeps)

    def schedule(self, order: Order) -> list[ScheduledJob]:
        """Each job as early as its arrival and the jobs before it allow."""
        free = [ends + [0] * (place.capacity - len(ends)) for ends, place in zip(self.inside, self.places, strict=True)]
        for ends in free:
            heapify(ends)
        turns = []
        for job, place in order:
            start = max(heappop(free[place]), job.arrival, 0)
            heappush(free[place], start + job.keeps)
            turns.append(ScheduledJob(job, place, start))
        return turns

    def bound(self) -> int:
        """No order of service costs less."""
        free = min(
            min(ends) if len(ends) == place.capacity else 0
            for ends, place in zip(self.inside, self.places, strict=True)
        )
        tasks = [Task(max(job.arrival, free, 0), job.keeps, job.weight) for job in self.jobs]
        capacity = sum(place.capacity for place in self.places)
        ends = least_weighted_ends([task for task in tasks if task.length], capacity)
        at_once = sum(task.weight * task.release for task in tasks if not task.length)
        return max(ends + at_once - sum(job.weight * (job.keeps + job.arrival) for job in self.jobs), 0)

    def first_come(self) -> list[ScheduledJob]:
        """Each job at the place that its robot is on its way to, by arrival: what happens without advice."""
        jobs = {job.request.robot: job for job in self.jobs}
        order = []
        for asked, place in enumerate(self.places):
            by_arrival = sorted(place.requests, key=attrgetter("arrival_s", "robot"))
            order += [(jobs[request.robot], asked) for request in by_arrival if not request.inside]
        return self.schedule(order)

    def dispatched(self) -> list[ScheduledJob]:
        """Each job at the place that is free first; of the waiting jobs, the one with most weight for its length first.

        This is the rule of Smith (1956), which is optimal if one place serves jobs that have all arrived.
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
            arrived = [job for job in waiting if job.arrival <= at]
            job = min(arrived, key=lambda job: (job.keeps / (job.weight or 0.5), job.asked != place, job.request.robot))
            waiting.remove(job)
            order.append((job, place))
            heappush(free, (at + job.keeps, place))
        return self.schedule(order)

    def standing(self, advice: Recommendation) -> list[ScheduledJob]:
        """An earlier advice, followed now; jobs that it does not name come last, by arrival."""
        index = {place.resource: row for row, place in enumerate(self.places)}
        advised = {slot.robot: (rank, index.get(slot.resource)) for rank, slot in enumerate(advice.slots)}
        unnamed = len(advised)

        def key(job: Job) -> tuple[int, int, str]:
            return advised.get(job.request.robot, (unnamed, None))[0], job.arrival, job.request.robot

        def place(job: Job) -> int:
            chosen = advised.get(job.request.robot, (unnamed, None))[1]
            return job.asked if chosen is None else chosen

        return self.schedule([(job, place(job)) for job in sorted(self.jobs, key=key)])


def total_cost(turns: Sequence[ScheduledJob]) -> int:
    """In milliseconds, weighted by hundredths of priority."""
    return sum(turn.cost for turn in turns)


def milliseconds(time_s: float) -> int:
    return round(time_s * 1000)
