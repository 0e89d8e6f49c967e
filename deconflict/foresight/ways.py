"""Where robots went between their last two reports and will go by their newest forecasts, who comes near whom,
and how far off that may be.

Compiled; arrays are by slot, as `followed` keeps them. A report is t_s, x_m, y_m, yaw_rad and floor; a track x_m, y_m,
yaw_rad and floor for every second from its report on.
"""

from math import pi

import numba
import numpy as np

from deconflict.motion import Bools
from ingest.compiled import inner, kernel
from ingest.seam import Floats, Ints

_INTS, _FLOATS, _MATRIX, _CUBE = numba.int64[::1], numba.float64[::1], numba.float64[:, ::1], numba.float64[:, :, ::1]
_ASKED = numba.types.Array(numba.float64, 2, "A", readonly=True)


@inner
def _turned(yaw: float, other: float, share: float) -> float:
    return yaw + share * ((other - yaw + pi) % (2 * pi) - pi)


@kernel(
    numba.types.Tuple((*[_INTS] * 3, _FLOATS))(  # type: ignore[no-untyped-call]
        *[_MATRIX] * 3, _INTS, numba.int64, numba.float64, numba.float64
    )
)
def due(
    before: Floats, seen: Floats, made_s: Floats, slots: Ints, horizons: int, long_ago_s: float, joined_s: float
) -> tuple[Ints, Ints, Ints, Floats]:
    """Slots, forecasts and seconds ahead, less one, of the moments between the last two reports of `slots` (n,) for
    which they have forecasts, made at `made_s` (slots, kept); and these moments. In that order, (d,) each."""
    most = len(slots) * made_s.shape[1] * horizons
    slot, kept, ahead, due_s = (
        np.empty(most, np.int64),
        np.empty(most, np.int64),
        np.empty(most, np.int64),
        np.empty(most),
    )
    found = 0
    for one in slots:
        before_s, seen_s = before[one, 0], seen[one, 0]
        if before_s <= long_ago_s or before_s < seen_s - joined_s:
            continue
        for made in range(made_s.shape[1]):
            for second in range(horizons):
                moment_s = made_s[one, made] + (second + 1.0)
                if before_s < moment_s <= seen_s:
                    slot[found], kept[found], ahead[found], due_s[found] = one, made, second, moment_s
                    found += 1
    return slot[:found].copy(), kept[:found].copy(), ahead[:found].copy(), due_s[:found].copy()


@kernel(_CUBE(_MATRIX, _MATRIX, _INTS, _ASKED, numba.float64, numba.float64))
def joined(before: Floats, seen: Floats, slots: Ints, t_s: Floats, long_ago_s: float, joined_s: float) -> Floats:
    """(n, m, 4) where robots were at `t_s` (n, m), on the line of their last two reports; floor -1 where none is."""
    poses = np.empty((*t_s.shape, 4))
    for row in range(len(slots)):
        a, b = before[slots[row]], seen[slots[row]]
        known = a[0] > long_ago_s and a[4] == b[4] and b[0] - a[0] <= joined_s
        if not known:
            a = b
        for at in range(t_s.shape[1]):
            share = (t_s[row, at] - a[0]) / max(b[0] - a[0], 1e-9)
            share = 0.0 if share < 0.0 else 1.0 if share > 1.0 else share
            pose = poses[row, at]
            pose[0], pose[1] = a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2])
            pose[2], pose[3] = _turned(a[3], b[3], share), b[4] if known else -1.0
    return poses


@inner
def _set_ahead(pose: Floats, track: Floats, since_s: float) -> None:
    """Where a robot is so long after the report of its track; linear between its samples."""
    last = len(track) - 1
    since_s = min(max(since_s, 0.0), float(last))
    whole = min(int(since_s), last - 1)
    a, b = track[whole], track[whole + 1]
    share = since_s - whole if a[3] == b[3] else 0.0
    pose[0], pose[1] = a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])
    pose[2], pose[3] = _turned(a[2], b[2], share), a[3]


