"""The ledger: how far forecasts turned out to be off, by vendor, model, basis and horizon.

Bands are conformal: the radius of a band is an empirical quantile of past errors, and the level at which it is read
follows the coverage that bands truly had, so that coverage holds whatever the shape of the errors and when they drift
(Gibbs and Candes 2021, adaptive conformal inference). Old errors fade, a half in `HALF_LIFE_S`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple

import numba
import numpy as np

from deconflict.foresight.sketch import BINS, bins, quantiles
from deconflict.learned import Part, UnreadableError, numbers
from ingest.compiled import inner, kernel, ready
from ingest.seam import Basis, Floats, Ints

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
RADIAL, ALONG, ACROSS = range(3)


_COUNTS = tuple(numba.types.Array(numba.float64, dimensions, "C") for dimensions in (4, 3, 3, 2, 3))
_INTS, _FLOATS, _MATRIX = (
    numba.types.Array(kind, dimensions, "C", readonly=True)
    for kind, dimensions in ((numba.int64, 1), (numba.float64, 1), (numba.float64, 2))
)
_ERRORS = (*[_INTS] * 2, *[_FLOATS] * 3, numba.int64[:, ::1], _MATRIX)


@inner
def _fade(counts: Floats, bias_m: Floats, covered: Floats, cases: Floats, rows: Ints, kept: Floats) -> None:
    for at, row in enumerate(rows):
        for column in range(cases.shape[1]):
            cases[row, column] *= kept[at]
            for size in range(counts.shape[1]):
                for one in range(counts.shape[3]):
                    counts[row, size, column, one] *= kept[at]
            for side in range(bias_m.shape[2]):
                bias_m[row, column, side] *= kept[at]
            for band in range(covered.shape[2]):
                covered[row, column, band] *= kept[at]


@kernel(numba.void(*_COUNTS, _INTS, _FLOATS, *_ERRORS, *[_FLOATS] * 3, numba.float64))
def _count(
    counts: Floats,
    bias_m: Floats,
    covered: Floats,
    cases: Floats,
    level: Floats,
    rows: Ints,
    kept: Floats,
    kind: Ints,
    horizon_s: Ints,
    radial_m: Floats,
    along_m: Floats,
    across_m: Floats,
    bin_of: Ints,
    bands_m: Floats,
    shares: Floats,
    lowest: Floats,
    highest: Floats,
    gain: float,
) -> None:
    """Add e errors of kinds `rows` (r,) to the columns of a `Ledger`, of which so much is `kept` (r,) until then; the
    bins of their sizes are (3, e)."""
    _fade(counts, bias_m, covered, cases, rows, kept)
    for at in range(len(kind)):
        row, column = kind[at], horizon_s[at] - 1
        cases[row, column] += 1.0
        for size in range(len(bin_of)):
            counts[row, size, column, bin_of[size, at]] += 1.0
        bias_m[row, column, 0] += along_m[at]
        bias_m[row, column, 1] += across_m[at]
        for band in range(len(shares)):
            inside = 1.0 if radial_m[at] <= bands_m[at, band] else 0.0
            covered[row, column, band] += inside
            level[row, column, band] += gain * (shares[band] - inside)
    for row in rows:
        for column in range(level.shape[1]):
            for band in range(level.shape[2]):
                level[row, column, band] = min(max(level[row, column, band], lowest[band]), highest[band])


class Kind(NamedTuple):
    """Forecasts that are held to account together."""

    vendor: str
    model: str
    basis: Basis


@dataclass(frozen=True, slots=True, eq=False)
class Errors:
    """e forecasts of one moment each, and how far off they were. Arrays are (e,) unless said otherwise."""

    kind: Ints
    """Row of the ledger."""
    robot: Ints
    """The caller's own number of the robot."""
    horizon_s: Ints
    """1 to `HORIZONS`."""
    along_m: Floats
    """Positive where the robot was further along its heading than forecast."""
    across_m: Floats
    """Positive to the left."""
    bands_m: Floats
    """(e, 3) radii of the bands when the forecast was made."""
    radial_m: Floats = field(init=False)
    size: Ints = field(init=False)
    """(3, e) bins of the sizes: radial, along and across."""

    def __post_init__(self) -> None:
        sizes_m = np.empty((3, len(self)))
        np.hypot(self.along_m, self.across_m, out=sizes_m[RADIAL])
        np.abs(self.along_m, out=sizes_m[ALONG])
        np.abs(self.across_m, out=sizes_m[ACROSS])
        object.__setattr__(self, "radial_m", sizes_m[RADIAL])
        object.__setattr__(self, "size", bins(sizes_m))

    def __len__(self) -> int:
        return len(self.kind)

    def take(self, rows: Ints) -> "Errors":
        return Errors(*(getattr(self, one.name)[rows] for one in fields(self) if one.init))


