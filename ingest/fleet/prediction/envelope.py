"""The envelope of a robot: the area that it covers with its load, and the centre of that area along its forecast.

It is a rectangle with a bottom and a top. If the site states another shape, the rectangle is the one around it, and
the shape goes with it.
"""

from collections.abc import Sequence
from math import cos, hypot, inf, isnan, sin
from operator import itemgetter

from ingest.batch import Basis
from ingest.fleet.prediction.forecast_model import Forecast, Knot, RobotBody
from ingest.shapes import Shape

_YAW = itemgetter(3)


def with_envelope(
    basis: Basis, knots: Sequence[Knot], floors: tuple[int, ...], body: RobotBody, z_m: float, findings: tuple[str, ...]
) -> Forecast:
    """Move the knots from the location to the envelope centre. Between knots the centre then moves in a straight line.

    If a heading is unknown, the envelope becomes the square that holds it in any direction, and a shape the circle.
    """
    length_m, width_m, bottom_m, top_m, shape = size(body, z_m)
    dx, dy = body.offset_m
    if lacks_heading(knots):
        length_m = width_m = hypot(length_m, width_m)
        if shape:
            length_m = width_m = 2 * shape.reach_m(length_m / 2)
        length_m = width_m = length_m + 2 * hypot(dx, dy)
        shape = Shape.circle(length_m) if shape else None
        knots = [(t_s, x, y, 0.0) for t_s, x, y, _ in knots]
    elif dx or dy:
        knots = _at_centre(knots, dx, dy)
    return Forecast(basis, tuple(knots), floors, length_m, width_m, bottom_m, top_m, shape, findings)


def size(body: RobotBody, z_m: float) -> tuple[float, float, float, float, Shape | None]:
    """Length, width, bottom, top and shape of an envelope. Bottom and top are infinite if the height is unknown."""
    length_m, width_m, height_m = body.envelope_m
    bottom_m = z_m + body.lift_m
    heights_m = (bottom_m, bottom_m + height_m) if height_m else (-inf, inf)
    return length_m, width_m, *heights_m, body.shape


def _at_centre(knots: Sequence[Knot], dx: float, dy: float) -> list[Knot]:
    centred = []
    for t_s, x, y, yaw_rad in knots:
        c, s = cos(yaw_rad), sin(yaw_rad)
        centred.append((t_s, x + c * dx - s * dy, y + s * dx + c * dy, yaw_rad))
    return centred


def lacks_heading(knots: Sequence[Knot]) -> bool:
    """Whether a heading is unknown. A sum with nan is nan."""
    return isnan(sum(map(_YAW, knots)))
