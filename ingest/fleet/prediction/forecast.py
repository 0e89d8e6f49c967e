"""The forecast of one robot from its status, in the frame of its floor.

The operational state decides what the forecast rests on. A navigating robot follows its path; without a usable path,
its velocity. One that does not drive heads for its next destination if it may be about to, see `_sets_off`; so does one
without a speed. In the states idle, charging, waiting, disabled, offline and unknown a robot stands where it is.
One exception is an idle robot whose path has times ahead and leads away: it says when it sets out. Manual mode is not
subject to the standard (section 1), so its path and destinations are not used, only its measured velocity. The position
of a robot with a lost error may be off by `lost_doubt_m`.

Motion that is reported counts for more than what a robot says of itself. One that drives goes on, whatever its state
and its errors; one that stands with a blocking error is an obstacle. Where its path ends before the horizon it goes on
as it was going, unless it says that it stops there.
"""

import re
from collections.abc import Sequence
from functools import lru_cache
from itertools import chain, pairwise
from math import atan2, ceil, cos, hypot, inf, isnan, nan, sin
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from ingest.batch import Basis, Floats
from ingest.fleet.prediction.envelope import lacks_heading, with_envelope
from ingest.fleet.prediction.forecast_model import (
    NO_STOPS,
    Forecast,
    ForecastContext,
    Knot,
    Route,
    Sighting,
)
from ingest.fleet.prediction.pace import LEAST_SPEED, Paces, allowance
from ingest.fleet.prediction.path_forecast import knot_at, on_floors, route_by_path
from ingest.fleet.prediction.plausibility import REGULAR_S
from ingest.fleet.prediction.way_on import (
    AWAY_M,
    SHORT_BY_S,
    THERE_M,
    driven_to,
    end_of,
    is_behind,
    is_passed,
    lets_stand,
    way_on,
)
from ingest.frames.assumed_motion import DRIVES_MPS, MOVING_MPS, TURNS_RADPS
from ingest.languages.model import Status

NO_LETTERS = re.compile(r"[\W_]+")
SETS_OFF_S = 3.0
"""A robot that has a destination and stands sets off again, or begins to drive, within this time, or it is held up. So
does one that reports what blocks robots and says that it drives."""


def forecast(status: Status, here: Sighting, context: ForecastContext, paces: Paces) -> Forecast:
    """The forecast of a robot seen at `here`, with the deviations of its path."""
    findings: list[str] = []
    basis, (knots, floors) = _Route(status, here, context, paces, findings).chosen()
    return with_envelope(basis, knots, floors, context.body, status.z, tuple(findings))


def stops(status: Status, here: Sighting, context: ForecastContext) -> Floats:
    """The destinations ahead in the order of their times: (m, 4) t_s, x_m, y_m and floor index.

    Empty in manual mode. A destination whose time is past stays: the robot is late for it.
    """
    if not status.destinations.datums or status.state == "manualOverride":
        return NO_STOPS
    latest_s = here.t_s + context.reading.destination_horizon_s
    groups = on_floors(status.destinations, here, context)
    rows = [(t_s, x_m, y_m, floor) for floor, points in groups for t_s, x_m, y_m, _ in points if t_s <= latest_s]
    return np.array(rows, np.float64) if rows else NO_STOPS


def matches(codes: tuple[str, ...], parts: tuple[str, ...]) -> bool:
    """Whether an error code contains one of the parts. Case, hyphens and underscores are ignored."""
    if not codes:
        return False
    plain_codes = _plain_texts(codes)
    return any(part in code for part in _plain_texts(parts) for code in plain_codes)


