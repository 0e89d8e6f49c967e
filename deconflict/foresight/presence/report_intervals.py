"""When each robot was heard, how often it usually reports, and how it moved between its last two reports."""

from collections.abc import Sequence
from itertools import repeat
from statistics import median
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ingest.batch import Batch, Floats, Ints
from ingest.kernels import kernel, ready

GAPS = 7
"""Between reports that are remembered of each robot."""
FEWEST_GAPS = 2
"""Of one that has reported less often it is not known how often it does."""
GRACE_S, GRACE_GAPS, GRACE_UNKNOWN_S = 5.0, 3.0, 30.0
"""A robot is silent after the longer of the first time and so many of its usual gaps; after the last, where they are
not known."""
STOOD_MPS, STOOD_LEAST_M, STOOD_MOST_M = 0.05, 0.02, 0.1
"""A robot that moved no faster from one report to the next stood; and none moved by the second, or stood beyond the
third."""

HEARD = np.dtype(
    [(name, np.float64) for name in ("arrival_s", "event_s", "x_m", "y_m", "yaw_rad", "due_s")]
    + [("floor", np.int64), ("stood", np.bool_), ("reports", np.int64), ("gaps_s", np.float64, (GAPS,))],
    align=True,
)
"""When the newest report of a robot arrived, and when it was true; where the robot was then; from when on it may be
silent, inf where it is; on which floor of the batches it was, and whether it had stood since the report before; how
many reports came; and the times between the last of them, the newest at `(reports - 2) % GAPS`."""

Heard = NDArray[Any]
"""Of `HEARD`, by slot."""

_NOBODY = np.zeros((), HEARD)
_NOBODY["due_s"] = np.inf
_HEARD = numba.from_dtype(HEARD)[::1]
_FLOATS, _INTS = (numba.types.Array(kind, 1, "C", readonly=True) for kind in (numba.float64, numba.int64))
_BOTH, _BOTH_INTS = numba.float64[:, ::1], numba.int64[:, ::1]


class Legs(NamedTuple):
    """How n robots moved from the report before to the newest; arrays are (n,) or (n, 2) for before and now."""

    rows: Ints
    """Of the batch."""
    before: Heard
    """What was known of each before."""
    gap_s: Floats
    """From the arrival of the report before; inf where there is none."""
    took_s: Floats
    x_m: Floats
    y_m: Floats
    yaw_rad: Floats
    floor: Ints
    """(n, 2)"""


@kernel(
    numba.types.Tuple((numba.int64[::1], _HEARD, *[numba.float64[::1]] * 2, *[_BOTH] * 3, _BOTH_INTS))(  # type: ignore[no-untyped-call]
        _HEARD, *[numba.int64[::1]], *[_FLOATS] * 2, *[_INTS] * 2, *[_FLOATS] * 3, _INTS
    )
)
def _hear(
    heard: Heard,
    slots: Ints,
    arrival_s: Floats,
    event_s: Floats,
    statuses: Ints,
    start: Ints,
    x_m: Floats,
    y_m: Floats,
    yaw_rad: Floats,
    floor: Ints,
) -> tuple[Ints, Heard, Floats, Floats, Floats, Floats, Floats, Ints]:
    """Take in what robots of `slots` (n,) report, where that is new; the columns of `Legs`."""
    rows, before, n = np.empty(len(slots), np.int64), np.empty(len(slots), HEARD), 0
    for row in range(len(slots)):
        if arrival_s[row] > heard[slots[row]].arrival_s:
            rows[n], before[n] = row, heard[slots[row]]
            n += 1
    gap_s, took_s = np.full(n, np.inf), np.full(n, np.inf)
    x, y, yaw, on = np.empty((n, 2)), np.empty((n, 2)), np.empty((n, 2)), np.empty((n, 2), np.int64)
    for leg in range(n):
        row, was = rows[leg], before[leg]
        one, knot = heard[slots[row]], start[row]
        one.arrival_s, one.event_s, one.due_s = arrival_s[row], event_s[row], arrival_s[row] + GRACE_S
        one.x_m, one.y_m, one.yaw_rad, one.floor = x_m[knot], y_m[knot], yaw_rad[knot], floor[knot]
        if was.reports:
            gap_s[leg], took_s[leg] = one.arrival_s - was.arrival_s, one.event_s - was.event_s
            one.gaps_s[(was.reports - 1) % GAPS] = gap_s[leg] / max(statuses[row], 1)
            most_m = min(max(STOOD_MPS * took_s[leg], STOOD_LEAST_M), STOOD_MOST_M)
            one.stood = one.floor == was.floor and np.hypot(one.x_m - was.x_m, one.y_m - was.y_m) <= most_m
        one.reports = was.reports + 1
        x[leg, 0], y[leg, 0], yaw[leg, 0], on[leg, 0] = was.x_m, was.y_m, was.yaw_rad, was.floor
        x[leg, 1], y[leg, 1], yaw[leg, 1], on[leg, 1] = one.x_m, one.y_m, one.yaw_rad, one.floor
    return rows[:n].copy(), before[:n].copy(), gap_s, took_s, x, y, yaw, on


