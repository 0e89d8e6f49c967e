"""The place, closing speed and class of a predicted encounter of two robots."""

from dataclasses import dataclass
from math import atan2, cos, hypot, inf, isnan, nan, pi, sin
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray
from shapely import Polygon

from deconflict.sweep.geometry.knots import KNOT, ROBOT, Knots, Robots
from deconflict.sweep.geometry.pose import COLUMNS, Columns, Moving, Pose, columns_of, moving, pose_at
from deconflict_client.advisory import EncounterClass
from ingest.batch import Floats, Forecasts, Ints
from ingest.frames.angles import turn_between
from ingest.kernels import FLOAT, FLOATS, INTS, inner, kernel

STANDING_MPS = 0.05
"""A slower robot stands."""
FOLLOWING_RAD = pi / 4
"""Two robots follow each other if their directions of travel differ by less than this. They meet head-on if one
direction is within this of the opposite of the other."""
SAME_M = 1e-9
"""Distances that differ by less count as equal."""

Row = tuple[Forecasts, int]
"""Forecasts, and the row of one robot in them."""
Box = tuple[float, float, float, float, float, float]
"""A rectangle: x and y of its centre, cosine and sine of its heading, half its length and half its width."""

_STANDING, _FOLLOWING, _CROSSING, _HEAD_ON = range(4)
CLASSES = (
    EncounterClass.STATIONARY_OBSTACLE,
    EncounterClass.FOLLOWING,
    EncounterClass.CROSSING,
    EncounterClass.HEAD_ON,
)
ENCOUNTER = np.dtype(
    [
        ("x", np.float64),  # place between the two robots, metres in the frame of the floor; nan if unknown
        ("y", np.float64),
        ("kind", np.int64),  # index of the class in `CLASSES`, -1 if unknown
        ("floor", np.int64),  # of the first robot, -1 if unknown
    ]
)
"""The encounter of one pair."""

Encounters = NDArray[Any]
"""(n,) of `ENCOUNTER`."""

_KNOWN = (*(numba.from_dtype(dtype)[::1] for dtype in (ROBOT, KNOT)), FLOATS)
"""Robots by slot, their knots, and how much longer and wider than reported each envelope is."""


_turn_between, _moving = inner(turn_between), inner(moving)


@dataclass(frozen=True, slots=True)
class Encounter:
    """The moment two envelopes first come within the clearance."""

    encounter_class: EncounterClass
    closing_speed_mps: float
    """Of the centres; negative if they draw apart."""
    x_m: float
    """Place between the two envelopes, in the frame of the floor."""
    y_m: float
    floor: int
    """Index of the first robot's floor."""


def encounter(a: Row, b: Row, contact_s: float) -> Encounter:
    """The encounter of two robots at `contact_s`. Its place is midway between the nearest points of their envelopes.

    If there are several such places, or if the envelopes overlap, it is the mean of the places. If they overlap and
    neither has a corner in the other, it is the centroid of their common area.
    """
    _, x_m, y_m, closing_mps, kind, floor, _ = _met(columns_of(*a), columns_of(*b), contact_s)
    if isnan(x_m):
        x_m, y_m = _shared(a, b, contact_s)
    return Encounter(CLASSES[kind], closing_mps, x_m, y_m, floor)


def separation_m(a: Row, b: Row, t_s: float) -> float | None:
    """Distance of the two envelopes at `t_s`, 0 if they overlap; None if they are on different floors."""
    distance_m, *_, floor_a, floor_b = _met(columns_of(*a), columns_of(*b), t_s)
    return None if floor_a != floor_b or floor_a < 0 else distance_m


def envelope(forecast: Forecasts, pose: Pose) -> Polygon:
    """The rectangle of one robot at `pose`."""
    c, s = cos(pose.yaw_rad), sin(pose.yaw_rad)
    half_l, half_w = float(forecast.length_m[0]) / 2, float(forecast.width_m[0]) / 2
    corners = ((half_l, half_w), (-half_l, half_w), (-half_l, -half_w), (half_l, -half_w))
    return Polygon([(pose.x_m + c * u - s * v, pose.y_m + s * u + c * v) for u, v in corners])


def _shared(a: Row, b: Row, t_s: float) -> tuple[float, float]:
    """The centroid of the common area of two envelopes."""
    robots = [forecasts.single(row) for forecasts, row in (a, b)]
    envelope_a, envelope_b = (envelope(robot, pose_at(robot, t_s)) for robot in robots)
    middle = envelope_a.intersection(envelope_b).centroid
    return middle.x, middle.y


@inner
def _box(at: Moving, columns: Columns) -> Box:
    _, _, _, _, _, _, length_m, width_m, row = columns
    return at[0], at[1], cos(at[2]), sin(at[2]), length_m[row] / 2, width_m[row] / 2


@inner
def _from_corner(box: Box, other: Box, corner: int) -> tuple[float, float, float, float, float, float]:
    """A corner of `other` in the frame of `box`; the vector from that corner to `box` in the same frame; and the point
    midway, in the frame of the floor."""
    x, y, c, s, half_length, half_width = other
    along = half_length if corner in (0, 3) else -half_length
    across = half_width if corner in (0, 1) else -half_width
    corner_x, corner_y = x + c * along - s * across, y + s * along + c * across
    x, y, c, s, half_length, half_width = box
    dx, dy = corner_x - x, corner_y - y
    u, v = c * dx + s * dy, c * dy - s * dx
    du = min(max(u, -half_length), half_length) - u
    dv = min(max(v, -half_width), half_width) - v
    return u, v, du, dv, corner_x + (c * du - s * dv) / 2, corner_y + (s * du + c * dv) / 2


