"""How long robots of a model usually take: by cell of the floor and direction of travel, learned from passes in which
nothing was in their way.

The memory is bounded: a table of fixed size. If it is full, a rarely driven cell makes room.
"""

from math import atan2, ceil, floor, hypot, nan, pi
from typing import NamedTuple

import numpy as np

from ingest.batch import Floats, Ints
from ingest.kernels import FLOATS, INTS, inner, named_type

CELL_M, STEP_M = 2.0, 1.0
"""Size of a cell, and longest step of a way that counts to one cell."""
DIRECTIONS = 8
ENTRIES = 1 << 16
"""Cells, directions and models that are known at once: 1.5 MiB."""
LOOKS = 8
"""Places of the table at which a cell may stand."""
LEAST_M = 4.0
"""The usual time of a cell is known once a model has driven this far in it."""
MOST_M = 60.0
"""Beyond this way what was learned counts half, so that the table follows changes."""
STANDS_M = 0.05
"""A robot that came less far stands, for which no time is usual."""
MOST_FLOORS, MOST_CELLS, MOST_KINDS = 1 << 8, 1 << 16, 1 << 12
"""Floors, cells along each side and models that have a key of their own."""


class UsualTimes(NamedTuple):
    """Arrays are (ENTRIES,)."""

    key: Ints
    """Of floor, cell, direction and model; 0 where there is none."""
    way_m: Floats
    """How far robots drove."""
    took_s: Floats
    """How long they took for it."""


USUAL = named_type(UsualTimes, INTS, FLOATS, FLOATS)
"""The type of `UsualTimes` in kernels."""


def no_usual_times() -> UsualTimes:
    return UsualTimes(np.zeros(ENTRIES, np.int64), np.zeros(ENTRIES), np.zeros(ENTRIES))


@inner
def _key(kind: int, floor_index: float, x_m: float, y_m: float, direction_rad: float) -> int:
    """A number above 0 for the model `kind`, cell and direction."""
    direction = floor((direction_rad / (2 * pi) + 1.0) * DIRECTIONS + 0.5) % DIRECTIONS
    key = int(floor_index + 1) % MOST_FLOORS
    key = key * MOST_CELLS + floor(x_m / CELL_M) % MOST_CELLS
    key = key * MOST_CELLS + floor(y_m / CELL_M) % MOST_CELLS
    return (key * DIRECTIONS + direction) * MOST_KINDS + kind % MOST_KINDS + 1


@inner
def _first_look(key: int) -> int:
    mixed = (key ^ (key >> 23)) * 2654435761
    return int((mixed ^ (mixed >> 29)) & (ENTRIES - 1))


@inner
def _found(usual: UsualTimes, key: int) -> int:
    """The entry of a key; -1 if there is none."""
    first = _first_look(key)
    for look in range(LOOKS):
        entry = (first + look) & (ENTRIES - 1)
        if usual.key[entry] == key:
            return entry
    return -1


@inner
def _entry_for(usual: UsualTimes, key: int) -> int:
    """The entry of a key. A new one takes the place of the least driven."""
    entry = _found(usual, key)
    if entry >= 0:
        return entry
    first = least = _first_look(key)
    for look in range(LOOKS):
        entry = (first + look) & (ENTRIES - 1)
        if usual.way_m[entry] < usual.way_m[least]:
            least = entry
    usual.key[least], usual.way_m[least], usual.took_s[least] = key, 0.0, 0.0
    return least


@inner
def learn_pass(usual: UsualTimes, kind: int, floor_index: float, begin: Floats, end: Floats, took_s: float) -> None:
    """A robot of a model has driven undisturbed from one pose (3,) to another."""
    way_x, way_y = end[0] - begin[0], end[1] - begin[1]
    way_m, direction_rad = hypot(way_x, way_y), atan2(way_y, way_x)
    steps = max(ceil(way_m / STEP_M), 1)
    for step in range(steps):
        share = (step + 0.5) / steps
        key = _key(kind, floor_index, begin[0] + share * way_x, begin[1] + share * way_y, direction_rad)
        entry = _entry_for(usual, key)
        if usual.way_m[entry] > MOST_M:
            usual.way_m[entry], usual.took_s[entry] = usual.way_m[entry] / 2, usual.took_s[entry] / 2
        usual.way_m[entry] += way_m / steps
        usual.took_s[entry] += took_s / steps


@inner
def usual_s(usual: UsualTimes, kind: int, floor_index: float, begin: Floats, end: Floats) -> float:
    """How long robots of a model usually take from one pose (3,) to another; nan if it is not known."""
    way_x, way_y = end[0] - begin[0], end[1] - begin[1]
    way_m, direction_rad = hypot(way_x, way_y), atan2(way_y, way_x)
    if way_m < STANDS_M:
        return 0.0
    steps, sum_s = max(ceil(way_m / STEP_M), 1), 0.0
    for step in range(steps):
        share = (step + 0.5) / steps
        key = _key(kind, floor_index, begin[0] + share * way_x, begin[1] + share * way_y, direction_rad)
        entry = _found(usual, key)
        if entry < 0 or usual.way_m[entry] < LEAST_M:
            return nan
        sum_s += way_m / steps * usual.took_s[entry] / usual.way_m[entry]
    return sum_s
