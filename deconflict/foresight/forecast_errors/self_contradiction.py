"""Robots that go elsewhere than they say, and where they go instead.

A robot is held to its word whenever it has moved for about a second: it contradicts itself by how far it then is from
the way that it had told, whatever the time it had told for it. One that is late, waits or hurries along its way does
not; the bands of the ledger have that. One that says that it stands, or goes another way, does. From a few such reports
on its forecast is set aside while it moves, for straight on at the speed of its last second. Points that are far apart
in time say little of the way between them, so that nobody is held to that.
"""

from dataclasses import replace
from math import hypot, inf

import numba
import numpy as np
from numpy.typing import NDArray

from ingest.batch import Basis, Batch, Floats, Forecasts, Ints
from ingest.kernels import inner, kernel

AHEAD_S = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0)
"""The way that a robot tells is kept at these times after its report."""
LEAST_S, MOST_S = 0.7, 3.0
"""A report is held against one that was so long before it."""
MOVES_MPS = 0.3
"""One that goes more slowly is taken at its word: it may wait, or set out."""
SLACK_M, SLACK_SHARE = 0.15, 0.5
"""So far off its way is still on it: in metres, and of the way that it went."""
LONGEST_LEG_S, AWAY_M = 3.0, 0.3
"""A leg that takes longer, and leads further away, does not tell the way."""
KEEPS = 0.7
"""How much of a contradiction is left at the next."""

WORD = np.dtype(
    [(name, np.float64) for name in ("at_s", "x_m", "y_m", "floor", "x_mps", "y_mps", "contradicts")]
    + [("way_m", np.float64, (len(AHEAD_S), 2)), ("vague", np.bool_)],
    align=True,
)
"""Where a robot was when it gave its word, and the way that it told (looks, 2); how fast it went by its reports since;
and by how many times what is still on its way it is off it, faded over a few reports; and whether it told no way."""

Words = NDArray[np.void]
"""Of `WORD`, by slot."""

_WORDS = numba.from_dtype(WORD)[::1]
_INTS, _FLOATS = (numba.types.Array(kind, 1, "C", readonly=True) for kind in (numba.int64, numba.float64))


def unheard(slots: int) -> Words:
    """(slots,) of robots that have said nothing yet."""
    words = np.zeros(slots, WORD)
    words["at_s"] = -inf
    return words


@inner
def _place(t_s: Floats, at_m: Floats, first: int, end: int, at_s: float) -> float:
    """A coordinate at a time, between the knots from `first` to `end`."""
    if at_s <= t_s[first]:
        return float(at_m[first])
    for knot in range(first + 1, end):
        if at_s <= t_s[knot]:
            share = (at_s - t_s[knot - 1]) / (t_s[knot] - t_s[knot - 1])
            return float(at_m[knot - 1] + share * (at_m[knot] - at_m[knot - 1]))
    return float(at_m[end - 1])


@inner
def _is_vague(t_s: Floats, x_m: Floats, y_m: Floats, first: int, end: int) -> bool:
    """Whether a leg by which a robot may go before it is held to its word does not tell the way."""
    for knot in range(first + 1, end):
        if t_s[knot - 1] > t_s[first] + MOST_S:
            break
        leads_m = hypot(x_m[knot] - x_m[knot - 1], y_m[knot] - y_m[knot - 1])
        if t_s[knot] - t_s[knot - 1] > LONGEST_LEG_S and leads_m > AWAY_M:
            return True
    return False


@inner
def _beside_m(way_m: Floats, from_x: float, from_y: float, x: float, y: float) -> float:
    """How far a point is from a way that begins at another one."""
    least = np.inf
    for look in range(len(way_m)):
        to_x, to_y = way_m[look, 0], way_m[look, 1]
        along_x, along_y = to_x - from_x, to_y - from_y
        square = along_x * along_x + along_y * along_y
        share = ((x - from_x) * along_x + (y - from_y) * along_y) / square if square > 0.0 else 0.0
        share = min(max(share, 0.0), 1.0)
        least = min(least, hypot(x - from_x - share * along_x, y - from_y - share * along_y))
        from_x, from_y = to_x, to_y
    return least


@kernel(_INTS.copy(readonly=False)(_WORDS, numba.int64[::1], _INTS, *[_FLOATS] * 3, _INTS))
def hold_to_word(words: Words, slots: Ints, start: Ints, t_s: Floats, x_m: Floats, y_m: Floats, floor: Ints) -> Ints:
    """Hold robots of `slots` (n,) to the ways that they told before, and keep those of their forecasts, as of
    `Forecasts`. The rows (m,) of those that move and contradict themselves."""
    rows, n = np.empty(len(slots), np.int64), 0
    for row in range(len(slots)):
        word, first, end = words[slots[row]], start[row], start[row + 1]
        at_s, x, y = t_s[first], x_m[first], y_m[first]
        gap_s = at_s - word.at_s
        if not (0.0 <= gap_s < LEAST_S and word.floor == floor[first]):
            if LEAST_S <= gap_s <= MOST_S and word.floor == floor[first]:
                word.x_mps, word.y_mps = (x - word.x_m) / gap_s, (y - word.y_m) / gap_s
                went_m = hypot(x - word.x_m, y - word.y_m)
                if word.vague:
                    word.contradicts *= KEEPS
                elif went_m >= MOVES_MPS * gap_s:
                    off_m = _beside_m(word.way_m, word.x_m, word.y_m, x, y)
                    word.contradicts = KEEPS * word.contradicts + (1 - KEEPS) * off_m / (SLACK_M + SLACK_SHARE * went_m)
            else:
                word.x_mps = word.y_mps = 0.0
            word.at_s, word.x_m, word.y_m, word.floor = at_s, x, y, floor[first]
            word.vague = _is_vague(t_s, x_m, y_m, first, end)
            for look in range(len(AHEAD_S)):
                word.way_m[look, 0] = _place(t_s, x_m, first, end, at_s + AHEAD_S[look])
                word.way_m[look, 1] = _place(t_s, y_m, first, end, at_s + AHEAD_S[look])
        if word.contradicts > 1.0 and hypot(word.x_mps, word.y_mps) >= MOVES_MPS:
            rows[n] = row
            n += 1
    return rows[:n].copy()


def straight_on(batch: Batch, rows: Ints, slots: Ints, words: Words, horizon_s: float) -> Batch:
    """The batch with robots of `rows` (m,), of `slots` (m,), that go straight on for the horizon instead."""
    told = batch.forecasts
    first, m = told.start[rows], len(rows)
    speed_mps = words[slots]
    t_s, x_m, y_m = told.t_s[first], told.x_m[first], told.y_m[first]
    gone = Forecasts(
        np.arange(0, 2 * m + 1, 2),
        np.stack([t_s, t_s + horizon_s], axis=1).ravel(),
        np.stack([x_m, x_m + speed_mps["x_mps"] * horizon_s], axis=1).ravel(),
        np.stack([y_m, y_m + speed_mps["y_mps"] * horizon_s], axis=1).ravel(),
        told.yaw_rad[first].repeat(2),
        told.floor[first].repeat(2),
        *(size_m[rows] for size_m in (told.length_m, told.width_m, told.bottom_m, told.top_m)),
    )
    order, basis = np.arange(len(batch)), batch.basis.copy()
    order[rows], basis[rows] = len(batch) + np.arange(m), Basis.VELOCITY
    return replace(batch, basis=basis, forecasts=Forecasts.joined([told, gone]).take(order))
