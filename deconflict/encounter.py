"""What a predicted encounter is like: where, how fast it closes, and of which class."""

from dataclasses import dataclass
from math import atan2, hypot, pi

from deconflict.advisory import EncounterClass
from deconflict.nearest import Box, nearest
from deconflict.pose import Pose, pose_at
from ingest.angles import turn_between
from ingest.seam import Forecasts

STANDING_MPS = 0.05
FOLLOWING_RAD = pi / 4
"""Headings of travel nearer than this follow each other; within the same of opposite they meet head-on."""


@dataclass(frozen=True, slots=True)
class Encounter:
    """The moment two envelopes first come within the clearance."""

    encounter_class: EncounterClass
    closing_speed_mps: float
    """Of the centres; negative where they draw apart."""
    x_m: float
    y_m: float
    floor: int


def encounter(a: Forecasts, b: Forecasts, contact_s: float) -> Encounter:
    """How two robots, one forecast each, meet at `contact_s`; the place is midway between their envelopes there."""
    pose_a, pose_b = pose_at(a, contact_s), pose_at(b, contact_s)
    _, (x_m, y_m) = nearest(_box(a, pose_a), _box(b, pose_b))
    return Encounter(
        encounter_class=_class_of(pose_a, pose_b),
        closing_speed_mps=_closing_mps(pose_a, pose_b),
        x_m=x_m,
        y_m=y_m,
        floor=pose_a.floor,
    )


def separation_m(a: Forecasts, b: Forecasts, t_s: float) -> float | None:
    """Distance of the two envelopes at `t_s`, 0 where they overlap; None where they are on different floors."""
    pose_a, pose_b = pose_at(a, t_s), pose_at(b, t_s)
    if pose_a.floor != pose_b.floor or pose_a.floor < 0:
        return None
    return nearest(_box(a, pose_a), _box(b, pose_b))[0]


def _box(forecast: Forecasts, pose: Pose) -> Box:
    return Box(pose.x_m, pose.y_m, pose.yaw_rad, forecast.length_m.item(0) / 2, forecast.width_m.item(0) / 2)


def _class_of(a: Pose, b: Pose) -> EncounterClass:
    """By the angle between the directions of travel, as surrogate safety measures do (SSAM, SUMO)."""
    if min(a.speed_mps, b.speed_mps) < STANDING_MPS:
        return EncounterClass.STATIONARY_OBSTACLE
    angle = abs(turn_between(atan2(a.vy_mps, a.vx_mps), atan2(b.vy_mps, b.vx_mps)))
    if angle < FOLLOWING_RAD:
        return EncounterClass.FOLLOWING
    return EncounterClass.HEAD_ON if angle > pi - FOLLOWING_RAD else EncounterClass.CROSSING


def _closing_mps(a: Pose, b: Pose) -> float:
    dx, dy = b.x_m - a.x_m, b.y_m - a.y_m
    distance_m = hypot(dx, dy)
    if distance_m == 0:
        return 0.0
    return -(dx * (b.vx_mps - a.vx_mps) + dy * (b.vy_mps - a.vy_mps)) / distance_m
