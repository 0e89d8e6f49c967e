"""Which pairs of robots may come near each other, by where they will go by their newest forecasts.

Compiled. Arrays are by slot, see `PendingForecasts`. `find_pairs` is long because it makes the grid of cells and
then goes through it once: the size of a cell depends on all robots.
"""

import numpy as np

from deconflict.foresight.forecast_errors.track_kernels import on_track
from ingest.batch import Bools, Floats, Ints
from ingest.kernels import BOOLS, CUBE, FLOAT, FLOATS, INT, INT_MATRIX, INTS, MATRIX, inner, kernel

MOST_FOUND = 256
"""A robot with news is paired with at most so many others. Far fewer bodies have room beside it."""


@inner
def _set_places(
    places: Floats, near: Floats, reach: Floats, newest: Floats, track: Floats, slot: int, now_s: float
) -> None:
    """Set the places of a robot at every whole second from now on, x_m, y_m and floor, in `places`; and its `reach`
    plus half of its longest step, in `near`. Does nothing if they are set already."""
    if near[slot] >= 0.0:
        return
    longest = 0.0
    for second in range(places.shape[1]):
        x, y, _, floor = on_track(track, slot, now_s - newest[slot, 0] + second)
        if second:
            dx, dy = x - places[slot, second - 1, 0], y - places[slot, second - 1, 1]
            longest = max(longest, dx * dx + dy * dy)
        places[slot, second, 0], places[slot, second, 1], places[slot, second, 2] = x, y, floor
    near[slot] = reach[slot] + np.sqrt(longest) / 2


@inner
def _are_near(x: float, y: float, floor: float, place: Floats, within: float) -> bool:
    """Whether a point and a place (3,) are on one floor, and within a distance of each other."""
    dx, dy = x - place[0], y - place[1]
    return bool(floor == place[2] and floor >= 0.0 and dx * dx + dy * dy <= within * within)


@inner
def _nearing(places: Floats, newest: Floats, a: int, b: int, within: float, waits: Bools) -> int:
    """The first of the seconds at which two robots are within a distance of each other, also if one that waits stays
    where it was reported, while the other goes; -1 if they never are."""
    stays, goes = (a, b) if waits[a] else (b, a)
    one_waits = waits[a] != waits[b]
    x, y, floor = newest[stays, 1], newest[stays, 2], newest[stays, 4]
    for second in range(places.shape[1]):
        if _are_near(places[a, second, 0], places[a, second, 1], places[a, second, 2], places[b, second], within):
            return second
        if one_waits and _are_near(x, y, floor, places[goes, second], within):
            return second
    return -1


@inner
def _cell(around: Floats, slot: int, side: float) -> tuple[int, int]:
    return int(np.floor(around[slot, 0] / side)), int(np.floor(around[slot, 1] / side))


@inner
def _cells(slots: Ints, around: Floats, side: float, across: int, after: Ints) -> Ints:
    """(across, across) the last of the slots whose boxes have their centre in each cell, -1 if there is none. The slot
    before it in the cell is in `after` (slots,), and so on to -1. Cells repeat in space, so that a far one costs no
    memory."""
    last = np.full((across, across), -1)
    for slot in slots:
        x, y = _cell(around, slot, side)
        x, y = x & (across - 1), y & (across - 1)
        after[slot], last[x, y] = last[x, y], slot
    return last


@kernel(INT_MATRIX(*[BOOLS] * 3, *[INTS] * 2, MATRIX, FLOATS, MATRIX, CUBE, FLOAT, INT, FLOAT))
def find_pairs(
    has_news: Bools,
    is_left_out: Bools,
    waits: Bools,
    slots: Ints,
    rank: Ints,
    around: Floats,
    reach: Floats,
    newest: Floats,
    track: Floats,
    now_s: float,
    seconds: int,
    rounding_m: float,
) -> Ints:
    """(p, 3) pairs of `slots` (n,) that come near each other at any of the whole seconds, and the first of these. Each
    pair comes once, the lower in `rank` first. At least one robot of each pair `has_news`, and none `is_left_out`. One
    that `waits` may stay where it was reported, while the other goes.

    Near means within the `reach` of both plus half of each one's longest step. Only robots whose boxes `around`, grown
    so, overlap are compared in time: they are in neighbouring cells.
    """
    box, found, pairs = np.empty((len(has_news), 2)), np.empty((64, 3), np.int64), 0
    widest, across = 0.0, 4
    for slot in slots:
        by = around[slot, 4] / 2 + reach[slot] + rounding_m
        box[slot, 0], box[slot, 1] = around[slot, 2] + by, around[slot, 3] + by
        widest = max(widest, box[slot, 0], box[slot, 1])
    while across * across < len(slots):
        across *= 2
    side, after = 2 * widest, np.empty(len(has_news), np.int64)
    last = _cells(slots, around, side, across, after)
    places, near = np.empty((len(has_news), seconds, 3)), np.full(len(has_news), -1.0)
    for slot in slots:
        if not has_news[slot] or is_left_out[slot]:
            continue
        most = pairs + MOST_FOUND
        _set_places(places, near, reach, newest, track, slot, now_s)
        x, y = _cell(around, slot, side)
        for cell in range(9):
            next_slot = last[(x + cell // 3 - 1) & (across - 1), (y + cell % 3 - 1) & (across - 1)]
            while next_slot >= 0 and pairs < most:
                beside, next_slot = next_slot, after[next_slot]
                away_x, away_y = abs(around[beside, 0] - around[slot, 0]), abs(around[beside, 1] - around[slot, 1])
                is_beyond = (away_x > box[slot, 0] + box[beside, 0]) | (away_y > box[slot, 1] + box[beside, 1])
                if is_beyond | is_left_out[beside] | (has_news[beside] & (beside <= slot)):
                    continue
                _set_places(places, near, reach, newest, track, beside, now_s)
                first = _nearing(places, newest, slot, beside, near[slot] + near[beside], waits)
                if first >= 0:
                    if pairs == len(found):
                        found = np.concatenate((found, np.empty_like(found)))
                    second = int(rank[slot] < rank[beside])
                    found[pairs, 1 - second], found[pairs, second], found[pairs, 2] = slot, beside, first
                    pairs += 1
    return found[:pairs].copy()
