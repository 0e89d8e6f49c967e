"""Interchangeable places and their queues, and what an order of service costs there."""

from collections.abc import Sequence
from dataclasses import dataclass
from heapq import heapify, heappop, heappush
from operator import attrgetter

from deconflict.advice.priorities import WEIGHT
from deconflict.contention.queues.queue_forecast import ServiceRequest
from deconflict.contention.queues.schedule_bounds import Task, least_weighted_ends
from deconflict_client.advisory import Recommendation


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
