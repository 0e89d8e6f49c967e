"""When robots came to their destinations, against when they had said they would: what contention forecasts rest on.

A robot's word is kept when it first names a destination and every half minute after; it has come when its envelope's
centre is within 0.75 m. The error of each word is told by how long ahead it was given. A robot that has not come by the
time that it told, when it is heard of last, is late by at least as long as it was heard of after that.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from deconflict.contention.robots.announced_arrivals import Promise, Promises
from ingest.batch import Batch, Destinations, Ints
from metrics.scoring.length_quantiles import BINS, bins_of, quantile
from metrics.scoring.place_scores import AHEAD_S


class ArrivalScores:
    """Words that wait for their robots, and counts of errors by vendor."""

    def __init__(self) -> None:
        self._promises = Promises()
        self._errors: dict[str, Ints] = {}
        """(late or early, ahead, BINS) by vendor."""
        self._out: dict[str, Ints] = {}
        """(ahead,) by vendor: words whose robots had not come when they were heard of last."""
        self._heard: dict[str, tuple[str, float]] = {}
        """By robot, its vendor, and when it was heard of last."""

    def add_batch(self, batch: Batch) -> None:
        """Robots that have reported, and where they say that they go."""
        first, told = batch.forecasts.start[:-1], _known(batch.destinations)
        heard = zip(batch.vendors, batch.event_s.tolist(), strict=True)
        self._heard.update(zip(batch.robots, heard, strict=True))
        floor, x_m, y_m = (getattr(batch.forecasts, name)[first] for name in ("floor", "x_m", "y_m"))
        for row, kept in self._promises.hear(batch, batch.event_s, (floor, x_m, y_m), told):
            for said in kept:
                self._count(batch.vendors[row], float(batch.event_s[row]), said)
        for robot in batch.gone:
            self._promises.forget(robot)

    def figures(self) -> list[dict[str, Any]]:
        """By vendor and by how long ahead: words of arrivals, how far off they were, and the share that came late.

        Ends what waits.
        """
        for robot, said in list(self._promises.waiting()):
            vendor, heard_s = self._heard[robot]
            self._count(vendor, heard_s, [one for one in said if one.told_s < heard_s], came=False)
            self._promises.forget(robot)
        return [
            {
                "vendor": vendor,
                "ahead_up_to_s": ahead_s,
                **_row(counts[:, column]),
                "out": int(self._out[vendor][column]),
            }
            for vendor, counts in sorted(self._errors.items())
            for column, ahead_s in enumerate(AHEAD_S.tolist())
            if counts[:, column].any()
        ]

    def _count(self, vendor: str, now_s: float, said: list[Promise], *, came: bool = True) -> None:
        """Words whose robot has come now, or has not by now."""
        counts = self._errors.setdefault(vendor, np.zeros((2, len(AHEAD_S), BINS), np.int64))
        out = self._out.setdefault(vendor, np.zeros(len(AHEAD_S), np.int64))
        for at_s, told_s in said:
            column, late_s = int(np.searchsorted(AHEAD_S, told_s - at_s)), now_s - told_s
            if column < len(AHEAD_S):
                counts[int(late_s > 0), column, bins_of(np.array([abs(late_s)]))] += 1
                out[column] += not came


def _known(told: Destinations) -> Destinations:
    """Those that are compared with something."""
    known = told.floor >= 0
    if known.all():
        return told
    start = np.concatenate([[0], np.cumsum(known)])[told.start]
    return Destinations(start, *(getattr(told, name)[known] for name in ("t_s", "x_m", "y_m", "floor")))


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
