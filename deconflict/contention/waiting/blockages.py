"""Robots that stand where others will pass, and all robots that they hold up."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from heapq import nsmallest

from deconflict.contention.robots.robot_view import RobotView
from deconflict.contention.waiting.wait_graph import Hindrance

MOST_HELD_UP = 50
"""Of robots that one robot holds up, so many count: the soonest that wait for it directly, then those behind them."""


@dataclass(frozen=True, slots=True)
class Blockage:
    """One blocker and the robots that it holds up."""

    blocker: str
    since_s: float
    """Since when it stands."""
    holds_up: tuple[str, ...]
    """The soonest first, with robots behind them."""
    from_s: tuple[float, ...]
    """Since when each of them waits, or from when it will."""


def blockages(in_way: Iterable[Hindrance], robots: Mapping[str, RobotView]) -> list[Blockage]:
    """Robots in the way of others that stand outside every resource and wait for nobody."""
    behind: dict[str, list[Hindrance]] = {}
    waits = set()
    for hindrance in in_way:
        behind.setdefault(hindrance.blocker, []).append(hindrance)
        waits.add(hindrance.waiter)
    behind |= {
        holder: nsmallest(MOST_HELD_UP, each, lambda hindrance: (hindrance.since_s, hindrance.waiter))
        for holder, each in behind.items()
        if len(each) > MOST_HELD_UP
    }
    found = []
    for blocker in sorted(behind.keys() - waits):
        robot = robots[blocker]
        if robot.here is None:
            from_s = _held_up_s(blocker, behind)
            holds_up = tuple(sorted(from_s, key=from_s.__getitem__))
            found.append(Blockage(blocker, robot.stood_s, holds_up, tuple(map(from_s.__getitem__, holds_up))))
    return found


def _held_up_s(blocker: str, behind: Mapping[str, list[Hindrance]]) -> dict[str, float]:
    """All robots that wait for the blocker, directly or through others, and since when or from when."""
    held_up_s: dict[str, float] = {}
    queue = [(blocker, 0.0)]
    while queue:
        holder, after_s = queue.pop(0)
        for hindrance in behind.get(holder, ()):
            waiter, from_s = hindrance.waiter, max(hindrance.since_s, after_s)
            if waiter not in held_up_s and len(held_up_s) == MOST_HELD_UP:
                continue
            if waiter != blocker and from_s < held_up_s.get(waiter, float("inf")):
                held_up_s[waiter] = from_s
                queue.append((waiter, from_s))
    return held_up_s
