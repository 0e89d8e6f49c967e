"""Times at which robots did as advised. Outcomes at these times do not show whether a prediction was right."""

from collections.abc import Collection, Iterable
from itertools import combinations
from math import inf

from ingest.batch import Pair

ONE_WAIT_S = 2.5
"""Two observations of a wait within this time belong to one wait."""


class AdvisedWaits:
    """The waits of each robot, and the times at which one of a pair did what it was asked for the other, in order."""

    def __init__(self) -> None:
        self._of: dict[str | Pair, list[tuple[float, float]]] = {}

    def __contains__(self, pair: Pair) -> bool:
        """Whether one robot of a pair has ever waited, or has done what it was asked for the other."""
        return pair in self._of or not self._of.keys().isdisjoint(pair)

    def add(self, now_s: float, waiting: Iterable[str | Pair]) -> None:
        """Add that these robots wait at `now_s`, and that of these pairs one robot does what it was asked."""
        for each in waiting:
            spans = self._of.setdefault(each, [])
            if spans and now_s - spans[-1][1] <= ONE_WAIT_S:
                spans[-1] = (spans[-1][0], now_s)
            else:
                spans.append((now_s, now_s))

    def began_s(self, robots: Collection[str], from_s: float, to_s: float, *, is_deadlock: bool = False) -> float:
        """When one of some robots first waited between two times, or did what it was asked for another of them; inf if
        none did. Robots that stand in a deadlock do not wait as advised."""
        first_s = inf
        keys: list[str | Pair] = [*(() if is_deadlock else robots), *combinations(sorted(robots), 2)]
        for each in keys:
            for began_s, ended_s in reversed(self._of.get(each, ())):
                if ended_s < from_s:
                    break
                if began_s <= to_s:
                    first_s = min(first_s, max(began_s, from_s))
        return first_s
