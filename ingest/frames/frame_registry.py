"""The common frame: from the location that a robot reports to the location on its floor.

A floor's frame is in metres and right-handed. A datum in metres is that frame. A datum in degrees is projected. A
vendor's own map is transformed by the vendor's readings of the datum's reference points.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ingest.frames.fitting import Fit, FitError, fit
from ingest.frames.projection import Projection
from ingest.frames.transforms import Transform
from ingest.settings import NIL_DATUM, Datum, Vendor, VendorMap, plain_uuid

LONGEST_NAME = 200
"""Letters of a datum that the site does not have. Each batch and advisory there names it."""
Pose = tuple[float, float, float]
"""x, y, yaw_rad"""


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """What one vendor means by one datum."""

    floor: str
    """Id of the floor."""
    known: bool
    """Whether the site file has the floor."""
    comparable: bool = True
    """False for a frame that no other vendor shares."""
    projection: Projection | None = None
    """From degrees to metres; None if the frame is in metres."""
    transform: Transform | None = None
    """From the vendor's map to the floor's frame; None if they are the same."""

    @property
    def mirrored(self) -> bool:
        """Whether a left turn in this frame is a right turn on the floor."""
        return self.projection is not None or (self.transform is not None and self.transform.mirrored)

    def pose(self, x: float, y: float, yaw_rad: float) -> Pose:
        """A pose as sent, in metres and radians in the floor's frame.

        An unknown yaw stays nan. Degrees that are no place on Earth become inf.
        """
        if self.transform is not None:
            return self.transform.pose(x, y, yaw_rad)
        if self.projection is not None:
            return self.projection.poses([(x, y, yaw_rad)])[0]
        return x, y, yaw_rad


class FrameRegistry:
    """The frames of the site, and those that only messages name."""

    def __init__(self, datums: Sequence[Datum], vendors: Sequence[Vendor]) -> None:
        """Raises `FitError`, with vendor and datum, for readings to which nothing can be fitted."""
        by_id = {datum.id: datum for datum in datums}
        self._datums = {datum.id: _frame_of_datum(datum) for datum in datums}
        self.floors = frozenset(by_id)
        """Ids of the floors of the site file."""
        self._in_degrees = frozenset(key for key, frame in self._datums.items() if frame.projection)
        self._maps = {
            (vendor.name, vendor_map.datum): _frame_of_map(vendor, vendor_map, by_id[vendor_map.site_datum])
            for vendor in vendors
            for vendor_map in vendor.maps
        }

    def frame(self, vendor: str, datum: str) -> Frame:
        """The vendor's own map of that name, else the site's datum, else a floor of its own.

        A datum that the site does not have names a floor shared by all vendors that name it, since by the standard the
        id is that of the frame. A nil, missing or overlong datum names no frame and is compared with nothing.
        """
        key = _key(datum)
        found = self._maps.get((vendor, key)) or self._datums.get(key)
        if found:
            return found
        if key in ("", NIL_DATUM) or len(key) > LONGEST_NAME:
            return Frame(f"unknown:{vendor}", known=False, comparable=False)
        return Frame(key, known=False)

    def is_in_degrees(self, datum: str) -> bool:
        """Whether the site's datum is in degrees, so that a location on it may be no place on Earth."""
        return bool(self._in_degrees) and _key(datum) in self._in_degrees


def _key(datum: str) -> str:
    """By what a datum is found, however its UUID is spelt."""
    return plain_uuid(datum) or datum


def fit_map(vendor_map: VendorMap, datum: Datum) -> Fit:
    """The fit of a vendor's readings to the datum's reference points, in floor metres. Raises `FitError`."""
    known = {point.id: (point.x, point.y) for point in datum.reference_points}
    missing = sorted(set(vendor_map.readings) - set(known))
    if missing:
        raise FitError(f"reads {', '.join(missing)}, which datum {datum.name!r} does not have")
    readings = np.array(list(vendor_map.readings.values()), np.float64).reshape(-1, 2)
    reference = np.array([known[point] for point in vendor_map.readings], np.float64).reshape(-1, 2)
    if datum.coordinates != "metres":
        reference = Projection(datum).points(reference)
    if not np.isfinite(reference).all():
        raise FitError(f"the reference points of datum {datum.name!r} are nowhere on Earth; x is latitude")
    return fit(readings, reference, tuple(vendor_map.readings), mirrored=vendor_map.mirrored)


def _frame_of_datum(datum: Datum) -> Frame:
    projection = None if datum.coordinates == "metres" else Projection(datum)
    return Frame(datum.id, known=True, projection=projection)


def _frame_of_map(vendor: Vendor, vendor_map: VendorMap, datum: Datum) -> Frame:
    try:
        return Frame(datum.id, known=True, transform=fit_map(vendor_map, datum).transform)
    except FitError as error:
        raise FitError(f"vendor {vendor.name!r}, map of {datum.name!r}: {error}") from error
