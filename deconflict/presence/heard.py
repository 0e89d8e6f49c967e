"""When each robot was heard, how often it usually reports, and how it moved between its last two reports."""

from collections.abc import Sequence
from itertools import repeat
from statistics import median
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from deconflict.motion import Bools
from ingest.seam import Batch, Floats, Ints

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
    [(name, np.float64) for name in ("arrival_s", "event_s", "x_m", "y_m", "yaw_rad")]
    + [("floor", np.int64), ("stood", np.bool_), ("reports", np.int64), ("gaps_s", np.float64, (GAPS,))],
    align=True,
)
"""When the newest report of a robot arrived, and when it was true; where the robot was then, and on which floor of the
batches; whether it had stood since the report before; how many reports came; and the times between the last of them,
the newest at `(reports - 2) % GAPS`."""

Heard = NDArray[Any]
"""Of `HEARD`, by slot."""


class Legs(NamedTuple):
    """How robots moved from the report before to the newest; arrays are (n,) or (n, 2) for before and now."""

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


class Hearing:
    """By slot; another robot may have the slot of one that was forgotten."""

    def __init__(self) -> None:
        self.slots: dict[str, int] = {}
        self.names: list[str] = []
        """By slot; "" where it is free."""
        self.heard: Heard = np.zeros(0, HEARD)
        self._spare: list[int] = []

    def take(self, batch: Batch) -> tuple[Legs, list[int]]:
        """The legs of the robots of a batch that have reported anew, and the rows of those that were not known."""
        slots = np.fromiter(map(self.slots.get, batch.robots, repeat(-1)), np.int64, len(batch))
        new = np.flatnonzero(slots < 0).tolist()
        for row in new:
            slots[row] = self._slot(batch.robots[row])
        rows = np.flatnonzero(batch.arrival_s > self.heard["arrival_s"][slots])
        slots = slots[rows]
        before = self.heard[slots]
        now = self._now(batch, rows, before)
        self.heard[slots] = now
        poses = [np.stack([before[name], now[name]], axis=1) for name in ("x_m", "y_m", "yaw_rad", "floor")]
        is_known = before["reports"] > 0
        since_s = (np.where(is_known, now[name] - before[name], np.inf) for name in ("arrival_s", "event_s"))
        return Legs(rows, before, *since_s, *poses), new

    def _now(self, batch: Batch, rows: Ints, before: Heard) -> Heard:
        """(n,) what is known of robots after the reports of `rows` (n,)."""
        now, told, knots = before.copy(), batch.forecasts, batch.forecasts.start[rows]
        now["arrival_s"], now["event_s"] = batch.arrival_s[rows], batch.event_s[rows]
        now["x_m"], now["y_m"], now["yaw_rad"] = told.x_m[knots], told.y_m[knots], told.yaw_rad[knots]
        now["floor"] = told.floor[knots]
        known = np.flatnonzero(before["reports"] > 0)
        statuses = np.maximum(batch.statuses[rows], 1)
        gap_s = (now["arrival_s"] - before["arrival_s"]) / statuses
        now["gaps_s"][known, (before["reports"][known] - 1) % GAPS] = gap_s[known]
        now["stood"] = _stood(before, now) & (before["reports"] > 0)
        now["reports"] += 1
        return now

    def forget(self, uuid: str) -> bool:
        """Whether the robot was known."""
        slot = self.slots.pop(uuid, None)
        if slot is None:
            return False
        self.heard[slot], self.names[slot] = np.zeros((), HEARD), ""
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
        if self._spare:
            slot = self._spare.pop()
            self.names[slot] = uuid
        else:
            slot = len(self.names)
            self.names.append(uuid)
            if slot == len(self.heard):
                self.heard = np.concatenate([self.heard, np.zeros(max(slot, 64), HEARD)])
        self.slots[uuid] = slot
        return slot


def grace_s(one: np.void) -> float:
    """How long a robot may say nothing before it is silent, by its record."""
    return grace_after_s(one["gaps_s"][: max(int(one["reports"]) - 1, 0)].tolist())


def grace_after_s(gaps_s: Sequence[float]) -> float:
    """The same by the times between its last reports."""
    return max(GRACE_S, GRACE_GAPS * median(gaps_s)) if len(gaps_s) >= FEWEST_GAPS else GRACE_UNKNOWN_S


def _stood(before: Heard, now: Heard) -> Bools:
    """Whether robots stood from one report to the next."""
    away_m = np.hypot(now["x_m"] - before["x_m"], now["y_m"] - before["y_m"])
    most_m = np.clip(STOOD_MPS * (now["event_s"] - before["event_s"]), STOOD_LEAST_M, STOOD_MOST_M)
    stood: Bools = (now["floor"] == before["floor"]) & (away_m <= most_m)
    return stood
