"""How far from where they will be robots may be found, by the bands of their kind. Compiled; arrays are by slot."""

import numba
import numpy as np

from deconflict.motion import Bools
from ingest.compiled import inner, kernel
from ingest.seam import Floats, Ints

_INTS, _FLOATS, _MATRIX, _CUBE = numba.int64[::1], numba.float64[::1], numba.float64[:, ::1], numba.float64[:, :, ::1]
_ASKED_LOOKS = numba.types.Array(numba.float64, 1, "A", readonly=True)
_ASKED = numba.types.Array(numba.float64, 2, "A", readonly=True)


@inner
def _reach(bands_m: Floats, kind: int, ahead_s: float) -> float:
    """Radius of the 80 % band of a kind so far ahead; linear between and beyond the whole seconds."""
    whole = min(max(int(np.floor(ahead_s)), 0), bands_m.shape[1] - 1)
    before = bands_m[kind, whole - 1, 1] if whole else 0.0
    return float(before + max(ahead_s - whole, 0.0) * (bands_m[kind, whole, 1] - before))


@kernel(_FLOATS(_CUBE, *[_INTS] * 2, *[_FLOATS] * 2, _MATRIX, *[numba.float64] * 3))
def reach_m(
    bands_m: Floats,
    slots: Ints,
    kind: Ints,
    trust: Floats,
    doubt_m: Floats,
    half: Floats,
    beyond_m: float,
    horizon_s: float,
    most_grown_m: float,
) -> Floats:
    """(slots,) how far from where they will be robots of `slots` (n,) may be met: within the circle around their `half`
    sides (2, slots), `beyond_m` and their doubt, grown by their 80 % bands at the horizon."""
    reach = np.empty(len(kind))
    for slot in slots:
        grown = min(_reach(bands_m, kind[slot], horizon_s) * trust[slot], most_grown_m)
        reach[slot] = np.hypot(half[0, slot], half[1, slot]) + beyond_m + doubt_m[slot] + grown
    return reach


@kernel(
    _MATRIX(
        _CUBE,
        _INTS,
        _ASKED_LOOKS,
        *[_FLOATS] * 2,
        numba.boolean[::1],
        *[_INTS] * 2,
        _ASKED,
        *[_FLOATS] * 3,
        *[numba.float64] * 5,
    )
)
def within_sds(
    bands_m: Floats,
    kind: Ints,
    heard_s: Floats,
    doubt_m: Floats,
    trust: Floats,
    rests: Bools,
    a: Ints,
    b: Ints,
    ahead_m: Floats,
    ahead_s: Floats,
    swept_m: Floats,
    swept_s: Floats,
    now_s: float,
    within_m: float,
    soon_s: float,
    band_sds: float,
    exact_m: float,
) -> Floats:
    """(2, n) by how many standard deviations of their distance robots `a` and `b` (n,) are within `within_m`, where
    that is most: in the horizon, and in its first `soon_s`.

    They are so far apart: `ahead_m` (n, m) so long ahead (m,), and `swept_m` (n,) at the times `swept_s`. Bands are
    `band_sds` wide, and `trust` times as wide; the deviation is `exact_m` at least. The place of a robot that fell
    silent grows uncertain, unless it stood: it is still there, for all that is known.
    """
    most = np.full((2, len(a)), -np.inf)
    for row in range(len(a)):
        for at in range(len(ahead_s) + 1):
            apart_m, after_s = swept_m[row], swept_s[row] - now_s
            if at < len(ahead_s):
                apart_m, after_s = ahead_m[row, at], ahead_s[at]
            square = 0.0
            for slot in (a[row], b[row]):
                since_s = 0.0 if rests[slot] else max(now_s - heard_s[slot], 0.0)
                reach = _reach(bands_m, kind[slot], after_s + since_s) * trust[slot] / band_sds
                square += reach * reach + doubt_m[slot] * doubt_m[slot]
            sds = (within_m - apart_m) / (np.sqrt(square) + exact_m)
            most[0, row] = max(most[0, row], sds)
            if after_s <= soon_s:
                most[1, row] = max(most[1, row], sds)
    return most
