"""From what a robot says to where it will be: one robot's forecast in the frame of its floor.

What an operational state means for prediction: a navigating robot follows its path, else its velocity, else
heads for its next destination. Idle, charging, waiting, disabled, offline and unknown states stand where they
are. Manual mode is not subject to the standard (section 1), so its path and destinations are not trusted and only
its measured velocity is. A blocking error makes any robot an obstacle where it stands; a lost one may be off by
`lost_doubt_m`.
"""

from dataclasses import dataclass
from itertools import pairwise
from math import atan2, ceil, cos, hypot, isnan, sin
from typing import Protocol

import numpy as np

from ingest.frames import Frame
from ingest.messages import Path, Status
from ingest.seam import Basis, Floats
from ingest.settings import Envelope, Model, Reading

DESTINATION_SPEED_MPS = 1.0
"""Assumed towards a destination without a usable time, where the robot's greatest speed is not known."""
MOVING_MPS = 0.02
JUMP_FACTOR = 2.0
"""A path that asks for more than this times the robot's greatest speed contradicts its motion."""
PLAUSIBLE_SPEED_MPS = 5.0
"""Greatest speed of a robot that has not stated one."""


Motion = tuple[Basis, Floats, tuple[int, ...]]
"""What the forecast rests on, poses (k, 4) of the location, and the floor of each."""
NO_STOPS: tuple[Floats, tuple[int, ...]] = (np.empty((0, 3)), ())


class FrameOf(Protocol):
    """Frame and floor index for a datum that one vendor names; "" is the robot's own."""

    def __call__(self, datum: str) -> tuple[Frame, int]: ...


@dataclass(frozen=True, slots=True)
class Body:
    """A robot's envelope now, with its load: length, width and height, and where its centre lies."""

    envelope_m: Envelope
    offset_m: tuple[float, float] = (0.0, 0.0)
    max_speed_mps: float | None = None


@dataclass(frozen=True, slots=True)
class View:
    """How one robot's messages are read: its body, its clock, its frames, the settings."""

    body: Body
    clock_offset_s: float
    """Added to the robot's stamps it gives service time."""
    frame_of: FrameOf
    reading: Reading


@dataclass(frozen=True, slots=True)
class Sighting:
    """Where a robot was: location (not envelope centre) in its floor's frame."""

    t_s: float
    floor: int
    x_m: float
    y_m: float
    yaw_rad: float
    """nan where the heading is unknown."""
    linear_mps: float | None = None
    """Signed along the heading; None where neither sent nor observed."""
    turn_radps: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Forecast:
    """Knots of one envelope centre: `poses` (k, 4) as t_s, x_m, y_m, yaw_rad, and the floor of each."""

    basis: Basis
    poses: Floats
    floors: tuple[int, ...]
    length_m: float
    width_m: float
    bottom_m: float
    top_m: float
    findings: tuple[str, ...] = ()


def body_of(model: Model, reported: Envelope, loaded: bool, max_speed_mps: float | None) -> Body:
    """The envelope that holds now: the model's by load where the site states it, else the one reported."""
    if loaded and model.loaded_envelope_m:
        return Body(model.loaded_envelope_m, model.loaded_offset_m or model.offset_m, max_speed_mps)
    return Body(model.envelope_m or reported, model.offset_m, max_speed_mps)


def forecast(status: Status, here: Sighting, view: View) -> Forecast:
    """The forecast of a robot seen at `here`, and the rules its message broke in giving it."""
    reading = view.reading
    blocked = matches(status.error_codes, reading.blocking_errors)
    findings: list[str] = []
    motion: Motion = (Basis.STATIONARY, _standing(here), (here.floor,))
    if not blocked and status.state == "navigating":
        motion = _navigating(status, here, view, findings)
    elif not blocked and status.state == "manualOverride" and here.linear_mps:
        motion = (Basis.VELOCITY, *_by_velocity(here, reading.horizon_s))
    return _enveloped(motion, view.body, status.z, tuple(findings))


