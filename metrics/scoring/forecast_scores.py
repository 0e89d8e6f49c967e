"""Errors of forecasts 1 to 10 s ahead, by vendor and model, and by what they are made from.

The truth is the recorded motion of `metrics/truth/recorded_motion.py`. Errors along and across refer to the forecast
heading.

`_errors` is long because it is one loop with two places that only move on: in the motion, and in the forecast.
"""

import sys
from collections.abc import Sequence
from math import cos, hypot, isfinite, sin
from typing import Any

import numpy as np

from deconflict.foresight.motion_assumptions import JOINED_S
from ingest.batch import Basis, Batch, Floats, Forecasts, Ints
from ingest.kernels import FLOAT, INT, READ_CUBE, READ_FLOATS, READ_INTS, kernel, ready
from metrics.scoring.length_quantiles import BINS, bins_of, quantile
from metrics.truth.encounters import LAG_S

HORIZONS_S = np.arange(1.0, 11.0)
BANDS = (0.5, 0.8, 0.9)
PARTS = ("distance", "along", "across")
USUAL, FEWEST_CASES = 0.9, 100
"""The usual error of a maker's forecasts is this quantile. It is unknown with fewer cases."""
GATHERED_S = 5.0
"""Forecasts made within this time are compared with the motion together."""

Kind = tuple[str, str, int]
"""Vendor, model and `Basis` of forecasts. The first two are the maker."""


