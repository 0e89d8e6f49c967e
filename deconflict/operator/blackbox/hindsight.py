"""What two robots truly did, from their own reports, and the least delay of one that would have kept them apart."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import hypot
from typing import NamedTuple

import numpy as np

from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import Site
from deconflict.sweep.one_shot import sweep
from ingest.batch import Forecasts
from ingest.fleet.robot import Robot
from ingest.measures.measures import Measures
from ingest.recording.log_reader import Received

JOINED_S = 2.1
"""Reports further apart say nothing of what lay between them, unless the robot had not moved."""
STOOD_M = 0.1
LEVEL_M = 0.1
"""A robot whose height changes by no more keeps it."""
BRIEF_S = 1e-3
"""So long before it is somewhere else, or after it was last seen, a robot is still there."""
STEP_S = 0.1
"""Delays are tried in steps of this."""
LONGEST_S = 20.0
"""The longest that is tried; the pair must keep apart for as long before and after."""


class Report(NamedTuple):
    """Where one robot was, by one of its reports."""

    t_s: float
    x_m: float
    y_m: float
    yaw_rad: float
    floor: int
    bottom_m: float
    """Heights that it reached from and to."""
    top_m: float


@dataclass(slots=True, eq=False)
class Track:
    """One robot's reports, in the order of time."""

    name: str = ""
    vendor: str = ""
    reports: list[Report] = field(default_factory=list)
    length_m: float = 0.0
    width_m: float = 0.0

    def take(self, robot: Robot) -> None:
        """The robot as it is known now, if that is newer."""
        one = robot.forecast
        if one is None or (self.reports and one.knots[0][0] <= self.reports[-1].t_s):
            return
        self.name, self.vendor = robot.name, robot.vendor
        t_s, x_m, y_m, yaw_rad = one.knots[0]
        new = Report(t_s, x_m, y_m, yaw_rad, one.floors[0], one.bottom_m, one.top_m)
        if self.reports:
            last = self.reports[-1]
            if new.t_s - last.t_s > JOINED_S and hypot(new.x_m - last.x_m, new.y_m - last.y_m) > STOOD_M:
                self.reports.append(last._replace(t_s=last.t_s + BRIEF_S, floor=-1))
        self.reports.append(new)
        self.length_m, self.width_m = one.length_m, one.width_m

    def way(self) -> Forecasts:
        """The reports as forecasts, joined linearly: one for each stretch of time in which the robot kept its height.

        It is nowhere before and after each, and once its reports have ended for `JOINED_S`.
        """
        stretches, last = self._stretches(), self.reports[-1]
        knots = [[*now, *_until(now[-1], after[0])] for now, after in pairwise(stretches)]
        knots.append([*stretches[-1], last._replace(t_s=last.t_s + JOINED_S, floor=-1)])
        t_s, x_m, y_m, yaw_rad, floor, _, _ = np.array([knot for some in knots for knot in some]).T
        n = len(stretches)
        return Forecasts(
            start=np.concatenate([[0], np.cumsum(list(map(len, knots)))]),
            t_s=t_s,
            x_m=x_m,
            y_m=y_m,
            yaw_rad=yaw_rad,
            floor=floor.astype(np.int64),
            length_m=np.full(n, self.length_m),
            width_m=np.full(n, self.width_m),
            bottom_m=np.array([min(one.bottom_m for one in some) for some in stretches]),
            top_m=np.array([max(one.top_m for one in some) for some in stretches]),
        )

    def _stretches(self) -> list[list[Report]]:
        """The reports in runs of one height each."""
        stretches: list[list[Report]] = []
        for one in self.reports:
            if stretches and _is_level(stretches[-1][0], one):
                stretches[-1].append(one)
            else:
                stretches.append([one])
        return stretches


def _until(one: Report, after: Report) -> list[Report]:
    """What ends a stretch, of which `one` is the last report, as the robot comes to another height."""
    gone = after._replace(floor=-1)
    if after.floor != one.floor:
        return [gone]
    brief_s = min(BRIEF_S, (after.t_s - one.t_s) / 2)
    return [after._replace(t_s=after.t_s - brief_s), gone]


