"""When each robot was last heard, how often it usually reports, and how it moved between its last two reports."""

from collections.abc import Iterator, Sequence
from math import inf
from statistics import median
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from deconflict.sweep.robot_slots import RobotSlots
from ingest.batch import Batch, Floats, Ints
from ingest.kernels import INT_MATRIX, INTS, MATRIX, READ_FLOATS, READ_INTS, kernel, ready

GAPS = 7
"""So many of the last times between reports are kept of each robot."""
FEWEST_GAPS = 2
"""With fewer times between reports, it is not known how often a robot reports."""
GRACE_S, GRACE_GAPS, GRACE_UNKNOWN_S = 5.0, 3.0, 30.0
"""A robot is silent after the first time, or after so many of its usual gaps if that is longer. It is silent after the
third number if its usual gap is not known. It is not silent as long as the rules of its language allow."""
SOON_SHARE = 0.6
"""A robot is silent after this share of that time already, if it has probably left by then."""
SOON_S = SOON_SHARE * GRACE_S
STOOD_MPS, STOOD_LEAST_M, STOOD_MOST_M = 0.05, 0.02, 0.1
"""A robot stood between two reports if it moved at most at this speed. Up to the second number it always stood; beyond
the third it never did."""

HEARD = np.dtype(
    [
        ("arrival_s", np.float64),  # when the newest report arrived
        ("event_s", np.float64),  # when it was true
        ("x_m", np.float64),  # where the robot was then
        ("y_m", np.float64),
        ("yaw_rad", np.float64),
        ("due_s", np.float64),  # from when on the robot may be silent, inf if it is silent
        ("floor", np.int64),  # index of the floor in the batches
        ("stood", np.bool_),  # whether it had stood since the report before
        ("reports", np.int64),  # how many reports came
        ("reports_within_s", np.float64),  # the next report may come as late as this by the rules of its language
        ("gaps_s", np.float64, (GAPS,)),  # times between the last reports, the newest at `(reports - 2) % GAPS`
    ],
    align=True,
)
"""The newest report of one robot."""

Heard = NDArray[Any]
"""(slots,) of `HEARD`."""

_NOBODY = np.zeros((), HEARD)
_NOBODY["due_s"] = np.inf
_HEARD = numba.from_dtype(HEARD)[::1]
_BOTH, _BOTH_INTS = MATRIX, INT_MATRIX


class Legs(NamedTuple):
    """How n robots moved from the report before to the newest one. Arrays are (n,), or (n, 2) for before and now."""

    rows: Ints
    """Rows of the batch."""
    before: Heard
    """The records of the robots before the new reports."""
    gap_s: Floats
    """Time between the arrivals of the two reports; inf if there was none before."""
    took_s: Floats
    """Time between their event times; inf if there was none before."""
    x_m: Floats
    """(n, 2) centre of the envelope in the floor's frame."""
    y_m: Floats
    """(n, 2)"""
    yaw_rad: Floats
    """(n, 2) heading."""
    floor: Ints
    """(n, 2) index of the floor."""

    def after_silence(self) -> Iterator[int]:
        """The rows of robots that were unknown, or silent before this report."""
        for leg in np.flatnonzero(self.gap_s > GRACE_S).tolist():
            if self.gap_s[leg] == inf or self.gap_s[leg] > grace_s(self.before[leg]):
                yield int(self.rows[leg])


