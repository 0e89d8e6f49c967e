"""What robots say of when they will be where, kept until they come, and given up where they plan otherwise."""

from dataclasses import dataclass
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


Stops = list[tuple[float, Spot]]
"""When a robot will be where, as it says."""


@dataclass(slots=True, eq=False)
class _Word:
    """What one robot has said."""

    promised: dict[Spot, list[Promise]]
    """By destination, to the decimetre."""
    stops: Stops | None = None
    """As it said last, where all of that is promised and nothing else."""
    said_s: float = 0.0
    """The least of when each of them was promised last."""


class Promises:
    """By robot."""

    def __init__(self) -> None:
        self._open: dict[str, _Word] = {}

    def heard(self, robot: str, now_s: float, here: Spot, stops: Stops) -> list[list[Promise]]:
        """A robot is at `here` and says when it will be where; what it had said of each destination it has come to."""
        word = self._open.get(robot)
        ahead = {(datum, round(x, 1), round(y, 1)): t_s for t_s, (datum, x, y) in stops}
        if not ahead and not word:
            return []
        promised = word.promised if word else {}
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
        if promised:
            settled = stops if promised.keys() == ahead.keys() else None
            self._open[robot] = _Word(promised, settled, min(said[-1].said_s for said in promised.values()))
        else:
            self._open.pop(robot, None)
        return kept

    def know(self, robot: str, now_s: float, stops: Stops) -> bool:
        """Whether a robot that is at none of its destinations says what it said, and not for so long that it counts."""
        word = self._open.get(robot)
        return word is not None and stops == word.stops and now_s - word.said_s < SAY_AGAIN_S

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