@dataclass(slots=True, eq=False)
class Ledger:
    """Errors by kind of forecast; rows are never reordered."""

    kinds: dict[Kind, int] = field(default_factory=dict)
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
    _stale: set[int] = field(default_factory=set)
    _refreshed_s: float = float("-inf")

    def row(self, vendor: str, model: str, basis: Basis, now_s: float) -> int:
        """The row of a kind, made with a prior where it is new; models beyond `MOST_CLASSES` kinds share one."""
        found = self.kinds.get(Kind(vendor, model, basis))
        if found is not None:
            return found
        kind = Kind(vendor, model if len(self.kinds) < MOST_CLASSES else "", basis)
        if kind in self.kinds:
            return self.kinds[kind]
        row = self.kinds[kind] = len(self.kinds)
        prior = np.zeros((1, 3, HORIZONS, BINS))
        for horizon in range(HORIZONS):
            spread = bins(PRIOR_SPREAD * PRIOR_MPS[basis] * (horizon + 1))
            np.add.at(prior[0, RADIAL, horizon], spread, PRIOR_CASES / len(spread))
        self.counts = np.concatenate([self.counts, prior])
        self.level = np.concatenate([self.level, np.broadcast_to(SHARES, (1, HORIZONS, 3))])
        for name in ("bias_m", "covered", "cases", "as_of_s", "bands_m"):
            column = getattr(self, name)
            setattr(self, name, np.concatenate([column, np.zeros((1, *column.shape[1:]))]))
        self.as_of_s[row] = now_s
        self._read_bands([row])
        return row

    def rows(self, vendors: Sequence[str], models: Sequence[str], bases: Sequence[int], now_s: float) -> list[int]:
        """(n,) as `row`, of n kinds, most of them alike."""
        kinds = list(zip(vendors, models, bases, strict=True))
        known: Mapping[Any, int] = self.kinds
        found = [known.get(kind) for kind in kinds]
        return [
            self.row(*kind[:2], Basis(kind[2]), now_s) if row is None else row
            for row, kind in zip(found, kinds, strict=True)
        ]

    def record(self, errors: Errors, now_s: float) -> None:
        """Take in errors; the bands follow at most once in `REFRESH_S`."""
        if len(errors):
            rows = np.flatnonzero(np.bincount(errors.kind))
            kept = 0.5 ** (np.maximum(now_s - self.as_of_s[rows], 0.0) / HALF_LIFE_S)
            self.as_of_s[rows] = np.maximum(self.as_of_s[rows], now_s)
            columns = (self.counts, self.bias_m, self.covered, self.cases, self.level)
            off_m, bands_m = (errors.radial_m, errors.along_m, errors.across_m), ready(errors.bands_m)
            of, shares = (errors.kind, errors.horizon_s), (SHARES, LOWEST_LEVEL, HIGHEST_LEVEL)
            _count(*columns, rows, kept, *of, *off_m, errors.size, bands_m, *shares, LEVEL_GAIN)
            self._stale.update(rows.tolist())
        if self._stale and not 0 <= now_s - self._refreshed_s < REFRESH_S:
            self._refreshed_s = now_s
            self._read_bands(sorted(self._stale))
            self._stale.clear()

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
            kinds = [Kind(str(vendor), str(model), Basis(basis)) for vendor, model, basis in part["kinds"]]
        except (KeyError, TypeError, ValueError) as error:
            raise UnreadableError(f"kinds of forecasts are not told: {error}") from error
        columns = {name: numbers(part, name, (len(kinds), *getattr(self, name).shape[1:])) for name in LEARNED}
        self.kinds = {kind: row for row, kind in enumerate(kinds)}
        for name, column in columns.items():
            setattr(self, name, column)
        self.bands_m = np.zeros((len(kinds), HORIZONS, len(SHARES)))
        self._read_bands(list(range(len(kinds))))

    def _read_bands(self, rows: list[int]) -> None:
        radii = quantiles(self.counts[rows, RADIAL], self.level[rows])
        radii = np.maximum.accumulate(np.maximum.accumulate(radii, axis=2), axis=1)
        self.bands_m[rows] = radii
