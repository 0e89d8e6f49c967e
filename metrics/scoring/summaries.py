"""Statistics of many cases. A statistic of no cases is None.

A bootstrap draws hundreds of samples, so each statistic also has a function that computes it for many samples at once.
There the statistic of no cases is nan.
"""

from math import isnan

import numpy as np

from ingest.batch import Floats


def means(values: Floats) -> Floats:
    """(d,) mean of the known values of each row (d, n). nan is unknown."""
    known = ~np.isnan(values)
    return _shares(np.where(known, values, 0.0).sum(axis=1), known.sum(axis=1))


def medians(values: Floats) -> Floats:
    """(d,) median of the known values of each row (d, n)."""
    if not values.shape[1]:
        return np.full(len(values), np.nan)
    rows, known = np.arange(len(values)), np.count_nonzero(~np.isnan(values), axis=1)
    ranked = np.sort(values, axis=1)
    return (ranked[rows, (known - 1) // 2] + ranked[rows, known // 2]) / 2


def briers(groups: Floats) -> Floats:
    """(d,) Brier scores. `groups` (d, n, 3): number of samples, number that came true, sum of squared errors."""
    count, _, squared = groups.sum(axis=1).T
    return _shares(squared, count)


def brier_skills(groups: Floats) -> Floats:
    """(d,) Brier skill: the relative gain over a forecast that is always the base rate."""
    count, came_true, squared = groups.sum(axis=1).T
    return 1 - _shares(squared * count, came_true * (count - came_true))


def ratios(rows: Floats) -> Floats:
    """(d,) the sum of the first column divided by that of the second, for each of `rows` (d, n, 2)."""
    above, below = rows.sum(axis=1).T
    return _shares(above, below)


def ratio(rows: Floats) -> float | None:
    return _single(ratios(rows[None]))


def mean(values: Floats) -> float | None:
    return _single(means(values[None]))


def median(values: Floats) -> float | None:
    return _single(medians(values[None]))


def brier(groups: Floats) -> float | None:
    return _single(briers(groups[None]))


def brier_skill(groups: Floats) -> float | None:
    return _single(brier_skills(groups[None]))


def spread(values: Floats) -> dict[str, float] | None:
    """Median, p10 and p90 of the known values."""
    known = values[~np.isnan(values)]
    if not len(known):
        return None
    p10, middle, p90 = np.percentile(known, (10, 50, 90))
    return {"median": float(middle), "p10": float(p10), "p90": float(p90)}


def letters(values: Floats) -> str:
    """For each of some values n for 0, y for 1, - for nan."""
    return "".join("-" if isnan(value) else "ny"[int(value)] for value in values)


def tenths(values: Floats) -> str:
    """Values with one decimal, - for nan."""
    return " ".join("-" if isnan(value) else f"{value:.1f}" for value in values)


def _shares(parts: Floats, wholes: Floats) -> Floats:
    with np.errstate(divide="ignore", invalid="ignore"):
        shares: Floats = np.where(wholes == 0, np.nan, parts / wholes)
    return shares


def _single(figures: Floats) -> float | None:
    value = float(figures[0])
    return None if isnan(value) else value
