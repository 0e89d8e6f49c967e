"""The pose of one robot at one moment of its forecast."""

from dataclasses import dataclass
from math import cos, hypot, sin

from shapely import Polygon

from ingest.batch import Forecasts
from ingest.frames.angles import turn_between


@dataclass(frozen=True, slots=True)
class Pose:
    """Centre of the envelope, heading, velocity and floor."""

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
    """The pose of one robot at `t_s`, interpolated between knots as `Forecasts` says; before the first knot it is
    there."""
    f = forecast
    knot = max(int(f.t_s.searchsorted(t_s, "right")) - 1, 0)
    x, y, yaw, floor = f.x_m.item(knot), f.y_m.item(knot), f.yaw_rad.item(knot), f.floor.item(knot)
    following, begins_s = knot + 1, f.t_s.item(knot)
    if following >= len(f.t_s) or t_s < begins_s or f.floor.item(following) != floor:
        return Pose(x, y, yaw, 0.0, 0.0, floor)
    span_s = f.t_s.item(following) - begins_s
    share = (t_s - begins_s) / span_s
    dx, dy = f.x_m.item(following) - x, f.y_m.item(following) - y
    turn = turn_between(yaw, f.yaw_rad.item(following))
    return Pose(x + share * dx, y + share * dy, yaw + share * turn, dx / span_s, dy / span_s, floor)


def envelope(forecast: Forecasts, pose: Pose) -> Polygon:
    """The rectangle of one robot at `pose`."""
    c, s = cos(pose.yaw_rad), sin(pose.yaw_rad)
    half_l, half_w = float(forecast.length_m[0]) / 2, float(forecast.width_m[0]) / 2
    corners = ((half_l, half_w), (-half_l, half_w), (-half_l, -half_w), (half_l, -half_w))
    return Polygon([(pose.x_m + c * u - s * v, pose.y_m + s * u + c * v) for u, v in corners])
