"""Robots that stand before a crossing that is free, each for the other: as a ring of waits, and what ends it."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from deconflict.contention.robots.robot_table import RobotTable
from deconflict.contention.waiting.deadlocks import RingLink, Want
from deconflict.contention.waiting.wait_graph import PATH
from deconflict_client.advisory import Action, Recommendation

PASSES_S = 10.0
"""So long the other waits until the first has passed."""


@dataclass(frozen=True, slots=True)
class Crossing:
    """Two robots that stand before the place where their ways cross, with nobody in it."""

    robots: tuple[str, str]
    since_s: float
    """Since when both rest, seconds since the epoch."""
    before_m: tuple[tuple[float, float], tuple[float, float]]
    """Of each, the first point of its way where it would be in the other's."""
    goes_first: str | None = None
    """The robot whose vendor has agreed that it goes first; None if none has."""

    @property
    def first(self) -> str:
        """The robot that should go first."""
        return self.goes_first or self.robots[0]

    @property
    def middle_m(self) -> tuple[float, float]:
        (ax, ay), (bx, by) = self.before_m
        return (ax + bx) / 2, (ay + by) / 2


def mutual_waits(crossings: Iterable[Crossing], robots: RobotTable) -> dict[frozenset[str], Crossing]:
    """By its robots, the crossings at which robots of two vendors still stand, and nobody on foot."""
    found = {}
    for crossing in crossings:
        if not all(uuid in robots and robots.rests_since_s(uuid) <= crossing.since_s for uuid in crossing.robots):
            continue
        views = [robots[uuid] for uuid in crossing.robots]
        if len({view.vendor for view in views}) > 1 and not any(view.on_foot for view in views):
            found[frozenset(crossing.robots)] = crossing
    return found


def crossing_wants(crossings: Iterable[Crossing]) -> list[Want]:
    """The wants of robots for the place where their ways cross, which neither takes."""
    return [
        Want((waiter, 0), ((holder, 0),), PATH, crossing.since_s)
        for crossing in crossings
        for waiter, holder in (crossing.robots, crossing.robots[::-1])
    ]


def crossing_of(ring: Sequence[RingLink], crossings: dict[frozenset[str], Crossing]) -> Crossing | None:
    """The crossing before which the robots of a ring wait for each other; None if they wait for something else."""
    waits_on_path = len(ring) == 2 and all(link.where == PATH for link in ring)
    return crossings.get(frozenset(link.waiter for link in ring)) if waits_on_path else None


def crossing_advice(crossing: Crossing, robots: RobotTable) -> Recommendation:
    """One goes first, and the other waits meanwhile."""
    first = robots[crossing.first]
    other = robots[next(uuid for uuid in crossing.robots if uuid != first.uuid)]
    reason = "both stand, and nobody is where their ways cross"
    wait = Action(robot=other.uuid, name=other.name, action="wait", where="before the crossing", reason=reason)
    go = Action(robot=first.uuid, name=first.name, action="go_first")
    return Recommendation(actions=(wait, go), cost_s=PASSES_S, bound_s=0.0, proven_optimal=False)
