"""The results of rollouts, and which robots are due to be driven on again.

Robots that come near each other, directly or through others between them, form an island. Islands have their turns at
different times, so that the work of many is spread over the passes.
"""

import numpy as np

from deconflict.foresight.rollout.rollout import NEVER, NOBODY, RolloutResult
from ingest.batch import Bools, Floats, Ints
from ingest.kernels import INT, INTS, inner, kernel

_APART = -1
"""A slot whose robot comes near no other."""


@inner
def _root(parent: Ints, slot: int) -> int:
    """The slot that stands for the island of a slot. Shortens the way to it."""
    while parent[slot] != slot:
        parent[slot] = parent[parent[slot]]
        slot = parent[slot]
    return slot


@inner
def _join(parent: Ints, a: int, b: int) -> None:
    """Make one island of the islands of two slots."""
    of_a, of_b = _root(parent, a), _root(parent, b)
    parent[max(of_a, of_b)] = min(of_a, of_b)


@inner
def _numbers(parent: Ints) -> Ints:
    """(n,) the number of the island of each slot, from 0 by their lowest slots; `_APART` for a slot that has none."""
    number, islands = np.full(len(parent), _APART), 0
    for slot in range(len(parent)):
        if parent[slot] == slot:
            number[slot], islands = islands, islands + 1
        elif parent[slot] != _APART:
            number[slot] = number[_root(parent, slot)]
    return number


@kernel((INTS, INTS, INT))
def islands_of(a: Ints, b: Ints, slots: int) -> tuple[Ints, Ints]:
    """The slots (n,) of all robots of the pairs `a`, `b` (p,), ascending, and the island of each, (n,).

    Islands are numbered from 0, by their lowest slots. All slots are below `slots`. This is a union-find: Tarjan,
    "Efficiency of a good but not linear set union algorithm", 1975.
    """
    parent = np.full(slots, _APART)
    for row in range(len(a)):
        for slot in (a[row], b[row]):
            if parent[slot] == _APART:
                parent[slot] = slot
        _join(parent, a[row], b[row])
    number = _numbers(parent)
    found = np.flatnonzero(number != _APART)
    return found, number[found]


EVERY_S = 1.0
"""Interval between two rollouts of an island."""
MOST = 200
"""About how many robots are driven on at one look. The others wait; those that have waited longest come first."""
MOST_PER_S = 2000.0
"""The same in the looks of one second, on average."""
KEYS = 1 << 24
"""A robot's key is below this."""


class RolloutSchedule:
    """By slot and by pair, the results of the last rollout of each."""

    def __init__(self) -> None:
        self.waits_for: Ints = np.zeros(0, np.int64)
        """(slots,) the slot of the robot that a standing robot has to wait for; `NOBODY` if there is none."""
        self._driven_s: Floats = np.zeros(0)
        """(slots,) when each robot was last driven on; -inf if it has no result."""
        self._code: Ints = np.zeros(0, np.int64)
        """(p,) codes of the pairs with results, ascending."""
        self._features: Floats = np.zeros((0, len(NEVER)))
        """(p, ROLLED)"""
        self._slots: Ints = np.zeros((0, 2), np.int64)
        """(p, 2)"""
        self._allowed, self._filled_s = float(MOST), -np.inf
        """A token bucket: how many robots may be driven on, and when it was last filled."""

    def grow(self, slots: int) -> None:
        """Make room for this many slots."""
        more = slots - len(self.waits_for)
        self.waits_for = np.concatenate([self.waits_for, np.full(more, NOBODY)])
        self._driven_s = np.concatenate([self._driven_s, np.full(more, -np.inf)])

    def forget(self, slots: Ints) -> None:
        """Other robots have these slots from now on."""
        if len(slots):
            self._driven_s[slots], self.waits_for[slots] = -np.inf, NOBODY
            self._drop_pairs(slots)

    def due(self, a: Ints, b: Ints, key: Ints, now_s: float) -> Ints:
        """Slots of the robots whose turn it is. The pairs `a`, `b` (p,) come near each other; `key` is by slot.

        A robot that comes near no other robot loses its result: it waits for nobody, and is in nobody's way.
        """
        slots, island = islands_of(a, b, len(self.waits_for))
        is_alone = np.isfinite(self._driven_s)
        is_alone[slots] = False
        self.forget(np.flatnonzero(is_alone))
        if not len(slots):
            return slots
        islands = int(island.max()) + 1
        last_s, lowest_key = np.full(islands, np.inf), np.full(islands, KEYS)
        np.minimum.at(last_s, island, self._driven_s[slots])
        np.minimum.at(lowest_key, island, key[slots])
        turn_s = lowest_key / KEYS * EVERY_S
        is_due = np.floor((now_s + turn_s) / EVERY_S) > np.floor((last_s + turn_s) / EVERY_S)
        self._allowed = min(self._allowed + (now_s - self._filled_s) * MOST_PER_S, MOST)
        self._filled_s = now_s
        is_due[_postponed(is_due, np.bincount(island), last_s, lowest_key, self._allowed)] = False
        chosen = slots[is_due[island]]
        self._allowed = max(self._allowed - len(chosen), 0.0)
        return chosen

    def store(self, slots: Ints, result: RolloutResult, code: Ints, now_s: float) -> None:
        """Keep the result of a rollout of the robots `slots`, whose pairs have these codes (p,)."""
        self._drop_pairs(slots)
        self._driven_s[slots], self.waits_for[slots] = now_s, result.waits_for
        code = np.concatenate([self._code, code])
        order = np.argsort(code)
        self._code = code[order]
        self._features = np.concatenate([self._features, result.features])[order]
        self._slots = np.concatenate([self._slots, np.column_stack([result.a, result.b])])[order]

    def features_of(self, code: Ints) -> Floats:
        """(p, ROLLED) features of the pairs `code` (p,); `NEVER` for a pair without a result."""
        features = np.tile(NEVER, (len(code), 1))
        if len(self._code):
            at = np.minimum(np.searchsorted(self._code, code), len(self._code) - 1)
            is_known = self._code[at] == code
            features[is_known] = self._features[at[is_known]]
        return features

    def _drop_pairs(self, slots: Ints) -> None:
        """Forget the results of the pairs of these robots."""
        is_dropped = np.zeros(len(self.waits_for), np.bool_)
        is_dropped[slots] = True
        kept = ~is_dropped[self._slots].any(axis=1)
        self._code, self._features, self._slots = self._code[kept], self._features[kept], self._slots[kept]


def _postponed(is_due: Bools, robots: Ints, last_s: Floats, lowest_key: Ints, allowed: float) -> Ints:
    """The due islands that wait for a later look. Arrays are (n,), by island.

    Islands are chosen until `allowed` robots are reached: first those whose last turn, `last_s`, is longest ago, and of
    equals the one with the lowest key. `robots` is how many robots each island has.
    """
    due = np.flatnonzero(is_due)
    due = due[np.lexsort((lowest_key[due], last_s[due]))]
    before = np.cumsum(robots[due]) - robots[due]
    return due[before >= allowed]
