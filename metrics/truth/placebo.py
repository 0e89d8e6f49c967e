"""A placebo test of the interaction finder: how often it finds an interaction by chance.

For an interaction that was found, the test repeats the motion of the yielding robot among the other robots at their
positions of a minute before. Robots that have hardly moved since are left out. An interaction that the finder finds
there is a coincidence.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from deconflict.foresight.interactions.interaction_finder import Interaction, InteractionFinder
from deconflict.foresight.interactions.progress_kernels import AHEAD_S
from deconflict.foresight.interactions.recent_reports import InteractionReports
from ingest.batch import Bools, Floats, Ints

SHIFT_S = 60.0
OWN_S = 20.0
"""Length of the yielding robot's motion before the interaction was found."""
NEAR_M = 20.0
"""Robots that were further from the yielding robot than this are left out."""
MOVED_M = 3.0
"""Robots that moved at most this far in the minute are left out: they are in its way as before."""
FORECAST = 3
"""Samples of a forecast that are kept of other robots: the report, and two seconds after it."""
TURN_S = 0.5
"""Reports within this time are processed together, the newest of each robot."""
EVERY = 4
"""One interaction in this many is tested."""
NOBODY = InteractionReports(
    np.empty(0, np.int64),
    np.empty(0),
    np.empty((0, FORECAST, 4)),
    np.empty(0, np.bool_),
    np.empty((0, AHEAD_S)),
)


class Placebo:
    """Reports of the last minutes, and how many of the tested interactions were found again by chance."""

    def __init__(self) -> None:
        self._newest: list[InteractionReports] = []
        """Reports of the last `OWN_S`."""
        self._older: list[InteractionReports] = []
        """Earlier reports, with shorter forecasts."""
        self._first_s = np.inf
        self._offered = 0
        self._looked_at = self._any = 0
        self._same_looked_at = self._same = 0

    def add_reports(self, reports: InteractionReports) -> None:
        """Add the reports of a batch, and drop those that are too old to be needed."""
        now_s = float(reports.event_s.max())
        self._first_s = min(self._first_s, now_s)
        self._newest.append(reports)
        while self._newest and self._newest[0].event_s.max() < now_s - OWN_S - 2.0:
            old = self._newest.pop(0)
            self._older.append(old._replace(track=old.track[:, :FORECAST].copy()))
        while self._older and self._older[0].event_s.max() < now_s - SHIFT_S - OWN_S - 2.0:
            del self._older[0]

    def forget(self, slots: Sequence[int]) -> None:
        """Drop the reports of these slots. Other robots will use the slots."""
        for kept in (self._newest, self._older):
            kept[:] = [_rows(reports, ~np.isin(reports.slot, slots)) for reports in kept]
            kept[:] = [reports for reports in kept if len(reports.slot)]

    def check(self, interaction: Interaction, half_m: Floats, levels_m: Floats) -> None:
        """Test an interaction that was just found, with all others at their positions of a minute before."""
        if self._last_s(interaction.robot) - self._first_s < SHIFT_S + OWN_S:
            return
        self._offered += 1
        if (self._offered - 1) % EVERY:
            return
        now = _joined(self._newest)
        own = _rows(now, now.slot == interaction.robot)
        until_s = float(own.event_s[-1])
        others = _elsewhere(self._a_minute_before(until_s), now)
        found = found_again(interaction, own, _near(others, own.track[-1, 0]), half_m, levels_m)
        self._looked_at += 1
        self._any += found >= 0
        if interaction.other in others.slot:
            self._same_looked_at += 1
            self._same += found == interaction.other

    def figures(self) -> dict[str, Any]:
        """Figures of the test.

        How many interactions were tested, and the share of them that is found again with any robot. Then the same for
        interactions whose other robot was elsewhere a minute before: how many, and the share found with that robot.
        """
        return {
            "looked_at": self._looked_at,
            "any_robot": self._any / self._looked_at if self._looked_at else None,
            "same_looked_at": self._same_looked_at,
            "same_robot": self._same / self._same_looked_at if self._same_looked_at else None,
        }

    def _last_s(self, slot: int) -> float:
        """The time of the last report of a robot that has reported lately."""
        of_robot = (reports.event_s[reports.slot == slot] for reports in reversed(self._newest))
        return next(float(event_s[-1]) for event_s in of_robot if len(event_s))

    def _a_minute_before(self, until_s: float) -> InteractionReports:
        """The reports of a minute before, with times shifted by a minute."""
        begin_s, end_s = until_s - SHIFT_S - OWN_S, until_s - SHIFT_S
        then = _joined(
            [reports for reports in self._older if reports.event_s.max() >= begin_s and reports.event_s.min() <= end_s]
        )
        then = _rows(then, (then.event_s >= begin_s) & (then.event_s <= end_s))
        return then._replace(event_s=then.event_s + SHIFT_S, explained=np.ones(len(then.slot), np.bool_))


