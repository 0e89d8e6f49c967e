"""Fast path for a status that differs from the robot's last only in motion.

One kernel does with it what `ingest/fleet/fleet.py` does with any status in many steps.

As it did is over the same connection, in the same vocabulary, under the same load, and by a motion since it was seen
last in which nothing is to be mended. What can't have changed then is worked out once, as its `Manner`; whatever is not
so is left to others.
"""

from dataclasses import dataclass
from math import ceil

import numpy as np

from ingest.batch import Basis, Floats
from ingest.fast_path.path_kernels import AS_IT_IS, go_on
from ingest.fast_path.scanner_kernels import OF_DESTINATIONS, OF_PATH
from ingest.fast_path.status_scanner import Letters, Words
from ingest.fleet import ownership_claims, plausibility
from ingest.fleet.forecast import JUMP_SLACK_M, NO_STOPS, Forecast, Sighting, View, jump_mps, size
from ingest.fleet.robot import Robot
from ingest.frames.floor_index import NOWHERE
from ingest.frames.frame_registry import Frame
from ingest.languages.massrobotics import path_points, vocabulary
from ingest.languages.massrobotics.conformance_rules import Findings
from ingest.languages.massrobotics.parser import HOUR_S
from ingest.port.connection import Connection

_PATH_END, _STOPS_END = OF_PATH + 1, OF_DESTINATIONS + 1


@dataclass(slots=True, eq=False)
class Manner:
    """How a robot goes on."""

    robot: Robot
    connection: Connection
    words: Words
    view: View
    view_of: tuple[bool, str]
    """As the robot's: another load may be read in the same view."""
    basis: Basis
    """Of its forecasts: stationary, or by path or velocity."""
    most_knots: int
    """Of a forecast that is not by path."""
    floor: int
    table: Floats
    """Of the transformation to its floor."""
    limits: Floats
    """As `go_on` has them."""
    found: tuple[str, ...]
    """In each of its messages, whatever their times and the number of their points."""

    def is_over(self, connection: Connection) -> bool:
        """Whether it goes on over that connection, and is read as before."""
        robot = self.robot
        return self.connection is connection and robot.view is self.view and robot.view_of is self.view_of

    def onward(self, told: Letters, event_s: float) -> tuple[str, ...] | None:
        """Put the robot where it is and forecast it from there; the findings, or None where it does not go on so."""
        robot, before, at = self.robot, self.robot.seen, told.at
        if before is None or before.floor != self.floor:
            return None
        first_point, end_of_path = at[OF_PATH], at[_PATH_END]
        first_stop, end_of_stops = at[OF_DESTINATIONS], at[_STOPS_END]
        room = max(end_of_path - first_point + 1, self.most_knots)
        rows = np.empty((room + end_of_stops - first_stop, 4))
        knots, ahead, odd, x_m, y_m, yaw_rad, linear_mps, turn_radps, z_m, stamp_s = go_on(
            told.rows,
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
        robot.state, robot.known_state, robot.doubt_m = self.words.state, self.words.known_state, 0.0
        robot.battery_pct, run_time_left_h = told.rows.item(2, 0), told.rows.item(2, 1)
        robot.run_time_left_s = run_time_left_h * HOUR_S
        robot.seen = Sighting(event_s, self.floor, x_m, y_m, yaw_rad, linear_mps, turn_radps, event_s - stamp_s)
        robot.forecast = Forecast(self.basis, rows[:knots], (self.floor,) * knots, *size(self.view.body, z_m))
        robot.stops = rows[room : room + ahead] if ahead else NO_STOPS
        return self._found_in(told, stamp_s) if odd else self.found

    def _found_in(self, told: Letters, stamp_s: float) -> tuple[str, ...]:
        findings: Findings = dict.fromkeys(self.found)
        at, (first_s, last_s, _, latest_s) = told.at, told.rows[3].tolist()
        if self.words.path:
            path_points.judge_path(at[_PATH_END] - at[OF_PATH], (first_s, last_s), stamp_s, findings)
        if self.words.destinations:
            stops = at[_STOPS_END] - at[OF_DESTINATIONS]
            path_points.judge_destinations(stops, latest_s, stamp_s, findings)
        return tuple(findings)


def manner(robot: Robot, told: Letters, connection: Connection, names_as_uuid: str | None) -> Manner | None:
    """How a robot goes on whose view is of such a status; None where each has to be looked at closely."""
    said, view = told.words, robot.view
    basis = _basis(said)
    if view is None or robot.view_of[1] != said.datum or basis is None:
        return None
    frame, floor = view.frame_of("")
    path_frame, path_floor = view.frame_of(said.path[0]) if basis is Basis.PATH and said.path else (frame, floor)
    stops_frame, stops_floor = view.frame_of(said.destinations[0]) if said.destinations else (frame, floor)
    if floor == NOWHERE or path_floor != floor or not _alike(frame, path_frame, stops_frame):
        return None
    limits = np.array([basis, robot.view_of[0], frame.mirrored, stops_floor, *_limits(view)], np.float64)
    table = frame.transform.table if frame.transform else AS_IT_IS
    most_knots = ceil(view.reading.horizon_s) + 1 if basis is Basis.VELOCITY else 1
    found = _found(told, frame, names_as_uuid)
    return Manner(robot, connection, said, view, robot.view_of, basis, most_knots, floor, table, limits, found)


def _basis(said: Words) -> Basis | None:
    """Of the forecasts of a robot that says so, where it says its speed too; None where that takes a closer look."""
    if said.state == "navigating" and not said.path:
        return None if said.destinations else Basis.VELOCITY
    if said.state == "manualOverride" or (said.state == "idle" and said.path):
        return None
    return Basis.PATH if said.state == "navigating" else Basis.STATIONARY


def _alike(frame: Frame, *others: Frame) -> bool:
    return frame.projection is None and all(
        one.projection is None and one.transform is frame.transform for one in others
    )


def _limits(view: View) -> tuple[float, ...]:
    """Those of `go_on` that the view and the rules give."""
    body, reading = view.body, view.reading
    return (
        *body.offset_m,
        jump_mps(body),
        JUMP_SLACK_M,
        reading.horizon_s,
        reading.quiet_after_s,
        reading.destination_horizon_s,
        path_points.MOST_POINTS,
        path_points.PATH_S,
        path_points.DESTINATIONS_S,
        path_points.SLACK_S,
        plausibility.COMPARABLE_S,
        plausibility.MOVED_M,
        ownership_claims.JUMP_M,
        plausibility.MAX_TURN_RADPS,
        plausibility.SLOW_TURN_RAD,
    )


def _found(told: Letters, frame: Frame, names_as_uuid: str | None) -> tuple[str, ...]:
    findings: Findings = {}
    vocabulary.robot_uuid(told.uuid.decode(), names_as_uuid, findings)
    said = told.words
    for found in (said.found, *(part[1] for part in (said.destinations, said.path) if part)):
        findings.update(dict.fromkeys(found))
    if not frame.known:
        findings["datum-unknown"] = None
    return tuple(findings)