class ReportIntervals:
    """By slot; another robot may have the slot of one that was forgotten."""

    def __init__(self) -> None:
        self.slots: dict[str, int] = {}
        self.names: list[str] = []
        """By slot; "" where it is free."""
        self.heard: Heard = np.zeros(0, HEARD)
        self._spare: list[int] = []

    def add_batch(self, batch: Batch) -> tuple[Legs, list[int]]:
        """The legs of the robots of a batch that have reported anew, and the rows of those that were not known."""
        slots = np.fromiter(map(self.slots.get, batch.robots, repeat(-1)), np.int64, len(batch))
        new = np.flatnonzero(slots < 0).tolist()
        for row in new:
            slots[row] = self._slot(batch.robots[row])
        told = batch.forecasts
        places = ready(told.x_m), ready(told.y_m), ready(told.yaw_rad), ready(told.floor, np.int64)
        counts = ready(batch.statuses, np.int64), ready(told.start, np.int64)
        legs = _hear(self.heard, slots, ready(batch.arrival_s), ready(batch.event_s), *counts, *places)
        return Legs(*legs), new

    def overdue(self, now_s: float) -> list[str]:
        """The robots that may be silent by now, and are not known to be."""
        return [self.names[slot] for slot in np.flatnonzero(self.heard["due_s"] <= now_s).tolist()]

    def set_due(self, uuid: str, at_s: float) -> None:
        """A robot can't be silent before then; inf for one that is, until it reports."""
        self.heard["due_s"][self.slots[uuid]] = at_s

    def forget(self, uuid: str) -> bool:
        """Whether the robot was known."""
        slot = self.slots.pop(uuid, None)
        if slot is None:
            return False
        self.heard[slot], self.names[slot] = _NOBODY, ""
        self._spare.append(slot)
        return True

    def heard_s(self, uuid: str) -> float:
        """When a robot was heard last."""
        return float(self.heard["arrival_s"][self.slots[uuid]])

    def moved(self, uuid: str) -> bool | None:
        """Whether a robot moved from its last report but one to the last; None where there is but one."""
        one = self.heard[self.slots[uuid]]
        return None if one["reports"] < 2 else not one["stood"]

    def grace_s(self, uuid: str) -> float:
        """How long a robot may say nothing before it is silent."""
        return grace_s(self.heard[self.slots[uuid]])

    def _slot(self, uuid: str) -> int:
        """The slot of a robot, a new one where it has none: a batch may hold a new robot twice."""
        if uuid in self.slots:
            return self.slots[uuid]
        if self._spare:
            slot = self._spare.pop()
            self.names[slot] = uuid
        else:
            slot = len(self.names)
            self.names.append(uuid)
            if slot == len(self.heard):
                self.heard = np.concatenate([self.heard, np.full(max(slot, 64), _NOBODY)])
        self.slots[uuid] = slot
        return slot


def grace_s(one: np.void) -> float:
    """How long a robot may say nothing before it is silent, by its record."""
    gaps = min(max(int(one["reports"]) - 1, 0), GAPS)
    return grace_after_s(one["gaps_s"][:gaps].tolist())


def grace_after_s(gaps_s: Sequence[float]) -> float:
    """The same by the times between its last reports."""
    return max(GRACE_S, GRACE_GAPS * median(gaps_s)) if len(gaps_s) >= FEWEST_GAPS else GRACE_UNKNOWN_S
