"""When a robot should be at a place by a forecast, and how long it should take from one place to the next."""

from math import hypot, inf, nan, sqrt

from ingest.batch import Floats
from ingest.frames.angles import turn_between
from ingest.kernels import inner

TURN_M = 0.5
"""A turn of one radian counts as this way."""
OFF_M = 0.35
"""A forecast that comes no nearer to a pose than this does not lead there."""
BESIDE_M, ALONG_RAD = 2.0, 0.8
"""A robot that is this near to its forecast way, with a heading that differs by less, drives beside it."""
SAME_PLACE_M = 0.03
"""Poses that differ by less count as the same."""

_turn_between = inner(turn_between)


@inner
def way_between_m(before: Floats, now: Floats) -> float:
    """How far a robot went from one pose to another; its turn counts, too."""
    turn_m = TURN_M * _turn_between(before[2], now[2])
    return hypot(hypot(now[0] - before[0], now[1] - before[1]), turn_m)


@inner
def _leg_share(track: Floats, leg: int, x_m: float, y_m: float, yaw_rad: float) -> tuple[float, float]:
    """The share of a leg of a forecast at which it is nearest to a pose, and how far off that is."""
    leg_x, leg_y = track[leg + 1, 0] - track[leg, 0], track[leg + 1, 1] - track[leg, 1]
    leg_turn = TURN_M * _turn_between(track[leg, 2], track[leg + 1, 2])
    to_x, to_y = x_m - track[leg, 0], y_m - track[leg, 1]
    to_turn = TURN_M * _turn_between(track[leg, 2], yaw_rad)
    square = leg_x * leg_x + leg_y * leg_y + leg_turn * leg_turn
    share = (to_x * leg_x + to_y * leg_y + to_turn * leg_turn) / square if square > 1e-6 else 0.0
    share = min(max(share, 0.0), 1.0)
    off_x, off_y, off_turn = to_x - share * leg_x, to_y - share * leg_y, to_turn - share * leg_turn
    return share, sqrt(off_x * off_x + off_y * off_y + off_turn * off_turn)


@inner
def _passed_s(track: Floats, x_m: float, y_m: float, yaw_rad: float) -> tuple[float, float]:
    """When a forecast `track` (k, 3), in seconds after it was made, is at a pose for the first and for the last time;
    nan if it does not lead there."""
    least_m = inf
    for leg in range(len(track) - 1):
        _, off_m = _leg_share(track, leg, x_m, y_m, yaw_rad)
        least_m = min(least_m, off_m)
    first_s, last_s = nan, nan
    if least_m > OFF_M:
        return first_s, last_s
    for leg in range(len(track) - 1):
        share, off_m = _leg_share(track, leg, x_m, y_m, yaw_rad)
        if off_m <= least_m + SAME_PLACE_M:
            last_s = leg + share
            if not first_s >= 0.0:
                first_s = last_s
    return first_s, last_s


@inner
def planned_s(track: Floats, begin: Floats, end: Floats) -> float:
    """How long a robot takes from one pose (3,) to another by a forecast (k, 3), without standing at either. Negative
    if the forecast leads from the second to the first; nan if it does not lead past both."""
    _, begin_s = _passed_s(track, begin[0], begin[1], begin[2])
    end_s, _ = _passed_s(track, end[0], end[1], end[2])
    return end_s - begin_s


@inner
def beside_s(track: Floats, begin: Floats, end: Floats) -> float:
    """How long a robot takes from one pose (3,) to another beside its forecast (k, 3), at the speed that the forecast
    has there; nan if it does not lead along."""
    x_m, y_m = (begin[0] + end[0]) / 2, (begin[1] + end[1]) / 2
    least_m, needed_s = BESIDE_M, nan
    for leg in range(len(track) - 1):
        leg_m = hypot(track[leg + 1, 0] - track[leg, 0], track[leg + 1, 1] - track[leg, 1])
        if leg_m < SAME_PLACE_M or abs(_turn_between(track[leg, 2], end[2])) > ALONG_RAD:
            continue
        along = ((x_m - track[leg, 0]) * (track[leg + 1, 0] - track[leg, 0])
                 + (y_m - track[leg, 1]) * (track[leg + 1, 1] - track[leg, 1])) / (leg_m * leg_m)  # fmt: skip
        share = min(max(along, 0.0), 1.0)
        off_x = x_m - track[leg, 0] - share * (track[leg + 1, 0] - track[leg, 0])
        off_y = y_m - track[leg, 1] - share * (track[leg + 1, 1] - track[leg, 1])
        off_m = hypot(off_x, off_y)
        if off_m < least_m:
            least_m, needed_s = off_m, hypot(end[0] - begin[0], end[1] - begin[1]) / leg_m
    return needed_s