@inner
def _apart(box: Box, other: Box) -> bool:
    """Whether a side of `box` separates it from all of `other`."""
    right = left = ahead = behind = 0
    for corner in range(4):
        u, v, _, _, _, _ = _from_corner(box, other, corner)
        ahead, behind = ahead + (u > box[4]), behind + (u < -box[4])
        left, right = left + (v > box[5]), right + (v < -box[5])
    return max(ahead, behind, left, right) == 4


@inner
def _nearest(a: Box, b: Box) -> tuple[float, float, float]:
    """The distance of two rectangles, 0 if they overlap, and the mean of the points midway between their nearest
    points; nan if they overlap and neither has a corner in the other."""
    distance = 0.0
    if _apart(a, b) or _apart(b, a):
        distance = inf
        for box, turned_box in ((a, b), (b, a)):
            for corner in range(4):
                _, _, du, dv, _, _ = _from_corner(box, turned_box, corner)
                distance = min(distance, hypot(du, dv))
    places, x, y = 0, 0.0, 0.0
    for box, turned_box in ((a, b), (b, a)):
        for corner in range(4):
            _, _, du, dv, at_x, at_y = _from_corner(box, turned_box, corner)
            if hypot(du, dv) <= distance + SAME_M:
                places, x, y = places + 1, x + at_x, y + at_y
    return (distance, x / places, y / places) if places else (distance, nan, nan)


@inner
def _class_of(a: Moving, b: Moving) -> int:
    """The class by the angle between the directions of travel, as in surrogate safety measures (SSAM, SUMO)."""
    if min(hypot(a[3], a[4]), hypot(b[3], b[4])) < STANDING_MPS:
        return _STANDING
    angle = abs(_turn_between(atan2(a[4], a[3]), atan2(b[4], b[3])))
    if angle < FOLLOWING_RAD:
        return _FOLLOWING
    return _HEAD_ON if angle > pi - FOLLOWING_RAD else _CROSSING


@inner
def _closing_mps(a: Moving, b: Moving) -> float:
    dx, dy = b[0] - a[0], b[1] - a[1]
    distance_m = hypot(dx, dy)
    if distance_m == 0:
        return 0.0
    return -(dx * (b[3] - a[3]) + dy * (b[4] - a[4])) / distance_m


@kernel((*[COLUMNS] * 2, FLOAT))
def _met(columns_a: Columns, columns_b: Columns, at_s: float) -> tuple[float, float, float, float, int, int, int]:
    """Of two envelopes at `at_s`: their distance, x and y of the place between them, the closing speed of their
    centres, the class, and the floor of each."""
    a, b = _moving(columns_a, at_s), _moving(columns_b, at_s)
    box_a, box_b = _box(a, columns_a), _box(b, columns_b)
    return *_nearest(box_a, box_b), _closing_mps(a, b), _class_of(a, b), a[5], b[5]


@inner
def moving_there(robot: Any, knots: Knots, at_s: float) -> Moving:
    """A robot of a slot table at `at_s`, as `moving`."""
    knot, last = robot.first, robot.first + robot.count - 1
    while knot < last and knots[knot + 1].t <= at_s:
        knot += 1
    k, since_s = knots[knot], at_s - knots[knot].t
    if since_s < 0:
        return k.x, k.y, k.yaw, 0.0, 0.0, k.floor
    return k.x + since_s * k.vx, k.y + since_s * k.vy, k.yaw + since_s * k.turn, k.vx, k.vy, k.floor


@inner
def _box_of(at: Moving, robot: Any, widened_m: float) -> Box:
    half_m = widened_m / 2
    return at[0], at[1], cos(at[2]), sin(at[2]), robot.half_length - half_m, robot.half_width - half_m


@kernel(numba.from_dtype(ENCOUNTER)[::1](*_KNOWN, INTS, FLOATS))
def encounters(robots: Robots, knots: Knots, widened_m: Floats, slots: Ints, at_s: Floats) -> Encounters:
    """(n,) of `ENCOUNTER`: the encounters of n pairs of rectangles at the times `at_s` (n,), equal to `encounter` up to
    rounding. `slots` (2 n,) are those of the pairs one after the other, -1 for an unknown robot. The place is unknown
    if a robot is unknown, or if the two overlap and neither has a corner in the other."""
    met = np.empty(len(at_s), ENCOUNTER)
    for row in range(len(at_s)):
        slot_a, slot_b, found = slots[2 * row], slots[2 * row + 1], met[row]
        found.x, found.y, found.kind, found.floor = nan, nan, -1, -1
        if slot_a >= 0 and slot_b >= 0:
            robot_a, robot_b = robots[slot_a], robots[slot_b]
            a, b = moving_there(robot_a, knots, at_s[row]), moving_there(robot_b, knots, at_s[row])
            box_a, box_b = _box_of(a, robot_a, widened_m[slot_a]), _box_of(b, robot_b, widened_m[slot_b])
            _, found.x, found.y = _nearest(box_a, box_b)
            found.kind, found.floor = _class_of(a, b), a[5]
    return met
