"""Who comes near whom, by where robots will go by their newest forecasts.

Compiled; arrays are by slot, as `followed` keeps them and `ways` describes them.
"""

import numba
import numpy as np

from ingest.batch import Bools, Floats, Ints
from ingest.kernels import inner, kernel

_INTS, _FLOATS, _MATRIX, _CUBE = numba.int64[::1], numba.float64[::1], numba.float64[:, ::1], numba.float64[:, :, ::1]


@inner
def _set_way(ways: Floats, near: Floats, reach: Floats, seen: Floats, track: Floats, slot: int, now_s: float) -> None:
    """Where a robot is, x_m, y_m and floor, at every whole second from now on, in `ways`; and its `reach` and half of
    the furthest that it goes in one, in `near`: unless they are set already. All are as far into a second of its track.
    """
    if near[slot] >= 0.0:
        return
    last, since_s, longest = track.shape[1] - 1, now_s - seen[slot, 0], 0.0
    whole = int(np.floor(since_s))
    for second in range(ways.shape[1]):
        at, share = whole + second, since_s - whole
        if at < 0:
            at, share = 0, 0.0
        elif at >= last:
            at, share = last - 1, 1.0
        x, y, floor = track[slot, at, 0], track[slot, at, 1], track[slot, at, 3]
        if track[slot, at + 1, 3] == floor:
            x, y = x + share * (track[slot, at + 1, 0] - x), y + share * (track[slot, at + 1, 1] - y)
        if second:
            dx, dy = x - ways[slot, second - 1, 0], y - ways[slot, second - 1, 1]
            longest = max(longest, dx * dx + dy * dy)
        ways[slot, second, 0], ways[slot, second, 1], ways[slot, second, 2] = x, y, floor
    near[slot] = reach[slot] + np.sqrt(longest) / 2


@inner
def _meet(ways: Floats, one: int, other: int, within: float) -> bool:
    """Whether two ways come so near at any of their seconds."""
    for second in range(ways.shape[1]):
        if ways[one, second, 2] == ways[other, second, 2] and ways[one, second, 2] >= 0.0:
            dx, dy = ways[one, second, 0] - ways[other, second, 0], ways[one, second, 1] - ways[other, second, 1]
            if dx * dx + dy * dy <= within * within:
                return True
    return False


@inner
def _cell(around: Floats, slot: int, side: float) -> tuple[int, int]:
    return int(np.floor(around[slot, 0] / side)), int(np.floor(around[slot, 1] / side))


@inner
def _cells(slots: Ints, around: Floats, side: float, across: int, after: Ints) -> Ints:
    """(across, across) the last of the slots whose boxes have their centre in each cell, -1 where none has; the one
    before it is in `after` (slots,), and so on to -1. Cells repeat, so that one far away costs no room."""
    last = np.full((across, across), -1)
    for slot in slots:
        x, y = _cell(around, slot, side)
        x, y = x & (across - 1), y & (across - 1)
        after[slot], last[x, y] = last[x, y], slot
    return last


@kernel(
    numba.int64[:, ::1](
        numba.boolean[::1], *[_INTS] * 2, _MATRIX, _FLOATS, _MATRIX, _CUBE, numba.float64, numba.int64, numba.float64
    )
)
def nearing(
    told: Bools,
    slots: Ints,
    rank: Ints,
    around: Floats,
    reach: Floats,
    seen: Floats,
    track: Floats,
    now_s: float,
    seconds: int,
    rounding_m: float,
) -> Ints:
    """(p, 2) pairs of `slots` (n,), one of each `told`, that come near at any of so many whole seconds; once each, the
    lower in `rank` first.

    Near is within the `reach` of both and half of what each goes from one second to the next. Only robots whose boxes
    `around` meet, grown so, are followed: they are in cells that are neighbours.
    """
    box, found, pairs = np.empty((len(told), 2)), np.empty((64, 2), np.int64), 0
    widest, across = 0.0, 4
    for slot in slots:
        by = around[slot, 4] / 2 + reach[slot] + rounding_m
        box[slot, 0], box[slot, 1] = around[slot, 2] + by, around[slot, 3] + by
        widest = max(widest, box[slot, 0], box[slot, 1])
    while across * across < len(slots):
        across *= 2
    side, after = 2 * widest, np.empty(len(told), np.int64)
    last = _cells(slots, around, side, across, after)
    ways, near = np.empty((len(told), seconds, 3)), np.full(len(told), -1.0)
    for slot in slots:
        if not told[slot]:
            continue
        _set_way(ways, near, reach, seen, track, slot, now_s)
        x, y = _cell(around, slot, side)
        for cell in range(9):
            other = last[(x + cell // 3 - 1) & (across - 1), (y + cell % 3 - 1) & (across - 1)]
            while other >= 0:
                beside, other = other, after[other]
                away_x, away_y = abs(around[beside, 0] - around[slot, 0]), abs(around[beside, 1] - around[slot, 1])
                is_beyond = (away_x > box[slot, 0] + box[beside, 0]) | (away_y > box[slot, 1] + box[beside, 1])
                if is_beyond | (told[beside] & (beside <= slot)):
                    continue
                _set_way(ways, near, reach, seen, track, beside, now_s)
                if _meet(ways, slot, beside, near[slot] + near[beside]):
                    if pairs == len(found):
                        found = np.concatenate((found, np.empty_like(found)))
                    second = int(rank[slot] < rank[beside])
                    found[pairs, 1 - second], found[pairs, second] = slot, beside
                    pairs += 1
    return found[:pairs].copy()
