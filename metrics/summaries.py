"""What many cases come to: a figure over nothing is None."""

import numpy as np

from ingest.seam import Floats


def mean(values: Floats) -> float | None:
    """Of the values that are known, which is not nan."""
    known = values[~np.isnan(values)]
    return float(known.mean()) if len(known) else None


def median(values: Floats) -> float | None:
    """Of the values that are known."""
    known = values[~np.isnan(values)]
    return float(np.median(known)) if len(known) else None


def spread(values: Floats) -> dict[str, float] | None:
    """Median, p10 and p90 of the values that are known."""
    known = values[~np.isnan(values)]
    if not len(known):
        return None
    p10, middle, p90 = np.percentile(known, (10, 50, 90))
    return {"median": float(middle), "p10": float(p10), "p90": float(p90)}


def brier(groups: Floats) -> float | None:
    """The mean squared error of probabilities; `groups` are (n, 3) samples, those that came true, squared errors."""
    count, _, squared = groups.sum(axis=0).tolist()
    return squared / count if count else None


def brier_skill(groups: Floats) -> float | None:
    """The share by which that is less than the error of always saying the base rate."""
    count, came_true, squared = groups.sum(axis=0).tolist()
    base = came_true * (count - came_true)
    return 1 - squared * count / base if base else None
