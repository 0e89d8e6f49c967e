"""The envelope of a robot: the area that it covers with its load, and the centre of that area along its forecast.

It is a rectangle with a bottom and a top. Another shape begins here and in the columns of `ingest.batch.Forecasts`; the
sweep measures the distances of shapes in `deconflict/sweep/narrowphase.py`.
"""

from collections.abc import Sequence
from math import cos, hypot, inf, isnan, sin
from operator import itemgetter

from ingest.batch import Basis
from ingest.fleet.prediction.forecast_model import Forecast, Knot, RobotBody

_YAW = itemgetter(3)


def with_envelope(
    basis: Basis, knots: Sequence[Knot], floors: tuple[int, ...], body: RobotBody, z_m: float, findings: tuple[str, ...]
) -> Forecast:
    """Move the knots from the location to the envelope centre. Between knots the centre then moves in a straight line.

    If a heading is unknown, the envelope becomes the square that holds it in any direction.
    """
    length_m, width_m, bottom_m, top_m = size(body, z_m)
    dx, dy = body.offset_m
    if lacks_heading(knots):
        length_m = width_m = hypot(length_m, width_m) + 2 * hypot(dx, dy)
        knots = [(t_s, x, y, 0.0) for t_s, x, y, _ in knots]
    elif dx or dy:
        knots = _at_centre(knots, dx, dy)
    return Forecast(basis, tuple(knots), floors, length_m, width_m, bottom_m, top_m, findings)


def size(body: RobotBody, z_m: float) -> tuple[float, float, float, float]:
    """Length, width, bottom and top of an envelope. Bottom and top are infinite if the height is unknown."""
    length_m, width_m, height_m = body.envelope_m
    return (length_m, width_m, z_m, z_m + height_m) if height_m else (length_m, width_m, -inf, inf)


def _at_centre(knots: Sequence[Knot], dx: float, dy: float) -> list[Knot]:
    centred = []
    for t_s, x, y, yaw_rad in knots:
        c, s = cos(yaw_rad), sin(yaw_rad)
        centred.append((t_s, x + c * dx - s * dy, y + s * dx + c * dy, yaw_rad))
    return centred


def lacks_heading(knots: Sequence[Knot]) -> bool:
    """Whether a heading is unknown. A sum with nan is nan."""
    return isnan(sum(map(_YAW, knots)))