class ForecastScores:
    """Forecasts that wait for the motion that they predict, and counts of their errors."""

    def __init__(self, most_kinds: int = sys.maxsize) -> None:
        """Beyond `most_kinds`, all kinds of one basis share a row."""
        self._most_kinds = most_kinds
        self._counts: Ints = np.zeros((len(PARTS), 0, len(HORIZONS_S), BINS), np.int64)
        """(parts, kinds, horizons, BINS) counts of errors."""
        self._inside: Ints = np.zeros((0, len(HORIZONS_S), len(BANDS) + 1), np.int64)
        """(kinds, horizons, bands + 1) number of errors within each band; last, number of errors with known bands."""
        self._index: dict[str, int] = {}
        self._kinds: dict[Kind, int] = {}
        self._usually_aside_m: Floats = np.zeros((0, len(HORIZONS_S)))
        """(kinds, horizons) usual error of the maker across the forecast heading; 0 if unknown."""
        self._waiting: list[tuple[Ints, Ints, Floats, Forecasts]] = []
        """Robots, kinds, bands and forecasts, by batch."""
        self._since_s: float | None = None
        """When the oldest waiting forecast was made."""

    def add_batch(self, batch: Batch, now_s: float, bands_m: Floats | None = None) -> Floats:
        """Add the forecasts of a batch; return the usual errors of its robots, as `usually_aside_m`."""
        kinds = list(zip(batch.vendors, batch.models, batch.basis.tolist(), strict=True))
        self.add(batch.robots, kinds, batch.forecasts, bands_m)
        self.advance(now_s)
        return self.usually_aside_m(kinds)

    def add(
        self, robots: Sequence[str], kinds: Sequence[Kind], forecasts: Forecasts, bands_m: Floats | None = None
    ) -> None:
        """Add the forecasts of robots that have reported. The first knot of each is its present pose.

        `bands_m` (n, horizons, bands) are the radii that should contain the error with the probabilities of `BANDS`;
        nan if they are unknown.
        """
        if not len(robots):
            return
        rows = [self._index.setdefault(robot, len(self._index)) for robot in robots]
        if bands_m is None:
            bands_m = np.full((len(rows), len(HORIZONS_S), len(BANDS)), np.nan)
        self._waiting.append((np.array(rows), self._rows(kinds), bands_m, forecasts))
        if self._since_s is None:
            self._since_s = float(forecasts.t_s[forecasts.start[:-1]].min())

    def advance(self, now_s: float) -> None:
        """Count the errors of all forecasts that were made long enough ago."""
        if self._since_s is not None and now_s >= self._since_s + GATHERED_S + HORIZONS_S[-1] + LAG_S:
            self._count(self._since_s + GATHERED_S)

    def finish(self) -> None:
        if self._since_s is not None:
            self._count(np.inf)

    def usually_aside_m(self, kinds: Sequence[Kind]) -> Floats:
        """(n, horizons) usual error across the heading of all forecasts of the makers of kinds (n,), by whole seconds
        ahead; 0 if it is unknown."""
        rows = self._rows(kinds)
        return self._usually_aside_m[rows]

    def figures(self) -> dict[str, Any]:
        """Median and p90 by horizon: of all robots, by vendor, by vendor and model, and by basis."""
        vendors, makers, bases = (self._rows_by(*part) for part in ((0,), (0, 1), (2,)))
        return {
            "all": self._by_horizon(list(self._kinds.values())),
            "by_vendor": [{"vendor": name, "horizons": self._by_horizon(rows)} for (name,), rows in vendors],
            "by_model": [
                {"vendor": vendor, "model": model, "horizons": self._by_horizon(rows)}
                for (vendor, model), rows in makers
            ],
            "by_basis": [
                {"basis": Basis(basis).name.lower(), "horizons": self._by_horizon(rows)} for (basis,), rows in bases
            ],
        }

    def _rows_by(self, *fields: int) -> list[tuple[tuple[Any, ...], list[int]]]:
        """The rows of the kinds that agree in these fields."""
        rows_by: dict[tuple[Any, ...], list[int]] = {}
        for kind, row in sorted(self._kinds.items()):
            rows_by.setdefault(tuple(kind[field] for field in fields), []).append(row)
        return sorted(rows_by.items())

    def _by_horizon(self, rows: list[int]) -> list[dict[str, Any]]:
        return _by_horizon(self._counts[:, rows].sum(axis=1), self._inside[rows].sum(axis=0))

    def _rows(self, kinds: Sequence[Kind]) -> Ints:
        """The rows of kinds (n,) in the counts. Adds rows for new kinds."""
        new = [kind for kind in dict.fromkeys(kinds) if kind not in self._kinds]
        room = max(self._most_kinds - len(self._kinds), 0)
        shared: dict[Kind, Kind] = {kind: ("", "", kind[2]) for kind in new[room:]}
        new = new[:room] + [kind for kind in dict.fromkeys(shared.values()) if kind not in self._kinds]
        if new:
            usual_m = {kind[:2]: self._usually_aside_m[row] for kind, row in self._kinds.items()}
            self._kinds |= {kind: row for row, kind in enumerate(new, len(self._kinds))}
            self._counts = np.pad(self._counts, ((0, 0), (0, len(new)), (0, 0), (0, 0)))
            self._inside = np.pad(self._inside, ((0, len(new)), (0, 0), (0, 0)))
            more_m = [usual_m.get(kind[:2], np.zeros(len(HORIZONS_S))) for kind in new]
            self._usually_aside_m = np.concatenate([self._usually_aside_m, more_m])
        return np.array([self._kinds[shared.get(kind, kind)] for kind in kinds], np.int64)

    def _count(self, until_s: float) -> None:
        robot, kind, bands_m = (np.concatenate([waiting[n] for waiting in self._waiting]) for n in range(3))
        forecasts = Forecasts.joined(waiting[3] for waiting in self._waiting)
        made_s = forecasts.t_s[forecasts.start[:-1]]
        knots = (
            forecasts.t_s,
            forecasts.x_m,
            forecasts.y_m,
            forecasts.yaw_rad,
            ready(forecasts.floor, np.int64),
            bands_m,
        )
        order = np.lexsort((made_s, robot))
        errors, at = _errors(order, robot, kind, forecasts.start, *knots, until_s, HORIZONS_S, JOINED_S, self._inside)
        for counts, bins in zip(self._counts, bins_of(errors), strict=True):
            np.add.at(counts.reshape(-1), at * BINS + bins, 1)
        self._learn_usual()
        rows = np.flatnonzero(made_s >= until_s)
        self._keep(robot[rows], kind[rows], bands_m[rows], forecasts.take(rows))

    def _learn_usual(self) -> None:
        for _, rows in self._rows_by(0, 1):
            counts = self._counts[PARTS.index("across"), rows].sum(axis=0)
            for horizon in np.flatnonzero(counts.sum(axis=1) >= FEWEST_CASES).tolist():
                self._usually_aside_m[rows, horizon] = quantile(counts[horizon], USUAL) or 0.0

    def _keep(self, robot: Ints, kind: Ints, bands_m: Floats, rest: Forecasts) -> None:
        self._waiting, self._since_s = [], None
        if len(robot):
            self._waiting = [(robot, kind, bands_m, rest)]
            self._since_s = float(rest.t_s[rest.start[:-1]].min())


