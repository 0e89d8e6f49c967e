"""The newest reports of each robot, and where robots rest that have not reported for long."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from deconflict.foresight.history_rows import HistoryRows, with_rows
from deconflict.foresight.interactions.progress_kernels import AHEAD_S, KEPT, STATE, Findings, add_reports
from deconflict.foresight.interactions.way_kernels import ways_left_m
from ingest.batch import Bools, Floats, Ints

BY_ROW = "_states", "_t_s", "_tracks", "_floor", "_speed", "_follows"
"""Arrays by the row of a robot that does not rest."""


class InteractionReports(NamedTuple):
    """n robots of a batch, each of them once. Arrays are (n,) if not said otherwise."""

    slot: Ints
    event_s: Floats
    track: Floats
    """(n, k, 4) x_m, y_m, yaw_rad and floor: as reported, and as forecast for each whole second after that, at least
    `AHEAD_S`; nan if unknown."""
    explained: Bools
    """Whether the robot says why it stands, such as that it charges or is driven by hand."""
    usual_m: Floats
    """(n, AHEAD_S) usual errors of forecasts of its kind, by whole seconds ahead."""


class ReportedMotion(NamedTuple):
    """The newest `KEPT` reports of each robot, by row, as views that change with each report."""

    states: NDArray[Any]
    """(rows,) of `STATE`: which report is the newest, and how many are kept."""
    t_s: Floats
    """(rows, KEPT) time of each."""
    tracks: Floats
    """(rows, KEPT, AHEAD_S + 1, 3) x_m, y_m and yaw_rad, as reported and as forecast for each second after that."""
    floor: Floats
    """(rows, KEPT)"""
    speed: Floats
    """(rows, KEPT) speed from the report before."""


class RecentReports:
    """By the row of each robot that does not rest, its newest reports; by slot, where a robot rests."""

    def __init__(self) -> None:
        self.rows = HistoryRows()
        self._states = np.zeros(0, STATE)
        self._t_s = np.zeros((0, KEPT))
        """(rows, KEPT) time of each kept report."""
        self._tracks = np.zeros((0, KEPT, AHEAD_S + 1, 3))
        """(rows, KEPT, AHEAD_S + 1, 3) x_m, y_m and yaw_rad of each kept report and of its forecast."""
        self._floor = np.zeros((0, KEPT))
        """(rows, KEPT) floor of each kept report."""
        self._speed = np.zeros((0, KEPT))
        """(rows, KEPT) speed from the report before."""
        self._follows = np.zeros((0, KEPT))
        """(rows, KEPT) share of the forecast way that the robot had come since the report before."""
        self._rest = np.zeros((0, 4))
        """(slots, 4) x_m, y_m, yaw_rad and floor of each robot that rests; nan for others."""

    def grow(self, slots: int) -> None:
        """Make room for this many slots."""
        more = slots - len(self._rest)
        if more > 0:
            self.rows.grow(slots)
            self._rest = np.concatenate([self._rest, np.full((more, 4), np.nan)])

    def release(self, slots: Ints) -> None:
        """Forget all of these robots."""
        self._states[self.rows.release(slots)] = np.zeros((), STATE)
        self._rest[slots] = np.nan
        self._fit()

    def _fit(self) -> None:
        if len(self.rows) != len(self._states):
            for name, column in with_rows(self, BY_ROW, len(self.rows)).items():
                setattr(self, name, column)

    def rest(self, slots: Ints) -> tuple[Ints, Floats]:
        """These robots stand from now on where their forecasts ended. Returns those of them that did not rest already,
        and when they reported last."""
        slots = slots[self.rows.of_slot[slots] >= 0]
        rows = self.rows.of_slot[slots]
        newest = self._states["newest"][rows]
        last_s, poses = self._t_s[rows, newest], self._tracks[rows, newest, AHEAD_S]
        places = np.column_stack([poses, self._floor[rows, newest]])
        self.release(slots)
        self._rest[slots] = places
        return slots, last_s

    def add(self, reports: InteractionReports, half_width_m: Floats) -> Findings:
        """Add reports of robots with these half widths (n,), and return what they show."""
        rows = self.rows.assign(reports.slot)
        self._rest[reports.slot] = np.nan
        self._fit()
        history = (self._states, self._t_s, self._tracks, self._floor, self._speed, self._follows)
        found = (rows, reports.event_s, reports.track, half_width_m, reports.explained, reports.usual_m)
        return add_reports(*history, *found)

    @property
    def motion(self) -> ReportedMotion:
        return ReportedMotion(self._states, self._t_s, self._tracks, self._floor, self._speed)

    def places(self) -> tuple[Ints, Floats, Floats]:
        """The slots (n,) of all robots, ascending; (n, 3) x_m, y_m and floor as last reported, or where a robot rests;
        and (n,) the speed to there."""
        rows, resting = np.flatnonzero(self._states["reports"] > 0), np.flatnonzero(np.isfinite(self._rest[:, 0]))
        newest = self._states["newest"][rows]
        reported = np.column_stack([self._tracks[rows, newest, 0, :2], self._floor[rows, newest]])
        slots = np.concatenate([self.rows.slots[rows], resting])
        order = np.argsort(slots)
        place = np.concatenate([reported, self._rest[resting][:, [0, 1, 3]]])
        speed_mps = np.concatenate([self._speed[rows, newest], np.zeros(len(resting))])
        return slots[order], place[order], speed_mps[order]

    def ways_left_m(
        self, slot: int, others: Ints, looks_s: Floats, way: Floats, most_mps: float, half_m: Floats
    ) -> Floats:
        """(r,) the shortest way that a robot has left to each of the robots `others` (r,): see `way_kernels`."""
        history = self._states, self._t_s, self._tracks, self.rows.of_slot, self._rest
        return ways_left_m(*history, slot, others, looks_s, way, most_mps, half_m)
