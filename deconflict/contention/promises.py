"""What robots say of when they will be where, kept until they come, and given up where they plan otherwise."""

from collections.abc import Iterable
from math import hypot
from typing import NamedTuple

ARRIVED_M = 0.75
"""A robot this near its destination has arrived."""
SAY_AGAIN_S = 30.0
"""A robot's word is kept anew after this time."""
MOST_PROMISES = 32
"""Kept of one destination: a quarter of an hour."""
FORGET_S = 600.0
"""A robot this late is not waited for. One that no longer names a destination that lies ahead has another plan."""

Spot = tuple[str, float, float]
"""Datum, x, y."""


class Promise(NamedTuple):
    """When it was said, and the time that was told."""

    said_s: float
    told_s: float


class Promises:
    """By robot and destination, to the decimetre."""

    def __init__(self) -> None:
        self._open: dict[str, dict[Spot, list[Promise]]] = {}

    def heard(self, robot: str, now_s: float, here: Spot, stops: Iterable[tuple[float, Spot]]) -> list[list[Promise]]:
        """A robot is at `here` and says when it will be where; what it had said of each destination it has come to."""
        ahead = {(datum, round(x, 1), round(y, 1)): t_s for t_s, (datum, x, y) in stops}
        if not ahead and robot not in self._open:
            return []
        promised = self._open.setdefault(robot, {})
        kept = []
        for spot, said in list(promised.items()):
            if near(spot, here):
                kept.append(promised.pop(spot))
            elif spot not in ahead and _is_over(said[-1], now_s):
                del promised[spot]
        for spot, t_s in ahead.items():
            if spot not in promised and near(spot, here):
                continue
            said = promised.setdefault(spot, [])
            if len(said) < MOST_PROMISES and (not said or now_s - said[-1].said_s >= SAY_AGAIN_S):
                said.append(Promise(now_s, t_s))
        if not promised:
            del self._open[robot]
        return kept

    def open(self, robot: str) -> bool:
        """Whether anything that it said is kept."""
        return robot in self._open

    def forget(self, robot: str) -> None:
        self._open.pop(robot, None)


def near(a: Spot, b: Spot, within_m: float = ARRIVED_M) -> bool:
    return a[0] == b[0] and hypot(a[1] - b[1], a[2] - b[2]) <= within_m


def _is_over(last: Promise, now_s: float) -> bool:
    """Whether a destination that is no longer named lay ahead, which is another plan, or is long past."""
    return last.told_s > now_s or last.told_s + FORGET_S < now_s