@lru_cache(maxsize=256)
def _plain_texts(texts: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(NO_LETTERS.sub("", text.casefold()) for text in texts)


def until_s(here: Sighting, context: ForecastContext) -> float:
    """How far a forecast reaches that has no end of its own: the horizon, from the next report on if those are rare,
    and from the last message on if the pose is older."""
    late_s = here.interval_s if here.interval_s > REGULAR_S else 0.0
    last_s = here.t_s if isnan(here.repeated_s) else here.repeated_s
    return last_s + context.reading.horizon_s + late_s


class _Route(NamedTuple):
    """What the route of a robot is chosen from."""

    status: Status
    here: Sighting
    context: ForecastContext
    paces: Paces
    findings: list[str]

    def chosen(self) -> tuple[Basis, Route]:
        status, here = self.status, self.here
        drives = here.is_driving or here.is_turning
        has_error = matches(status.error_codes, self.context.reading.blocking_errors)
        is_stuck = status.is_hindered and here.standing_s > SETS_OFF_S
        if drives or not (status.is_blocked or is_stuck or has_error):
            if status.state == "manualOverride":
                if (here.linear_mps or here.is_turning) and not isnan(here.yaw_rad):
                    return Basis.VELOCITY, self._by_velocity()
            elif status.state == "navigating" or (drives and self._is_overruled()):
                return self._navigating()
            elif status.state == "idle" and (route := self._departure()):
                return status.path_basis, route
        return Basis.STATIONARY, _standing(here)

    def _is_overruled(self) -> bool:
        """Whether a state in which robots stand counts for less than the motion.

        Without a stated speed it must have had this state before it moved: a robot that has just arrived moved, too.
        """
        states_speed = self.status.linear_mps is not None
        return states_speed or not self.status.known_state or self.here.moves_anyway or self.here.is_turning

    def _navigating(self) -> tuple[Basis, Route]:
        status, here = self.status, self.here
        if route := route_by_path(status.path, here, self.context, self.paces, self.findings):
            knots = _with_headings(route[0])
            if not self._turns_at(knots):
                return status.path_basis, self._beyond(knots, route[1])
            return Basis.VELOCITY, self._by_velocity()
        has_speed = here.linear_mps is not None and not isnan(here.yaw_rad)
        is_moving = abs(here.linear_mps or 0.0) > MOVING_MPS
        stays = here.linear_mps is not None and not is_moving and not self._sets_off()
        if has_speed and (is_moving or stays):
            return Basis.VELOCITY, self._by_velocity()
        if not stays and (towards := self._by_destination()) and not (len(towards[0]) == 1 and here.turn_radps):
            return Basis.DESTINATION, towards
        if has_speed and here.turn_radps:
            return Basis.VELOCITY, self._by_velocity()
        return Basis.STATIONARY, _standing(here)

    def _sets_off(self) -> bool:
        """Whether a robot that does not drive is to head for a destination.

        One that is held up stands while it stands, unless its times let it stand: a destination without a time does not
        say when. One that turns is on its way, and at a destination it turns as that says.
        """
        if not (stops := self._destinations()):
            return False
        here, (_, x, y, _) = self.here, stops[0]
        is_held_up = here.standing_s > SETS_OFF_S and abs(here.turn_radps) <= TURNS_RADPS
        if not is_held_up or hypot(x - here.x_m, y - here.y_m) <= AWAY_M:
            return True
        return lets_stand(knot_at(here), stops[0], self._usual_mps)

    def _turns_at(self, knots: Sequence[Knot]) -> bool:
        """Whether the robot turns on the spot, while its path says only that it stands there."""
        here = self.here
        is_turning = abs(here.turn_radps) > TURNS_RADPS and abs(here.linear_mps or 0.0) <= DRIVES_MPS
        return is_turning and all(
            hypot(x - here.x_m, y - here.y_m) <= AWAY_M and yaw_rad == here.yaw_rad for _, x, y, yaw_rad in knots
        )

    def _departure(self) -> Route | None:
        """The route of an idle robot by its path. None unless the path leads away and its own times say when."""
        path_findings: list[str] = []
        route = route_by_path(self.status.path, self.here, self.context, self.paces, path_findings)
        if route is None or "path-retimed" in path_findings:
            return None
        knots, floors = route
        if max(hypot(x - self.here.x_m, y - self.here.y_m) for _, x, y, _ in knots) <= AWAY_M:
            return None
        self.findings.extend(path_findings)
        return self._beyond(_with_headings(knots), floors)

    def _by_velocity(self) -> Route:
        """Constant speed and turn rate. An arc gets a knot for each second, since motion is linear between knots."""
        here, until = self.here, until_s(self.here, self.context)
        speed_mps, way_rad = here.linear_mps or 0.0, here.way_rad
        if abs(here.turn_radps) > 1e-3:
            return _arc(here, self.context.reading.horizon_s)
        stops = self._destinations() if abs(speed_mps) > MOVING_MPS and not here.sideways_rad else []
        if stops and _is_on_way(here, here.direction_rad, stops[0]):
            end = way_on(knot_at(here), here.direction_rad, abs(speed_mps), stops[0], until, self.paces.turn_radps)
            knots = self._through([knot_at(here), *end], stops, abs(speed_mps))
            return knots, (here.floor,) * len(knots)
        reach_m = speed_mps * (until - here.t_s)
        end_x, end_y = here.x_m + reach_m * cos(way_rad), here.y_m + reach_m * sin(way_rad)
        return (knot_at(here), (until, end_x, end_y, here.yaw_rad)), (here.floor,) * 2

    def _beyond(self, knots: Sequence[Knot], floors: tuple[int, ...]) -> Route:
        """A route that ends before the horizon, or before half of it after the robot's next report, and how the robot
        goes on."""
        here, end, horizon_s = self.here, knots[-1], self.context.reading.horizon_s
        short = end[0] < here.t_s + max(horizon_s, here.interval_s + horizon_s / 2) - SHORT_BY_S
        if not short or self.status.path.ends_in_stop or set(floors) != {here.floor} or isnan(end[3]):
            return knots, floors
        stops = self._destinations()
        destination = stops[0] if stops else None
        going = end_of(knots, abs(here.linear_mps or 0.0), destination)
        if going is None:
            return knots, floors
        mps = max(min(going.mps, self.context.body.max_speed_mps or inf), LEAST_SPEED)
        if here.is_driving:
            self.paces.pace.expect_beyond_path(end, going.direction_rad, mps)
        mps *= self.paces.beyond_share
        until = until_s(here, self.context)
        further = way_on(end, going.direction_rad, mps, destination, until, self.paces.turn_radps)
        knots = self._through([*knots, *further], stops, mps)
        return knots, (*floors, *(here.floor,) * (len(knots) - len(floors)))

    def _through(self, knots: list[Knot], stops: Sequence[Knot], mps: float) -> list[Knot]:
        """The knots, and how the robot goes on where they end at a destination at which its times leave no stop.

        `stops` are its destinations.
        """
        for stop, following in pairwise(stops):
            end = knots[-1]
            is_there = hypot(stop[1] - end[1], stop[2] - end[2]) <= THERE_M
            if end[0] >= until_s(self.here, self.context) or not (is_there and is_passed(stop, following, mps)):
                break
            knots = [*knots, *driven_to(end, following, mps, self.paces.turn_radps)[1:]]
        return knots

    def _destinations(self) -> list[Knot]:
        """The destinations on this floor in the order of their times, without those that the robot has passed."""
        if not self.status.destinations.datums or self.status.state == "manualOverride":
            return []
        latest_s = self.here.t_s + self.context.reading.destination_horizon_s
        groups = on_floors(self.status.destinations, self.here, self.context)
        on_this_floor = [points for floor, points in groups if floor == self.here.floor]
        reachable = [knot for knot in chain.from_iterable(on_this_floor) if knot[0] <= latest_s]
        ordered = sorted(reachable, key=itemgetter(0))
        while len(ordered) > 1 and is_behind(ordered[0], ordered[1], self.here):
            ordered.pop(0)
        return ordered

    @property
    def _usual_mps(self) -> float:
        """Its pace where nothing is said of the way."""
        return self.paces.of(allowance(self.context.body.max_speed_mps or inf))

    def _by_destination(self) -> Route | None:
        """Straight to the next destination on this floor, at the time it states or at the robot's pace."""
        if not (stops := self._destinations()):
            return None
        here, destination = self.here, stops[0]
        mps = self._usual_mps
        knots = driven_to(knot_at(here), destination, mps, self.paces.turn_radps)
        if len(knots) < 2:
            return _standing(here)
        if destination[0] > here.t_s:
            share = (destination[0] - here.t_s) / (knots[-1][0] - here.t_s)
            knots = [(here.t_s + share * (t_s - here.t_s), x, y, yaw_rad) for t_s, x, y, yaw_rad in knots]
        knots = list(_with_headings(self._through(knots, stops, mps)))
        return knots, (here.floor,) * len(knots)


def _standing(here: Sighting) -> Route:
    return (knot_at(here),), (here.floor,)


def _is_on_way(here: Sighting, direction_rad: float, destination: Knot) -> bool:
    """Whether a destination lies ahead of a robot that drives straight on, within `THERE_M` beside its way."""
    dx, dy = destination[1] - here.x_m, destination[2] - here.y_m
    return abs(dy * cos(direction_rad) - dx * sin(direction_rad)) <= THERE_M


def _arc(here: Sighting, horizon_s: float) -> Route:
    steps, radius_m, way_rad = ceil(horizon_s), (here.linear_mps or 0.0) / here.turn_radps, here.way_rad
    knots = []
    for step in range(steps + 1):
        t_s = horizon_s * step / steps
        turned_rad = here.turn_radps * t_s
        x_m = here.x_m + radius_m * (sin(way_rad + turned_rad) - sin(way_rad))
        y_m = here.y_m - radius_m * (cos(way_rad + turned_rad) - cos(way_rad))
        knots.append((here.t_s + t_s, x_m, y_m, here.yaw_rad + turned_rad))
    return knots, (here.floor,) * (steps + 1)


def _with_headings(knots: Sequence[Knot]) -> Sequence[Knot]:
    """Replace unknown headings by the direction of travel. The headings of a robot that does not move stay nan."""
    if not lacks_heading(knots):
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
