"""What robots say of when they will be where, kept until they come, and given up where they plan otherwise."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import dist, hypot, inf
from typing import NamedTuple

ARRIVED_M = 0.75
"""A robot this near its destination has arrived."""
SAY_AGAIN_S = 30.0
"""A robot's word is kept anew after this time."""
MOST_PROMISES = 32
"""Kept of one destination: a quarter of an hour."""
FORGET_S = 600.0
"""A robot this late is not waited for. One that no longer names a destination that lies ahead has another plan."""
ROUNDING_M = 1e-6
"""What is nearer than this to having arrived, or not, is looked at again."""

Spot = tuple[str, float, float]
"""Datum, x, y."""


class Promise(NamedTuple):
    """When it was said, and the time that was told."""

    said_s: float
    told_s: float


@dataclass(slots=True, eq=False)
class _Word:
    """What one robot has said."""

    promised: dict[Spot, list[Promise]]
    """By destination, to the decimetre."""
    spots: Sequence[Spot] | None
    """Its destinations as it said them last; None where others are promised too."""
    here: Spot
    """Where it was then."""
    free_m: float
    """So far it can go from there and come to none of them, and leave none."""
    said_s: float
    """The least of when each was promised last."""

    def stands(self, now_s: float, here: Spot, spots: Sequence[Spot]) -> bool:
        """Whether a robot that says the same destinations again says nothing that counts."""
        return spots == self.spots and now_s - self.said_s < SAY_AGAIN_S and near(here, self.here, self.free_m)


class Promises:
    """By robot."""

    def __init__(self) -> None:
        self._open: dict[str, _Word] = {}

    def heard(
        self, robot: str, now_s: float, here: Spot, spots: Sequence[Spot], told_s: Sequence[float]
    ) -> list[list[Promise]]:
        """A robot is at `here` and says when it will be at each of `spots`, of the same length as `told_s`.

        What it had said of each destination it has come to.
        """
        word = self._open.get(robot)
        if word.stands(now_s, here, spots) if word else not spots:
            return []
        ahead = {(datum, round(x, 1), round(y, 1)): t_s for (datum, x, y), t_s in zip(spots, told_s, strict=True)}
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
        if promised or ahead:
            said_s = min((said[-1].said_s for said in promised.values()), default=inf)
            again = spots if promised.keys() <= ahead.keys() else None
            self._open[robot] = _Word(promised, again, here, _free_m(here, ahead), said_s)
        else:
            self._open.pop(robot, None)
        return kept

    def __contains__(self, robot: str) -> bool:
        """Whether it named destinations when it was heard last, or some of before are still promised."""
        return robot in self._open

    def forget(self, robot: str) -> None:
        self._open.pop(robot, None)


def near(a: Spot, b: Spot, within_m: float = ARRIVED_M) -> bool:
    return a[0] == b[0] and hypot(a[1] - b[1], a[2] - b[2]) <= within_m


def _free_m(here: Spot, spots: Iterable[Spot]) -> float:
    """How far a robot can go and be near to the same spots as now."""
    from_m = [abs(dist(spot[1:], here[1:]) - ARRIVED_M) for spot in spots if spot[0] == here[0]]
    return min(from_m, default=inf) - ROUNDING_M


def _is_over(last: Promise, now_s: float) -> bool:
    """Whether a destination that is no longer named lay ahead, which is another plan, or is long past."""
    return last.told_s > now_s or last.told_s + FORGET_S < now_s