def stops(status: Status, here: Sighting, view: View) -> tuple[Floats, tuple[int, ...]]:
    """The destinations ahead, `(d, 3)` as t_s, x_m, y_m by time, and the floor of each.

    Empty in manual mode. One whose time is past stays: the robot is late for it.
    """
    if not len(status.destinations.poses) or status.state == "manualOverride":
        return NO_STOPS
    points, floors = _on_floors(status.destinations, view)
    reached = points[:, 0] <= here.t_s + view.reading.destination_horizon_s
    return points[reached, :3], tuple(floor for floor, near in zip(floors, reached, strict=True) if near)


def matches(codes: tuple[str, ...], words: tuple[str, ...]) -> bool:
    """Whether any error code contains any of the words; case, hyphens and underscores are ignored."""
    plain = [_plain(code) for code in codes]
    return any(_plain(word) in code for word in words for code in plain)


def _plain(text: str) -> str:
    return "".join(character for character in text.casefold() if character.isalnum())


def _standing(here: Sighting) -> Floats:
    return np.array([[here.t_s, here.x_m, here.y_m, here.yaw_rad]])


def _navigating(status: Status, here: Sighting, view: View, findings: list[str]) -> Motion:
    along = _by_path(status.path, here, view, findings)
    if along:
        return Basis.PATH, *along
    if here.linear_mps is not None and (abs(here.linear_mps) > MOVING_MPS or not len(status.destinations.poses)):
        return Basis.VELOCITY, *_by_velocity(here, view.reading.horizon_s)
    towards = _by_destination(status.destinations, here, view)
    if towards:
        return Basis.DESTINATION, *towards
    return Basis.STATIONARY, _standing(here), (here.floor,)


def _by_path(path: Path, here: Sighting, view: View, findings: list[str]) -> tuple[Floats, tuple[int, ...]] | None:
    if not len(path.poses):
        return None
    points, floors = _on_floors(path, view)
    if not len(points):
        return None
    times = points[:, 0]
    if np.any(np.diff(times) <= 0) or times[-1] <= here.t_s:
        retimed = _retime(points, here, view.body)
        if retimed is None:
            return None
        findings.append("path-retimed")
        points = retimed
    ahead = points[:, 0] > here.t_s
    points, floors = points[ahead], [floor for floor, keep in zip(floors, ahead, strict=True) if keep]
    within = int(np.searchsorted(points[:, 0], here.t_s + view.reading.horizon_s + view.reading.quiet_after_s)) + 1
    knots = np.vstack([_standing(here), points[:within]])
    all_floors = (here.floor, *floors[:within])
    possible = _up_to_jump(knots, all_floors, view.body)
    if possible < len(knots):
        findings.append("path-contradicts-motion")
    if possible < 2:
        return None
    return _headed(knots[:possible]), all_floors[:possible]


def _on_floors(path: Path, view: View) -> tuple[Floats, list[int]]:
    """`(p, 4)` poses as t_s, x_m, y_m, yaw_rad in floor frames, and the floor of each.

    Points that have no place there, such as degrees that no latitude has, are left out.
    """
    points = np.empty((len(path.poses), 4))
    points[:, 0] = path.poses[:, 0] + view.clock_offset_s
    if not any(path.datums):
        frame, floor = view.frame_of("")
        points[:, 1:] = frame.to_floor(path.poses[:, (1, 2, 4)])
        floors = [floor] * len(points)
    else:
        floors = []
        for row, datum in enumerate(path.datums):
            frame, floor = view.frame_of(datum)
            points[row, 1:] = frame.to_floor(path.poses[row : row + 1, (1, 2, 4)])[0]
            floors.append(floor)
    placed = np.flatnonzero(np.isfinite(points[:, :3]).all(axis=1))
    return points[placed], [floors[row] for row in placed]


def _retime(points: Floats, here: Sighting, body: Body) -> Floats | None:
    """Times by the robot's speed along the points in the order sent; None where the speed is not known."""
    speed_mps = abs(here.linear_mps) if here.linear_mps else body.max_speed_mps
    if not speed_mps or speed_mps <= MOVING_MPS:
        return None
    legs = np.diff(np.vstack([[here.x_m, here.y_m], points[:, 1:3]]), axis=0)
    lengths = np.maximum(np.hypot(legs[:, 0], legs[:, 1]), 1e-3)
    retimed = points.copy()
    retimed[:, 0] = here.t_s + np.cumsum(lengths) / speed_mps
    return retimed


