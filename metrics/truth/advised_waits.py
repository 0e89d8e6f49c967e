"""Times at which robots waited as advised. Outcomes at these times do not show whether a prediction was right."""

from collections.abc import Iterable
from math import inf

from ingest.batch import Pair

ONE_WAIT_S = 2.5
"""Two observations of a wait within this time belong to one wait."""


class AdvisedWaits:
    """The waits of each robot, in order."""

    def __init__(self) -> None:
        self._of: dict[str, list[tuple[float, float]]] = {}

    def __contains__(self, pair: Pair) -> bool:
        """Whether one robot of a pair has ever waited."""
        return not self._of.keys().isdisjoint(pair)

    def add(self, now_s: float, waiting: Iterable[str]) -> None:
        """Add that these robots wait at `now_s`."""
        for robot in waiting:
            spans = self._of.setdefault(robot, [])
            if spans and now_s - spans[-1][1] <= ONE_WAIT_S:
                spans[-1] = (spans[-1][0], now_s)
            else:
                spans.append((now_s, now_s))

    def began_s(self, robots: Iterable[str], from_s: float, to_s: float) -> float:
        """When one of some robots first waited between two times; inf if none did."""
        first_s = inf
        for robot in robots:
            for began_s, ended_s in reversed(self._of.get(robot, ())):
                if ended_s < from_s:
                    break
                if began_s <= to_s:
                    first_s = min(first_s, max(began_s, from_s))
        return first_s
