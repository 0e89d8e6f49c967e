"""Quantiles of many lengths or times in bounded memory: bins that grow by 2 % (after DDSketch, Masson 2019).

A quantile is the middle of its bin. The engine's own bands need a bound from fading counts instead:
`deconflict/foresight/forecast_errors/upper_quantiles.py`.
"""

import numpy as np

from ingest.batch import Floats, Ints

LEAST_M, GROWTH, BINS = 1e-3, 1.02, 700
"""The bins reach from a millimetre to a kilometre. Lengths outside count in the first or last bin."""


def bins_of(lengths_m: Floats) -> Ints:
    """The bin of each length."""
    steps = np.log(np.maximum(lengths_m, LEAST_M) / LEAST_M) / np.log(GROWTH)
    return np.minimum(np.rint(steps).astype(np.int64), BINS - 1)


def quantile(counts: Ints, share: float) -> float | None:
    """The `share` quantile of `counts` (BINS,), within 1 %. 0 below a millimetre; None if all counts are 0."""
    total = int(counts.sum())
    if not total:
        return None
    row = int(np.searchsorted(np.cumsum(counts), share * total))
    return float(f"{LEAST_M * GROWTH**row:.3g}") if row else 0.0
