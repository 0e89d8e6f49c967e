"""Fast path for a status that differs from the robot's last only in motion.

One kernel does what `ingest/fleet/placement.py` does in many steps for any status. It needs a status with the
connection, texts and load of the last one, and a motion that needs no correction. What stays the same then is prepared
once, in a `RepeatReader`. The fleet reads any other status in full.

To import this imports numba, which takes 0.5 s and 60 MB, and compiles kernels that are not on disk.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, isnan
from typing import NamedTuple

import numpy as np

from ingest.batch import Basis, Floats
from ingest.fast_path.path_kernels import NO_TRANSFORM, forecast_repeat
from ingest.fast_path.scanner_kernels import OF_DESTINATIONS, OF_PATH
from ingest.fast_path.status_scanner import ScannedStatus, StatusTexts, scan
from ingest.fleet.owners import ownership_claims
from ingest.fleet.prediction import plausibility
from ingest.fleet.prediction.envelope import size
from ingest.fleet.prediction.forecast_model import NO_STOPS, Forecast, ForecastContext, Sighting
from ingest.fleet.prediction.hand_moves import is_out_of_reach
from ingest.fleet.prediction.held_poses import is_repeated
from ingest.fleet.prediction.pace import SPACED_S
from ingest.fleet.prediction.path_forecast import JUMP_SLACK_M, LATE_S, jump_mps
from ingest.fleet.prediction.way_on import SHORT_BY_S
from ingest.fleet.robot import Robot
from ingest.fleet.shown.odd_values import Oddities
from ingest.frames.assumed_motion import DRIVES_MPS, MOVING_MPS, TURNS_RADPS
from ingest.frames.floor_index import NOWHERE
from ingest.frames.frame_registry import Frame
from ingest.languages.massrobotics import path_points, vocabulary
from ingest.languages.rules import Findings
from ingest.port.connection import Connection
from ingest.sizes.stated_loads import StatedLoad

_PATH_END, _STOPS_END = OF_PATH + 1, OF_DESTINATIONS + 1


@dataclass(slots=True, eq=False)
class RepeatReader:
    """Reads the statuses of one robot that differ from its last only in motion."""

    robot: Robot
    connection: Connection
    texts: StatusTexts
    context: ForecastContext
    context_key: tuple[bool, str, tuple[StatedLoad, ...]]
    """The robot's key. It may change while the context stays, since another load may share the context."""
    basis: Basis
    """The basis of its forecasts: stationary, path or velocity."""
    most_knots: int
    """Knots of a forecast that is not by path."""
    floor: int
    table: Floats
    """Table of the transform to its floor."""
    limits: Floats
    """The values of a `path_kernels.LIMITS` record."""
    findings: tuple[str, ...]
    """Deviations of each of its statuses, except those of times and of the number of points."""

    def is_valid(self, connection: Connection) -> bool:
        """Whether the robot still reports over this connection and is read by the same settings."""
        robot = self.robot
        return self.connection is connection and robot.context is self.context and robot.context_key is self.context_key

    def read(self, scanned: ScannedStatus, event_s: float) -> tuple[tuple[str, ...], Oddities] | None:
        """Update the robot and its forecast. Returns its deviations and the values that show them. None, without any
        change, for any other status."""
        robot, before, marks = self.robot, self.robot.seen, scanned.marks
        if before is None or not self._may_repeat(before, event_s):
            return None
        first_point, end_of_path = marks[OF_PATH], marks[_PATH_END]
        first_stop, end_of_stops = marks[OF_DESTINATIONS], marks[_STOPS_END]
        room = max(end_of_path - first_point + 1, self.most_knots)
        rows = np.empty((room + end_of_stops - first_stop, 4))
        knots, ahead, breaks_a_rule, x_m, y_m, yaw_rad, linear_mps, turn_radps, z_m, stamp_s = forecast_repeat(
            scanned.rows,
            rows,
            self.table,
            self.limits,
            first_point,
            end_of_path,
            first_stop,
            end_of_stops,
            before.t_s,
            before.x_m,
            before.y_m,
            before.yaw_rad,
            event_s,
        )
        if not knots:
            return None
        offset_s, state = event_s - stamp_s, self.texts.state
        seen = Sighting(event_s, self.floor, x_m, y_m, yaw_rad, linear_mps, turn_radps, offset_s, state=state)
        if self._is_odd(before, seen):
            return None
        robot.state, robot.known_state, robot.doubt_m = self.texts.state, self.texts.known_state, 0.0
        robot.reports_within_s = 0.0
        robot.amounts = scanned.amounts
        self._move(before, seen, rows[:knots], z_m)
        robot.stops = rows[room : room + ahead] if ahead else NO_STOPS
        return self._with_points(scanned, stamp_s) if breaks_a_rule else (self.findings, self.texts.oddities)

    def _move(self, before: Sighting, seen: Sighting, knots: Floats, z_m: float) -> None:
        """Let the robot be seen after `before`, with the knots (k, 4) of its forecast, at a height."""
        robot = self.robot
        robot.before, robot.between, robot.seen = before, None, plausibility.in_motion(before, seen)
        robot.pace.observe(robot.seen)
        robot.pace.kind = None
        robot.forecast = Forecast(self.basis, knots, (self.floor,) * len(knots), *size(self.context.body, z_m))
        is_by_path = self.basis is Basis.PATH and robot.seen.is_driving
        robot.pace.follow(knots, seen.linear_mps, is_by_path=is_by_path)

    def _is_odd(self, before: Sighting, seen: Sighting) -> bool:
        """Whether the pose may be older than its message, or the robot was moved."""
        max_speed_mps = self.context.body.max_speed_mps
        is_moved = is_out_of_reach(before, seen, self.robot.doubt_m, max_speed_mps)
        return is_moved or is_repeated(before, seen)

    def _may_repeat(self, before: Sighting, event_s: float) -> bool:
        """Whether a message that comes a while later may be read here. One of a robot whose poses may be older than its
        messages, or that does not keep the times of its paths, may not."""
        robot, is_spaced = self.robot, event_s - before.t_s >= SPACED_S
        is_corrected = robot.held.lasts_s or not isnan(before.posed_s) or robot.pace.path_share != 1.0
        return before.floor == self.floor and is_spaced and not is_corrected

    def _with_points(self, scanned: ScannedStatus, stamp_s: float) -> tuple[tuple[str, ...], Oddities]:
        findings = Findings(self.findings)
        findings.name(self.texts.oddities)
        marks, (first_s, last_s, _, latest_s) = scanned.marks, scanned.rows[3].tolist()
        if self.texts.path:
            path_points.check_path(marks[_PATH_END] - marks[OF_PATH], (first_s, last_s), stamp_s, findings)
        if self.texts.destinations:
            stops = marks[_STOPS_END] - marks[OF_DESTINATIONS]
            path_points.check_destinations(stops, latest_s, stamp_s, findings)
        return tuple(findings), tuple(findings.oddities)


