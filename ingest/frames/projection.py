"""Datums in latitude and longitude: x is north and y is east, in degrees. This frame is left-handed."""

from collections.abc import Sequence
from math import pi

import numpy as np

from ingest.batch import Floats
from ingest.settings import Datum


class Projection:
    """Projects degrees on a datum to metres east and north of its reference location, and yaws likewise.

    It is an azimuthal equidistant projection on WGS 84 about the reference location. Distances from that are true. On
    an area as small as a floor, distances between other points are true to less than a millimetre.
    """

    def __init__(self, datum: Datum) -> None:
        if datum.reference_location is None:
            raise ValueError(f"datum {datum.name!r} is in degrees and needs a reference_location")
        from pyproj import Transformer  # noqa: PLC0415 - takes 18 MB, and most floors are in metres

        latitude, longitude = datum.reference_location
        self._base = (latitude, longitude) if datum.coordinates == "latlon-relative" else (0.0, 0.0)
        local = f"+proj=aeqd +lat_0={latitude} +lon_0={longitude} +datum=WGS84 +units=m"
        self._to_metres = Transformer.from_crs("EPSG:4326", local, always_xy=False)

    def points(self, degrees: Floats) -> Floats:
        """`(p, 2)` latitude and longitude to `(p, 2)` metres east and north."""
        metres = degrees.copy()
        latitudes, longitudes = degrees[:, 0] + self._base[0], degrees[:, 1] + self._base[1]
        metres[:, 0], metres[:, 1] = self._to_metres.transform(latitudes, longitudes)
        return metres

    def poses(self, poses: Sequence[tuple[float, float, float]]) -> list[tuple[float, float, float]]:
        """Latitude, longitude and yaw clockwise from north to metres east and north and yaw anticlockwise from east."""
        placed = self.points(np.array(poses).reshape(-1, 3)[:, :2]).tolist()
        return [(x, y, self.yaw(yaw_rad)) for (x, y), (_, _, yaw_rad) in zip(placed, poses, strict=True)]

    def yaw(self, yaw_rad: float) -> float:
        """A yaw from north towards east to one anticlockwise from east."""
        return pi / 2 - yaw_rad
