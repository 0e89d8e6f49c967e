"""The headings of a robot's trailers, by where the robot was."""

from collections.abc import Sequence
from math import hypot

from msgspec.structs import replace

from ingest.fleet.prediction.forecast_model import Forecast, Sighting
from ingest.frames.towing import towed_along
from ingest.shapes import Shape

FARTHEST_M = 10.0
"""After a robot was seen this much further on, its trailers are taken to be straight behind it."""


def trailer_headings(
    shape: Shape | None, yaws_rad: Sequence[float], last: Sighting | None, seen: Sighting
) -> tuple[float, ...]:
    """The headings of the trailers of a robot that is at `seen` and was at `last`, where they were `yaws_rad`."""
    if shape is None or not shape.trailers:
        return ()
    if last is None or last.floor != seen.floor or len(yaws_rad) != len(shape.trailers):
        return (seen.yaw_rad,) * len(shape.trailers)
    dx_m, dy_m = seen.x_m - last.x_m, seen.y_m - last.y_m
    if hypot(dx_m, dy_m) > FARTHEST_M:
        return (seen.yaw_rad,) * len(shape.trailers)
    return tuple(towed_along(yaws_rad, [trailer.hitch_m for trailer in shape.trailers], dx_m, dy_m))


def with_trailers(forecast: Forecast, yaws_rad: Sequence[float]) -> Forecast:
    """The forecast with the headings of its trailers at its first knot."""
    shape = forecast.shape
    return replace(forecast, shape=shape.with_headings(yaws_rad)) if shape else forecast
