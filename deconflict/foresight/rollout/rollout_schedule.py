"""What came of the robots that were driven on together, and who is due to be driven on again.

Robots that come near each other, directly or by others between them, are one island. Each island has its own turn, so
that the work of many is spread over the passes.
"""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from deconflict.foresight.rollout.rollout import NEVER, NOBODY, RolloutResult
from ingest.batch import Bools, Floats, Ints

EVERY_S = 1.0
"""An island is driven on so often."""
MOST = 200
"""About how many robots one look drives on. The others wait; those that have waited longest come first."""
KEYS = 1 << 24
"""A robot's key is below this."""


class RolloutSchedule:
    """By slot and by pair, as of the last time that each was driven on."""

    def __init__(self) -> None:
        self.waits_for: Ints = np.zeros(0, np.int64)
        """(slots,) for whose slot a robot that stands has to wait; `NOBODY` where for none."""
        self._rolled_s: Floats = np.zeros(0)
        self._code: Ints = np.zeros(0, np.int64)
        """Of pairs, ascending."""
        self._seen: Floats = np.zeros((0, len(NEVER)))
        self._slots: Ints = np.zeros((0, 2), np.int64)

    def grow(self, slots: int) -> None:
        more = slots - len(self.waits_for)
        self.waits_for = np.concatenate([self.waits_for, np.full(more, NOBODY)])
        self._rolled_s = np.concatenate([self._rolled_s, np.full(more, -np.inf)])

    def forget(self, slots: Ints) -> None:
        """Other robots have these slots from now on."""
        if len(slots):
            self._rolled_s[slots], self.waits_for[slots] = -np.inf, NOBODY
            self._drop(slots)

    def due(self, a: Ints, b: Ints, key: Ints, now_s: float) -> Ints:
        """Slots of the robots whose turn it is, where pairs `a`, `b` (p,) come near; `key` is by slot.

        A robot that comes near nobody waits for nobody, and is in nobody's way.
        """
        slots, places = np.unique(np.concatenate([a, b]), return_inverse=True)
        alone = np.isfinite(self._rolled_s)
        alone[slots] = False
        self.forget(np.flatnonzero(alone))
        if not len(slots):
            return slots
        graph = coo_array((np.ones(len(a)), (places[: len(a)], places[len(a) :])), (len(slots), len(slots)))
        islands, island = connected_components(graph, directed=False)
        last_s, lowest = np.full(islands, np.inf), np.full(islands, KEYS)
        np.minimum.at(last_s, island, self._rolled_s[slots])
        np.minimum.at(lowest, island, key[slots])
        turn_s = lowest / KEYS * EVERY_S
        is_due = np.floor((now_s + turn_s) / EVERY_S) > np.floor((last_s + turn_s) / EVERY_S)
        is_due[_postponed(is_due, np.bincount(island), last_s, lowest)] = False
        due: Ints = slots[is_due[island]]
        return due

    def store(self, slots: Ints, rolled: RolloutResult, code: Ints, now_s: float) -> None:
        """Robots of `slots` were driven on, which gave `rolled`, of pairs with that `code` (p,)."""
        self._drop(slots)
        self._rolled_s[slots], self.waits_for[slots] = now_s, rolled.waits_for
        code = np.concatenate([self._code, code])
        order = np.argsort(code)
        self._code = code[order]
        self._seen = np.concatenate([self._seen, rolled.seen])[order]
        self._slots = np.concatenate([self._slots, np.column_stack([rolled.a, rolled.b])])[order]

    def seen_of(self, code: Ints) -> Floats:
        """(p, ROLLED) features of pairs (p,)."""
        seen = np.tile(NEVER, (len(code), 1))
        if len(self._code):
            at = np.minimum(np.searchsorted(self._code, code), len(self._code) - 1)
            known = self._code[at] == code
            seen[known] = self._seen[at[known]]
        return seen

    def _drop(self, slots: Ints) -> None:
        """Forget the pairs of these."""
        dropped = np.zeros(len(self.waits_for), np.bool_)
        dropped[slots] = True
        kept = ~dropped[self._slots].any(axis=1)
        self._code, self._seen, self._slots = self._code[kept], self._seen[kept], self._slots[kept]


def _postponed(is_due: Bools, robots: Ints, last_s: Floats, lowest: Ints) -> Ints:
    """The due islands that wait for a later look. Arrays are (n,), by island.

    Islands are taken until `MOST` robots are reached: first those whose last turn, `last_s`, is longest ago, and of
    equals the one with the lowest key, `lowest`. `robots` is how many robots each island has.
    """
    due = np.flatnonzero(is_due)
    due = due[np.lexsort((lowest[due], last_s[due]))]
    before = np.cumsum(robots[due]) - robots[due]
    waits: Ints = due[before >= MOST]
    return waits