@kernel(_CUBE(_MATRIX, _CUBE, _INTS, _ASKED))
def ahead(seen: Floats, track: Floats, slots: Ints, t_s: Floats) -> Floats:
    """(n, m, 4) where robots will be at `t_s` (n, m)."""
    poses = np.empty((*t_s.shape, 4))
    for row in range(len(slots)):
        for at in range(t_s.shape[1]):
            _set_ahead(poses[row, at], track[slots[row]], t_s[row, at] - seen[slots[row], 0])
    return poses


@inner
def _set_way(way: Floats, seen: Floats, track: Floats, slot: int, now_s: float) -> float:
    """Where a robot is at every whole second from now on, in `way`; the furthest that it goes in one."""
    longest = 0.0
    for second in range(len(way)):
        _set_ahead(way[second], track[slot], now_s + second - seen[slot, 0])
        if second:
            dx, dy = way[second, 0] - way[second - 1, 0], way[second, 1] - way[second - 1, 1]
            longest = max(longest, dx * dx + dy * dy)
    return float(np.sqrt(longest))


@inner
def _meet(one: Floats, other: Floats, within: float) -> bool:
    """Whether two ways come so near at any of their seconds."""
    for second in range(len(one)):
        if one[second, 3] == other[second, 3] and one[second, 3] >= 0.0:
            dx, dy = one[second, 0] - other[second, 0], one[second, 1] - other[second, 1]
            if dx * dx + dy * dy <= within * within:
                return True
    return False


@kernel(
    numba.int64[:, ::1](
        numba.boolean[::1], _INTS, _MATRIX, _FLOATS, _MATRIX, _CUBE, numba.float64, numba.int64, numba.float64
    )
)
def nearing(
    told: Bools,
    slots: Ints,
    around: Floats,
    reach: Floats,
    seen: Floats,
    track: Floats,
    now_s: float,
    seconds: int,
    rounding_m: float,
) -> Ints:
    """(p, 2) pairs of `slots` (n,), one of each `told`, once each, that come near at any of so many whole seconds.

    Near is within the `reach` of both and half of what each goes from one second to the next. Only robots whose circles
    `around` meet, grown so, are followed; they are gone through from west to east.
    """
    n, found, pairs = len(slots), np.empty((64, 2), np.int64), 0
    west_to_east = slots[np.argsort(around[slots, 0])]
    circle, widest = np.empty(n), 0.0
    for at in range(n):
        slot = west_to_east[at]
        circle[at] = around[slot, 2] + around[slot, 3] / 2 + reach[slot] + rounding_m
        widest = max(widest, circle[at])
    ways, near = np.empty((n, seconds, 4)), np.full(n, -1.0)
    for at in range(n):
        slot = west_to_east[at]
        if not told[slot]:
            continue
        for side in (1, -1):
            other = at + side
            while 0 <= other < n and abs(around[west_to_east[other], 0] - around[slot, 0]) <= circle[at] + widest:
                one, beside, other = other, west_to_east[other], other + side
                dx, dy = around[beside, 0] - around[slot, 0], around[beside, 1] - around[slot, 1]
                within = circle[at] + circle[one]
                if dx * dx + dy * dy > within * within or (side < 0 and told[beside]):
                    continue
                for row in (at, one):
                    if near[row] < 0.0:
                        step_m = _set_way(ways[row], seen, track, west_to_east[row], now_s)
                        near[row] = reach[west_to_east[row]] + step_m / 2
                if _meet(ways[at], ways[one], near[at] + near[one]):
                    if pairs == len(found):
                        found = np.concatenate((found, np.empty_like(found)))
                    found[pairs, 0], found[pairs, 1] = slot, beside
                    pairs += 1
    return found[:pairs].copy()


@kernel(_MATRIX(_CUBE, _INTS, _ASKED))
def reach_m(bands_m: Floats, rows: Ints, ahead_s: Floats) -> Floats:
    """(n, m) radius of the 80 % band of n rows of the ledger at the times ahead (n, m); linear between and beyond
    the whole seconds."""
    reach = np.empty(ahead_s.shape)
    for row in range(len(rows)):
        band = bands_m[rows[row], :, 1]
        for at in range(ahead_s.shape[1]):
            whole = min(max(int(np.floor(ahead_s[row, at])), 0), len(band) - 1)
            before = band[whole - 1] if whole else 0.0
            reach[row, at] = before + max(ahead_s[row, at] - whole, 0.0) * (band[whole] - before)
    return reach
