"""When robots came to their destinations, against when they had said they would: what contention forecasts rest on.

A robot's word is kept when it first names a destination and every half minute after; it has come when its envelope's
centre is within 0.75 m. The error of each word is told by how long ahead it was given.
"""

from collections.abc import Mapping
from itertools import pairwise
from math import hypot
from typing import Any

import numpy as np

from ingest.seam import Batch, Ints
from metrics.sketch import BINS, bins_of, quantile

ARRIVED_M = 0.75
SAY_AGAIN_S = 30.0
FORGET_S = 600.0
"""Somebody this late is not waited for."""
MOST_WORDS = 32
"""Kept of one destination: a quarter of an hour."""
AHEAD_S = (60.0, 300.0, 900.0)
"""Words given at most so long ahead are told together."""

Spot = tuple[int, float, float]
"""Floor, x and y to the decimetre."""


class Arrivals:
    """Words that wait for their robots, and counts of errors by vendor."""

    def __init__(self) -> None:
        self._words: dict[str, dict[Spot, list[tuple[float, float]]]] = {}
        """By robot and destination: when it was said, and the time that was told."""
        self._errors: dict[str, Ints] = {}
        """(late or early, ahead, BINS) by vendor."""

    def take(self, batch: Batch) -> None:
        """Robots that have reported, and where they say that they go."""
        first = batch.forecasts.start[:-1]
        here = zip(
            batch.forecasts.floor[first].tolist(),
            batch.forecasts.x_m[first].tolist(),
            batch.forecasts.y_m[first].tolist(),
            strict=True,
        )
        told = batch.destinations
        stops = list(zip(told.floor.tolist(), told.x_m.tolist(), told.y_m.tolist(), told.t_s.tolist(), strict=True))
        for row, (place, (begin, end)) in enumerate(zip(here, pairwise(told.start.tolist()), strict=True)):
            if begin < end or batch.robots[row] in self._words:
                self._hear(batch.robots[row], batch.vendors[row], float(batch.event_s[row]), place, stops[begin:end])
        for robot in batch.gone:
            self._words.pop(robot, None)

    def figures(self) -> list[dict[str, Any]]:
        """By vendor and by how long ahead: arrivals told, how far off they were, and the share that came late."""
        return [
            {"vendor": vendor, "ahead_up_to_s": ahead_s, **_row(counts[:, column])}
            for vendor, counts in sorted(self._errors.items())
            for column, ahead_s in enumerate(AHEAD_S)
            if counts[:, column].any()
        ]

    def _hear(
        self, robot: str, vendor: str, now_s: float, here: Spot, stops: list[tuple[int, float, float, float]]
    ) -> None:
        words = self._words.setdefault(robot, {})
        for spot in [one for one in words if _near(one, here)]:
            self._come(vendor, now_s, words.pop(spot))
        ahead = {(floor, round(x, 1), round(y, 1)): t_s for floor, x, y, t_s in stops if floor >= 0}
        for spot in [one for one in words if one not in ahead and _is_over(words[one], now_s)]:
            del words[spot]
        for spot, t_s in ahead.items():
            said = words.setdefault(spot, []) if not _near(spot, here) else None
            if said is not None and len(said) < MOST_WORDS and (not said or now_s - said[-1][0] >= SAY_AGAIN_S):
                said.append((now_s, t_s))
        if not words:
            del self._words[robot]

    def _come(self, vendor: str, now_s: float, said: list[tuple[float, float]]) -> None:
        counts = self._errors.setdefault(vendor, np.zeros((2, len(AHEAD_S), BINS), np.int64))
        for at_s, told_s in said:
            column = next((n for n, ahead_s in enumerate(AHEAD_S) if told_s - at_s <= ahead_s), None)
            if column is not None:
                late_s = now_s - told_s
                counts[int(late_s > 0), column, bins_of(np.array([abs(late_s)]))] += 1


def _is_over(said: list[tuple[float, float]], now_s: float) -> bool:
    """Whether a destination that is no longer named lay ahead, which is another plan, or is long past."""
    _, told_s = said[-1]
    return told_s > now_s or told_s + FORGET_S < now_s


def _near(a: Spot, b: Spot) -> bool:
    return a[0] == b[0] and hypot(a[1] - b[1], a[2] - b[2]) <= ARRIVED_M


def _row(counts: Ints) -> Mapping[str, Any]:
    """`counts` (2, BINS) of early and late ones."""
    both = counts.sum(axis=0)
    cases = int(both.sum())
    return {
        "cases": cases,
        "off_median_s": quantile(both, 0.5),
        "off_p90_s": quantile(both, 0.9),
        "late": int(counts[1].sum()) / cases,
    }