def found_again(
    interaction: Interaction, own: InteractionReports, others: InteractionReports, half_m: Floats, levels_m: Floats
) -> int:
    """Run the finder on the motion `own` of the yielding robot of `interaction` among `others`.

    Returns the slot of the robot to which it yields, or -1 if it yields to none. `half_m` and `levels_m` are (2,
    slots).
    """
    slots = np.unique(np.concatenate([own.slot, others.slot]))
    finder, vendor = InteractionFinder(), np.arange(len(slots))
    finder.grow(len(slots))
    of_slots = np.ascontiguousarray(half_m[:, slots]), levels_m[:, slots], vendor
    for reports in _turns(own, others):
        for found in finder.receive(reports._replace(slot=np.searchsorted(slots, reports.slot)), *of_slots):
            if slots[found.robot] == interaction.robot and abs(found.onset_s - interaction.onset_s) < TURN_S:
                return int(slots[found.other])
    return -1


def _elsewhere(then: InteractionReports, now: InteractionReports) -> InteractionReports:
    """The reports of `then`, without robots whose last position in it is within `MOVED_M` of that in `now`."""
    (slots_then, rows_then), (slots_now, rows_now) = _last_rows(then), _last_rows(now)
    slots, of_then, of_now = np.intersect1d(slots_then, slots_now, assume_unique=True, return_indices=True)
    moves_m = then.track[rows_then[of_then], 0, :2] - now.track[rows_now[of_now], 0, :2]
    return _rows(then, ~np.isin(then.slot, slots[np.hypot(*moves_m.T) <= MOVED_M]))


def _last_rows(reports: InteractionReports) -> tuple[Ints, Ints]:
    """The slots in the reports, and the last row of each."""
    slots, from_end = np.unique(reports.slot[::-1], return_index=True)
    return slots, len(reports.slot) - 1 - from_end


def _near(reports: InteractionReports, pose: Floats) -> InteractionReports:
    """The reports near the pose (4,) of a robot."""
    return _rows(reports, np.hypot(*(reports.track[:, 0, :2] - pose[:2]).T) < NEAR_M)


def _turns(own: InteractionReports, others: InteractionReports) -> list[InteractionReports]:
    """All reports in the order of time, in parts of `TURN_S` with only the newest of each robot."""
    every = _joined([_lengthened(reports) for reports in (own, others)])
    turn = np.floor(every.event_s / TURN_S).astype(np.int64)
    order = np.lexsort((every.event_s, every.slot, turn))
    turn, slot = turn[order], every.slot[order]
    is_newest = np.append((turn[1:] != turn[:-1]) | (slot[1:] != slot[:-1]), [True] * min(len(turn), 1))
    rows, turn = order[is_newest], turn[is_newest]
    return [_rows(every, part) for part in np.split(rows, np.flatnonzero(np.diff(turn)) + 1) if len(part)]


def _joined(parts: Sequence[InteractionReports]) -> InteractionReports:
    return InteractionReports._make(map(np.concatenate, zip(*parts, strict=True))) if parts else NOBODY


def _rows(reports: InteractionReports, rows: Ints | Bools) -> InteractionReports:
    return InteractionReports._make(column[rows] for column in reports)


def _lengthened(reports: InteractionReports) -> InteractionReports:
    """The reports with forecasts as long as the finder needs. The robot stands after the end of its forecast."""
    missing = AHEAD_S + 1 - reports.track.shape[1]
    if missing <= 0:
        return reports
    last = np.repeat(reports.track[:, -1:], missing, axis=1)
    return reports._replace(track=np.concatenate([reports.track, last], axis=1))
