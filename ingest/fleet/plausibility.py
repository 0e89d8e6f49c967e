"""What only history shows: messages that contradict each other or the robot's own motion.

Sources: the readings of A1, A6 to A8, A13 and A16 in practice, and clause 5.4 of the standard.
"""

from math import atan2, cos, hypot, isnan, pi, sin

from msgspec.structs import replace

from ingest.fleet.forecast import Sighting
from ingest.frames.angles import turn_between

MIN_GAP_S = 0.9
"""Messages of one robot nearer than this are more than one a second, network jitter set aside."""
MOVED_M = 0.2
"""A displacement that shows a direction in spite of the noise of a position."""
COMPARABLE_S = 5.0
"""Sightings further apart than this say nothing of the motion between them."""
MAX_TURN_RADPS = 2.0
SLOW_TURN_RAD = 0.5


def frequency(gap_s: float, quiet_after_s: float) -> tuple[str, ...]:
    """Findings on the time since the robot's last status, by arrival."""
    if gap_s < MIN_GAP_S:
        return ("status-too-frequent",)
    return ("status-too-rare",) if gap_s > quiet_after_s else ()


def reconcile(before: Sighting | None, now: Sighting) -> tuple[Sighting, tuple[str, ...]]:
    """`now` with heading, speed and turn rate mended by the motion since `before`, and the findings.

    An unknown heading becomes the direction of travel, or stays as it was while the robot stands. A speed
    that was not sent is the observed one; a norm gets the sign of the motion. A turn rate that the headings do not
    bear out is set aside.
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
        turned, told = turn_between(before.yaw_rad, now.yaw_rad), now.turn_radps * gap_s
        if abs(told - turned) > SLOW_TURN_RAD + abs(told) / 2:
            findings += ("turn-rate-contradicts-motion",) if now.turn_radps else ()
            now = replace(now, turn_radps=0.0)
    if now.linear_mps is None:
        along_m = dx * cos(now.yaw_rad) + dy * sin(now.yaw_rad) if not isnan(now.yaw_rad) else moved_m
        return replace(now, linear_mps=along_m / gap_s), findings
    if moved_m <= MOVED_M or isnan(now.yaw_rad) or not now.linear_mps:
        return now, findings
    return _signed(now, now.linear_mps, atan2(dy, dx), findings)


def _signed(
    now: Sighting, linear_mps: float, travel_rad: float, findings: tuple[str, ...]
) -> tuple[Sighting, tuple[str, ...]]:
    astray = abs(turn_between(now.yaw_rad, travel_rad))
    if linear_mps > 0 and astray > 3 * pi / 4:
        return replace(now, linear_mps=-linear_mps), (*findings, "speed-sign-lost")
    if pi / 4 < astray < 3 * pi / 4:
        return now, (*findings, "heading-contradicts-motion")
    return now, findings
