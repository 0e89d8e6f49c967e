"""What robots say of when they will be where, kept until they come, and given up where they plan otherwise."""

from collections.abc import Iterable, Iterator, Sequence
from math import dist, hypot, inf
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ingest.batch import Batch, Destinations, Floats, Ints
from ingest.kernels import inner, kernel, ready

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
Spots = tuple[Ints, Floats, Floats]
"""Floor, x, y of many."""

MOST_SPOTS = 10
"""Destinations that a robot may tell by the standard; of one that tells more, everything counts."""
UNKNOWN = -1
WORD = np.dtype(
    [("told", np.int64), ("said_s", np.float64), ("free_m", np.float64), ("floor", np.int64, 1 + MOST_SPOTS)]
    + [(name, np.float64, 1 + MOST_SPOTS) for name in ("x_m", "y_m")],
    align=True,
)
"""What one robot has said: how many destinations, or `UNKNOWN` where it always counts what it says; the least of when
each was promised last; how far it can go from where it was and come to none of them, and leave none; and where it was
then, and its destinations."""

_WORDS = numba.types.Array(numba.from_dtype(WORD), 1, "C")
_FLOATS, _INTS = (numba.types.Array(kind, 1, "C", readonly=True) for kind in (numba.float64, numba.int64))


class Promise(NamedTuple):
    """When it was said, and the time that was told."""

    said_s: float
    told_s: float


@inner
def _note(word: Any, numbers: Ints, floor: Ints, x_m: Floats, y_m: Floats, to: int, first: int, count: int) -> None:
    """Write so many spots of some into a word."""
    for k in range(count):
        word.floor[to + k] = numbers[floor[first + k]] if floor[first + k] >= 0 else -1
        word.x_m[to + k], word.y_m[to + k] = x_m[first + k], y_m[first + k]


@kernel(numba.int64(numba.int64, _WORDS, *[_INTS] * 2, _FLOATS, _INTS, *[_FLOATS] * 2, _INTS, _INTS, *[_FLOATS] * 2))
def _first_that_counts(
    row: int,
    words: NDArray[Any],
    slots: Ints,
    numbers: Ints,
    now_s: Floats,
    floor: Ints,
    x_m: Floats,
    y_m: Floats,
    start: Ints,
    to_floor: Ints,
    to_x_m: Floats,
    to_y_m: Floats,
) -> int:
    """The first from `row` on of a robot that says something else than before, or says it anew, comes or sets out."""
    while row < len(slots):
        first, count, word = start[row], start[row + 1] - start[row], words[slots[row]]
        stands = count == word.told
        if stands and count:
            on = numbers[floor[row]] if floor[row] >= 0 else -1
            away_m = hypot(x_m[row] - word.x_m[0], y_m[row] - word.y_m[0])
            stands = now_s[row] - word.said_s < SAY_AGAIN_S and on == word.floor[0] and away_m <= word.free_m
            for k in range(count if stands else 0):
                on = numbers[to_floor[first + k]] if to_floor[first + k] >= 0 else -1
                stands = stands and on == word.floor[1 + k]
                stands = stands and to_x_m[first + k] == word.x_m[1 + k] and to_y_m[first + k] == word.y_m[1 + k]
        if not stands:
            _note(words[slots[row]], numbers, floor, x_m, y_m, 0, row, 1)
            _note(words[slots[row]], numbers, to_floor, to_x_m, to_y_m, 1, first, min(count, MOST_SPOTS))
            words[slots[row]].told = count if count <= MOST_SPOTS else UNKNOWN
            break
        row += 1
    return row


