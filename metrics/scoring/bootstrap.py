"""How sure a figure is: the same figure over cases drawn again, with replacement (Efron 1979)."""

from collections.abc import Callable

import numpy as np

from ingest.batch import Floats

DRAWS = 400
LEVEL = 0.95
SEED = 20_090_724
GROUPS = 32
"""Pairs fall into so many groups, which are drawn whole: seconds of one pair are no independent cases."""
DRAWN = 1_000_000
"""Cases drawn at once, which bounds the memory."""

Interval = tuple[float, float] | None
"""The middle 95 % of the figure; None where it could not be told of most draws."""


def interval(cases: Floats, figures: Callable[[Floats], Floats]) -> Interval:
    """Of a figure over `cases` (n, ...). The draws are the same on every run.

    `figures` tells it of samples (d, n, ...), each by itself: (d,), nan where it can't be told.
    """
    if not len(cases):
        return None
    rng, at_once, found = np.random.default_rng(SEED), max(DRAWN // len(cases), 1), np.empty(0)
    while len(found) < DRAWS:
        rows = rng.integers(0, len(cases), (min(at_once, DRAWS - len(found)), len(cases)))
        found = np.append(found, figures(cases[rows]))
    return middle(found[~np.isnan(found)].tolist())


def middle(values: list[float]) -> Interval:
    """The middle 95 % of what draws gave."""
    if len(values) < DRAWS / 2:
        return None
    low, high = np.percentile(values, (50 - 50 * LEVEL, 50 + 50 * LEVEL)).tolist()
    return low, high
