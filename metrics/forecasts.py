"""How far robots were from where their forecasts had put them, 1 to 10 s ahead, by vendor and model.

The truth is the recorded motion of `metrics/motion.py`. Along and across are those of the heading that was forecast.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from deconflict.motion import Bools
from ingest.seam import Floats, Forecasts, Ints
from metrics.motion import JOINED_S
from metrics.sketch import BINS, bins_of, quantile
from metrics.truth import LAG_S

HORIZONS_S = np.arange(1.0, 11.0)
BANDS = (0.5, 0.8, 0.9)
KINDS = ("distance", "along", "across")
GATHERED_S = 5.0
"""Forecasts of so long are held against the motion together."""
APART = 1e6
"""Seconds between two robots on the one time axis of a search; more than any log that is held at once."""

Maker = tuple[str, str]
"""Vendor and model."""


class ForecastErrors:
    """Forecasts that wait for the motion they foretold, and counts of their errors."""

    def __init__(self) -> None:
        self.counts: dict[Maker, Ints] = {}
        """(kinds, horizons, BINS) by vendor and model."""
        self.inside: dict[Maker, Ints] = {}
        """(horizons, bands + 1) by vendor and model: how many lay within each band, and of how many bands are known."""
        self._index: dict[str, int] = {}
        self._makers: list[Maker] = []
        self._waiting: list[tuple[Ints, Ints, Floats, Forecasts]] = []
        """Robot, maker, bands, forecast."""
        self._since_s: float | None = None
        """When the first of those that wait was made."""

    def take(
        self, robots: Sequence[str], makers: Sequence[Maker], forecasts: Forecasts, bands_m: Floats | None = None
    ) -> None:
        """Take the forecasts of robots that have reported; their first knots are where they were.

        `bands_m` (n, horizons, bands) are the radii within which each is said to come true, with the probabilities of
        `BANDS`; nan where none are.
        """
        if not len(robots):
            return
        made_by = [self._maker(maker) for maker in makers]
        rows = [self._index.setdefault(robot, len(self._index)) for robot in robots]
        if bands_m is None:
            bands_m = np.full((len(rows), len(HORIZONS_S), len(BANDS)), np.nan)
        self._waiting.append((np.array(rows), np.array(made_by), bands_m, forecasts))
        if self._since_s is None:
            self._since_s = float(forecasts.t_s[forecasts.start[:-1]].min())

    def advance(self, now_s: float) -> None:
        """Count what can be told of all forecasts that were made long enough ago."""
        if self._since_s is not None and now_s >= self._since_s + GATHERED_S + HORIZONS_S[-1] + LAG_S:
            self._count(self._since_s + GATHERED_S)

    def finish(self) -> None:
        if self._since_s is not None:
            self._count(np.inf)

    def figures(self) -> dict[str, Any]:
        """Median and p90 by horizon, of all and by vendor and model."""
        return {
            "all": _by_horizon(
                sum(self.counts.values(), np.zeros((len(KINDS), len(HORIZONS_S), BINS), np.int64)),
                sum(self.inside.values(), np.zeros((len(HORIZONS_S), len(BANDS) + 1), np.int64)),
            ),
            "by_model": [
                {
                    "vendor": vendor,
                    "model": model,
                    "horizons": _by_horizon(self.counts[vendor, model], self.inside[vendor, model]),
                }
                for vendor, model in sorted(self.counts)
            ],
        }

    def _maker(self, maker: Maker) -> int:
        if maker not in self.counts:
            self.counts[maker] = np.zeros((len(KINDS), len(HORIZONS_S), BINS), np.int64)
            self.inside[maker] = np.zeros((len(HORIZONS_S), len(BANDS) + 1), np.int64)
            self._makers.append(maker)
        return self._makers.index(maker)

    def _count(self, until_s: float) -> None:
        robot, maker, bands_m = (np.concatenate([waiting[n] for waiting in self._waiting]) for n in range(3))
        forecasts = Forecasts.joined(waiting[3] for waiting in self._waiting)
        made_s = forecasts.t_s[forecasts.start[:-1]]
        due = np.flatnonzero(made_s < until_s)
        errors, known = _errors(robot, forecasts, due)
        for row, name in enumerate(self._makers):
            chosen = known & (maker[due] == row)[:, None]
            at = np.nonzero(chosen)
            for kind in range(len(KINDS)):
                np.add.at(self.counts[name][kind], (at[1], bins_of(errors[kind][at])), 1)
            bands = bands_m[due][at]
            np.add.at(self.inside[name][:, :-1], at[1], errors[0][at][:, None] <= bands)
            np.add.at(self.inside[name][:, -1], at[1], np.isfinite(bands).all(axis=1))
        rows = np.flatnonzero(made_s >= until_s)
        self._keep(robot[rows], maker[rows], bands_m[rows], forecasts.take(rows))

    def _keep(self, robot: Ints, maker: Ints, bands_m: Floats, rest: Forecasts) -> None:
        self._waiting, self._since_s = [], None
        if len(robot):
            self._waiting = [(robot, maker, bands_m, rest)]
            self._since_s = float(rest.t_s[rest.start[:-1]].min())


def _errors(robot: Ints, forecasts: Forecasts, due: Ints) -> tuple[Floats, Bools]:
    """(kinds, d, horizons) errors of the forecasts `due`, and (d, horizons) whether the motion is known there."""
    first = forecasts.start[:-1]
    base_s = float(forecasts.t_s.min())
    order = np.lexsort((forecasts.t_s[first], robot))
    at, who = forecasts.t_s[first][order] - base_s, robot[order]
    wanted = (forecasts.t_s[first][due] - base_s)[:, None] + HORIZONS_S
    before = np.searchsorted(who * APART + at, robot[due][:, None] * APART + wanted, side="right") - 1
    after = np.minimum(before + 1, len(at) - 1)
    gap_s = at[after] - at[before]
    joined = (who[after] == robot[due][:, None]) & (gap_s > 0) & (gap_s <= JOINED_S)
    known = joined | (at[before] == wanted)
    share = np.where(joined, (wanted - at[before]) / np.where(joined, gap_s, 1.0), 0.0)
    b, a = first[order[before]], first[order[after]]
    known &= ~joined | (forecasts.floor[a] == forecasts.floor[b])
    x, y = (column[b] + share * (column[a] - column[b]) for column in (forecasts.x_m, forecasts.y_m))
    px, py, yaw, floor = _told(forecasts, due, wanted + base_s)
    known &= floor == forecasts.floor[b]
    dx, dy = x - px, y - py
    along, across = np.cos(yaw) * dx + np.sin(yaw) * dy, np.cos(yaw) * dy - np.sin(yaw) * dx
    return np.stack([np.hypot(dx, dy), np.abs(along), np.abs(across)]), known


def _told(forecasts: Forecasts, rows: Ints, t_s: Floats) -> tuple[Floats, Floats, Floats, Ints]:
    """Where the forecasts of `rows` put their robots at `t_s` (d, h): x, y, heading and floor."""
    base_s = float(forecasts.t_s.min())
    owner = np.repeat(np.arange(len(forecasts)), np.diff(forecasts.start))
    keys = owner * APART + (forecasts.t_s - base_s)
    knot = np.searchsorted(keys, rows[:, None] * APART + (t_s - base_s), side="right") - 1
    following = np.minimum(knot + 1, forecasts.start[rows + 1][:, None] - 1)
    lasts_s = forecasts.t_s[following] - forecasts.t_s[knot]
    moving = (lasts_s > 0) & (forecasts.floor[following] == forecasts.floor[knot])
    share = np.where(moving, (t_s - forecasts.t_s[knot]) / np.where(moving, lasts_s, 1.0), 0.0)
    x, y = (c[knot] + share * (c[following] - c[knot]) for c in (forecasts.x_m, forecasts.y_m))
    return x, y, forecasts.yaw_rad[knot], forecasts.floor[knot]


def _by_horizon(counts: Ints, inside: Ints) -> list[dict[str, Any]]:
    rows = []
    for column, horizon_s in enumerate(HORIZONS_S.tolist()):
        row: dict[str, Any] = {"horizon_s": horizon_s, "cases": int(counts[0, column].sum())}
        for kind, name in enumerate(KINDS):
            for share, label in ((0.5, "median"), (0.9, "p90")):
                row[f"{name}_{label}_m"] = quantile(counts[kind, column], share)
        *within, banded = inside[column].tolist()
        row["banded"] = banded
        for band, count in zip(BANDS, within, strict=True):
            row[f"covered_{band:.0%}".rstrip("%")] = count / banded if banded else None
        rows.append(row)
    return rows
