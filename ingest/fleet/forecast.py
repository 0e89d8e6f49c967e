"""From what a robot says to where it will be: one robot's forecast in the frame of its floor.

What an operational state means for prediction: a navigating robot follows its path, else its velocity, else
heads for its next destination. Idle, charging, waiting, disabled, offline and unknown states stand where they
are, but for an idle robot whose path has times ahead and leads away: it says when it sets out. Manual mode is not
subject to the standard (section 1), so its path and destinations are not trusted and only its measured velocity is.
A blocking error makes any robot an obstacle where it stands; a lost one may be off by `lost_doubt_m`.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Sequence
from itertools import chain, groupby
from math import atan2, ceil, cos, hypot, inf, isfinite, isnan, nan, sin
from operator import itemgetter, lt
from typing import Protocol

import msgspec
import numpy as np

from ingest.batch import Basis, Floats
from ingest.frames.frame_registry import Frame
from ingest.languages.massrobotics.parser import Path
from ingest.languages.model import Status
from ingest.settings import Envelope, Model, Reading

DESTINATION_SPEED_MPS = 1.0
"""Assumed towards a destination without a usable time, where the robot's greatest speed is not known."""
MOVING_MPS = 0.02
AWAY_M = 0.1
"""An idle robot whose path leads no further than this stands."""
JUMP_FACTOR, JUMP_SLACK_M = 2.0, 0.5
"""A path that asks for more than this times the robot's greatest speed, and so much, contradicts its motion."""
PLAUSIBLE_SPEED_MPS = 5.0
"""Greatest speed of a robot that has not stated one."""


_YAW = itemgetter(3)
Knot = tuple[float, float, float, float]
"""t_s, x_m, y_m, yaw_rad"""
Along = tuple[Sequence[Knot], tuple[int, ...]]
"""Knots of the location (k,), and the floor of each."""
NO_STOPS: Floats = np.empty((0, 4))


class FrameOf(Protocol):
    """Frame and floor index for a datum that one vendor names; "" is the robot's own."""

    def __call__(self, datum: str) -> tuple[Frame, int]: ...


class Body(msgspec.Struct, frozen=True, gc=False):
    """A robot's envelope now, with its load: length, width and height, and where its centre lies."""

    envelope_m: Envelope
    offset_m: tuple[float, float] = (0.0, 0.0)
    max_speed_mps: float | None = None


class View(msgspec.Struct, frozen=True):
    """How one robot's messages are read: its body, its frames, the settings."""

    body: Body
    frame_of: FrameOf
    reading: Reading


class Sighting(msgspec.Struct, frozen=True, gc=False):
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
    clock_offset_s: float = 0.0
    """Added to the robot's stamps it gives service time, as here."""


class Forecast(msgspec.Struct, frozen=True, gc=False, eq=False):
    """Where one envelope centre will be."""

    basis: Basis
    knots: tuple[Knot, ...] | Floats
    """(k,) or, where compiled code has made them, (k, 4)"""
    floors: tuple[int, ...]
    """(k,) of each knot."""
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
    findings: list[str] = []
    basis, (knots, floors) = _motion(status, here, view, findings)
    return _enveloped(basis, knots, floors, view.body, status.z, tuple(findings))


def stops(status: Status, here: Sighting, view: View) -> Floats:
    """The destinations ahead, by time: (m, 4) t_s, x_m, y_m and floor.

    None in manual mode. One whose time is past stays: the robot is late for it.
    """
    if not status.destinations.datums or status.state == "manualOverride":
        return NO_STOPS
    latest_s = here.t_s + view.reading.destination_horizon_s
    on_floors = _on_floors(status.destinations, here, view)
    told = [(t_s, x_m, y_m, floor) for floor, points in on_floors for t_s, x_m, y_m, _ in points if t_s <= latest_s]
    return np.array(told, np.float64) if told else NO_STOPS


def matches(codes: tuple[str, ...], words: tuple[str, ...]) -> bool:
    """Whether any error code contains any of the words; case, hyphens and underscores are ignored."""
    if not codes:
        return False
    plain = [_plain(code) for code in codes]
    return any(_plain(word) in code for word in words for code in plain)


def _plain(text: str) -> str:
    return "".join(character for character in text.casefold() if character.isalnum())


def _motion(status: Status, here: Sighting, view: View, findings: list[str]) -> tuple[Basis, Along]:
    if not matches(status.error_codes, view.reading.blocking_errors):
        if status.state == "navigating":
            return _navigating(status, here, view, findings)
        if status.state == "idle" and (along := _setting_out(status.path, here, view, findings)):
            return Basis.PATH, along
        if status.state == "manualOverride" and here.linear_mps and not isnan(here.yaw_rad):
            return Basis.VELOCITY, _by_velocity(here, view.reading.horizon_s)
    return Basis.STATIONARY, _standing(here)


def _standing(here: Sighting) -> Along:
    return (_knot(here),), (here.floor,)