def _is_level(one: Report, other: Report) -> bool:
    """Whether both are at one height."""
    heights_m = zip(one[-2:], other[-2:], strict=True)
    return all(before_m == after_m or abs(before_m - after_m) <= LEVEL_M for before_m, after_m in heights_m)


@dataclass(frozen=True, slots=True)
class Met:
    """How near two came."""

    began_s: float
    """When they first were within the clearance."""
    separation_m: float
    """The least there was; 0 where they overlapped."""
    at_s: float


def tracks(site: Site, events: Iterable[Received], robots: Iterable[str]) -> tuple[dict[str, Track], tuple[str, ...]]:
    """By robot, as their messages tell, and the floors that the tracks count through. Robots unheard of have none."""
    fleet, found = fleet_of(site, Measures()), {uuid: Track() for uuid in robots}
    now_s = 0.0
    for event in events:
        now_s = event.arrival_s
        if event.refused is None and fleet.receive(event.raw, event.arrival_s, event.connection) is None:
            for uuid, track in found.items():
                robot = fleet.robots.get(uuid)
                if robot:
                    track.take(robot)
    return {uuid: one for uuid, one in found.items() if one.reports}, fleet.snapshot(now_s).floors


def met(a: Forecasts, b: Forecasts, clearance_m: float, begin_s: float, end_s: float) -> Met | None:
    """How near two ways came between two times; None where that was not within the clearance."""
    found = sweep(Forecasts.joined([a, b]), now_s=begin_s, horizon_s=end_s - begin_s, clearance_m=clearance_m)
    rows = np.flatnonzero((found.pairs[:, 0] < len(a)) & (found.pairs[:, 1] >= len(a)))
    if not len(rows):
        return None
    nearest = rows[np.lexsort((found.separation_at_s[rows], found.separation_m[rows]))[0]]
    began_s = float(found.contact_s[rows].min())
    return Met(began_s, float(found.separation_m[nearest]), float(found.separation_at_s[nearest]))


def avoiding_s(a: Forecasts, b: Forecasts, clearance_m: float, at_s: float) -> tuple[float | None, float | None]:
    """How much later each of the two, the other being as it was, need have been; None where no delay would do.

    Every delay is swept at once, each on a floor of its own.
    """
    delays_s = np.arange(STEP_S, LONGEST_S + STEP_S / 2, STEP_S).round(3).tolist()
    cases = [(_later(a, delay_s), b) for delay_s in delays_s] + [(a, _later(b, delay_s)) for delay_s in delays_s]
    floors = 1 + max(int(a.floor.max()), int(b.floor.max()))
    ways = [_on_floor(one, number * floors) for number, case in enumerate(cases) for one in case]
    found = sweep(Forecasts.joined(ways), now_s=at_s - LONGEST_S, horizon_s=2 * LONGEST_S, clearance_m=clearance_m)
    way_of = np.repeat(np.arange(len(ways)), [len(one) for one in ways])
    meeting = {int(one) // 2 for one, other in way_of[found.pairs].tolist() if one != other}
    return _least(delays_s, meeting, 0), _least(delays_s, meeting, len(delays_s))


def row_at(way: Forecasts, at_s: float) -> int:
    """The row of a way on which its robot is at a time; the first one before it."""
    return max(int(np.searchsorted(way.t_s[way.start[:-1]], at_s, "right")) - 1, 0)


def _least(delays_s: Sequence[float], meeting: set[int], first_case: int) -> float | None:
    return next((delay_s for case, delay_s in enumerate(delays_s, first_case) if case not in meeting), None)


def _later(one: Forecasts, delay_s: float) -> Forecasts:
    return replace(one, t_s=one.t_s + delay_s)


def _on_floor(one: Forecasts, base: int) -> Forecasts:
    return replace(one, floor=np.where(one.floor < 0, -1, one.floor + base))
