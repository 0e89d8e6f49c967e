"""The envelope of a robot as a polygon. Kernels know envelopes by their length and width."""

from math import cos, sin

from shapely import Polygon

from deconflict.sweep.geometry.pose import Pose
from ingest.batch import Forecasts


def envelope(forecast: Forecasts, pose: Pose) -> Polygon:
    """The rectangle of one robot at `pose`."""
    c, s = cos(pose.yaw_rad), sin(pose.yaw_rad)
    half_l, half_w = float(forecast.length_m[0]) / 2, float(forecast.width_m[0]) / 2
    corners = ((half_l, half_w), (-half_l, half_w), (-half_l, -half_w), (half_l, -half_w))
    return Polygon([(pose.x_m + c * u - s * v, pose.y_m + s * u + c * v) for u, v in corners])
