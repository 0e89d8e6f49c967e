"""Errors of announced arrival times, on which contention forecasts are based.

An announcement is kept when a robot first names a destination, and every half minute after that. The robot has arrived
when the centre of its envelope is within 0.75 m. Errors are counted by how far ahead the arrival was announced. If a
robot has not arrived at its last report, and the announced time has passed, it is late by at least the time between.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from deconflict.contention.robots.announced_arrivals import AnnouncedArrivals, Announcement
from deconflict.sweep.robot_slots import RobotSlots
from ingest.batch import Batch, Destinations, Ints
from metrics.scoring.length_quantiles import BINS, bins_of, quantile
from metrics.scoring.place_scores import AHEAD_S


class ArrivalScores:
    """Announcements whose robots have not arrived yet, and counts of errors by vendor."""

    def __init__(self) -> None:
        self._slots = RobotSlots()
        self._announced = AnnouncedArrivals(self._slots)
        self._errors: dict[str, Ints] = {}
        """By vendor (2, ahead, BINS): counts of early (0) and late (1) arrivals, by time ahead and size of the
        error."""
        self._not_arrived: dict[str, Ints] = {}
        """By vendor (ahead,): announcements of robots that had not arrived at their last report."""
        self._last_reports: dict[str, tuple[str, float]] = {}
        """By robot: its vendor and the time of its last report."""

    def add_batch(self, batch: Batch) -> None:
        """Add the reports of a batch with their announced destinations."""
        first, destinations = batch.forecasts.start[:-1], _known(batch.destinations)
        reports = zip(batch.vendors, batch.event_s.tolist(), strict=True)
        self._last_reports.update(zip(batch.robots, reports, strict=True))
        floor, x_m, y_m = (getattr(batch.forecasts, name)[first] for name in ("floor", "x_m", "y_m"))
        for row, announced in self._announced.add_batch(batch, batch.event_s, (floor, x_m, y_m), destinations):
            for announcements in announced:
                self._count(batch.vendors[row], float(batch.event_s[row]), announcements)
        for robot in batch.gone:
            self._announced.forget(robot)
        self._slots.release(batch.gone)

    def figures(self) -> list[dict[str, Any]]:
        """By vendor and time ahead: the number of announcements, their errors, and the share of late arrivals.

        Also counts the announcements of robots that have not arrived. Call it once, after the last batch.
        """
        for robot, announcements in list(self._announced.open()):
            vendor, heard_s = self._last_reports[robot]
            past = [announcement for announcement in announcements if announcement.announced_s < heard_s]
            self._count(vendor, heard_s, past, has_arrived=False)
            self._announced.forget(robot)
        return [
            {
                "vendor": vendor,
                "ahead_up_to_s": ahead_s,
                **_row(counts[:, column]),
                "out": int(self._not_arrived[vendor][column]),
            }
            for vendor, counts in sorted(self._errors.items())
            for column, ahead_s in enumerate(AHEAD_S.tolist())
            if counts[:, column].any()
        ]

    def _count(self, vendor: str, now_s: float, announcements: list[Announcement], *, has_arrived: bool = True) -> None:
        """Count announcements whose robot arrived at `now_s`, or had not arrived by then."""
        counts = self._errors.setdefault(vendor, np.zeros((2, len(AHEAD_S), BINS), np.int64))
        not_arrived = self._not_arrived.setdefault(vendor, np.zeros(len(AHEAD_S), np.int64))
        for at_s, announced_s in announcements:
            column, late_s = int(np.searchsorted(AHEAD_S, announced_s - at_s)), now_s - announced_s
            if column < len(AHEAD_S):
                counts[int(late_s > 0), column, bins_of(np.array([abs(late_s)]))] += 1
                not_arrived[column] += not has_arrived


def _known(destinations: Destinations) -> Destinations:
    """The destinations on a known floor."""
    known = destinations.floor >= 0
    if known.all():
        return destinations
    start = np.concatenate([[0], np.cumsum(known)])[destinations.start]
    return Destinations(start, *(getattr(destinations, name)[known] for name in ("t_s", "x_m", "y_m", "floor")))


def _row(counts: Ints) -> Mapping[str, Any]:
    """The figures of `counts` (2, BINS): early and late arrivals by size of the error."""
    both = counts.sum(axis=0)
    cases = int(both.sum())
    return {
        "cases": cases,
        "off_median_s": quantile(both, 0.5),
        "off_p90_s": quantile(both, 0.9),
        "late": int(counts[1].sum()) / cases,
    }
