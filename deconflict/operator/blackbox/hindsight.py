"""What two robots did by their own reports, and the least delay of one that would have kept them apart."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import hypot
from typing import NamedTuple

import numpy as np

from deconflict.foresight.motion_assumptions import JOINED_S
from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import Site
from deconflict.sweep.sweep_once import sweep
from ingest.batch import Forecasts
from ingest.fleet.robot import Robot
from ingest.measures.measures import Measures
from ingest.recording.log_reader import Received
from ingest.shapes import Shape, shapes_of

STOOD_M = 0.1
"""A robot that moved no further between two reports stood still."""
LEVEL_M = 0.1
"""A robot whose height changes by no more keeps its height."""
BRIEF_S = 1e-3
"""A robot stays in its place until this long before it is reported elsewhere, and this long after its last report."""
STEP_S = 0.1
"""Delays are tried in steps of this."""
LONGEST_S = 20.0
"""The longest delay that is tried. The pair must keep apart for as long before and after."""


class ReportedPose(NamedTuple):
    """The pose in one report of a robot."""

    t_s: float
    """Time of the pose, seconds since the epoch."""
    x_m: float
    """Centre of the envelope in the floor's frame."""
    y_m: float
    yaw_rad: float
    """Heading, anticlockwise from x."""
    floor: int
    """-1 if the robot is on no floor."""
    bottom_m: float
    """Height of the bottom of its envelope."""
    top_m: float
    """Height of the top of its envelope."""


@dataclass(slots=True, eq=False)
class RecordedTrack:
    """One robot's reports, ordered by time."""

    name: str = ""
    vendor: str = ""
    reports: list[ReportedPose] = field(default_factory=list)
    length_m: float = 0.0
    """Of the newest envelope, along the heading."""
    width_m: float = 0.0
    """Of the newest envelope, across the heading."""
    shape: Shape | None = None
    """The newest one, with the headings of trailers at the first report; None for a rectangle."""

    def add_pose(self, robot: Robot) -> None:
        """Add the robot's present pose, if it is newer than the last."""
        forecast = robot.forecast
        if forecast is None or (self.reports and forecast.knots[0][0] <= self.reports[-1].t_s):
            return
        self.name, self.vendor = robot.name, robot.vendor
        t_s, x_m, y_m, yaw_rad = forecast.knots[0]
        new = ReportedPose(t_s, x_m, y_m, yaw_rad, forecast.floors[0], forecast.bottom_m, forecast.top_m)
        if self.reports:
            last = self.reports[-1]
            if new.t_s - last.t_s > JOINED_S and hypot(new.x_m - last.x_m, new.y_m - last.y_m) > STOOD_M:
                self.reports.append(last._replace(t_s=last.t_s + BRIEF_S, floor=-1))
        self.reports.append(new)
        self.length_m, self.width_m = forecast.length_m, forecast.width_m
        self.shape = _with_first_headings(forecast.shape, self.shape)

    def forecasts(self) -> Forecasts:
        """The reports as forecasts, joined linearly: one for each stretch of time in which the robot kept its height.

        The robot is on no floor before and after each stretch, and from `JOINED_S` after its last report.
        """
        stretches, last = self._stretches(), self.reports[-1]
        knots = [[*stretch, *_stretch_end(stretch[-1], after[0])] for stretch, after in pairwise(stretches)]
        knots.append([*stretches[-1], last._replace(t_s=last.t_s + JOINED_S, floor=-1)])
        t_s, x_m, y_m, yaw_rad, floor, _, _ = np.array([knot for stretch in knots for knot in stretch]).T
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
            bottom_m=np.array([min(report.bottom_m for report in stretch) for stretch in stretches]),
            top_m=np.array([max(report.top_m for report in stretch) for stretch in stretches]),
            shapes=shapes_of([self.shape] * n),
        )

    def _stretches(self) -> list[list[ReportedPose]]:
        """The reports in runs of one height each."""
        stretches: list[list[ReportedPose]] = []
        for report in self.reports:
            if stretches and _is_same_height(stretches[-1][0], report):
                stretches[-1].append(report)
            else:
                stretches.append([report])
        return stretches


def _with_first_headings(shape: Shape | None, before: Shape | None) -> Shape | None:
    if shape and before and len(shape.trailers) == len(before.trailers):
        return shape._replace(trailers=before.trailers)
    return shape