def _knot(here: Sighting) -> Knot:
    return here.t_s, here.x_m, here.y_m, here.yaw_rad


def _navigating(status: Status, here: Sighting, view: View, findings: list[str]) -> tuple[Basis, Along]:
    along = _by_path(status.path, here, view, findings)
    if along:
        return Basis.PATH, along
    moving = (
        here.linear_mps is not None
        and not isnan(here.yaw_rad)
        and (abs(here.linear_mps) > MOVING_MPS or not status.destinations.datums)
    )
    if moving:
        return Basis.VELOCITY, _by_velocity(here, view.reading.horizon_s)
    towards = _by_destination(status.destinations, here, view)
    if towards:
        return Basis.DESTINATION, towards
    return Basis.STATIONARY, _standing(here)


def _setting_out(path: Path, here: Sighting, view: View, findings: list[str]) -> Along | None:
    """By the path of a robot that stands, where its own times say when it will leave."""
    noted: list[str] = []
    along = _by_path(path, here, view, noted)
    if along is None or "path-retimed" in noted:
        return None
    if max(hypot(x - here.x_m, y - here.y_m) for _, x, y, _ in along[0]) <= AWAY_M:
        return None
    findings += noted
    return along


def _by_path(path: Path, here: Sighting, view: View, findings: list[str]) -> Along | None:
    points: list[Knot] = []
    floors: list[int] = []
    for floor, placed in _on_floors(path, here, view):
        points += placed
        floors += [floor] * len(placed)
    if not points:
        return None
    times = [point[0] for point in points]
    in_order = (path.in_order and not here.clock_offset_s) or all(map(lt, times, times[1:]))
    if times[-1] <= here.t_s or not in_order:
        retimed = _retimed(points, here, view.body)
        if retimed is None:
            return None
        findings.append("path-retimed")
        points, times = retimed, [point[0] for point in retimed]
    ahead = bisect_right(times, here.t_s)
    within = bisect_left(times, here.t_s + view.reading.horizon_s + view.reading.quiet_after_s) + 1
    knots, all_floors = [_knot(here), *points[ahead:within]], (here.floor, *floors[ahead:within])
    possible = _up_to_jump(knots, all_floors, view.body)
    if possible < len(knots):
        findings.append("path-contradicts-motion")
    if possible < 2:
        return None
    return _headed(knots[:possible]), all_floors[:possible]


def _on_floors(path: Path, here: Sighting, view: View) -> list[tuple[int, Sequence[Knot]]]:
    """The points in the order sent, those next to each other on one floor together in its frame.

    Points that have no place there, such as degrees that no latitude has, are left out.
    """
    on_floors: list[tuple[int, Sequence[Knot]]] = []
    for datum, poses in _by_datum(path) if path.datums else ():
        frame, floor = view.frame_of(datum)
        on_floors.append((floor, _placed(poses, frame, here.clock_offset_s)))
    return on_floors


def _by_datum(path: Path) -> Iterable[tuple[str, Sequence[Knot]]]:
    """The poses in the order sent, those next to each other on one datum together."""
    datums = path.datums
    if datums.count(datums[0]) == len(datums):
        return ((datums[0], path.poses),)
    groups = groupby(zip(datums, path.poses, strict=True), itemgetter(0))
    return [(datum, [pose for _, pose in group]) for datum, group in groups]


def _placed(poses: Sequence[Knot], frame: Frame, clock_offset_s: float) -> Sequence[Knot]:
    if frame.transform is not None:
        return [(t_s + clock_offset_s, *frame.transform.pose(x, y, yaw_rad)) for t_s, x, y, yaw_rad in poses]
    if frame.projection is not None:
        placed = zip(poses, frame.placed([pose[1:] for pose in poses]), strict=True)
        return [(pose[0] + clock_offset_s, x, y, yaw) for pose, (x, y, yaw) in placed if isfinite(x) and isfinite(y)]
    if not clock_offset_s:
        return poses
    return [(t_s + clock_offset_s, x, y, yaw_rad) for t_s, x, y, yaw_rad in poses]


def _retimed(points: list[Knot], here: Sighting, body: Body) -> list[Knot] | None:
    """Times by the robot's speed along the points in the order sent; None where the speed is not known."""
    speed_mps = abs(here.linear_mps) if here.linear_mps else body.max_speed_mps
    if not speed_mps or speed_mps <= MOVING_MPS:
        return None
    retimed: list[Knot] = []
    along_m, last_x, last_y = 0.0, here.x_m, here.y_m
    for _, x, y, yaw_rad in points:
        along_m += max(hypot(x - last_x, y - last_y), 1e-3)
        retimed.append((here.t_s + along_m / speed_mps, x, y, yaw_rad))
        last_x, last_y = x, y
    return retimed


def jump_mps(body: Body) -> float:
    """The speed beyond which a path contradicts the robot's motion."""
    return JUMP_FACTOR * (body.max_speed_mps or PLAUSIBLE_SPEED_MPS)


