"""Lower bounds of the cost of any order of service, from two relaxations that need no search.

Both relaxations allow jobs to be interrupted.

The first replaces n places by one place that is n times as fast. It always serves the released job with the highest
weight for its length. The bound is the weighted sum, over all jobs, of the mean time at which the job is served plus
half its length (Goemans, Queyranne, Schulz, Skutella and Wang 2002, "Single machine scheduling with release dates"; for
several places, Schulz and Skutella 2002).

The second applies to one place and jobs of equal weight. To serve the job with the shortest remaining time first gives
the least sum of ends (Schrage 1968).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from math import ceil


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