class Promises:
    """By robot."""

    def __init__(self) -> None:
        self._open: dict[str, dict[Spot, list[Promise]]] = {}
        """Of robots that named destinations when they were heard last, or of which some of before are still promised;
        by destination, to the decimetre."""
        self._floors = {"": -1}
        """Numbers of floors in `_words`."""
        self._slots: dict[str, int] = {}
        self._words = np.zeros(0, WORD)
        """By slot, and some to spare."""
        self._free: list[int] = []

    def hear(
        self, batch: Batch, now_s: Floats, here: Spots, told: Destinations
    ) -> Iterator[tuple[int, list[list[Promise]]]]:
        """Robots say where they go, as `told`, and are `here` (n,) by `now_s` (n,): rows of those that have come
        somewhere, and what they had said of that."""
        if not len(told.t_s) and not self._open:
            return
        numbers = np.array([self._number(floor) for floor in batch.floors], np.int64)
        floor, x_m, y_m = ready(here[0], np.int64), ready(here[1]), ready(here[2])
        start, to_floor, to_x_m, to_y_m = told.start, told.floor, told.x_m, told.y_m
        columns = (floor, x_m, y_m, ready(start, np.int64), ready(to_floor, np.int64), ready(to_x_m), ready(to_y_m))
        slots = np.array([self._slots.get(robot, UNKNOWN) for robot in batch.robots], np.int64)
        if len(slots) and slots.min() == UNKNOWN:
            slots = np.array([self._slot(robot) for robot in batch.robots])
        row, now_s = -1, ready(now_s)
        while (row := _first_that_counts(row + 1, self._words, slots, numbers, now_s, *columns)) < len(slots):
            stops = slice(start[row], start[row + 1])
            spots = zip(batch.datums(to_floor[stops]), to_x_m[stops].tolist(), to_y_m[stops].tolist(), strict=True)
            at = batch.floors[floor[row]] if floor[row] >= 0 else "", float(x_m[row]), float(y_m[row])
            if kept := self.heard(batch.robots[row], float(now_s[row]), at, list(spots), told.t_s[stops].tolist()):
                yield row, kept

    def heard(
        self, robot: str, now_s: float, here: Spot, spots: Sequence[Spot], told_s: Sequence[float]
    ) -> list[list[Promise]]:
        """A robot is at `here` and says when it will be at each of `spots`, of the same length as `told_s`.

        What it had said of each destination it has come to.
        """
        ahead = {(datum, round(x, 1), round(y, 1)): t_s for (datum, x, y), t_s in zip(spots, told_s, strict=True)}
        promised = self._open.get(robot, {})
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
            self._open[robot] = promised
        else:
            self._open.pop(robot, None)
        if robot in self._slots:
            word = self._words[self._slots[robot]]
            word["said_s"] = min((said[-1].said_s for said in promised.values()), default=inf)
            word["free_m"] = _free_m(here, ahead)
            if not promised.keys() <= ahead.keys():
                word["told"] = UNKNOWN
        return kept

    def waiting(self) -> Iterator[tuple[str, list[Promise]]]:
        """Robots, and what they said of each destination to which they have not come."""
        for robot, promised in self._open.items():
            for said in promised.values():
                yield robot, said

    def forget(self, robot: str) -> None:
        self._open.pop(robot, None)
        if robot in self._slots:
            self._free.append(self._slots.pop(robot))
            self._words["told"][self._free[-1]] = 0

    def _slot(self, robot: str) -> int:
        slot = self._slots.get(robot)
        if slot is None:
            slot = self._slots[robot] = self._free.pop() if self._free else len(self._slots)
            if slot >= len(self._words):
                self._words = np.pad(self._words, (0, slot + 1))
        return slot

    def _number(self, floor: str) -> int:
        return self._floors.setdefault(floor, len(self._floors))


def near(a: Spot, b: Spot, within_m: float = ARRIVED_M) -> bool:
    return a[0] == b[0] and hypot(a[1] - b[1], a[2] - b[2]) <= within_m


def _free_m(here: Spot, spots: Iterable[Spot]) -> float:
    """How far a robot can go and be near to the same spots as now."""
    from_m = [abs(dist(spot[1:], here[1:]) - ARRIVED_M) for spot in spots if spot[0] == here[0]]
    return min(from_m, default=inf) - ROUNDING_M


def _is_over(last: Promise, now_s: float) -> bool:
    """Whether a destination that is no longer named lay ahead, which is another plan, or is long past."""
    return last.told_s > now_s or last.told_s + FORGET_S < now_s
