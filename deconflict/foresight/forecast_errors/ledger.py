"""The ledger: how far forecasts turned out to be off, by vendor, model, basis and horizon.

Bands are conformal: the radius of a band is an empirical quantile of past errors, and the level at which it is read
follows the coverage that bands truly had, so that coverage holds whatever the shape of the errors and when they drift
(Gibbs and Candes 2021, adaptive conformal inference). Old errors fade, a half in `HALF_LIFE_S`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, cast

import numba
import numpy as np

from deconflict.foresight.forecast_errors.quantile_sketch import BINS, bins, set_quantiles
from deconflict.foresight.forecast_errors.track_kernels import ERROR, Errors
from deconflict.runtime.learned_state import Part, UnreadableError, numbers
from ingest.batch import Basis, Bools, Floats, Ints
from ingest.kernels import inner, kernel

HORIZONS = 10
"""Whole seconds ahead, from 1, at which forecasts are held to account."""
SHARES: Floats = np.array([0.5, 0.8, 0.9])
"""Of errors within the bands."""
HALF_LIFE_S = 3 * 86_400.0
PRIOR_CASES = 4.0
PRIOR_MPS = {Basis.STATIONARY: 0.02, Basis.PATH: 0.05, Basis.VELOCITY: 0.1, Basis.DESTINATION: 0.2}
"""Growth of the 80 % band of a vendor that has not been seen yet, metres a second."""
PRIOR_SPREAD: Floats = np.array([0.05, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 1.0, 1.3, 1.8])
LEVEL_GAIN = 0.003
"""How fast the level of a band follows coverage."""
LOWEST_LEVEL: Floats = SHARES - 0.2
HIGHEST_LEVEL: Floats = np.minimum(SHARES + 0.2, 0.998)
"""How far it may."""
MOST_CLASSES = 100
FEWEST_KEPT = 1.0
"""A kind of which fewer cases are left is not remembered over a restart."""
LEARNED = ("counts", "bias_m", "level", "covered", "cases", "as_of_s")
REFRESH_S = 1.0
RADIAL = 0
"""Of the counts; along the heading and across it are 1 and 2."""


_COUNTS = tuple(numba.types.Array(numba.float64, dimensions, "C") for dimensions in (4, 3, 3, 2, 3, 1))
_SHARES = numba.types.Array(numba.float64, 1, "C", readonly=True)


@inner
def _fade(counts: Floats, bias_m: Floats, covered: Floats, cases: Floats, row: int, kept: float) -> None:
    for column in range(cases.shape[1]):
        cases[row, column] *= kept
        for size in range(counts.shape[1]):
            for one in range(counts.shape[3]):
                counts[row, size, column, one] *= kept
        for side in range(bias_m.shape[2]):
            bias_m[row, column, side] *= kept
        for band in range(covered.shape[2]):
            covered[row, column, band] *= kept


@kernel(
    numba.void(
        *_COUNTS, numba.boolean[::1], numba.from_dtype(ERROR)[::1], *[_SHARES] * 3, *[numba.float64] * 2, numba.float64
    )
)
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
    """Add errors to the columns of a `Ledger`, after those of their kinds have faded, and mark these as stale."""
    is_told = np.zeros(len(cases), np.bool_)
    for error in errors:
        row, column = error.kind, error.horizon_s - 1
        if not is_told[row]:
            is_told[row] = stale[row] = True
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
    for row in range(len(is_told)):
        for column in range(level.shape[1] if is_told[row] else 0):
            for band in range(level.shape[2]):
                level[row, column, band] = min(max(level[row, column, band], lowest[band]), highest[band])


@kernel(numba.void(_COUNTS[1], numba.int64[::1]))
def _widen(bands_m: Floats, rows: Ints) -> None:
    """Have the bands of `rows` grow with the share and with the horizon."""
    for row in rows:
        for column in range(bands_m.shape[1]):
            for band in range(bands_m.shape[2]):
                if band:
                    bands_m[row, column, band] = max(bands_m[row, column, band], bands_m[row, column, band - 1])
                if column:
                    bands_m[row, column, band] = max(bands_m[row, column, band], bands_m[row, column - 1, band])


class ForecastKind(NamedTuple):
    """Forecasts that are held to account together."""

    vendor: str
    model: str
    basis: Basis


@dataclass(slots=True, eq=False)
class Ledger:
    """Errors by kind of forecast; rows are never reordered."""

    kinds: dict[ForecastKind, int] = field(default_factory=dict)
    counts: Floats = field(default_factory=lambda: np.zeros((0, 3, HORIZONS, BINS)))
    """(kinds, 3, HORIZONS, BINS) radial, along and across, faded."""
    bias_m: Floats = field(default_factory=lambda: np.zeros((0, HORIZONS, 2)))
    """(kinds, HORIZONS, 2) sums of signed errors along and across, faded like the counts."""
    level: Floats = field(default_factory=lambda: np.zeros((0, HORIZONS, 3)))
    covered: Floats = field(default_factory=lambda: np.zeros((0, HORIZONS, 3)))
    """How many errors lay within each band, faded."""
    cases: Floats = field(default_factory=lambda: np.zeros((0, HORIZONS)))
    as_of_s: Floats = field(default_factory=lambda: np.zeros(0))
    """(kinds,) when each was last faded."""
    bands_m: Floats = field(default_factory=lambda: np.zeros((0, HORIZONS, 3)))
    """(kinds, HORIZONS, 3) radii in force; they grow with the horizon and with the share."""
    _stale: Bools = field(default_factory=lambda: np.zeros(0, np.bool_))
    """(kinds,) of which errors came since the bands were read."""
    _refreshed_s: float = float("-inf")

    def row(self, vendor: str, model: str, basis: Basis, now_s: float) -> int:
        """The row of a kind, made with a prior where it is new; models beyond `MOST_CLASSES` kinds share one."""
        found = self.kinds.get(ForecastKind(vendor, model, basis))
        if found is not None:
            return found
        kind = ForecastKind(vendor, model if len(self.kinds) < MOST_CLASSES else "", basis)
        if kind in self.kinds:
            return self.kinds[kind]
        row = self.kinds[kind] = len(self.kinds)
        prior = np.zeros((1, 3, HORIZONS, BINS))
        for horizon in range(HORIZONS):
            spread = bins(PRIOR_SPREAD * PRIOR_MPS[basis] * (horizon + 1))
            np.add.at(prior[0, RADIAL, horizon], spread, PRIOR_CASES / len(spread))
        self.counts = np.concatenate([self.counts, prior])
        self.level = np.concatenate([self.level, np.broadcast_to(SHARES, (1, HORIZONS, 3))])
        for name in ("bias_m", "covered", "cases", "as_of_s", "bands_m", "_stale"):
            column = getattr(self, name)
            setattr(self, name, np.concatenate([column, np.zeros((1, *column.shape[1:]), column.dtype)]))
        self.as_of_s[row] = now_s
        self._read_bands(np.array([row]))
        return row

    def rows(self, vendors: Sequence[str], models: Sequence[str], bases: Sequence[int], now_s: float) -> list[int]:
        """(n,) as `row`, of n kinds, most of them alike."""
        known: Mapping[Any, int] = self.kinds
        found = list(map(known.get, zip(vendors, models, bases, strict=True)))
        if None not in found:
            return cast(list[int], found)
        told = zip(vendors, models, map(Basis, bases), strict=True)
        return [self.row(*kind, now_s) for kind in told]

    def record(self, errors: Errors, now_s: float) -> None:
        """Take in errors; the bands follow at most once in `REFRESH_S`."""
        if len(errors):
            columns = (self.counts, self.bias_m, self.covered, self.cases, self.level, self.as_of_s, self._stale)
            shares = (SHARES, LOWEST_LEVEL, HIGHEST_LEVEL)
            _count(*columns, errors, *shares, LEVEL_GAIN, now_s, HALF_LIFE_S)
        if not 0 <= now_s - self._refreshed_s < REFRESH_S and self._stale.any():
            self._refreshed_s = now_s
            self._read_bands(np.flatnonzero(self._stale))
            self._stale[:] = False

    def learned(self) -> Part:
        """All of it, without kinds of which nothing is left by the time of the newest."""
        aged = 0.5 ** ((self.as_of_s.max(initial=0.0) - self.as_of_s) / HALF_LIFE_S)
        rows = np.flatnonzero(self.cases.sum(axis=1) * aged >= FEWEST_KEPT)
        kinds = list(self.kinds)
        said: Part = {name: getattr(self, name)[rows] for name in LEARNED}
        return said | {"kinds": [list(kinds[row]) for row in rows.tolist()]}

    def resume(self, part: Part) -> None:
        """Go on with what `learned` told. Raises `UnreadableError`, and is then as it was."""
        try:
            kinds = [ForecastKind(str(vendor), str(model), Basis(basis)) for vendor, model, basis in part["kinds"]]
        except (KeyError, TypeError, ValueError) as error:
            raise UnreadableError(f"kinds of forecasts are not told: {error}") from error
        columns = {name: numbers(part, name, (len(kinds), *getattr(self, name).shape[1:])) for name in LEARNED}
        self.kinds = {kind: row for row, kind in enumerate(kinds)}
        for name, column in columns.items():
            setattr(self, name, column)
        self.bands_m = np.zeros((len(kinds), HORIZONS, len(SHARES)))
        self._stale = np.zeros(len(kinds), np.bool_)
        self._read_bands(np.arange(len(kinds)))

    def _read_bands(self, rows: Ints) -> None:
        set_quantiles(self.counts[:, RADIAL], self.level, rows, self.bands_m)
        _widen(self.bands_m, rows)