class FastPath(NamedTuple):
    """Functions that read plain messages faster than the parser. Without them the fleet gives the same results."""

    scan: Callable[[bytes], ScannedStatus | None]
    """The scanned status of a message. None for a message that is not a plain status."""
    repeat_reader: Callable[[Robot, ScannedStatus, Connection, str | None], RepeatReader | None]
    """`repeat_reader` below."""


def load() -> FastPath:
    """The functions for `Fleet.use`."""
    return FastPath(scan, repeat_reader)


def repeat_reader(
    robot: Robot, scanned: ScannedStatus, connection: Connection, names_as_uuid: str | None
) -> RepeatReader | None:
    """A reader for a robot whose last status was scanned. None if each of its statuses has to be read in full.

    `names_as_uuid` is its vendor if names are read as UUIDs.
    """
    texts, context = scanned.texts, robot.context
    basis = _basis(texts)
    if context is None or robot.context_key[1] != texts.datum or basis is None or robot.trailer_yaws_rad:
        return None
    frame, floor = context.frame_of("")
    path_frame, path_floor = context.frame_of(texts.path[0]) if basis is Basis.PATH and texts.path else (frame, floor)
    stops_frame, stops_floor = context.frame_of(texts.destinations[0]) if texts.destinations else (frame, floor)
    is_replaced = path_frame is frame and texts.path is not None and texts.path[0] not in ("", texts.datum)
    if floor == NOWHERE or path_floor != floor or is_replaced or not _same_transform(frame, path_frame, stops_frame):
        return None
    limits = np.array([basis, robot.context_key[0], frame.mirrored, stops_floor, *_limits(context)], np.float64)
    table = frame.transform.table if frame.transform else NO_TRANSFORM
    most_knots = ceil(context.reading.horizon_s) + 1 if basis is Basis.VELOCITY else 1
    findings = _constant_findings(scanned, frame, names_as_uuid)
    return RepeatReader(
        robot, connection, texts, context, robot.context_key, basis, most_knots, floor, table, limits, findings
    )


def _basis(texts: StatusTexts) -> Basis | None:
    """The basis of the forecasts of a robot that sends its speed. None if its statuses have to be read in full."""
    if not texts.known_state:
        return None  # what it means, the motion shows
    if texts.state == "navigating" and not texts.path:
        return None if texts.destinations else Basis.VELOCITY
    if texts.state == "manualOverride" or (texts.state == "idle" and texts.path):
        return None
    return Basis.PATH if texts.state == "navigating" else Basis.STATIONARY


def _same_transform(*frames: Frame) -> bool:
    """Whether all frames have the same transform and none is projected."""
    first = frames[0].transform
    return all(frame.projection is None and frame.transform is first for frame in frames)


def _limits(context: ForecastContext) -> tuple[float, ...]:
    """The fields of `LIMITS` from `centre_x_m` on."""
    body, reading = context.body, context.reading
    return (
        *body.offset_m,
        jump_mps(body),
        JUMP_SLACK_M,
        LATE_S,
        reading.horizon_s,
        reading.quiet_after_s,
        reading.horizon_s - SHORT_BY_S,
        reading.destination_horizon_s,
        path_points.MOST_POINTS,
        path_points.PATH_S,
        path_points.DESTINATIONS_S,
        path_points.SLACK_S,
        plausibility.REGULAR_S,
        plausibility.COMPARABLE_S,
        plausibility.OBSERVABLE_S,
        MOVING_MPS,
        TURNS_RADPS,
        DRIVES_MPS,
        plausibility.MOVED_M,
        ownership_claims.JUMP_MPS,
        ownership_claims.JUMP_S,
        plausibility.MAX_TURN_RADPS,
        plausibility.SLOW_TURN_RAD,
        plausibility.TURNED_RAD,
        plausibility.DRIFT_RAD,
        plausibility.CORNER_RAD,
        *plausibility.SPEED_AS_MOVED,
    )


def _constant_findings(scanned: ScannedStatus, frame: Frame, names_as_uuid: str | None) -> tuple[str, ...]:
    """The deviations of each status of the robot, except those of times and of the number of points."""
    findings = Findings()
    vocabulary.robot_uuid(scanned.uuid.decode(), names_as_uuid, findings)
    texts = scanned.texts
    for part in (texts.findings, *(part[1] for part in (texts.destinations, texts.path) if part)):
        findings.update(dict.fromkeys(part))
    if not frame.known:
        findings["datum-unknown"] = None
    return tuple(findings)
