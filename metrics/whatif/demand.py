"""The demand of a log: from where to where each robot drives, along which way, and how long it stays at the end.

A robot stops where it stands for some seconds that it does not lose to others. What it drives from one stop to the next
is a trip.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from math import hypot

import numpy as np

from deconflict.simulation.floor_layout import Place
from ingest.batch import Floats
from metrics.whatif.recorded_tracks import RecordedFloor, RobotTrack

STANDS_MPS = 0.12
STOP_S = 4.0
"""A robot stops if it stands for this long and loses nothing to others meanwhile."""
LOSES_AROUND_S = 1.0
"""Standing this long before and after a loss belongs to it."""
LEAST_TRIP_M = 1.5
"""Robots that move less between two stops have not left the first."""
SAME_PLACE_M = 0.7
"""Stops that are nearer to each other are one place."""
RETURNS_M, LOOP_M = 0.4, 20.0
"""A way that comes back to within the first distance, after less than the second, leaves the loop out: the robot has
backed off, or gone around another."""
STRAIGHT_M = 0.12
"""A way is simplified to corners from which it deviates by at most this."""
TOP_PERCENT = 95.0
LEAST_TOP_MPS = 0.3
JUMP_MPS = 4.0
"""Robots that move faster are carried, or ride in a lift: the way has a gap there."""


@dataclass(frozen=True, slots=True)
class Stop:
    """One robot at one place. Times are seconds after the start of the log."""

    place: Place
    yaw_rad: float
    floor: int
    from_s: float
    until_s: float
    lost_s: float = 0.0
    """The part of it that was lost to others."""

    @property
    def stay_s(self) -> float:
        return max(self.until_s - self.from_s - self.lost_s, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Trip:
    """The way of one robot to its next stop."""

    corners: tuple[Place, ...]
    floor: int
    departs_s: float
    stop: Stop
    """Where it ends."""
    is_whole: bool
    """Whether the log shows that it ends."""
    free_s: float
    """How long it took without what was lost to others."""


@dataclass(frozen=True, slots=True, eq=False)
class RobotDemand:
    """The trips of one robot, in order."""

    track: RobotTrack
    top_mps: float
    start: Stop
    trips: tuple[Trip, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Demand:
    robots: tuple[RobotDemand, ...]
    floors: tuple[str, ...]
    """Ids of the floors by index."""


def demand_of(floor: RecordedFloor) -> Demand:
    """The demand of a recorded log."""
    lost: dict[str, list[tuple[float, float]]] = {}
    for loss in floor.losses:
        lost.setdefault(loss.robot, []).append((loss.from_s - LOSES_AROUND_S, loss.until_s + LOSES_AROUND_S))
    robots = [_robot(track, lost.get(track.uuid, [])) for track in floor.tracks if len(track.t_s) > 1]
    return Demand(tuple(robots), floor.floors)


def _robot(track: RobotTrack, lost: list[tuple[float, float]]) -> RobotDemand:
    stops = _stops(track, lost)
    moved = np.hypot(np.diff(track.x_m), np.diff(track.y_m))
    speeds = moved / np.maximum(np.diff(track.t_s), 1e-3)
    speeds = speeds[(speeds > STANDS_MPS) & (speeds < JUMP_MPS)]
    top_mps = max(float(np.percentile(speeds, TOP_PERCENT)), LEAST_TOP_MPS) if len(speeds) else LEAST_TOP_MPS
    trips = [trip for a, b in pairwise(stops) if (trip := _trip(track, a, b, lost)) is not None]
    return RobotDemand(track, top_mps, stops[0], tuple(trips))


def _stops(track: RobotTrack, lost: list[tuple[float, float]]) -> list[Stop]:
    """The stops of a robot. Its first and its last report count as stops too, as the log says no more."""
    last = len(track.t_s) - 1
    found = [_stop(track, 0, 0, lost)]
    for first, end in _stands(track):
        stop = _stop(track, first, end, lost)
        is_end = first == 0 or end == last
        if stop.stay_s < STOP_S and not is_end:
            continue
        if _far(found[-1], stop):
            found.append(stop)
        else:
            found[-1] = _joined(found[-1], stop)
    final = _stop(track, last, last, lost)
    if _far(found[-1], final):
        found.append(final)
    return found


def _far(a: Stop, b: Stop) -> bool:
    return a.floor != b.floor or hypot(a.place[0] - b.place[0], a.place[1] - b.place[1]) > LEAST_TRIP_M


def _joined(a: Stop, b: Stop) -> Stop:
    return Stop(b.place, b.yaw_rad, b.floor, a.from_s, b.until_s, a.lost_s + b.lost_s)


def _stop(track: RobotTrack, first: int, end: int, lost: list[tuple[float, float]]) -> Stop:
    from_s, until_s = float(track.t_s[first]), float(track.t_s[end])
    lost_s = sum(max(0.0, min(until_s, to_s) - max(from_s, since_s)) for since_s, to_s in lost)
    place = float(track.x_m[end]), float(track.y_m[end])
    return Stop(place, float(track.yaw_rad[end]), int(track.floor[end]), from_s, until_s, min(lost_s, until_s - from_s))


def _stands(track: RobotTrack) -> Iterable[tuple[int, int]]:
    """First and last report of each time for which a robot stands."""
    moved = np.hypot(np.diff(track.x_m), np.diff(track.y_m))
    stands = (moved < STANDS_MPS * np.maximum(np.diff(track.t_s), 1e-3)) & (np.diff(track.floor) == 0)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], stands, [False]]).astype(np.int8)))
    return zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)


def _trip(track: RobotTrack, a: Stop, b: Stop, lost: list[tuple[float, float]]) -> Trip | None:
    """The trip between two stops; None if the log has a gap between them, as where a robot rides in a lift."""
    rows = np.flatnonzero((track.t_s >= a.until_s) & (track.t_s <= b.from_s))
    points = np.column_stack([track.x_m[rows], track.y_m[rows]])
    speeds = np.hypot(*np.diff(points, axis=0).T) / np.maximum(np.diff(track.t_s[rows]), 1e-3)
    if len(rows) < 2 or a.floor != b.floor or np.any(speeds > JUMP_MPS):
        return None
    ends = np.array([a.place]), np.array([b.place])
    corners = simplified(without_loops(np.vstack([ends[0], points, ends[1]])))
    took_s = b.from_s - a.until_s
    lost_s = sum(max(0.0, min(b.from_s, to_s) - max(a.until_s, since_s)) for since_s, to_s in lost)
    is_whole = b.from_s < b.until_s
    return Trip(tuple(map(tuple, corners.tolist())), a.floor, a.until_s, b, is_whole, max(took_s - lost_s, 0.1))


def without_loops(points: Floats) -> Floats:
    """A way (k, 2) without where it comes back to itself, and without repeated points."""
    kept: list[int] = []
    for index, point in enumerate(points):
        if kept:
            away_m = np.hypot(*(points[kept] - point).T)
            legs_m = np.hypot(*np.diff(np.vstack([points[kept], point]), axis=0).T)
            back_m = np.cumsum(legs_m[::-1])[::-1]
            returns = np.flatnonzero((away_m < RETURNS_M) & (back_m < LOOP_M))
            if len(returns):
                del kept[returns[0] + 1 :]
                if index == len(points) - 1:
                    kept = [*kept[: returns[0]], index] if returns[0] else [*kept, index]
                continue
        kept.append(index)
    return points[kept]


def simplified(points: Floats, tolerance_m: float = STRAIGHT_M) -> Floats:
    """The corners of a way (Douglas and Peucker 1973)."""
    if len(points) < 3:
        return points
    dx, dy = points[-1] - points[0]
    length_m = hypot(dx, dy)
    if length_m < 1e-6:
        off_m = np.hypot(*(points - points[0]).T)
    else:
        off_m = np.abs((points[:, 0] - points[0, 0]) * dy - (points[:, 1] - points[0, 1]) * dx) / length_m
    furthest = int(np.argmax(off_m))
    if off_m[furthest] <= tolerance_m:
        return points[[0, -1]]
    return np.vstack([simplified(points[: furthest + 1], tolerance_m)[:-1], simplified(points[furthest:], tolerance_m)])
