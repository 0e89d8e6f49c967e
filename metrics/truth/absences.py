"""Robots that fell silent: when each was gone, and who met those that were still there.

A robot is gone from the grace after it was heard last (`deconflict/foresight/presence/report_intervals.py`): for good,
or until it comes back elsewhere. One that comes back where it was heard last stood there all the while; a meeting with
it is another robot that comes within the clearance of where it stood.
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
from ingest.batch import Batch, Forecasts, Pair

STOOD_M = 0.3
"""A robot that comes back within this of where it was heard last stood there."""
LOOK_S = 1.0
"""How often it is looked whether robots have fallen silent."""

TimeRange = tuple[float, float]


@dataclass(slots=True, eq=False)
class SilentRobot:
    """One robot that is silent, and those that have come near since."""

    since_s: float
    """When its grace was over."""
    approaches: dict[float, list[Approach]] = field(default_factory=dict)
    """By clearance; of each robot the first."""


class Absences:
    """As reports come in. Memory holds each robot's newest report, its silences, and meetings with the silent."""

    def __init__(self, clearances_m: Iterable[float]) -> None:
        self._clearances_m = tuple(clearances_m)
        self._intervals, self._places = ReportIntervals(), BelievedPlaces()
        self._told: dict[str, tuple[Forecasts, int, Sequence[str]]] = {}
        """The newest forecast of each robot: its row of a batch, and the floors of that."""
        self._silent: dict[str, SilentRobot] = {}
        self._gone: dict[str, list[TimeRange]] = {}
        self._meetings: dict[float, list[Approach]] = {clearance_m: [] for clearance_m in self._clearances_m}
        self._there = 0
        self._looked_s = -inf

    def add_batch(self, batch: Batch) -> None:
        """Take in the robots of a batch."""
        legs, _ = self._intervals.add_batch(batch)
        for leg in np.flatnonzero(legs.gap_s > GRACE_S).tolist():
            self._back(batch, legs, leg)
        for row in legs.rows.tolist():
            self._told[batch.robots[row]] = batch.forecasts, row, batch.floors
        for clearance_m in self._clearances_m:
            for one in self._places.approached(batch, legs, clearance_m):
                met = self._silent[one.silent].approaches.setdefault(clearance_m, [])
                if all(one.other != before.other for before in met):
                    met.append(one)
        if batch.now_s - self._looked_s >= LOOK_S:
            self._looked_s = batch.now_s
            self._look(batch.now_s)

    def finish(self) -> None:
        """Nothing more comes: who is silent is gone for good, as is who falls silent by then."""
        for uuid in self._intervals.slots:
            self._gone.setdefault(uuid, []).append((self._intervals.heard_s(uuid) + self._intervals.grace_s(uuid), inf))

    def is_gone(self, uuid: str, at_s: float) -> bool:
        """Whether a robot was gone then, once all has come."""
        return any(begin_s <= at_s < end_s for begin_s, end_s in self._gone.get(uuid, ()))

    def figures(self, clearance_m: float, alerts: Sequence[tuple[Pair, float, float]], told_s: float) -> dict[str, Any]:
        """Of alerts, pairs with when each was raised and cleared: how many concern somebody gone. And of meetings with
        silent robots that were there, how many were told of in the last `told_s` before."""
        gone = sum(any(self.is_gone(uuid, raised_s) for uuid in pair) for pair, raised_s, _ in alerts)
        of_pair: dict[Pair, list[TimeRange]] = {}
        for pair, *span in alerts:
            of_pair.setdefault(pair, []).append((span[0], span[1]))
        met = self._meetings[clearance_m]
        told = sum(_is_told(of_pair, one, told_s) for one in met)
        return {
            "raised": len(alerts),
            "about_gone": gone,
            "about_gone_share": gone / len(alerts) if alerts else None,
            "silent_there": self._there,
            "meetings": len(met),
            "told_of": told,
            "told_of_share": told / len(met) if met else None,
        }

    def _back(self, batch: Batch, legs: Legs, leg: int) -> None:
        """A robot reports that had not for some time."""
        row = int(legs.rows[leg])
        uuid, gap_s, allowed_s = batch.robots[row], float(legs.gap_s[leg]), grace_s(legs.before[leg])
        self._places.discard(uuid)
        silent = self._silent.pop(uuid, None)
        if not allowed_s < gap_s < inf:
            return
        told, of, floors = self._told[uuid]
        before, back_s = told.single(of), float(batch.arrival_s[row])
        knot, now = int(batch.forecasts.start[row]), batch.forecasts
        if not was_there(before, floors, batch, row):
            self._gone.setdefault(uuid, []).append((back_s - gap_s + allowed_s, back_s))
            return
        self._there += 1
        moved_m = hypot(float(now.x_m[knot] - before.x_m[0]), float(now.y_m[knot] - before.y_m[0]))
        if silent and moved_m <= STOOD_M:
            for clearance_m, met in silent.approaches.items():
                self._meetings[clearance_m] += met

    def _look(self, now_s: float) -> None:
        """Have places for robots that have fallen silent."""
        heard = self._intervals.heard
        late = np.flatnonzero((now_s - heard["arrival_s"] > GRACE_S) & (heard["reports"] > 0))
        for slot in late.tolist():
            uuid = self._intervals.names[slot]
            if uuid not in self._silent and now_s - heard["arrival_s"][slot] > grace_s(heard[slot]):
                told, row, _ = self._told[uuid]
                before = told.single(row)
                pose = pose_at(before, float(before.t_s[0]))
                self._silent[uuid] = SilentRobot(now_s)
                if pose.floor >= 0:
                    self._places.set(uuid, place_of(before, pose))


def _is_told(alerts: Mapping[Pair, Sequence[TimeRange]], met: Approach, told_s: float) -> bool:
    first, second = sorted((met.silent, met.other))
    spans = alerts.get((first, second), ())
    return any(raised_s < met.at_s and cleared_s >= met.at_s - told_s for raised_s, cleared_s in spans)