def _up_to_jump(knots: Floats, floors: tuple[int, ...], body: Body) -> int:
    """How many knots can be reached in turn; a change of floor is never a jump."""
    limit_mps = JUMP_FACTOR * (body.max_speed_mps or PLAUSIBLE_SPEED_MPS)
    legs = np.diff(knots[:, :3], axis=0)
    slack_m = 0.5
    jumps = np.hypot(legs[:, 1], legs[:, 2]) > limit_mps * legs[:, 0] + slack_m
    jumps &= np.array([before == after for before, after in pairwise(floors)], bool)
    return int(np.argmax(jumps)) + 1 if jumps.any() else len(knots)


def _by_velocity(here: Sighting, horizon_s: float) -> tuple[Floats, tuple[int, ...]]:
    """Constant speed and turn rate; an arc becomes a knot a second, since motion is linear between knots."""
    speed_mps, heading = here.linear_mps or 0.0, here.yaw_rad
    steps = ceil(horizon_s) if abs(here.turn_radps) > 1e-3 else 1
    t = np.linspace(0.0, horizon_s, steps + 1)
    poses = np.empty((steps + 1, 4))
    poses[:, 0] = here.t_s + t
    poses[:, 3] = heading + here.turn_radps * t
    if steps == 1:
        poses[:, 1] = here.x_m + speed_mps * cos(heading) * t
        poses[:, 2] = here.y_m + speed_mps * sin(heading) * t
    else:
        radius_m = speed_mps / here.turn_radps
        poses[:, 1] = here.x_m + radius_m * (np.sin(poses[:, 3]) - sin(heading))
        poses[:, 2] = here.y_m - radius_m * (np.cos(poses[:, 3]) - cos(heading))
    return poses, (here.floor,) * (steps + 1)


def _by_destination(destinations: Path, here: Sighting, view: View) -> tuple[Floats, tuple[int, ...]] | None:
    """Straight to the next destination on this floor, at the time it states or at the robot's speed."""
    if not len(destinations.poses):
        return None
    points, floors = _on_floors(destinations, view)
    reachable = [
        row
        for row, floor in enumerate(floors)
        if floor == here.floor and points[row, 0] <= here.t_s + view.reading.destination_horizon_s
    ]
    if not reachable:
        return None
    goal = points[min(reachable, key=lambda row: float(points[row, 0]))].copy()
    if goal[0] <= here.t_s:
        distance_m = hypot(goal[1] - here.x_m, goal[2] - here.y_m)
        goal[0] = here.t_s + max(distance_m / (view.body.max_speed_mps or DESTINATION_SPEED_MPS), 1e-3)
    return _headed(np.vstack([_standing(here), goal])), (here.floor, here.floor)


def _headed(knots: Floats) -> Floats:
    """Fill unknown headings with the direction of travel; those of a robot that does not move stay nan."""
    if not np.isnan(knots[:, 3]).any():
        return knots
    headed = knots.copy()
    for row in range(len(knots)):
        if isnan(knots[row, 3]):
            a, b = (row - 1, row) if row else (0, 1)
            dx, dy = knots[b, 1] - knots[a, 1], knots[b, 2] - knots[a, 2]
            headed[row, 3] = atan2(dy, dx) if hypot(dx, dy) > 1e-3 else headed[row - 1, 3] if row else np.nan
    return headed


def _enveloped(motion: Motion, body: Body, z_m: float, findings: tuple[str, ...]) -> Forecast:
    """Move poses from the location to the envelope centre; without a heading, the circumscribed square stands.

    The centre, not the location, then moves in a straight line between knots.
    """
    basis, poses, floors = motion
    length_m, width_m, height_m = body.envelope_m
    dx, dy = body.offset_m
    if np.isnan(poses[:, 3]).any():
        length_m = width_m = hypot(length_m, width_m) + 2 * hypot(dx, dy)
        poses = poses.copy()
        poses[:, 3] = 0.0
    elif dx or dy:
        poses = poses.copy()
        c, s = np.cos(poses[:, 3]), np.sin(poses[:, 3])
        poses[:, 1] += c * dx - s * dy
        poses[:, 2] += s * dx + c * dy
    bottom_m, top_m = (z_m, z_m + height_m) if height_m else (-np.inf, np.inf)
    return Forecast(basis, poses, floors, length_m, width_m, bottom_m, top_m, findings)
