"""Silent robots: when each was gone, and encounters with those that were still there.

A silent robot is gone from the end of the grace period after its last report
(`deconflict/foresight/presence/report_intervals.py`): for good, or until it reports from another place. A robot that
reports from the same place again stood there during the silence. An encounter with it is another robot that comes
within the clearance of that place.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import hypot, inf
from typing import Any

import numpy as np

from deconflict.foresight.presence.believed_places import Approach, BelievedPlaces, place_of
from deconflict.foresight.presence.report_intervals import GRACE_S, Legs, ReportIntervals, grace_s
from deconflict.foresight.presence.returned_robots import was_there
from deconflict.sweep.geometry.pose import pose_at
from deconflict.sweep.robot_slots import RobotSlots
from ingest.batch import Batch, Forecasts, Pair

STOOD_M = 0.3
"""A robot that reports again within this distance of its last pose stood there."""
LOOK_S = 1.0
"""Interval of the check for robots that have become silent."""

TimeRange = tuple[float, float]


@dataclass(slots=True, eq=False)
class SilentRobot:
    """One silent robot, and the robots that have come near since."""

    since_s: float
    """End of its grace period."""
    approaches: dict[float, list[Approach]] = field(default_factory=dict)
    """By clearance: the first approach of each other robot."""


class Absences:
    """Finds silences from batches in the order of time. Keeps each robot's newest report, its silences, and encounters
    with silent robots."""

    def __init__(self, clearances_m: Iterable[float]) -> None:
        self._clearances_m = tuple(clearances_m)
        self._intervals, self._places = ReportIntervals(RobotSlots()), BelievedPlaces()
        self._newest: dict[str, tuple[Forecasts, int, Sequence[str]]] = {}
        """By robot: the forecasts of its newest batch, its row in them, and the batch's floors. Of a silent robot only
        its own forecast is kept."""
        self._silent: dict[str, SilentRobot] = {}
        self._gone: dict[str, list[TimeRange]] = {}
        self._meetings: dict[float, list[Approach]] = {clearance_m: [] for clearance_m in self._clearances_m}
        self._there = 0
        self._looked_s = -inf

    def add_batch(self, batch: Batch) -> None:
        """Add the reports of a batch."""
        legs, _ = self._intervals.add_batch(batch)
        for leg in np.flatnonzero(legs.gap_s > GRACE_S).tolist():
            self._end_silence(batch, legs, leg)
        for row in legs.rows.tolist():
            self._newest[batch.robots[row]] = batch.forecasts, row, batch.floors
        for clearance_m in self._clearances_m:
            for approach in self._places.approached(batch, legs, clearance_m):
                met = self._silent[approach.silent].approaches.setdefault(clearance_m, [])
                if all(approach.other != before.other for before in met):
                    met.append(approach)
        if batch.now_s - self._looked_s >= LOOK_S:
            self._looked_s = batch.now_s
            self._add_silent(batch.now_s)

    def finish(self) -> None:
        """End of the log: every robot is gone for good after its last report and grace period."""
        for uuid in self._intervals.slots.by_uuid:
            self._gone.setdefault(uuid, []).append((self._intervals.heard_s(uuid) + self._intervals.grace_s(uuid), inf))

    def is_gone(self, uuid: str, at_s: float) -> bool:
        """Whether a robot was gone at `at_s`. Call it after `finish`."""
        return any(begin_s <= at_s < end_s for begin_s, end_s in self._gone.get(uuid, ()))

    def figures(
        self, clearance_m: float, alerts: Sequence[tuple[Pair, float, float]], warned_before_s: float
    ) -> dict[str, Any]:
        """How many alerts (pair, raised, cleared) concern a robot that was gone; and how many encounters with silent
        robots that were there had an alert in the last `warned_before_s` before."""
        gone = sum(any(self.is_gone(uuid, raised_s) for uuid in pair) for pair, raised_s, _ in alerts)
        of_pair: dict[Pair, list[TimeRange]] = {}
        for pair, *span in alerts:
            of_pair.setdefault(pair, []).append((span[0], span[1]))
        met = self._meetings[clearance_m]
        warned = sum(_has_alert(of_pair, approach, warned_before_s) for approach in met)
        return {
            "raised": len(alerts),
            "about_gone": gone,
            "about_gone_share": gone / len(alerts) if alerts else None,
            "silent_there": self._there,
            "meetings": len(met),
            "told_of": warned,
            "told_of_share": warned / len(met) if met else None,
        }

    def _end_silence(self, batch: Batch, legs: Legs, leg: int) -> None:
        """A robot reports again after a silence."""
        row = int(legs.rows[leg])
        uuid, gap_s, allowed_s = batch.robots[row], float(legs.gap_s[leg]), grace_s(legs.before[leg])
        self._places.discard(uuid)
        silent = self._silent.pop(uuid, None)
        if not allowed_s < gap_s < inf:
            return
        forecasts, row_then, floors = self._newest[uuid]
        before, back_s = forecasts.single(row_then), float(batch.arrival_s[row])
        knot, now = int(batch.forecasts.start[row]), batch.forecasts
        if not was_there(before, floors, batch, row):
            self._gone.setdefault(uuid, []).append((back_s - gap_s + allowed_s, back_s))
            return
        self._there += 1
        moved_m = hypot(float(now.x_m[knot] - before.x_m[0]), float(now.y_m[knot] - before.y_m[0]))
        if silent and moved_m <= STOOD_M:
            for clearance_m, met in silent.approaches.items():
                self._meetings[clearance_m] += met

    def _add_silent(self, now_s: float) -> None:
        """Add the places of robots that have become silent."""
        for uuid in self._intervals.overdue(now_s):
            if now_s - self._intervals.heard_s(uuid) > self._intervals.grace_s(uuid):
                self._intervals.set_due(uuid, inf)
                forecasts, row, floors = self._newest[uuid]
                before = forecasts.take([row])
                self._newest[uuid] = before, 0, floors
                pose = pose_at(before, float(before.t_s[0]))
                self._silent[uuid] = SilentRobot(now_s)
                if pose.floor >= 0:
                    self._places.set(uuid, place_of(before, pose))


def _has_alert(alerts: Mapping[Pair, Sequence[TimeRange]], approach: Approach, warned_before_s: float) -> bool:
    first, second = sorted((approach.silent, approach.other))
    spans = alerts.get((first, second), ())
    return any(
        raised_s < approach.at_s and cleared_s >= approach.at_s - warned_before_s for raised_s, cleared_s in spans
    )
