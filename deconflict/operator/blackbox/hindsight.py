"""What two robots did by their own reports, and the least delay of one that would have kept them apart."""

from collections.abc import Iterable, Sequence

import numpy as np

from deconflict.foresight.near_misses.near_events import later, on_floor
from deconflict.foresight.near_misses.recorded_track import RecordedTrack, ReportedPose
from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import Site
from deconflict.sweep.sweep_once import sweep
from ingest.batch import Forecasts
from ingest.fleet.robot import Robot
from ingest.measures.measures import Measures
from ingest.recording.log_reader import Received

STEP_S = 0.1
"""Delays are tried in steps of this."""
LONGEST_S = 20.0
"""The longest delay that is tried. The pair must keep apart for as long before and after."""


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
                    _add_pose(track, robot)
    return {uuid: track for uuid, track in found.items() if track.reports}, fleet.snapshot(now_s).floors


def _add_pose(track: RecordedTrack, robot: Robot) -> None:
    """Add the robot's present pose."""
    forecast = robot.forecast
    if forecast:
        track.name, track.vendor = robot.name, robot.vendor
        t_s, x_m, y_m, yaw_rad = forecast.knots[0]
        levels_and_size = forecast.bottom_m, forecast.top_m, forecast.length_m, forecast.width_m
        pose = ReportedPose(t_s, x_m, y_m, yaw_rad, forecast.floors[0], *levels_and_size)
        track.add(pose, forecast.shape)


def avoiding_delays_s(a: Forecasts, b: Forecasts, clearance_m: float, at_s: float) -> tuple[float | None, float | None]:
    """The least delay of each robot alone that would have kept the clearance; None if no delay up to `LONGEST_S` does.

    One sweep tries all delays at once, each on a floor of its own.
    """
    delays_s = np.arange(STEP_S, LONGEST_S + STEP_S / 2, STEP_S).round(3).tolist()
    cases = [(later(a, delay_s), b) for delay_s in delays_s] + [(a, later(b, delay_s)) for delay_s in delays_s]
    floors = 1 + max(int(a.floor.max()), int(b.floor.max()))
    tracks = [on_floor(track, number * floors) for number, case in enumerate(cases) for track in case]
    found = sweep(Forecasts.joined(tracks), now_s=at_s - LONGEST_S, horizon_s=2 * LONGEST_S, clearance_m=clearance_m)
    track_of = np.repeat(np.arange(len(tracks)), [len(track) for track in tracks])
    meeting = {int(a) // 2 for a, b in track_of[found.pairs].tolist() if a != b}
    return _least(delays_s, meeting, 0), _least(delays_s, meeting, len(delays_s))


def row_at(track: Forecasts, at_s: float) -> int:
    """The row of a track on which the robot is at a time; the first row for a time before the track."""
    return max(int(np.searchsorted(track.t_s[track.start[:-1]], at_s, "right")) - 1, 0)


def _least(delays_s: Sequence[float], meeting: set[int], first_case: int) -> float | None:
    return next((delay_s for case, delay_s in enumerate(delays_s, first_case) if case not in meeting), None)
