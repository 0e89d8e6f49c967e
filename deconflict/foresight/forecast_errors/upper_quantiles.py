"""Distributions of distances in bounded memory: counts in bins, each a tenth wider than the one before.

A quantile is the upper edge of its bin, so that a band holds at least the share that it promises. The counts are
weights that fade, and the quantiles of many robots are set in one kernel at every pass. The figures of a replay need a
value that is neither too large nor too small and know no time limit: `metrics/scoring/length_quantiles.py`.
"""

import numba
import numpy as np

from ingest.batch import Floats, Ints
from ingest.kernels import CUBE, FLOAT, INTS, kernel

SMALLEST_M, STEP, BINS = 1e-3, 1.1, 128
"""The first bin holds all distances up to `SMALLEST_M`, the last all beyond 180 m."""
EDGES_M: Floats = SMALLEST_M * np.power(STEP, np.arange(BINS, dtype=np.float64))
"""(BINS,) upper edge of each bin."""
BINS_TEXT = f"{BINS} bins up to {SMALLEST_M:g} and from there by {STEP:g}"
LIMITS_M: Floats = EDGES_M[:-1] * STEP**1e-9
"""(BINS - 1,) the largest distance of each bin but the last. It is a little above the edge, so that a distance that is
beyond the edge by rounding alone stays in the bin."""
_EDGES, _TABLES = (numba.types.Array(FLOAT, dimensions, "A", readonly=True) for dimensions in (1, 3))
_FIRST: Ints = np.zeros(1, np.int64)


def bins(distances_m: Floats) -> Ints:
    """The bin of each distance."""
    return np.searchsorted(LIMITS_M, distances_m)


@kernel(numba.void(*[_TABLES] * 2, INTS, _EDGES, CUBE))
def _set_upper_quantiles(counts: Floats, shares: Floats, rows: Ints, edges_m: Floats, found: Floats) -> None:
    sums = np.empty(counts.shape[2])
    for row in rows:
        for line in range(counts.shape[1]):
            total = 0.0
            for at in range(len(sums)):
                total += counts[row, line, at]
                sums[at] = total
            for share in range(shares.shape[2]):
                at, wanted = 0, shares[row, line, share] * total - 1e-9
                while at < len(sums) - 1 and sums[at] < wanted:
                    at += 1
                found[row, line, share] = edges_m[at] if total > 0.0 else 0.0


def set_upper_quantiles(counts: Floats, shares: Floats, rows: Ints, found: Floats) -> None:
    """Set the `rows` of `found` (n, m, s) to the quantiles of `counts` (n, m, BINS) at `shares` (n, m, s)."""
    _set_upper_quantiles(counts, shares, rows, EDGES_M, found)


def upper_quantiles(counts: Floats, shares: Floats) -> Floats:
    """The distance (..., s) below which a share (s,) or (..., s) of the counts (..., BINS) is; 0 if there are no
    counts.

    It is at most a tenth too large: the upper edge of the bin.
    """
    shares = np.broadcast_to(shares, (*counts.shape[:-1], shares.shape[-1]))
    found = np.empty((1, counts.size // BINS, shares.shape[-1]))
    set_upper_quantiles(counts.reshape(1, -1, BINS), shares.reshape(found.shape), _FIRST, found)
    return found.reshape(shares.shape)
