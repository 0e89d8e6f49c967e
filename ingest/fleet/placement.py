"""Where a robot is on its floor, and where it will be."""

from collections.abc import Sequence
from functools import lru_cache, partial
from math import hypot, isfinite, isinf, isnan, nan
from typing import TYPE_CHECKING

from msgspec.structs import replace

from ingest.batch import Basis
from ingest.fleet.owners.device_kinds import participant_of
from ingest.fleet.owners.vendor_registry import VendorRegistry
from ingest.fleet.prediction import heading_sense, plausibility
from ingest.fleet.prediction.forecast import forecast, matches, stops
from ingest.fleet.prediction.forecast_model import (
    ForecastContext,
    RobotBody,
    Sighting,
    reported_body,
    robot_body,
    with_load,
)
from ingest.fleet.prediction.pace import PaceBook, Paces
from ingest.fleet.prediction.path_forecast import leads_elsewhere
from ingest.fleet.prediction.position_unit import unit_moves
from ingest.fleet.robot import Robot
from ingest.frames.floor_index import NOWHERE, FloorIndex
from ingest.frames.frame_registry import LONGEST_NAME, Frame, FrameRegistry
from ingest.frames.towing import towed_along
from ingest.languages.model import NO_PATH, Rejection, Status
from ingest.languages.rules import MOST_LETTERS, POSITION_IN_OTHER_UNIT, Oddity
from ingest.settings import Reading
from ingest.shapes import Shape
from ingest.sizes.model_sizes import ModelSizes
from ingest.sizes.site_sizes import site_figures
from ingest.sizes.stated_bodies import BodyReading, read_body
from ingest.sizes.stated_loads import NO_LOADS, StatedLoad, read_loads

if TYPE_CHECKING:  # a receiver starts without numba
    from ingest.fast_path.status_scanner import ScannedStatus

BEGUN_S = 1.0
"""A path of a robot that sends no stamp may have begun so long ago, for it should be renewed once a second."""
ASTRAY_M = 3.0
"""A robot that has driven so far elsewhere than its order leads is not on that way. At corners it is for less."""
MAX_CONTEXTS = 1024
"""Forecast contexts that are kept. Robots of one kind share one."""
TRAILERS_STRAIGHT_M = 10.0
"""After a robot was seen this much further on, its trailers are taken to be straight behind it."""


