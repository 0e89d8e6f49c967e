"""Headings in degrees, and positions with swapped or reversed axes, as moves show that contradict the heading.

One move shows nothing: robots are carried, and some drive sideways. Robots that drive at a constant angle to their
heading, whatever it is, fit a reading with axes changed at two headings across each other, and no third one.
"""

from collections.abc import Mapping
from math import atan2, degrees, hypot, isnan, pi, radians
from typing import NamedTuple

from ingest.fleet.prediction.forecast_model import Sighting
from ingest.fleet.prediction.plausibility import COMPARABLE_S, CORNER_RAD, MOVED_M
from ingest.frames.angles import turn_between
from ingest.frames.frame_registry import Frame
from ingest.languages.front_ends import MASSROBOTICS
from ingest.languages.model import Status
from ingest.languages.rules import AXES_CONTRADICT_MOTION, HEADING_IN_DEGREES, Oddity

FITS_RAD, APART_RAD = radians(10.0), radians(25.0)
"""A reading fits a move that is off by at most the first. Headings farther apart than the second are two."""
LEAST_MOVES = 6
"""Moves that a reading has to fit, without one between them that it does not fit."""
DEGREES, SWAPPED, REVERSED = "degrees", "swapped", "reversed"
LEAST_HEADINGS = {DEGREES: 2, SWAPPED: 3, REVERSED: 3}
HEADINGS = {MASSROBOTICS: "location.angle", "vda5050": "agvPosition.theta", "iso21423": "pose.orientation.yaw"}
"""The key that has the heading, by language."""
QUESTIONS = {
    DEGREES: "radians; the robot moves as if it were in degrees: is it? Send radians",
    SWAPPED: "kept; the robot moves as if x and y were swapped: are they? Else the heading turns from the wrong axis",
    REVERSED: "kept; the robot moves as if one axis, or the heading, were reversed: is it?",
}


class Fits(NamedTuple):
    """The moves that fit one reading."""

    moves: int
    headings_rad: tuple[float, ...]
    """Of these moves, as far as they differ."""


Sense = Mapping[str, Fits]
"""By reading; nothing of those that the last move did not fit."""


def sense(known: Sense, before: Sighting | None, now: Sighting, status: Status, frame: Frame) -> Sense:
    """What the moves up to `now` show of how the heading is meant. Moves along the heading show nothing."""
    gap_s = now.t_s - before.t_s if before and before.floor == now.floor else 0.0
    if before is None or not 0.0 < gap_s <= COMPARABLE_S or isnan(now.yaw_rad) or frame.projection:
        return known
    dx_m, dy_m = now.x_m - before.x_m, now.y_m - before.y_m
    travel_rad = atan2(dy_m, dx_m)
    off_rad = abs(turn_between(now.way_rad, travel_rad))
    is_backing = off_rad >= 3 * pi / 4 and (now.linear_mps is None or now.linear_mps < 0.0)
    if hypot(dx_m, dy_m) <= MOVED_M or off_rad <= pi / 4 or is_backing:
        return known
    turned_rad = 0.0 if isnan(before.yaw_rad) else turn_between(before.yaw_rad, now.yaw_rad)
    if abs(turned_rad) > CORNER_RAD:
        return known
    x_axis_rad = frame.pose(status.x, status.y, 0.0)[2]
    mirrored_rad = 2 * x_axis_rad - (now.yaw_rad - turned_rad / 2)
    meant_rad = {SWAPPED: mirrored_rad + pi / 2, REVERSED: mirrored_rad}
    if not isnan(status.heading_sent):
        meant_rad[DEGREES] = frame.pose(status.x, status.y, radians(status.heading_sent))[2]
    return {
        reading: _with_move(known.get(reading), reading, heading_rad if reading == DEGREES else now.yaw_rad)
        for reading, heading_rad in meant_rad.items()
        if _across(heading_rad, travel_rad) <= FITS_RAD
    }


def shown(found: Sense) -> str | None:
    """The reading that the moves show; None if they show none."""
    for reading, least in LEAST_HEADINGS.items():
        fits = found.get(reading)
        if fits and fits.moves >= LEAST_MOVES and len(fits.headings_rad) >= least:
            return reading
    return None


def oddity(reading: str, status: Status, language: str) -> Oddity:
    """What a person is shown of it."""
    rule = HEADING_IN_DEGREES if reading == DEGREES else AXES_CONTRADICT_MOTION
    sent = f"{status.heading_sent:.4g}" if reading == DEGREES else f"{degrees(status.yaw_rad):.0f} degrees"
    return Oddity(rule, HEADINGS.get(language, ""), sent, QUESTIONS[reading])


def _with_move(fits: Fits | None, reading: str, heading_rad: float) -> Fits:
    if fits is None:
        return Fits(1, (heading_rad,))
    apart = turn_between if reading == DEGREES else _across
    is_new = all(abs(apart(heading_rad, other_rad)) > APART_RAD for other_rad in fits.headings_rad)
    return Fits(fits.moves + 1, (*fits.headings_rad, heading_rad) if is_new else fits.headings_rad)


def _across(a_rad: float, b_rad: float) -> float:
    """How far two headings are apart, forwards or backwards."""
    apart_rad = abs(turn_between(a_rad, b_rad))
    return min(apart_rad, pi - apart_rad)
