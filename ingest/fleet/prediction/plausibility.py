"""Checks a status against the robot's earlier ones: messages that contradict each other or the robot's own motion.

Sources: the readings of A1, A6 to A8, A13 and A16 in practice, and clause 5.4 of the standard.
"""

from math import atan2, cos, hypot, isnan, pi, sin

from msgspec.structs import replace

from ingest.clocks import SenderClock
from ingest.fleet.prediction.forecast_model import Sighting
from ingest.frames.angles import turn_between

MIN_GAP_S = 0.9
"""Messages of one robot closer in time than this are more than one a second, with allowance for network jitter."""
STALE_S = 2.0
"""A status that takes this much longer than the sender's quickest one is stale."""
MOVED_M = 0.2
"""A displacement of this length shows a direction despite the noise of positions."""
COMPARABLE_S = 5.0
"""Sightings further apart in time than this show nothing about the motion between them."""
MAX_TURN_RADPS = 2.0
"""No robot turns faster."""
SLOW_TURN_RAD = 0.5
"""The turn between two headings may differ from the turn rate by this, plus half of what the turn rate gives."""


def frequency(gap_s: float, quiet_after_s: float) -> tuple[str, ...]:
    """Deviations of the time between the arrivals of two statuses."""
    if gap_s < MIN_GAP_S:
        return ("status-too-frequent",)
    return ("status-too-rare",) if gap_s > quiet_after_s else ()


def clock(sender: SenderClock, tolerance_s: float, resolution_s: float) -> tuple[str, ...]:
    """Deviations of the newest stamp of a sender's clock, which shows no less than `resolution_s`."""
    stale = ("stamp-stale",) if sender.delay_s > STALE_S + resolution_s else ()
    return (*stale, *(("clock-off",) if abs(sender.offset_s) > tolerance_s + resolution_s else ()))


def reconcile(before: Sighting | None, now: Sighting) -> tuple[Sighting, tuple[str, ...]]:
    """`now` with heading, speed and turn rate corrected by the motion since `before`, and the deviations.

    An unknown heading becomes the direction of travel, or the heading before if the robot has not moved. A speed that
    was not sent becomes the observed one. A speed without sign gets the sign of the motion. A turn rate that
    contradicts the headings becomes 0.
    """
    findings: tuple[str, ...] = ()
    if abs(now.turn_radps) > MAX_TURN_RADPS:
        now, findings = replace(now, turn_radps=0.0), ("turn-rate-contradicts-motion",)
    if before is None or before.floor != now.floor:
        return now, findings
    gap_s = now.t_s - before.t_s
    if not 0.0 < gap_s <= COMPARABLE_S:
        return now, findings
    dx, dy = now.x_m - before.x_m, now.y_m - before.y_m
    moved_m = hypot(dx, dy)
    if isnan(now.yaw_rad):
        now = replace(now, yaw_rad=atan2(dy, dx) if moved_m > MOVED_M else before.yaw_rad)
    elif not isnan(before.yaw_rad):
        observed_rad, reported_rad = turn_between(before.yaw_rad, now.yaw_rad), now.turn_radps * gap_s
        if abs(reported_rad - observed_rad) > SLOW_TURN_RAD + abs(reported_rad) / 2:
            findings += ("turn-rate-contradicts-motion",) if now.turn_radps else ()
            now = replace(now, turn_radps=0.0)
    if now.linear_mps is None:
        along_m = dx * cos(now.yaw_rad) + dy * sin(now.yaw_rad) if not isnan(now.yaw_rad) else moved_m
        return replace(now, linear_mps=along_m / gap_s), findings
    if moved_m <= MOVED_M or isnan(now.yaw_rad) or not now.linear_mps:
        return now, findings
    return _with_sign(now, now.linear_mps, atan2(dy, dx), findings)


def _with_sign(
    now: Sighting, linear_mps: float, travel_rad: float, findings: tuple[str, ...]
) -> tuple[Sighting, tuple[str, ...]]:
    """`now` with a negative speed if it travels backwards, and the deviations."""
    off_heading_rad = abs(turn_between(now.yaw_rad, travel_rad))
    if linear_mps > 0 and off_heading_rad > 3 * pi / 4:
        return replace(now, linear_mps=-linear_mps), (*findings, "speed-sign-lost")
    if pi / 4 < off_heading_rad < 3 * pi / 4:
        return now, (*findings, "heading-contradicts-motion")
    return now, findings
