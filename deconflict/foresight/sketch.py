"""Distributions of distances in bounded memory: counts by size, on a scale on which each step is a tenth more."""

import numpy as np

from ingest.seam import Floats, Ints

SMALLEST_M, STEP, BINS = 1e-3, 1.1, 128
"""The first bin holds all that is at most `SMALLEST_M`, the last all beyond 180 m."""
EDGES_M: Floats = SMALLEST_M * np.power(STEP, np.arange(BINS, dtype=np.float64))
"""(BINS,) upper edge of each bin."""


def bins(distances_m: Floats) -> Ints:
    """The bin of each distance."""
    scaled = np.ceil(np.log(np.maximum(distances_m, SMALLEST_M) / SMALLEST_M) / np.log(STEP) - 1e-9)
    found: Ints = np.clip(scaled, 0, BINS - 1).astype(np.int64)
    return found


def quantiles(counts: Floats, shares: Floats) -> Floats:
    """The distance (..., s) below which a share (s,) or (..., s) of the counts (..., BINS) lies; 0 of no counts.

    At most a tenth too large: the upper edge of the bin in which it lies.
    """
    sums = np.cumsum(counts, axis=-1)
    wanted = shares * sums[..., -1:]
    at = (sums[..., None, :] < wanted[..., :, None] - 1e-9).sum(axis=-1)
    found: Floats = np.where(sums[..., -1:] > 0, EDGES_M[np.minimum(at, BINS - 1)], 0.0)
    return found
