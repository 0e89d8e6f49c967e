"""Islands: robots or places that are near each other, directly or through others between them."""

from math import hypot

import numba
import numpy as np

from ingest.batch import Floats, Ints
from ingest.kernels import inner, kernel

_INTS = numba.int64[::1]
_APART = -1
"""A slot whose robot comes near no other."""


@inner
def _root(parent: Ints, slot: int) -> int:
    """The slot that stands for the island of a slot. Shortens the way to it."""
    while parent[slot] != slot:
        parent[slot] = parent[parent[slot]]
        slot = parent[slot]
    return slot


@kernel(numba.types.UniTuple(_INTS, 2)(_INTS, _INTS, numba.int64))  # type: ignore[no-untyped-call]
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
        of_a, of_b = _root(parent, a[row]), _root(parent, b[row])
        parent[max(of_a, of_b)] = min(of_a, of_b)
    number, islands, n = np.empty(slots, np.int64), 0, 0
    for slot in range(slots):
        if parent[slot] == slot:
            number[slot], islands = islands, islands + 1
        n += parent[slot] != _APART
    found, island, n = np.empty(n, np.int64), np.empty(n, np.int64), 0
    for slot in range(slots):
        if parent[slot] != _APART:
            found[n], island[n] = slot, number[_root(parent, slot)]
            n += 1
    return found, island


@kernel(_INTS(numba.float64[::1], numba.float64[::1], numba.float64))
def spots_of(x_m: Floats, y_m: Floats, within_m: float) -> Ints:
    """(n,) the island of each place, numbered from 0 by their first places. Places are near within a distance."""
    parent = np.arange(len(x_m))
    for a in range(len(x_m)):
        for b in range(a):
            if hypot(x_m[a] - x_m[b], y_m[a] - y_m[b]) <= within_m:
                of_a, of_b = _root(parent, a), _root(parent, b)
                parent[max(of_a, of_b)] = min(of_a, of_b)
    number, spots = np.empty(len(x_m), np.int64), 0
    for place in range(len(x_m)):
        if parent[place] == place:
            number[place], spots = spots, spots + 1
        else:
            number[place] = number[_root(parent, place)]
    return number
