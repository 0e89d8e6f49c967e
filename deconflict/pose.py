"""One robot at one moment of its forecast."""

from bisect import bisect_right
from dataclasses import dataclass
from math import cos, hypot, sin

from shapely import Polygon

from ingest.angles import turn_between
from ingest.seam import Forecasts


@dataclass(frozen=True, slots=True)
class Pose:
    """An envelope's centre, heading, velocity and floor."""

    x_m: float
    y_m: float
    yaw_rad: float
    vx_mps: float
    vy_mps: float
    floor: int

    @property
    def speed_mps(self) -> float:
        return hypot(self.vx_mps, self.vy_mps)


def pose_at(forecasts: Forecasts, row: int, t_s: float) -> Pose:
    """Robot `row` at `t_s`, as `Forecasts` reads between knots; before the first knot, at the first."""
    first, end = int(forecasts.start[row]), int(forecasts.start[row + 1])
    knot = max(first + bisect_right(forecasts.t_s[first:end].tolist(), t_s) - 1, first)
    x, y, yaw = (float(column[knot]) for column in (forecasts.x_m, forecasts.y_m, forecasts.yaw_rad))
    floor = int(forecasts.floor[knot])
    following = knot + 1
    if following >= end or t_s < forecasts.t_s[knot] or forecasts.floor[following] != floor:
        return Pose(x, y, yaw, 0.0, 0.0, floor)
    span_s = float(forecasts.t_s[following] - forecasts.t_s[knot])
    share = (t_s - float(forecasts.t_s[knot])) / span_s
    dx, dy = float(forecasts.x_m[following]) - x, float(forecasts.y_m[following]) - y
    turn = turn_between(yaw, float(forecasts.yaw_rad[following]))
    return Pose(x + share * dx, y + share * dy, yaw + share * turn, dx / span_s, dy / span_s, floor)


def envelope(forecasts: Forecasts, row: int, pose: Pose) -> Polygon:
    """The rectangle of robot `row` at `pose`."""
    c, s = cos(pose.yaw_rad), sin(pose.yaw_rad)
    half_l, half_w = float(forecasts.length_m[row]) / 2, float(forecasts.width_m[row]) / 2
    corners = ((half_l, half_w), (-half_l, half_w), (-half_l, -half_w), (half_l, -half_w))
    return Polygon([(pose.x_m + c * u - s * v, pose.y_m + s * u + c * v) for u, v in corners])