@kernel((_HEARD, *[INTS], *[READ_FLOATS] * 3, *[READ_INTS] * 2, *[READ_FLOATS] * 3, READ_INTS))
def _add_reports(
    heard: Heard,
    slots: Ints,
    arrival_s: Floats,
    event_s: Floats,
    reports_within_s: Floats,
    statuses: Ints,
    start: Ints,
    x_m: Floats,
    y_m: Floats,
    yaw_rad: Floats,
    floor: Ints,
) -> tuple[Ints, Heard, Floats, Floats, Floats, Floats, Floats, Ints]:
    """Add the reports of robots `slots` (n,) that are new. Returns the fields of `Legs`."""
    rows, before, n = np.empty(len(slots), np.int64), np.empty(len(slots), HEARD), 0
    for row in range(len(slots)):
        if arrival_s[row] > heard[slots[row]].arrival_s:
            rows[n], before[n] = row, heard[slots[row]]
            n += 1
    gap_s, took_s = np.full(n, np.inf), np.full(n, np.inf)
    x, y, yaw, on = np.empty((n, 2)), np.empty((n, 2)), np.empty((n, 2)), np.empty((n, 2), np.int64)
    for leg in range(n):
        row, was = rows[leg], before[leg]
        robot, knot = heard[slots[row]], start[row]
        robot.arrival_s, robot.event_s, robot.due_s = arrival_s[row], event_s[row], arrival_s[row] + SOON_S
        robot.reports_within_s = reports_within_s[row]
        robot.x_m, robot.y_m, robot.yaw_rad, robot.floor = x_m[knot], y_m[knot], yaw_rad[knot], floor[knot]
        if was.reports:
            gap_s[leg], took_s[leg] = robot.arrival_s - was.arrival_s, robot.event_s - was.event_s
            robot.gaps_s[(was.reports - 1) % GAPS] = gap_s[leg] / max(statuses[row], 1)
            most_m = min(max(STOOD_MPS * took_s[leg], STOOD_LEAST_M), STOOD_MOST_M)
            robot.stood = robot.floor == was.floor and np.hypot(robot.x_m - was.x_m, robot.y_m - was.y_m) <= most_m
        robot.reports = was.reports + 1
        x[leg, 0], y[leg, 0], yaw[leg, 0], on[leg, 0] = was.x_m, was.y_m, was.yaw_rad, was.floor
        x[leg, 1], y[leg, 1], yaw[leg, 1], on[leg, 1] = robot.x_m, robot.y_m, robot.yaw_rad, robot.floor
    return rows[:n].copy(), before[:n].copy(), gap_s, took_s, x, y, yaw, on


class ReportIntervals:
    """Records by slot."""

    def __init__(self, slots: RobotSlots) -> None:
        self.slots = slots
        self.heard: Heard = np.zeros(0, HEARD)

    def add_batch(self, batch: Batch) -> tuple[Legs, list[int]]:
        """Add a batch. Returns the legs of the robots that have reported anew, and the rows of the robots that were
        unknown."""
        slots, _ = self.slots.assign(batch.robots)
        self._grow(len(self.slots))
        new = np.flatnonzero(self.heard["reports"][slots] == 0).tolist()
        f = batch.forecasts
        places = ready(f.x_m), ready(f.y_m), ready(f.yaw_rad), ready(f.floor, np.int64)
        counts = ready(batch.statuses, np.int64), ready(f.start, np.int64)
        times = ready(batch.arrival_s), ready(batch.event_s), ready(batch.reports_within_s)
        legs = _add_reports(self.heard, slots, *times, *counts, *places)
        return Legs(*legs), new

    def overdue(self, now_s: float) -> list[str]:
        """The robots that may be silent by now, and are not known to be silent."""
        return [self.slots.uuids[slot] for slot in np.flatnonzero(self.heard["due_s"] <= now_s).tolist()]

    def set_due(self, uuid: str, at_s: float) -> None:
        """A robot can't be silent before `at_s`; inf for a robot that is silent, until it reports."""
        self.heard["due_s"][self.slots.by_uuid[uuid]] = at_s

    def forget(self, uuid: str) -> None:
        if uuid in self.slots.by_uuid:
            self.heard[self.slots.by_uuid[uuid]] = _NOBODY

    def heard_s(self, uuid: str) -> float:
        """When a robot was last heard."""
        return float(self.heard["arrival_s"][self.slots.by_uuid[uuid]])

    def moved(self, uuid: str) -> bool | None:
        """Whether a robot moved between its last two reports; None if it has sent only one."""
        record = self.heard[self.slots.by_uuid[uuid]]
        return None if record["reports"] < 2 else not record["stood"]

    def grace_s(self, uuid: str) -> float:
        """How long a robot may say nothing before it counts as silent."""
        return grace_s(self.heard[self.slots.by_uuid[uuid]])

    def soon_s(self, uuid: str) -> float:
        """How long a robot may say nothing before it counts as silent, if it has probably left."""
        record = self.heard[self.slots.by_uuid[uuid]]
        return max(SOON_SHARE * grace_s(record), float(record["reports_within_s"]))

    def _grow(self, slots: int) -> None:
        if slots > len(self.heard):
            self.heard = np.concatenate([self.heard, np.full(max(slots, 64), _NOBODY)])


def grace_s(record: np.void) -> float:
    """How long a robot may say nothing before it counts as silent, by its record."""
    gaps = min(max(int(record["reports"]) - 1, 0), GAPS)
    return max(grace_after_s(record["gaps_s"][:gaps].tolist()), float(record["reports_within_s"]))


def grace_after_s(gaps_s: Sequence[float]) -> float:
    """How long a robot may say nothing before it counts as silent, by the times between its last reports."""
    return max(GRACE_S, GRACE_GAPS * median(gaps_s)) if len(gaps_s) >= FEWEST_GAPS else GRACE_UNKNOWN_S
