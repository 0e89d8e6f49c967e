"""How sure a figure is: the same figure over cases drawn again, with replacement (Efron 1979)."""

from collections.abc import Callable

import numpy as np

from ingest.seam import Floats

DRAWS = 400
LEVEL = 0.95
SEED = 20_090_724

Interval = tuple[float, float] | None
"""The middle 95 % of the figure; None where it could not be told of most draws."""


def interval(cases: Floats, figure: Callable[[Floats], float | None]) -> Interval:
    """Of a figure over `cases` (n, ...). The draws are the same on every run."""
    if not len(cases):
        return None
    rng = np.random.default_rng(SEED)
    drawn = [figure(cases[rng.integers(0, len(cases), len(cases))]) for _ in range(DRAWS)]
    return middle([value for value in drawn if value is not None])


def middle(values: list[float]) -> Interval:
    """The middle 95 % of what draws gave."""
    if len(values) < DRAWS / 2:
        return None
    low, high = np.percentile(values, (50 - 50 * LEVEL, 50 + 50 * LEVEL)).tolist()
    return low, high
