"""The newest reports of each robot, and where robots rest that have not reported for long."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from deconflict.foresight.history_rows import HistoryRows, with_rows
from deconflict.foresight.interactions.progress_kernels import AHEAD_S, KEPT, STATE, Findings, add_reports
from deconflict.foresight.interactions.way_kernels import ways_left_m
from ingest.batch import Batch, Bools, Floats, Ints
from ingest.kernels import ready

EXPLAINS_STANDING = frozenset(("charging", "disabled", "offline", "waitingHumanEvent"))
"""Operational states of robots that do not stand because of another robot."""
BY_ROW = "states", "t_s", "tracks", "floor", "speed", "follows"
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


def interaction_reports(batch: Batch, slots: Ints, track: Floats, usual_m: Floats) -> InteractionReports:
    """The n robots of a batch, which have these `slots` (n,). `track` and `usual_m` are as in `InteractionReports`."""
    explained = np.array([state in EXPLAINS_STANDING for state in batch.states], np.bool_)
    return InteractionReports(slots, ready(batch.event_s), track, explained, usual_m)


class RecentReports:
    """By the row of each robot that does not rest, its newest reports; by slot, where a robot rests. The arrays change
    with each report and are replaced as robots come and go: do not keep them."""

    def __init__(self) -> None:
        self.rows = HistoryRows()
        self.states: NDArray[Any] = np.zeros(0, STATE)
        """(rows,) of `STATE`: which report is the newest, and how many are kept."""
        self.t_s: Floats = np.zeros((0, KEPT))
        """(rows, KEPT) time of each kept report."""
        self.tracks: Floats = np.zeros((0, KEPT, AHEAD_S + 1, 3))
        """(rows, KEPT, AHEAD_S + 1, 3) x_m, y_m and yaw_rad of each kept report and of its forecast."""
        self.floor: Floats = np.zeros((0, KEPT))
        """(rows, KEPT) floor of each kept report."""
        self.speed: Floats = np.zeros((0, KEPT))
        """(rows, KEPT) speed from the report before."""
        self.follows: Floats = np.zeros((0, KEPT))
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
        self.states[self.rows.release(slots)] = np.zeros((), STATE)
        self._rest[slots] = np.nan
        self._fit()

    def _fit(self) -> None:
        if len(self.rows) != len(self.states):
            for name, column in with_rows(self, BY_ROW, len(self.rows)).items():
                setattr(self, name, column)

    def rest(self, slots: Ints) -> tuple[Ints, Floats]:
        """These robots stand from now on where their forecasts ended. Returns those of them that did not rest already,
        and when they reported last."""
        slots = slots[self.rows.of_slot[slots] >= 0]
        rows = self.rows.of_slot[slots]
        newest = self.states["newest"][rows]
        last_s, poses = self.t_s[rows, newest], self.tracks[rows, newest, AHEAD_S]
        places = np.column_stack([poses, self.floor[rows, newest]])
        self.release(slots)
        self._rest[slots] = places
        return slots, last_s

    def add(self, reports: InteractionReports, half_width_m: Floats) -> Findings:
        """Add reports of robots with these half widths (n,), and return what they show."""
        rows = self.rows.assign(reports.slot)
        self._rest[reports.slot] = np.nan
        self._fit()
        history = (self.states, self.t_s, self.tracks, self.floor, self.speed, self.follows)
        found = (rows, reports.event_s, reports.track, half_width_m, reports.explained, reports.usual_m)
        return add_reports(*history, *found)

    def places(self) -> tuple[Ints, Floats, Floats]:
        """The slots (n,) of all robots, ascending; (n, 3) x_m, y_m and floor as last reported, or where a robot rests;
        and (n,) the speed to there."""
        rows, resting = np.flatnonzero(self.states["reports"] > 0), np.flatnonzero(np.isfinite(self._rest[:, 0]))
        newest = self.states["newest"][rows]
        reported = np.column_stack([self.tracks[rows, newest, 0, :2], self.floor[rows, newest]])
        slots = np.concatenate([self.rows.slots[rows], resting])
        order = np.argsort(slots)
        place = np.concatenate([reported, self._rest[resting][:, [0, 1, 3]]])
        speed_mps = np.concatenate([self.speed[rows, newest], np.zeros(len(resting))])
        return slots[order], place[order], speed_mps[order]

    def ways_left_m(
        self, slot: int, others: Ints, looks_s: Floats, way: Floats, most_mps: float, half_m: Floats
    ) -> Floats:
        """(r,) the shortest way that a robot has left to each of the robots `others` (r,): see `way_kernels`."""
        history = self.states, self.t_s, self.tracks, self.rows.of_slot, self._rest
        return ways_left_m(*history, slot, others, looks_s, way, most_mps, half_m)
