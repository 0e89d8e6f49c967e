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


def pose_at(forecast: Forecasts, t_s: float) -> Pose:
    """One robot at `t_s`, as `Forecasts` reads between knots; before the first knot, at the first."""
    knot = max(bisect_right(forecast.t_s, t_s) - 1, 0)
    x, y, yaw = (float(column[knot]) for column in (forecast.x_m, forecast.y_m, forecast.yaw_rad))
    floor = int(forecast.floor[knot])
    following = knot + 1
    if following >= len(forecast.t_s) or t_s < forecast.t_s[knot] or forecast.floor[following] != floor:
        return Pose(x, y, yaw, 0.0, 0.0, floor)
    span_s = float(forecast.t_s[following] - forecast.t_s[knot])
    share = (t_s - float(forecast.t_s[knot])) / span_s
    dx, dy = float(forecast.x_m[following]) - x, float(forecast.y_m[following]) - y
    turn = turn_between(yaw, float(forecast.yaw_rad[following]))
    return Pose(x + share * dx, y + share * dy, yaw + share * turn, dx / span_s, dy / span_s, floor)


def envelope(forecast: Forecasts, pose: Pose) -> Polygon:
    """The rectangle of one robot at `pose`."""
    c, s = cos(pose.yaw_rad), sin(pose.yaw_rad)
    half_l, half_w = float(forecast.length_m[0]) / 2, float(forecast.width_m[0]) / 2
    corners = ((half_l, half_w), (-half_l, half_w), (-half_l, -half_w), (half_l, -half_w))
    return Polygon([(pose.x_m + c * u - s * v, pose.y_m + s * u + c * v) for u, v in corners])