@kernel((*[READ_INTS] * 4, *[READ_FLOATS] * 4, READ_INTS, READ_CUBE, FLOAT, READ_FLOATS, FLOAT, INT[:, :, ::1]))
def _errors(
    order: Ints,
    robot: Ints,
    kind: Ints,
    start: Ints,
    t_s: Floats,
    x_m: Floats,
    y_m: Floats,
    yaw_rad: Floats,
    floor: Ints,
    bands_m: Floats,
    until_s: float,
    horizons_s: Floats,
    joined_s: float,
    inside: Ints,
) -> tuple[Floats, Ints]:
    """Compare forecasts made before `until_s` with the motion. `order` sorts them by robot, then by when they were
    made.

    Returns (parts, m) errors, and (m,) kind and horizon of each as an index into (kinds, horizons). Adds to `inside`
    (kinds, horizons, bands + 1) the number of errors within each band; last, the number whose bands are all known.
    """
    n, horizons, bands, m = len(order), len(horizons_s), bands_m.shape[2], 0
    errors, at = np.empty((3, n * horizons)), np.empty(n * horizons, np.int64)
    for place in range(n):
        row = order[place]
        knot, end, made_s, before = start[row], start[row + 1], t_s[start[row]], place
        if made_s >= until_s:
            continue
        for column in range(horizons):
            ahead_s = horizons_s[column]
            while before + 1 < n and robot[order[before + 1]] == robot[row]:
                if t_s[start[order[before + 1]]] - made_s > ahead_s:
                    break
                before += 1
            b, share = start[order[before]], 0.0
            x, y, since_s = x_m[b], y_m[b], ahead_s - (t_s[b] - made_s)
            a = start[order[before + 1]] if before + 1 < n and robot[order[before + 1]] == robot[row] else b
            gap_s = t_s[a] - t_s[b]
            if 0.0 < gap_s <= joined_s and floor[a] == floor[b]:
                share = since_s / gap_s
                x, y = x + share * (x_m[a] - x), y + share * (y_m[a] - y)
            elif 0.0 < gap_s <= joined_s or since_s != 0.0:
                continue
            while knot + 1 < end and t_s[knot + 1] - made_s <= ahead_s:
                knot += 1
            if floor[knot] != floor[b]:
                continue
            dx, dy, following = x - x_m[knot], y - y_m[knot], min(knot + 1, end - 1)
            if following > knot and floor[following] == floor[knot]:
                share = (ahead_s - (t_s[knot] - made_s)) / (t_s[following] - t_s[knot])
                dx = x - (x_m[knot] + share * (x_m[following] - x_m[knot]))
                dy = y - (y_m[knot] + share * (y_m[following] - y_m[knot]))
            c, s = cos(yaw_rad[knot]), sin(yaw_rad[knot])
            errors[0, m], errors[1, m], errors[2, m] = hypot(dx, dy), abs(c * dx + s * dy), abs(c * dy - s * dx)
            at[m] = kind[row] * horizons + column
            within, known = inside[kind[row], column], True
            for band in range(bands):
                within[band] += errors[0, m] <= bands_m[row, column, band]
                known &= isfinite(bands_m[row, column, band])
            within[bands] += known
            m += 1
    return errors[:, :m].copy(), at[:m].copy()


def _by_horizon(counts: Ints, inside: Ints) -> list[dict[str, Any]]:
    rows = []
    for column, horizon_s in enumerate(HORIZONS_S.tolist()):
        row: dict[str, Any] = {"horizon_s": horizon_s, "cases": int(counts[0, column].sum())}
        for part, name in enumerate(PARTS):
            for share, label in ((0.5, "median"), (0.9, "p90")):
                row[f"{name}_{label}_m"] = quantile(counts[part, column], share)
        *within, banded = inside[column].tolist()
        row["banded"] = banded
        for band, count in zip(BANDS, within, strict=True):
            row[f"covered_{band:.0%}".rstrip("%")] = count / banded if banded else None
        rows.append(row)
    return rows
