"""Bootstrap intervals: the distribution of a figure over cases drawn with replacement (Efron 1979)."""

from collections.abc import Callable

import numpy as np

from ingest.batch import Floats

DRAWS = 400
LEVEL = 0.95
SEED = 20_090_724
GROUPS = 32
"""Pairs are divided into this many groups. A whole group is drawn, because the seconds of one pair are dependent."""
DRAWN = 1_000_000
"""Cases drawn at once. Bounds the memory."""

Interval = tuple[float, float] | None
"""The central 95 % of the figure. None if the figure is unknown in most draws."""


def interval(cases: Floats, figures: Callable[[Floats], Floats]) -> Interval:
    """The interval of a figure over `cases` (n, ...). The draws are the same on every run.

    `figures` computes the figure of each of d samples (d, n, ...): (d,), nan if the figure is unknown.
    """
    if not len(cases):
        return None
    rng, at_once, found = np.random.default_rng(SEED), max(DRAWN // len(cases), 1), np.empty(0)
    while len(found) < DRAWS:
        rows = rng.integers(0, len(cases), (min(at_once, DRAWS - len(found)), len(cases)))
        found = np.append(found, figures(cases[rows]))
    return middle(found[~np.isnan(found)].tolist())


def middle(values: list[float]) -> Interval:
    """The central 95 % of the values from the draws."""
    if len(values) < DRAWS / 2:
        return None
    low, high = np.percentile(values, (50 - 50 * LEVEL, 50 + 50 * LEVEL)).tolist()
    return low, high
