"""The ledger: the errors of forecasts, by vendor, model, basis and horizon.

Bands are conformal: the radius of a band is an empirical quantile of past errors. The level at which the quantile is
read follows the coverage that the bands really had. So coverage holds for errors of any distribution, also if they
drift (Gibbs and Candes 2021, adaptive conformal inference). Old errors fade by a half in `HALF_LIFE_S`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any, NamedTuple, cast

import numba
import numpy as np

from deconflict.foresight.forecast_errors.track_kernels import ERROR, Errors
from deconflict.foresight.forecast_errors.upper_quantiles import BINS, BINS_TEXT, bins, set_upper_quantiles
from deconflict.runtime.learned_state import Column, count_column, time_column
from deconflict.sweep.robot_slots import lengthen
from ingest.batch import Basis, Batch, Bools, Floats, Ints
from ingest.kernels import BOOLS, FLOAT, INTS, READ_FLOATS, inner, kernel

HORIZONS = 10
"""Forecasts are compared with reports at this many whole seconds ahead, from 1 on."""
SHARES: Floats = np.array([0.5, 0.8, 0.9])
"""The share of errors that each band is to cover."""
HALF_LIFE_S = 3 * 86_400.0
PRIOR_CASES = 4.0
"""Errors that the prior of a new kind counts as, at each horizon."""
PRIOR_MPS = {Basis.STATIONARY: 0.02, Basis.PATH: 0.05, Basis.VELOCITY: 0.1, Basis.DESTINATION: 0.2, Basis.ORDER: 0.1}
"""Growth of the 80 % band of a new kind, metres a second."""
PRIOR_SPREAD: Floats = np.array([0.05, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 1.0, 1.3, 1.8])
"""Errors of the prior, as multiples of the 80 % band."""
LEVEL_GAIN = 0.003
"""How much the level of a band moves with each error."""
LOWEST_LEVEL: Floats = SHARES - 0.2
HIGHEST_LEVEL: Floats = np.minimum(SHARES + 0.2, 0.998)
"""Limits of the level of each band."""
MOST_CLASSES = 100
"""From this many kinds on, new models of a vendor share one kind."""
FEWEST_KEPT = 1.0
"""A kind with fewer faded cases is not kept over a restart."""
COLUMNS = {
    "counts": count_column("kinds", 3, HORIZONS, BINS),
    "bias_m": Column(("kinds", HORIZONS, 2), -1e15, 1e15),
    "level": Column(("kinds", HORIZONS, len(SHARES)), 0.0, 1.0),
    "covered": count_column("kinds", HORIZONS, len(SHARES)),
    "cases": count_column("kinds", HORIZONS),
    "as_of_s": time_column("kinds"),
}
"""What is kept over a restart."""
CONTENT = f"radial, along and across errors of forecasts each second, by {BINS_TEXT} m, in bands of {SHARES.tolist()}"
"""What the columns mean."""
REFRESH_S = 1.0
"""Shortest time between two readings of the bands."""
RADIAL = 0
"""The place of radial errors in the counts. Those along the heading and across it are at 1 and 2."""


_COUNTS = tuple(numba.types.Array(FLOAT, dimensions, "C") for dimensions in (4, 3, 3, 2, 3, 1))


@inner
def _fade(counts: Floats, bias_m: Floats, covered: Floats, cases: Floats, row: int, kept: float) -> None:
    for column in range(cases.shape[1]):
        cases[row, column] *= kept
        for size in range(counts.shape[1]):
            for bin_ in range(counts.shape[3]):
                counts[row, size, column, bin_] *= kept
        for side in range(bias_m.shape[2]):
            bias_m[row, column, side] *= kept
        for band in range(covered.shape[2]):
            covered[row, column, band] *= kept


@kernel(numba.void(*_COUNTS, BOOLS, numba.from_dtype(ERROR)[::1], *[READ_FLOATS] * 3, *[FLOAT] * 2, FLOAT))
def _count(
    counts: Floats,
    bias_m: Floats,
    covered: Floats,
    cases: Floats,
    level: Floats,
    as_of_s: Floats,
    stale: Bools,
    errors: Errors,
    shares: Floats,
    lowest: Floats,
    highest: Floats,
    gain: float,
    now_s: float,
    half_life_s: float,
) -> None:
    """Fade the columns of a `Ledger` of the kinds that have errors, add the errors, and mark these kinds as stale."""
    has_errors = np.zeros(len(cases), np.bool_)
    for error in errors:
        row, column = error.kind, error.horizon_s - 1
        if not has_errors[row]:
            has_errors[row] = stale[row] = True
            _fade(counts, bias_m, covered, cases, row, 0.5 ** (max(now_s - as_of_s[row], 0.0) / half_life_s))
            as_of_s[row] = max(as_of_s[row], now_s)
        cases[row, column] += 1.0
        counts[row, 0, column, error.radial_bin] += 1.0
        counts[row, 1, column, error.along_bin] += 1.0
        counts[row, 2, column, error.across_bin] += 1.0
        bias_m[row, column, 0] += error.along_m
        bias_m[row, column, 1] += error.across_m
        for band in range(len(shares)):
            inside = 1.0 if error.radial_m <= error.bands_m[band] else 0.0
            covered[row, column, band] += inside
            level[row, column, band] += gain * (shares[band] - inside)
    for row in range(len(has_errors)):
        for column in range(level.shape[1] if has_errors[row] else 0):
            for band in range(level.shape[2]):
                level[row, column, band] = min(max(level[row, column, band], lowest[band]), highest[band])


@kernel(numba.void(_COUNTS[1], INTS))
def _widen(bands_m: Floats, rows: Ints) -> None:
    """Make the bands of `rows` grow with the share and with the horizon."""
    for row in rows:
        for column in range(bands_m.shape[1]):
            for band in range(bands_m.shape[2]):
                if band:
                    bands_m[row, column, band] = max(bands_m[row, column, band], bands_m[row, column, band - 1])
                if column:
                    bands_m[row, column, band] = max(bands_m[row, column, band], bands_m[row, column - 1, band])


@cache
def _prior(basis: Basis) -> Floats:
    """(1, 3, HORIZONS, BINS) what a new kind counts before its first error."""
    prior = np.zeros((1, 3, HORIZONS, BINS))
    for horizon in range(HORIZONS):
        spread = bins(PRIOR_SPREAD * PRIOR_MPS[basis] * (horizon + 1))
        np.add.at(prior[0, RADIAL, horizon], spread, PRIOR_CASES / len(spread))
    return prior


class ForecastKind(NamedTuple):
    """Forecasts whose errors are counted together."""

    vendor: str
    model: str
    basis: Basis


@dataclass(slots=True, eq=False)
class Ledger:
    """Errors by kind of forecast. Rows are never reordered; those after the last kind are spare."""

    kinds: dict[ForecastKind, int] = field(default_factory=dict)
    """Row of each kind."""
    counts: Floats = field(default_factory=lambda: np.zeros((0, 3, HORIZONS, BINS)))
    """(kinds, 3, HORIZONS, BINS) errors by size: radial, along and across the heading; faded."""
    bias_m: Floats = field(default_factory=lambda: np.zeros((0, HORIZONS, 2)))
    """(kinds, HORIZONS, 2) sums of signed errors along and across the heading, faded."""
    level: Floats = field(default_factory=lambda: np.zeros((0, HORIZONS, 3)))
    """(kinds, HORIZONS, 3) the quantile at which each band is read."""
    covered: Floats = field(default_factory=lambda: np.zeros((0, HORIZONS, 3)))
    """(kinds, HORIZONS, 3) how many errors were within each band, faded."""
    cases: Floats = field(default_factory=lambda: np.zeros((0, HORIZONS)))
    """(kinds, HORIZONS) how many errors there were, faded."""
    as_of_s: Floats = field(default_factory=lambda: np.zeros(0))
    """(kinds,) when each kind was last faded."""
    bands_m: Floats = field(default_factory=lambda: np.zeros((0, HORIZONS, 3)))
    """(kinds, HORIZONS, 3) radii of the bands. They grow with the horizon and with the share."""
    stale: Bools = field(default_factory=lambda: np.zeros(0, np.bool_))
    """(kinds,) whether errors were added since the bands were read."""
    refreshed_s: Floats = field(default_factory=lambda: np.full(1, -np.inf))
    """(1,) when the bands were last read."""

    def row(self, vendor: str, model: str, basis: Basis, now_s: float) -> int:
        """The row of a kind, see `rows`."""
        return self.rows((vendor,), (model,), (basis,), now_s)[0]

    def rows(self, vendors: Sequence[str], models: Sequence[str], bases: Sequence[int], now_s: float) -> list[int]:
        """(n,) the rows of n kinds, most of them alike. New kinds get rows with a prior; models beyond `MOST_CLASSES`
        kinds share one."""
        known: Mapping[Any, int] = self.kinds
        kinds, before = list(zip(vendors, models, bases, strict=True)), len(self.kinds)
        rows = list(map(known.get, kinds))
        if None not in rows:
            return cast(list[int], rows)
        rows_now = [self._number(*kind) if row is None else row for kind, row in zip(kinds, rows, strict=True)]
        if len(self.kinds) > before:
            self._grow(list(self.kinds)[before:], now_s)
        return rows_now

    def _number(self, vendor: str, model: str, basis: int) -> int:
        """The row that a kind has, or will have."""
        kind = ForecastKind(vendor, model, Basis(basis))
        if kind not in self.kinds and len(self.kinds) >= MOST_CLASSES:
            kind = kind._replace(model="")
        return self.kinds.setdefault(kind, len(self.kinds))

    def _grow(self, new: Sequence[ForecastKind], now_s: float) -> None:
        """Set the rows of new kinds, the last ones. Room for more is made seldom: each time costs a copy of all."""
        if (missing := len(self.kinds) - len(self.counts)) > 0:
            lengthen(self, (*COLUMNS, "bands_m", "stale"), max(missing, len(self.counts) // 2))
        rows = np.arange(len(self.kinds) - len(new), len(self.kinds))
        self.counts[rows] = np.concatenate([_prior(kind.basis) for kind in new])
        self.level[rows], self.as_of_s[rows] = SHARES, now_s
        self._read_bands(rows)

    def bands_of(self, batch: Batch) -> Floats:
        """The radii that should contain the errors of a batch's forecasts, by what is known before its reports."""
        rows = self.rows(batch.vendors, batch.models, batch.basis.tolist(), batch.now_s)
        return self.bands_m[rows]

    def add_kinds(self, other: "Ledger", now_s: float) -> None:
        """Add the kinds that another ledger has got since the last call, so that they have the same rows here."""
        if new := list(other.kinds)[len(self.kinds) :]:
            vendors, models, bases = zip(*new, strict=True)
            self.rows(vendors, models, bases, now_s)

    def record(self, errors: Errors, now_s: float) -> None:
        """Count errors. The bands follow at most once in `REFRESH_S`."""
        if len(errors):
            columns = (self.counts, self.bias_m, self.covered, self.cases, self.level, self.as_of_s, self.stale)
            shares = (SHARES, LOWEST_LEVEL, HIGHEST_LEVEL)
            _count(*columns, errors, *shares, LEVEL_GAIN, now_s, HALF_LIFE_S)
        if not 0 <= now_s - self.refreshed_s[0] < REFRESH_S and self.stale.any():
            self.refreshed_s[0] = now_s
            self._read_bands(np.flatnonzero(self.stale))
            self.stale[:] = False

    def rows_with_cases(self) -> Ints:
        """(n,) the rows of all kinds that have cases left at the time of the newest one."""
        aged = 0.5 ** ((self.as_of_s.max(initial=0.0) - self.as_of_s) / HALF_LIFE_S)
        return np.flatnonzero(self.cases.sum(axis=1) * aged >= FEWEST_KEPT)

    def columns(self, rows: Ints) -> dict[str, Floats]:
        """A copy of what is kept over a restart of these kinds (n,)."""
        return {name: getattr(self, name)[rows] for name in COLUMNS}

    def restore(self, kinds: Sequence[ForecastKind], columns: Mapping[str, Floats]) -> Ints:
        """Go on with the columns that `columns` gave of these kinds (n,); their rows (n,). Rows stay as they are."""
        rows = np.array([self.row(*kind, 0.0) for kind in kinds], np.int64)
        for name, column in columns.items():
            getattr(self, name)[rows] = column
        self.stale[rows] = False
        self._read_bands(rows)
        return rows

    def _read_bands(self, rows: Ints) -> None:
        set_upper_quantiles(self.counts[:, RADIAL], self.level, rows, self.bands_m)
        _widen(self.bands_m, rows)