class Placement:
    """Places robots on their floors and forecasts them, by the settings of the site."""

    def __init__(self, vendors: VendorRegistry, frames: FrameRegistry, reading: Reading) -> None:
        self._vendors, self._frames, self._reading = vendors, frames, reading
        self._floors = FloorIndex(frames)
        self.model_sizes = ModelSizes()
        """What robots of one model state of their sizes."""
        self._pace_book = PaceBook()
        self._shared_context = lru_cache(MAX_CONTEXTS)(self._new_context)

    @property
    def floor_ids(self) -> tuple[str, ...]:
        """The id of each floor, by its index."""
        return self._floors.ids

    def reconfigure(self, vendors: VendorRegistry, frames: FrameRegistry, reading: Reading) -> None:
        """Use other settings from now on. The caller resets the context of each robot."""
        self._vendors, self._frames, self._reading = vendors, frames, reading
        self._floors.reconfigure(frames)
        self._shared_context.cache_clear()

    def event_time(
        self, robot: Robot, status: "Status | ScannedStatus", raw: bytes, arrival_s: float
    ) -> tuple[float, tuple[str, ...]]:
        """When the pose of a status was true, by the sender's corrected clock, and the deviations.

        A status without a stamp has no resolution of it either, and counts from its arrival. So does another one than
        the last if its stamp has come for longer than `STALE_S`: the clock stands. The same one is not older than that.
        """
        findings: tuple[str, ...] = () if robot.identity else ("identity-missing",)
        resolution_s, clock = status.stamp_resolution_s, robot.clock
        if isinf(resolution_s):
            return arrival_s, findings
        is_repeated = status.stamp_s == clock.stamp_s and raw == robot.status_raw
        event_s = clock.event_time(status.stamp_s, arrival_s, resolution_s, is_repeated=is_repeated)
        if clock.stands_s > plausibility.STALE_S + resolution_s:
            if raw != robot.status_raw:
                return arrival_s, (*findings, "stamp-unchanged")
            event_s = max(event_s, robot.seen.t_s) if robot.seen else event_s
        return event_s, findings + plausibility.clock(robot.clock, self._reading.clock_tolerance_s, resolution_s)

    def rejection(self, status: Status, vendor: str) -> Rejection | None:
        """Why the location of a status in degrees is no place on Earth. None if it is one."""
        frame = self._frames.frame(vendor, status.datum)
        if frame.projection is None:
            return None
        x_m, y_m, _ = frame.pose(status.x, status.y, 0.0)
        if isfinite(x_m) and isfinite(y_m):
            return None
        reason = f"location {status.x}, {status.y} is nowhere on datum {status.datum}; check units and order"
        return Rejection("position-absurd", reason)

    def forecast_again(self, robot: Robot, names_as_uuid: str | None) -> bool:
        """Forecast the robot from its last status, with its present identity. Returns whether it has one."""
        status = robot.newest_status(names_as_uuid) if robot.seen else None
        if not (robot.seen and status):
            return False
        seen = robot.seen
        frame, sighting = self.sighting(robot, status, seen.t_s)
        sighting = replace(
            sighting, clock_offset_s=seen.clock_offset_s, posed_s=seen.posed_s, repeated_s=seen.repeated_s
        )
        self.forecast(robot, status, frame, sighting, robot.before)
        return True

    def is_in_degrees(self, message: object) -> bool:
        """Whether the message is a status on a datum in degrees, so that its location may be no place on Earth."""
        return isinstance(message, Status) and self._frames.is_in_degrees(message.datum)

    def sighting(self, robot: Robot, status: Status, event_s: float) -> tuple[Frame, Sighting]:
        """Where the status puts the robot, in the floor's frame. A left-handed map reverses the turn rate.

        The stamp of a status that sent none is the time at which its path begins. If that is within the horizon, it
        holds; else the path begins now.
        """
        frame, floor = self._floors.of(robot.vendor, status.datum)
        x_m, y_m, yaw_rad = frame.pose(status.x, status.y, status.yaw_rad)
        turn_radps = nan if status.turn_rad_per_s is None else status.turn_rad_per_s
        sideways_rad = 0.0 if isnan(yaw_rad) else status.sideways_rad
        if frame.mirrored and (turn_radps or sideways_rad):
            turn_radps, sideways_rad = 0.0 - turn_radps, 0.0 - sideways_rad
        offset_s = event_s - status.stamp_s
        if isinf(status.stamp_resolution_s):
            ahead_s = robot.clock.offset_s - offset_s
            is_near = -BEGUN_S <= ahead_s <= self._reading.horizon_s
            offset_s = robot.clock.offset_s if is_near else offset_s
        motion = status.linear_mps, turn_radps, offset_s
        now = Sighting(event_s, floor, x_m, y_m, yaw_rad, *motion, state=status.state, sideways_rad=sideways_rad)
        return frame, robot.held.as_of_pose(robot.seen, now)

    def forecast(
        self, robot: Robot, status: Status, frame: Frame, sighting: Sighting, before: Sighting | None
    ) -> tuple[str, ...]:
        """Put the robot at `sighting`, reconciled with `before`, and forecast it from there. Returns the deviations."""
        datum = status.datum[: LONGEST_NAME + 1]  # an overlong name stays one
        context = self._context(robot, status.amounts.load_used_pct > 0.0, datum, status.loads)
        robot.frame = frame
        last = robot.seen
        robot.before = before or robot.before
        robot.seen, findings = plausibility.reconcile(before, sighting)
        may_stop = status.is_blocked and not robot.was_blocked
        is_gone = status.state == "offline" and last is not None and sighting.t_s == last.t_s
        if may_stop or is_gone:
            robot.seen = replace(robot.seen, is_driving=False, turned_rad=0.0)
        robot.was_blocked = status.is_blocked
        robot.pace.observe(robot.seen)
        robot.pace.kind = None
        status, unknown = self._on_own_floor(robot, status, last, context)
        robot.forecast = forecast(status, robot.seen, context, Paces(robot.pace, robot.seen))
        is_by_path = robot.forecast.basis is Basis.PATH and robot.seen.is_driving
        is_timed = robot.pace.path_share != 1.0 or "path-retimed" not in robot.forecast.findings
        is_by_path &= is_timed and not status.path.most
        robot.pace.follow(robot.forecast.knots, robot.seen.linear_mps, is_by_path=is_by_path)
        shape = robot.forecast.shape
        robot.trailer_yaws_rad = trailer_headings(shape, robot.trailer_yaws_rad, last, robot.seen)
        if shape and robot.trailer_yaws_rad:
            robot.forecast = replace(robot.forecast, shape=shape.with_headings(robot.trailer_yaws_rad))
        robot.stops = stops(status, robot.seen, context)
        is_lost = status.is_lost or matches(status.error_codes, self._reading.lost_errors)
        most_m = self._reading.lost_doubt_m
        robot.doubt_m = most_m if is_lost else min(status.deviation_m, most_m)
        robot.reports_within_s = status.reports_within_s
        unknown += () if frame.known else ("datum-unknown",)
        too_many = ("datum-too-many",) if frame.comparable and sighting.floor == NOWHERE else ()
        of_motion = self._motion_findings(robot, sighting, last, status)
        return (*findings, *of_motion, *robot.forecast.findings, *robot.loads.rules, *unknown, *too_many)

    def _on_own_floor(
        self, robot: Robot, status: Status, last: Sighting | None, context: ForecastContext
    ) -> tuple[Status, tuple[str, ...]]:
        """The status, without a way on a map that nobody has if that leads elsewhere than the robot has driven since
        `last` and before, and the deviations."""
        misspelling = self._floors.misspelling(robot.vendor, status.datum, status.path.datums)
        if not (misspelling and robot.seen):
            robot.astray_m = 0.0
            return status, ()
        seen, goes_astray = robot.seen, leads_elsewhere(status.path, robot.seen, context)
        moved_m = hypot(seen.x_m - last.x_m, seen.y_m - last.y_m) if last else 0.0
        robot.astray_m = robot.astray_m + moved_m if goes_astray else 0.0
        reading = "the robot's own floor; give the vendor a map for it"
        if robot.astray_m > ASTRAY_M:
            status = replace(status, path=NO_PATH, destinations=NO_PATH)
            reading = "not followed: it drives elsewhere; give the vendor a map"
        odd = Oddity("path-datum-unknown", "path", misspelling[:MOST_LETTERS], reading, status.datum[:LONGEST_NAME])
        robot.odd_values.note((odd,), robot.arrival_s)
        return status, ("path-datum-unknown",)

    def _motion_findings(
        self, robot: Robot, sighting: Sighting, last: Sighting | None, status: Status
    ) -> tuple[str, ...]:
        """The deviations of positions and headings that are meant otherwise, as a new sighting shows them."""
        if last and sighting.t_s <= last.t_s:
            return ()
        if robot.frame:
            robot.sense = heading_sense.sense(robot.sense, last, sighting, status, robot.frame)
        if reading := heading_sense.shown(robot.sense):
            odd = heading_sense.oddity(reading, status, robot.language)
            robot.odd_values.note((odd,), robot.arrival_s)
            return (odd.rule,)
        return self._unit_findings(robot, sighting, last)

    def _unit_findings(self, robot: Robot, sighting: Sighting, last: Sighting | None) -> tuple[str, ...]:
        max_speed_mps = robot.context.body.max_speed_mps if robot.context else None
        robot.unit_moves = unit_moves(robot.unit_moves, last, sighting, max_speed_mps)
        if not (robot.unit_moves and robot.unit_moves.shows_unit):
            return ()
        robot.odd_values.note((robot.unit_moves.oddity(robot.language),), robot.arrival_s)
        return (POSITION_IN_OTHER_UNIT,)

    def judge_size(self, robot: Robot) -> set[str]:
        """Judge the size in the robot's identity anew. Returns the UUIDs of other robots that this may explain."""
        robot.context, robot.size = None, self._size(robot)
        model = robot.identity.model if robot.identity else ""
        return self.model_sizes.note(robot.uuid, robot.vendor, model, robot.size) if robot.size else set()

    def _context(self, robot: Robot, loaded: bool, datum: str, loads: tuple[StatedLoad, ...]) -> ForecastContext:
        """The context in which a message of the robot is read. It seldom differs from the one before."""
        key = loaded, datum, loads
        if robot.context is None or robot.context_key != key:
            robot.context = self._shared_context(robot.vendor, datum, self._body(robot, loaded, loads))
            robot.context_key = key
            robot.participant = participant_of(self._vendors.settings(robot.vendor), robot.model, robot.uuid)
            robot.pace.of_model = self._pace_book.of_model(robot.vendor, robot.model)
        return robot.context

    def _new_context(self, vendor: str, datum: str, body: RobotBody) -> ForecastContext:
        return ForecastContext(body, partial(self._floors.of_own, vendor, datum), self._reading)

    def _body(self, robot: Robot, loaded: bool, loads: tuple[StatedLoad, ...]) -> RobotBody:
        robot.size, robot.loads = self._size(robot), NO_LOADS
        settings, model = self._vendors.settings(robot.vendor), self._vendors.model(robot.vendor, robot.model)
        max_speed_mps = robot.identity.max_speed_mps if robot.identity else None
        if robot.size:
            reported = reported_body(robot.size.body, max_speed_mps)
        else:
            usual_m = settings.default_envelope_m or self._reading.default_envelope_m
            reported = RobotBody(usual_m, max_speed_mps=max_speed_mps)
        body = robot_body(model, reported, loaded, None) if robot.identity else reported
        is_known = not (robot.size and robot.size.is_over_limit) or body.rectangle != reported.rectangle
        if not loads:
            return body
        shows_unit = body.rectangle if is_known else None
        robot.loads = read_loads(loads, shows_unit, body.rectangle, self._reading.largest_body_m)
        if (box := robot.loads.box) is None:
            return body
        return robot_body(model, reported, loaded, box) if robot.identity else with_load(body, box)

    def _size(self, robot: Robot) -> BodyReading | None:
        """How the size in the robot's identity is read. None without identity, or if that says none."""
        if (identity := robot.identity) is None or not identity.has_size:
            return None
        settings, model = self._vendors.settings(robot.vendor), self._vendors.model(robot.vendor, identity.model)
        others = self.model_sizes.figures(robot.vendor, identity.model)
        figures = (*identity.figures, *others, *site_figures(settings, model))
        return read_body(identity.body, figures, self._reading.largest_body_m)


def trailer_headings(
    shape: Shape | None, yaws_rad: Sequence[float], last: Sighting | None, seen: Sighting
) -> tuple[float, ...]:
    """The headings of the trailers of a robot that is at `seen` and was at `last`, where they were `yaws_rad`."""
    if shape is None or not shape.trailers:
        return ()
    if last is None or last.floor != seen.floor or len(yaws_rad) != len(shape.trailers):
        return (seen.yaw_rad,) * len(shape.trailers)
    dx_m, dy_m = seen.x_m - last.x_m, seen.y_m - last.y_m
    if hypot(dx_m, dy_m) > TRAILERS_STRAIGHT_M:
        return (seen.yaw_rad,) * len(shape.trailers)
    return tuple(towed_along(yaws_rad, [trailer.hitch_m for trailer in shape.trailers], dx_m, dy_m))
