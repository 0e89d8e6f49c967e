"""Checks a status against the robot's earlier ones: messages that contradict each other or the robot's own motion.

Sources: the readings of A1, A6 to A8, A13 and A16 in practice, and clause 5.4 of the standard.
"""

from math import atan2, copysign, cos, hypot, inf, isinf, isnan, pi, radians, sin

from msgspec.structs import replace

from ingest.clocks import SenderClock
from ingest.fleet.prediction.forecast_model import Sighting
from ingest.fleet.prediction.path_forecast import PLAUSIBLE_SPEED_MPS
from ingest.frames.angles import turn_between
from ingest.frames.assumed_motion import DRIVES_MPS, MOVING_MPS

MIN_GAP_S = 0.9
"""Messages of one robot closer in time than this are more than one a second, with allowance for network jitter."""
STALE_S = 2.0
"""A status that takes this much longer than the sender's quickest one is stale."""
MOVED_M = 0.2
"""A displacement of this length shows a direction despite the noise of positions."""
COMPARABLE_S = 5.0
"""Sightings further apart in time than this do not show how a robot has turned between them."""
OBSERVABLE_S = 35.0
"""Sightings further apart than this show nothing of the motion between them. Conforming robots may report so seldom."""
REGULAR_S = 2.0
"""Reports further apart than this are rare."""
CORNER_RAD = radians(20.0)
"""A robot that has turned by more between two reports may have done so before or after it moved."""
MAX_TURN_RADPS = 2.0
"""No robot turns faster."""
SLOW_TURN_RAD = 0.5
"""The turn between two headings may differ from the turn rate by this, plus half of what the turn rate gives."""
UNTURNED_RAD = 1.0
"""So far headings may lag behind turn rates in reports in a row, if they turn by less than half of what these give."""
TURNED_RAD = 0.2
"""A turn by so much shows a turn rate despite the noise of headings."""
DRIFT_RAD = 0.25
"""A move this far off the heading, twice, shows in which direction a robot drives despite the noise of positions."""
SPEED_AS_MOVED = 0.5, 1.5
"""A speed between these shares of the observed one is that of the move."""
FASTEST_MPS = 10.0
"""No robot of a floor is faster."""
PLACES_LATE = 1.5
"""A place may be the same for so many times the longest time that it was before."""
ALIKE = 1.25
"""Two shares that differ by no more than this factor are of one cause, such as another unit."""


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

    An unknown heading becomes the direction of travel, or the other one of a robot that says that it backs up, or the
    heading before if the robot has not moved. A speed that
    was not sent becomes the observed one, as does one that is twice far from the observed one. A speed
    without sign gets the sign of the motion, and the direction of two moves. A turn rate that contradicts the headings
    becomes 0; one that was not sent becomes the observed one of a robot that stands.
    """
    findings: tuple[str, ...] = ()
    if isnan(now.turn_radps):
        now = replace(now, turn_radps=_observed_turn_radps(before, now))
    if abs(now.turn_radps) > MAX_TURN_RADPS:
        now, findings = replace(now, turn_radps=0.0), ("turn-rate-contradicts-motion",)
    gap_s = now.t_s - before.t_s if before and before.floor == now.floor else 0.0
    if before is None or not 0.0 < gap_s <= OBSERVABLE_S:
        standing_s = before.standing_s if before and (before.t_s, before.state) == (now.t_s, now.state) else 0.0
        return now if now.interval_s else replace(now, is_driving=_is_fast(now), standing_s=standing_s), findings
    if gap_s <= COMPARABLE_S:
        now, found = _compared(before, now, gap_s)
        findings += found
    else:
        now = _observed(before, now, gap_s)
    return in_motion(before, now), findings


def in_motion(before: Sighting, now: Sighting) -> Sighting:
    """`now` with the time since `before`, and whether the robot drives by both."""
    gap_s = now.t_s - before.t_s
    moved_m = hypot(now.x_m - before.x_m, now.y_m - before.y_m)
    is_driving = _is_fast(now) and (_is_fast(before) or moved_m > DRIVES_MPS * gap_s)
    moves_anyway = is_driving and moved_m > MOVED_M and now.state == before.state
    has_moved = is_driving or moved_m > max(MOVED_M, DRIVES_MPS * gap_s)
    standing_s = 0.0 if has_moved or now.state != before.state else before.standing_s + gap_s
    is_headed = gap_s <= COMPARABLE_S and not (isnan(before.yaw_rad) or isnan(now.yaw_rad))
    turned_rad = turn_between(before.yaw_rad, now.yaw_rad) if is_headed else 0.0
    return replace(
        now,
        is_driving=is_driving,
        moves_anyway=moves_anyway,
        place_every_s=max(now.place_every_s, before.place_every_s),
        interval_s=gap_s,
        standing_s=standing_s,
        turned_rad=turned_rad,
    )


def _observed_turn_radps(before: Sighting | None, now: Sighting) -> float:
    """The turn rate by the headings of a robot that stands and turns as it did before; 0.0 for any other."""
    if before is None or before.floor != now.floor or not 0.0 < now.t_s - before.t_s <= COMPARABLE_S:
        return 0.0
    turned_rad = turn_between(before.yaw_rad, now.yaw_rad)
    stands = hypot(now.x_m - before.x_m, now.y_m - before.y_m) <= MOVED_M
    turns_on = min(abs(turned_rad), copysign(before.turned_rad, before.turned_rad * turned_rad)) > TURNED_RAD
    observed_radps = turned_rad / (now.t_s - before.t_s)
    return observed_radps if stands and turns_on and abs(observed_radps) <= MAX_TURN_RADPS else 0.0


def _is_fast(sighting: Sighting) -> bool:
    return abs(sighting.linear_mps or 0.0) > DRIVES_MPS


def _stands(sighting: Sighting) -> bool:
    """Whether it was stated to stand."""
    return sighting.linear_mps is not None and abs(sighting.linear_mps) <= MOVING_MPS


def _is_across(off_heading_rad: float) -> bool:
    return pi / 4 < abs(off_heading_rad) < 3 * pi / 4


def _observed(before: Sighting, now: Sighting, gap_s: float) -> Sighting:
    """`now` with the heading and the speed that were not sent, as the displacement shows them."""
    dx, dy = now.x_m - before.x_m, now.y_m - before.y_m
    moved_m = hypot(dx, dy)
    if isnan(now.yaw_rad):
        backs_rad = pi if now.linear_mps is not None and now.linear_mps < 0.0 else 0.0
        now = replace(now, yaw_rad=atan2(dy, dx) + backs_rad if moved_m > MOVED_M else before.yaw_rad)
    if now.linear_mps is not None:
        return now
    sideways_rad = turn_between(now.yaw_rad, atan2(dy, dx))
    has_turned = not abs(turn_between(before.yaw_rad, now.yaw_rad)) <= CORNER_RAD  # before or after it moved
    if moved_m > MOVED_M and gap_s <= COMPARABLE_S and _is_across(sideways_rad) and not has_turned:
        return replace(now, linear_mps=moved_m / gap_s, sideways_rad=sideways_rad)
    along_m = dx * cos(now.yaw_rad) + dy * sin(now.yaw_rad) if not isnan(now.yaw_rad) else moved_m
    whole = replace(now, linear_mps=copysign(moved_m, along_m) / gap_s)
    if gap_s > COMPARABLE_S:
        return whole  # it may have turned on the way
    drifting = _with_drift(before, whole, gap_s)
    return drifting if drifting.sideways_rad else replace(drifting, linear_mps=along_m / gap_s)


def _compared(before: Sighting, now: Sighting, gap_s: float) -> tuple[Sighting, tuple[str, ...]]:
    """The same for two sightings near in time, which also show what contradicts the motion."""
    now, findings = _with_turn(before, now, gap_s)
    moved_m = hypot(now.x_m - before.x_m, now.y_m - before.y_m)
    moved_mps = moved_m / gap_s
    share, share_before = _stated_share(before, now, moved_mps), before.stated_share
    now, stands_twice = (
        _with_place_age(before, replace(now, stated_share=share), moved_m, gap_s),
        _stands(before) and _stands(now),
    )
    is_again = stands_twice or max(share, share_before) <= ALIKE * min(share, share_before)
    is_no_speed = abs(now.linear_mps or 0.0) > FASTEST_MPS and moved_mps <= FASTEST_MPS / 2
    if is_no_speed or (share != 1.0 and is_again and not _may_be_old(now)):
        now, findings = replace(now, linear_mps=None, is_overruled=True), (*findings, "speed-contradicts-motion")
    if now.linear_mps is None or isnan(now.yaw_rad):
        return _observed(before, now, gap_s), findings
    if moved_m <= MOVED_M or not now.linear_mps:
        return now, findings
    travel_rad = atan2(now.y_m - before.y_m, now.x_m - before.x_m)
    if now.sideways_rad and abs(turn_between(now.way_rad, travel_rad)) > pi / 4:
        without_speed = replace(now, linear_mps=None, sideways_rad=0.0)
        return _observed(before, without_speed, gap_s), (*findings, "heading-contradicts-motion")
    off_heading_rad = turn_between(now.way_rad, travel_rad)
    if now.linear_mps > 0 and abs(off_heading_rad) > 3 * pi / 4:
        now, findings = replace(now, linear_mps=-now.linear_mps), (*findings, "speed-sign-lost")
    drifting = _with_drift(before, now, gap_s)
    if _is_across(off_heading_rad) or drifting.sideways_rad != now.sideways_rad:
        findings += ("heading-contradicts-motion",)
    return drifting, findings


def _stated_share(before: Sighting, now: Sighting, moved_mps: float) -> float:
    """The stated speed as a share of that of the move since the sighting before, if it is not nearly that; else 1.

    A robot that turned a corner shows nothing; nor does one that moves as fast as no robot. One that hardly moves
    stands, if it would have moved by far more at the stated speed.
    """
    least_mps, (least, most) = max(MOVED_M / (now.t_s - before.t_s), DRIVES_MPS), SPEED_AS_MOVED
    if now.linear_mps is None or moved_mps > PLAUSIBLE_SPEED_MPS:
        return 1.0
    if moved_mps <= least_mps:
        return inf if abs(now.linear_mps) > most * least_mps else 1.0
    if _stands(now):
        return 0.0
    share = abs(now.linear_mps) / moved_mps
    has_turned = abs(turn_between(before.yaw_rad, now.yaw_rad)) > CORNER_RAD
    return 1.0 if has_turned or least <= share <= most else share


def _with_place_age(before: Sighting, now: Sighting, moved_m: float, gap_s: float) -> Sighting:
    """`now` with how long its place has been the same, and how long that was at most before it moved on as it said.

    Some robots have a new place only at marks along their line, or every few seconds.
    """
    same_s, same_before_s = (before.same_place_s + gap_s if isinf(now.stated_share) else 0.0), before.same_place_s
    caught_up = same_before_s > 0.0 and moved_m >= SPEED_AS_MOVED[0] * abs(now.linear_mps or inf) * same_before_s
    longest_s = max(before.place_every_s, same_before_s + gap_s) if caught_up and not same_s else before.place_every_s
    return replace(now, same_place_s=same_s, place_every_s=longest_s)


def _may_be_old(now: Sighting) -> bool:
    """Whether the place of a robot that stands by it may only not have been renewed."""
    return 0.0 < now.same_place_s <= PLACES_LATE * now.place_every_s


def _with_turn(before: Sighting, now: Sighting, gap_s: float) -> tuple[Sighting, tuple[str, ...]]:
    """`now` without a turn rate that the headings contradict, and the deviations."""
    if isnan(now.yaw_rad) or isnan(before.yaw_rad) or not now.turn_radps:
        return now, ()
    observed_rad, reported_rad = turn_between(before.yaw_rad, now.yaw_rad), now.turn_radps * gap_s
    lag_rad = reported_rad - observed_rad
    lags = abs(lag_rad) > TURNED_RAD and abs(observed_rad) < abs(reported_rad) / 2
    unturned_rad = before.unturned_rad + lag_rad if lags else 0.0
    if unturned_rad:
        now = replace(now, unturned_rad=unturned_rad)
    if abs(lag_rad) > SLOW_TURN_RAD + abs(reported_rad) / 2 or (
        before.unturned_rad and abs(unturned_rad) > UNTURNED_RAD
    ):
        return replace(now, turn_radps=0.0), ("turn-rate-contradicts-motion",)
    return now, ()


def _with_drift(before: Sighting, now: Sighting, gap_s: float) -> Sighting:
    """`now` with the direction in which it moves, if it moves as fast as its speed says, and off its heading as it did
    before. A robot on an arc moves along the middle of its headings."""
    dx, dy, turned_rad = now.x_m - before.x_m, now.y_m - before.y_m, turn_between(before.yaw_rad, now.yaw_rad)
    moved_m, speed_mps = hypot(dx, dy), now.linear_mps or 0.0
    least, most = SPEED_AS_MOVED
    if not (abs(turned_rad) <= CORNER_RAD and least * moved_m <= abs(speed_mps) * gap_s <= most * moved_m):
        return now
    drives_rad = now.way_rad - turned_rad / 2 + (0.0 if speed_mps > 0.0 else pi)
    drift_rad = turn_between(drives_rad, atan2(dy, dx))
    if abs(drift_rad) <= DRIFT_RAD or moved_m * abs(drift_rad) <= MOVED_M:
        return now
    drifts_again = before.drift_rad != 0.0 and abs(turn_between(before.drift_rad, drift_rad)) <= DRIFT_RAD
    sideways_rad = now.sideways_rad + drift_rad if drifts_again else now.sideways_rad
    return replace(now, drift_rad=drift_rad, sideways_rad=sideways_rad)
