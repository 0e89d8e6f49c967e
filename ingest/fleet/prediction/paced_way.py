"""The times at which a robot will be along its way, by its own pace."""

from collections.abc import Sequence
from itertools import pairwise
from math import atan2, hypot, inf, isnan, sqrt

from ingest.fleet.prediction.forecast_model import Knot, Sighting
from ingest.fleet.prediction.pace import SPEEDS_UP_MPS2, TURN, Allowance, Paces, allowance
from ingest.frames.angles import turn_between
from ingest.frames.assumed_motion import CORNER_RAD, LEAST_STEP_S, SPOT_M

BEND_RAD = 0.02
"""Between two pieces whose directions differ by more than this there is a bend."""
WATCHED_S, BEYOND_M = 8.0, 1.0
"""Corners up to this far ahead are watched, to see when the robot is this far beyond them."""


def paced(points: Sequence[Knot], most: Sequence[float], here: Sighting, paces: Paces) -> list[Knot]:
    """The points (p,) of a way with new times. `most` (p,) is the greatest speed, or turn rate, to each.

    The robot starts at its present speed. A corner takes its turn, and what it was seen to take beyond.
    """
    kinds = allowances(points, most, here)
    paces.pace.kind = next((allowed.kind for allowed in kinds if allowed.kind != TURN), inf)
    t_s, x, y, yaw_rad = here.t_s, here.x_m, here.y_m, here.yaw_rad
    now_mps = abs(here.linear_mps) if here.linear_mps is not None else inf
    timed: list[Knot] = []
    corners = _Corners(here, paces)
    for (_, to_x, to_y, to_rad), allowed in zip(points, kinds, strict=True):
        speed, length_m = paces.of(allowed), hypot(to_x - x, to_y - y)
        if allowed.kind == TURN:
            turn_rad = abs(turn_between(yaw_rad, to_rad))
            turn_s = 0.0 if isnan(turn_rad) else turn_rad / speed
            t_s += turn_s
            now_mps = inf
            corners.turn(t_s, turn_s)
        else:
            t_s += corners.leave(x, y, to_x, to_y, speed, t_s)
            lasted_s, now_mps = driven_s(length_m, now_mps, speed)
            t_s += lasted_s
        t_s = max(t_s, (timed[-1][0] if timed else here.t_s) + LEAST_STEP_S)
        timed.append((t_s, to_x, to_y, to_rad))
        x, y, yaw_rad = to_x, to_y, to_rad
    return timed


def allowances(points: Sequence[Knot], most: Sequence[float], here: Sighting) -> list[Allowance]:
    """(p,) what bounds the way to each point."""
    places = [(here.x_m, here.y_m), *((x, y) for _, x, y, _ in points)]
    steps = [(bx - ax, by - ay) for (ax, ay), (bx, by) in pairwise(places)]
    found: list[Allowance] = []
    direction_rad: float | None = None
    for (dx, dy), greatest in zip(steps, most, strict=True):
        if hypot(dx, dy) < SPOT_M:
            found.append(Allowance(greatest, TURN))
            direction_rad = None
            continue
        before_rad, direction_rad = direction_rad, atan2(dy, dx)
        bent_rad = 0.0 if before_rad is None else abs(turn_between(before_rad, direction_rad))
        found.append(allowance(greatest, is_bend=BEND_RAD < bent_rad <= CORNER_RAD))
    return found


def driven_s(length_m: float, from_mps: float, mps: float) -> tuple[float, float]:
    """How long a robot takes for a straight piece at a pace, and its speed at the end."""
    start_mps = min(from_mps, mps)
    speeding_m = (mps * mps - start_mps * start_mps) / (2 * SPEEDS_UP_MPS2)
    if speeding_m > length_m:
        end_mps = sqrt(start_mps * start_mps + 2 * SPEEDS_UP_MPS2 * length_m)
        return (end_mps - start_mps) / SPEEDS_UP_MPS2, end_mps
    return length_m / mps + (mps - start_mps) ** 2 / (2 * SPEEDS_UP_MPS2 * mps), mps


class _Corners:
    """The corners along one way: turns on the spot between two pieces that are driven."""

    def __init__(self, here: Sighting, paces: Paces) -> None:
        self._watched_s = here.t_s + WATCHED_S if here.is_driving else -inf
        self._paces, self._turn_s, self._late_s = paces, 0.0, 0.0

    def turn(self, t_s: float, turn_s: float) -> None:
        """The robot has turned by this time, for `turn_s`."""
        self._turn_s += turn_s
        if t_s > self._watched_s:
            self._watched_s = -inf

    def leave(self, x: float, y: float, to_x: float, to_y: float, mps: float, t_s: float) -> float:
        """How long it takes beyond its turn at the corner at (x, y), which it leaves for (to_x, to_y)."""
        if not self._turn_s:
            return 0.0
        late_s, self._turn_s = max(self._paces.corner_s, -self._turn_s), 0.0
        length_m = hypot(to_x - x, to_y - y)
        share = min(BEYOND_M / length_m, 1.0)
        if t_s <= self._watched_s:
            expected_s = t_s - self._late_s + share * length_m / mps
            beyond = x + share * (to_x - x), y + share * (to_y - y)
            self._paces.pace.expect_beyond_corner(*beyond, expected_s)
        self._late_s += late_s
        return late_s
