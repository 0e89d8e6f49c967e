"""The forecast of one robot from its status, in the frame of its floor.

The operational state decides what the forecast rests on. A navigating robot follows its path; without a usable path,
its velocity; without that, it heads for its next destination. In the states idle, charging, waiting, disabled, offline
and unknown a robot stands where it is. One exception is an idle robot whose path has times ahead and leads away: it
says when it sets out. Manual mode is not subject to the standard (section 1), so its path and destinations are not
used, only its measured velocity. A robot with a blocking error is an obstacle where it stands. The position of a robot
with a lost error may be off by `lost_doubt_m`.
"""

import re
from collections.abc import Sequence
from functools import lru_cache
from itertools import chain
from math import atan2, ceil, cos, hypot, isnan, nan, sin
from operator import itemgetter

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
from ingest.fleet.prediction.path_forecast import MOVING_MPS, knot_at, on_floors, route_by_path
from ingest.languages.model import Path, Status

DESTINATION_SPEED_MPS = 1.0
"""Assumed towards a destination without a usable time, if the robot's greatest speed is not known."""
NO_LETTERS = re.compile(r"[\W_]+")
AWAY_M = 0.1
"""An idle robot whose path leads no further than this stands."""


def forecast(status: Status, here: Sighting, context: ForecastContext) -> Forecast:
    """The forecast of a robot seen at `here`, with the deviations of its path."""
    findings: list[str] = []
    basis, (knots, floors) = _route(status, here, context, findings)
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


def _route(status: Status, here: Sighting, context: ForecastContext, findings: list[str]) -> tuple[Basis, Route]:
    if not (status.is_blocked or matches(status.error_codes, context.reading.blocking_errors)):
        if status.state == "navigating":
            return _navigating(status, here, context, findings)
        if status.state == "idle" and (route := _departure(status.path, here, context, findings)):
            return status.path_basis, route
        if status.state == "manualOverride" and here.linear_mps and not isnan(here.yaw_rad):
            return Basis.VELOCITY, _by_velocity(here, context.reading.horizon_s)
    return Basis.STATIONARY, _standing(here)


def _standing(here: Sighting) -> Route:
    return (knot_at(here),), (here.floor,)


def _navigating(status: Status, here: Sighting, context: ForecastContext, findings: list[str]) -> tuple[Basis, Route]:
    route = route_by_path(status.path, here, context, findings)
    if route:
        return status.path_basis, (_with_headings(route[0]), route[1])
    moving = (
        here.linear_mps is not None
        and not isnan(here.yaw_rad)
        and (abs(here.linear_mps) > MOVING_MPS or not status.destinations.datums)
    )
    if moving:
        return Basis.VELOCITY, _by_velocity(here, context.reading.horizon_s)
    towards = _by_destination(status.destinations, here, context)
    if towards:
        return Basis.DESTINATION, towards
    return Basis.STATIONARY, _standing(here)


def _departure(path: Path, here: Sighting, context: ForecastContext, findings: list[str]) -> Route | None:
    """The route of an idle robot by its path. None unless the path leads away and its own times say when."""
    path_findings: list[str] = []
    route = route_by_path(path, here, context, path_findings)
    if route is None or "path-retimed" in path_findings:
        return None
    knots, floors = route
    if max(hypot(x - here.x_m, y - here.y_m) for _, x, y, _ in knots) <= AWAY_M:
        return None
    findings += path_findings
    return _with_headings(knots), floors


def _by_velocity(here: Sighting, horizon_s: float) -> Route:
    """Constant speed and turn rate. An arc gets a knot for each second, since motion is linear between knots."""
    speed_mps, heading = here.linear_mps or 0.0, here.yaw_rad
    if abs(here.turn_radps) <= 1e-3:
        reach_m = speed_mps * horizon_s
        end = here.t_s + horizon_s, here.x_m + reach_m * cos(heading), here.y_m + reach_m * sin(heading), heading
        return (knot_at(here), end), (here.floor,) * 2
    steps, radius_m = ceil(horizon_s), speed_mps / here.turn_radps
    knots = []
    for step in range(steps + 1):
        t_s = horizon_s * step / steps
        yaw_rad = heading + here.turn_radps * t_s
        x_m = here.x_m + radius_m * (sin(yaw_rad) - sin(heading))
        y_m = here.y_m - radius_m * (cos(yaw_rad) - cos(heading))
        knots.append((here.t_s + t_s, x_m, y_m, yaw_rad))
    return knots, (here.floor,) * (steps + 1)


def _by_destination(destinations: Path, here: Sighting, context: ForecastContext) -> Route | None:
    """Straight to the next destination on this floor, at the time it states or at the robot's speed."""
    latest_s = here.t_s + context.reading.destination_horizon_s
    on_this_floor = [points for floor, points in on_floors(destinations, here, context) if floor == here.floor]
    reachable = [knot for knot in chain.from_iterable(on_this_floor) if knot[0] <= latest_s]
    if not reachable:
        return None
    t_s, x_m, y_m, yaw_rad = min(reachable, key=itemgetter(0))
    if t_s <= here.t_s:
        distance_m = hypot(x_m - here.x_m, y_m - here.y_m)
        t_s = here.t_s + max(distance_m / (context.body.max_speed_mps or DESTINATION_SPEED_MPS), 1e-3)
    return _with_headings([knot_at(here), (t_s, x_m, y_m, yaw_rad)]), (here.floor, here.floor)


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
