"""One figure: its value, the number of cases, and the central 95 % of draws with replacement."""

from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.planned_floors.truth.motion import Bools
from ingest.batch import Floats
from metrics.scoring.bootstrap import interval

Figure = dict[str, Any]
"""`value`, None if unknown; `of`, the number of cases; `interval`, two values or None."""


def of_cases(rows: Floats, value: Callable[[Floats], Floats], count: int) -> Figure:
    """A figure over cases (n, columns).

    `value` takes draws (d, n, columns) and gives (d,), nan where it is not known.
    """
    if not len(rows):
        return {"value": None, "of": 0, "interval": None}
    found = float(value(rows[None])[0])
    return {"value": None if np.isnan(found) else found, "of": count, "interval": interval(rows, value)}


def share(hits: Floats | Bools) -> Figure:
    """The share of cases (n,) that are not 0."""
    rows = np.asarray(hits, np.float64)[:, None]
    return of_cases(rows, lambda draws: draws[:, :, 0].mean(axis=1), len(rows))


def alone(value: float, count: int) -> Figure:
    """A figure without an interval."""
    return {"value": None if np.isnan(value) else value, "of": count, "interval": None}


def ratio(over: Floats, under: Floats) -> Floats:
    """The quotient; nan if the denominator is 0."""
    return np.divide(over, under, out=np.full(len(under), np.nan), where=under > 0)
