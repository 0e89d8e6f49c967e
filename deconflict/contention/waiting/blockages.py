"""Robots that stand where others will pass, with everyone they hold up."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from deconflict.contention.robots.robot_view import Seen
from deconflict.contention.waiting.wait_graph import Hindrance


@dataclass(frozen=True, slots=True)
class Blocked:
    """One blocker and those it holds up, soonest first, others behind them included."""

    blocker: str
    since_s: float
    from_s: float
    """When the first of them gets there."""
    holds_up: tuple[str, ...]


def blockages(found: Iterable[Hindrance], robots: Mapping[str, Seen], now_s: float, stand_s: float) -> list[Blocked]:
    """Who has stood for `stand_s` outside of every resource and waits for nobody, though others' ways lead there."""
    behind: dict[str, list[Hindrance]] = {}
    waits = set()
    for one in found:
        behind.setdefault(one.blocker, []).append(one)
        waits.add(one.waiter)
    told = []
    for blocker in sorted(behind.keys() - waits):
        seen = robots[blocker]
        if seen.here is None and now_s - seen.stood_s >= stand_s:
            held = _held(blocker, behind)
            told.append(Blocked(blocker, seen.stood_s, min(held.values()), tuple(sorted(held, key=lambda u: held[u]))))
    return told


def _held(blocker: str, behind: Mapping[str, list[Hindrance]]) -> dict[str, float]:
    """Everyone who waits for the blocker or for one who does, and from when."""
    held: dict[str, float] = {}
    queue = [(blocker, 0.0)]
    while queue:
        holder, after_s = queue.pop(0)
        for one in behind.get(holder, ()):
            from_s = max(one.from_s, after_s)
            if one.waiter != blocker and from_s < held.get(one.waiter, float("inf")):
                held[one.waiter] = from_s
                queue.append((one.waiter, from_s))
    return held