def _stretch_end(last: ReportedPose, after: ReportedPose) -> list[ReportedPose]:
    """The knots that end a stretch: `last` is its last report, `after` the first one at another height."""
    gone = after._replace(floor=-1)
    if after.floor != last.floor:
        return [gone]
    brief_s = min(BRIEF_S, (after.t_s - last.t_s) / 2)
    return [after._replace(t_s=after.t_s - brief_s), gone]


def _is_same_height(before: ReportedPose, after: ReportedPose) -> bool:
    heights_m = zip(before[-2:], after[-2:], strict=True)
    return all(before_m == after_m or abs(before_m - after_m) <= LEVEL_M for before_m, after_m in heights_m)


@dataclass(frozen=True, slots=True)
class NearestApproach:
    """How near two robots came."""

    began_s: float
    """When they first were within the clearance."""
    separation_m: float
    """The smallest separation; 0 if their envelopes overlapped."""
    at_s: float
    """When the separation was smallest."""


def recorded_tracks(
    site: Site, events: Iterable[Received], robots: Iterable[str]
) -> tuple[dict[str, RecordedTrack], tuple[str, ...]]:
    """The track of each robot that has reported, and the floors, by the numbers that the tracks use."""
    fleet, found = fleet_of(site, Measures()), {uuid: RecordedTrack() for uuid in robots}
    now_s = 0.0
    for event in events:
        now_s = event.arrival_s
        if event.refused is None and fleet.receive_recorded(event) is None:
            for uuid, track in found.items():
                robot = fleet.robots.get(uuid)
                if robot:
                    track.add_pose(robot)
    return {uuid: track for uuid, track in found.items() if track.reports}, fleet.snapshot(now_s).floors


def nearest_approach(
    a: Forecasts, b: Forecasts, clearance_m: float, begin_s: float, end_s: float
) -> NearestApproach | None:
    """How near two robots came between two times; None if they kept the clearance."""
    found = sweep(Forecasts.joined([a, b]), now_s=begin_s, horizon_s=end_s - begin_s, clearance_m=clearance_m)
    rows = np.flatnonzero((found.pairs[:, 0] < len(a)) & (found.pairs[:, 1] >= len(a)))
    if not len(rows):
        return None
    nearest = rows[np.lexsort((found.separation_at_s[rows], found.separation_m[rows]))[0]]
    began_s = float(found.contact_s[rows].min())
    return NearestApproach(began_s, float(found.separation_m[nearest]), float(found.separation_at_s[nearest]))


def avoiding_delays_s(a: Forecasts, b: Forecasts, clearance_m: float, at_s: float) -> tuple[float | None, float | None]:
    """The least delay of each robot alone that would have kept the clearance; None if no delay up to `LONGEST_S` does.

    One sweep tries all delays at once, each on a floor of its own.
    """
    delays_s = np.arange(STEP_S, LONGEST_S + STEP_S / 2, STEP_S).round(3).tolist()
    cases = [(_later(a, delay_s), b) for delay_s in delays_s] + [(a, _later(b, delay_s)) for delay_s in delays_s]
    floors = 1 + max(int(a.floor.max()), int(b.floor.max()))
    tracks = [_on_floor(track, number * floors) for number, case in enumerate(cases) for track in case]
    found = sweep(Forecasts.joined(tracks), now_s=at_s - LONGEST_S, horizon_s=2 * LONGEST_S, clearance_m=clearance_m)
    track_of = np.repeat(np.arange(len(tracks)), [len(track) for track in tracks])
    meeting = {int(a) // 2 for a, b in track_of[found.pairs].tolist() if a != b}
    return _least(delays_s, meeting, 0), _least(delays_s, meeting, len(delays_s))


def row_at(track: Forecasts, at_s: float) -> int:
    """The row of a track on which the robot is at a time; the first row for a time before the track."""
    return max(int(np.searchsorted(track.t_s[track.start[:-1]], at_s, "right")) - 1, 0)


def _least(delays_s: Sequence[float], meeting: set[int], first_case: int) -> float | None:
    return next((delay_s for case, delay_s in enumerate(delays_s, first_case) if case not in meeting), None)


def _later(track: Forecasts, delay_s: float) -> Forecasts:
    return replace(track, t_s=track.t_s + delay_s)


def _on_floor(track: Forecasts, base: int) -> Forecasts:
    return replace(track, floor=np.where(track.floor < 0, -1, track.floor + base))
