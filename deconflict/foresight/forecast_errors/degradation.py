"""Whether the forecasts of a vendor have become worse, since when, and by how much.

The errors of its moving robots three seconds ahead are collected for two minutes. The logarithm of their 80 % quantile
is one value for the test of `ingest.measures.change_detection`, so that a vendor is compared with its own usual errors.
"""

from collections.abc import Iterable, Mapping
from math import exp, inf, log
from typing import Any

import numba
import numpy as np

from deconflict.foresight.forecast_errors.error_ledger import ForecastKind
from deconflict.foresight.forecast_errors.forecast_grades import GRADED_S
from deconflict.foresight.forecast_errors.track_kernels import ERROR, Errors
from deconflict.foresight.forecast_errors.upper_quantiles import BINS, upper_quantiles
from deconflict.runtime.learned_state import Form, Part, UnreadableError
from ingest.batch import Basis, Floats, Ints
from ingest.kernels import FLOAT, FLOATS, INT, INTS, MATRIX, kernel
from ingest.measures.change_detection import ChangeDetector, ChangeLimits, LevelChange

GATHERED_S, FEWEST = 120.0, 20
"""A value covers at least this much time, and this many errors."""
SHARE: Floats = np.array([0.8])
"""The quantile of the errors that makes a value."""
FINE_M = 0.2
"""Added to the quantile before the logarithm: smaller errors hardly differ."""
LIMITS = ChangeLimits(least_spread=0.15, least_change=0.4, rises_only=True)
"""In logarithms: the errors must grow by about a half to count as a change."""
MOST_LOGARITHM = 20.0
"""Logarithms beyond are damage."""
FORM = Form(
    f"logarithms of {FINE_M} m and the {SHARE[0]} quantile of errors {GRADED_S} s ahead, in {GATHERED_S} s",
    {"levels": dict[str, dict[str, Any]]},
)


@kernel(INT(FLOATS, MATRIX, INTS, numba.from_dtype(ERROR)[::1], *[INT] * 2, *[FLOAT] * 3))
def _gather(
    since_s: Floats,
    counts: Floats,
    vendor_of: Ints,
    errors: Errors,
    graded_s: int,
    first: int,
    now_s: float,
    lasts_s: float,
    fewest: float,
) -> int:
    """Add errors of forecasts `graded_s` ahead to `counts` (vendors, BINS), kind by kind, from the kind `first` on.

    Stops at the first kind whose vendor now has enough errors for a value, and returns that kind; -1 if there is none.
    `since_s` (vendors,) is when the count of each vendor began. `vendor_of` (kinds,) is the vendor of each kind, -1 for
    kinds that do not count.
    """
    last, before = np.full(len(vendor_of), -1), np.empty(len(errors), np.int64)
    for at, error in enumerate(errors):
        if error.horizon_s == graded_s:
            before[at], last[error.kind] = last[error.kind], at
    for kind in range(first, len(vendor_of)):
        vendor, at = vendor_of[kind], last[kind]
        if vendor < 0 or at < 0:
            continue
        while at >= 0:
            counts[vendor, errors[at].radial_bin] += 1.0
            at = before[at]
        since_s[vendor] = min(since_s[vendor], now_s)
        if now_s - since_s[vendor] >= lasts_s and counts[vendor].sum() >= fewest:
            return kind
    return -1


class DegradationDetector:
    """Compares each vendor's forecasts with its earlier ones."""

    def __init__(self) -> None:
        self._vendors: dict[str, int] = {}
        self._vendor_of: Ints = np.zeros(0, np.int64)
        """(kinds,) the vendor of each row of the ledger; -1 for robots that stand."""
        self._since_s = np.zeros(0)
        """(vendors,) since when errors are collected; inf if there are none."""
        self._counts = np.zeros((0, BINS))
        self._levels: dict[str, ChangeDetector] = {}

    def add_errors(self, errors: Errors, kinds: Mapping[ForecastKind, int], now_s: float) -> None:
        """Add errors of robots. `kinds` are those of the ledger, in the order of their rows."""
        if len(kinds) > len(self._vendor_of):
            self._add_kinds(kinds)
        kind = self._gather(errors, 0, now_s)
        while kind >= 0:
            self._add_value(int(self._vendor_of[kind]))
            kind = self._gather(errors, kind + 1, now_s)

    def changed(self) -> dict[str, LevelChange]:
        """By vendor that changed: by how many metres its errors three seconds ahead have grown, and since when."""
        return {
            vendor: LevelChange(level.change.since_s, exp(level.usual + level.change.by) - exp(level.usual))
            for vendor, level in self._levels.items()
            if level.change
        }

    def learned(self) -> Part:
        """What is kept over a restart."""
        return FORM.part({"levels": {vendor: level.learned() for vendor, level in self._levels.items()}})

    def resume(self, part: Part) -> None:
        """Go on with what `learned` returned. Raises `UnreadableError`."""
        levels = FORM.checked(part)["levels"]
        try:
            self._levels = {
                vendor: ChangeDetector.resumed(LIMITS, level, MOST_LOGARITHM) for vendor, level in levels.items()
            }
        except ValueError as error:
            raise UnreadableError(str(error)) from error
        self._vendor_of = np.zeros(0, np.int64)

    def _gather(self, errors: Errors, first: int, now_s: float) -> int:
        gathered = (self._since_s, self._counts, self._vendor_of)
        return _gather(*gathered, errors, GRADED_S, first, now_s, GATHERED_S, FEWEST)

    def _add_value(self, row: int) -> None:
        """Compare the errors that were collected of a vendor with its usual ones, and start to collect anew."""
        size_m = float(upper_quantiles(self._counts[row], SHARE)[0])
        level = self._levels.setdefault(list(self._vendors)[row], ChangeDetector(LIMITS))
        level.add(log(size_m + FINE_M), float(self._since_s[row]))
        self._since_s[row], self._counts[row] = inf, 0.0

    def _add_kinds(self, kinds: Iterable[ForecastKind]) -> None:
        moving = [kind.vendor if kind.basis is not Basis.STATIONARY else None for kind in kinds]
        rows = [-1 if vendor is None else self._vendors.setdefault(vendor, len(self._vendors)) for vendor in moving]
        more = len(self._vendors) - len(self._since_s)
        self._vendor_of = np.array(rows)
        self._since_s = np.concatenate([self._since_s, np.full(more, inf)])
        self._counts = np.concatenate([self._counts, np.zeros((more, BINS))])