def _up_to_jump(knots: Sequence[Knot], floors: tuple[int, ...], body: Body) -> int:
    """How many knots can be reached in turn; a change of floor is never a jump."""
    limit_mps = jump_mps(body)
    t, x, y, _ = knots[0]
    for row, (next_t, next_x, next_y, _) in enumerate(knots):
        if hypot(next_x - x, next_y - y) > limit_mps * (next_t - t) + JUMP_SLACK_M and floors[row - 1] == floors[row]:
            return row
        t, x, y = next_t, next_x, next_y
    return len(knots)


def _by_velocity(here: Sighting, horizon_s: float) -> Along:
    """Constant speed and turn rate; an arc becomes a knot a second, since motion is linear between knots."""
    speed_mps, heading = here.linear_mps or 0.0, here.yaw_rad
    if abs(here.turn_radps) <= 1e-3:
        reach_m = speed_mps * horizon_s
        end = here.t_s + horizon_s, here.x_m + reach_m * cos(heading), here.y_m + reach_m * sin(heading), heading
        return (_knot(here), end), (here.floor,) * 2
    steps, radius_m = ceil(horizon_s), speed_mps / here.turn_radps
    knots = []
    for step in range(steps + 1):
        t_s = horizon_s * step / steps
        yaw_rad = heading + here.turn_radps * t_s
        x_m = here.x_m + radius_m * (sin(yaw_rad) - sin(heading))
        y_m = here.y_m - radius_m * (cos(yaw_rad) - cos(heading))
        knots.append((here.t_s + t_s, x_m, y_m, yaw_rad))
    return knots, (here.floor,) * (steps + 1)


def _by_destination(destinations: Path, here: Sighting, view: View) -> Along | None:
    """Straight to the next destination on this floor, at the time it states or at the robot's speed."""
    latest_s = here.t_s + view.reading.destination_horizon_s
    on_floor = [points for floor, points in _on_floors(destinations, here, view) if floor == here.floor]
    reachable = [knot for knot in chain.from_iterable(on_floor) if knot[0] <= latest_s]
    if not reachable:
        return None
    t_s, x_m, y_m, yaw_rad = min(reachable, key=itemgetter(0))
    if t_s <= here.t_s:
        distance_m = hypot(x_m - here.x_m, y_m - here.y_m)
        t_s = here.t_s + max(distance_m / (view.body.max_speed_mps or DESTINATION_SPEED_MPS), 1e-3)
    return _headed([_knot(here), (t_s, x_m, y_m, yaw_rad)]), (here.floor, here.floor)


def _headed(knots: list[Knot]) -> list[Knot]:
    """Fill unknown headings with the direction of travel; those of a robot that does not move stay nan."""
    if not _unheaded(knots):
        return knots
    headed: list[Knot] = []
    for row, (t_s, x, y, sent_rad) in enumerate(knots):
        yaw_rad = sent_rad
        if isnan(yaw_rad):
            a, b = (knots[row - 1], knots[row]) if row else (knots[0], knots[1])
            dx, dy = b[1] - a[1], b[2] - a[2]
            yaw_rad = atan2(dy, dx) if hypot(dx, dy) > 1e-3 else headed[row - 1][3] if row else nan
        headed.append((t_s, x, y, yaw_rad))
    return headed


def _unheaded(knots: Sequence[Knot]) -> bool:
    """Whether any heading is unknown: a sum with nan is nan."""
    return isnan(sum(map(_YAW, knots)))


def _enveloped(
    basis: Basis, knots: Sequence[Knot], floors: tuple[int, ...], body: Body, z_m: float, findings: tuple[str, ...]
) -> Forecast:
    """Move knots from the location to the envelope centre; without a heading, the circumscribed square stands.

    The centre, not the location, then moves in a straight line between knots.
    """
    length_m, width_m, bottom_m, top_m = size(body, z_m)
    dx, dy = body.offset_m
    if _unheaded(knots):
        length_m = width_m = hypot(length_m, width_m) + 2 * hypot(dx, dy)
        knots = [(t_s, x, y, 0.0) for t_s, x, y, _ in knots]
    elif dx or dy:
        knots = _at_centre(knots, dx, dy)
    return Forecast(basis, tuple(knots), floors, length_m, width_m, bottom_m, top_m, findings)


def size(body: Body, z_m: float) -> tuple[float, float, float, float]:
    """Length and width of an envelope, and the heights from which and to which it reaches."""
    length_m, width_m, height_m = body.envelope_m
    return (length_m, width_m, z_m, z_m + height_m) if height_m else (length_m, width_m, -inf, inf)


def _at_centre(knots: Sequence[Knot], dx: float, dy: float) -> list[Knot]:
    centred = []
    for t_s, x, y, yaw_rad in knots:
        c, s = cos(yaw_rad), sin(yaw_rad)
        centred.append((t_s, x + c * dx - s * dy, y + s * dx + c * dy, yaw_rad))
    return centred
