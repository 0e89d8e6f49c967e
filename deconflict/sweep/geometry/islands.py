"""Islands: robots that are near each other, directly or through others between them."""

import numpy as np

from ingest.batch import Ints
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
