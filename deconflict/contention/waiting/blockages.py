"""Robots that stand where others will pass, and all robots that they hold up."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from deconflict.contention.robots.robot_view import RobotView
from deconflict.contention.waiting.wait_graph import Hindrance


@dataclass(frozen=True, slots=True)
class Blockage:
    """One blocker and the robots that it holds up."""

    blocker: str
    since_s: float
    """Since when it stands."""
    from_s: float
    """When the first robot gets there."""
    holds_up: tuple[str, ...]
    """The soonest first, with robots behind them."""


def blockages(
    in_way: Iterable[Hindrance], robots: Mapping[str, RobotView], now_s: float, stand_s: float
) -> list[Blockage]:
    """Robots in the way of others that have stood for `stand_s` outside every resource and wait for nobody."""
    behind: dict[str, list[Hindrance]] = {}
    waits = set()
    for hindrance in in_way:
        behind.setdefault(hindrance.blocker, []).append(hindrance)
        waits.add(hindrance.waiter)
    found = []
    for blocker in sorted(behind.keys() - waits):
        robot = robots[blocker]
        if robot.here is None and now_s - robot.stood_s >= stand_s:
            from_s = _held_up_s(blocker, behind)
            holds_up = tuple(sorted(from_s, key=from_s.__getitem__))
            found.append(Blockage(blocker, robot.stood_s, min(from_s.values()), holds_up))
    return found


def _held_up_s(blocker: str, behind: Mapping[str, list[Hindrance]]) -> dict[str, float]:
    """All robots that wait for the blocker, directly or through others, and from when."""
    held_up_s: dict[str, float] = {}
    queue = [(blocker, 0.0)]
    while queue:
        holder, after_s = queue.pop(0)
        for hindrance in behind.get(holder, ()):
            waiter, from_s = hindrance.waiter, max(hindrance.from_s, after_s)
            if waiter != blocker and from_s < held_up_s.get(waiter, float("inf")):
                held_up_s[waiter] = from_s
                queue.append((waiter, from_s))
    return held_up_s
