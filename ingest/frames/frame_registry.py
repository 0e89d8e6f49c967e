"""The common frame: from where a robot says it is to where that is on its floor.

A floor's frame is in metres and right-handed. A datum in metres is that frame; one in degrees is projected; a
vendor that keeps to its own map comes in by its readings of the datum's reference points.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ingest.frames.fitting import Fit, FitError, fit
from ingest.frames.projection import Projection
from ingest.frames.transforms import Transform
from ingest.settings import NIL_DATUM, Datum, Vendor, VendorMap

Pose = tuple[float, float, float]
"""x, y, yaw_rad"""


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """What one vendor means by one datum."""

    floor: str
    """Id of the floor."""
    known: bool
    """Whether the site file has it."""
    comparable: bool = True
    """False for a frame that nobody else shares."""
    projection: Projection | None = None
    transform: Transform | None = None

    @property
    def mirrored(self) -> bool:
        """Whether a turn to the left there is one to the right on the floor."""
        return self.projection is not None or (self.transform is not None and self.transform.mirrored)

    def placed(self, poses: Sequence[Pose]) -> Sequence[Pose]:
        """Poses as sent, to metres and radians in the floor's frame.

        An unknown yaw stays nan. Degrees that are nowhere on Earth become inf.
        """
        if self.transform is None and self.projection is None:
            return poses
        return self.projection.poses(poses) if self.projection else [self.pose(*pose) for pose in poses]

    def pose(self, x: float, y: float, yaw_rad: float) -> Pose:
        """One of `placed`."""
        if self.transform is not None:
            return self.transform.pose(x, y, yaw_rad)
        if self.projection is not None:
            return self.projection.poses([(x, y, yaw_rad)])[0]
        return x, y, yaw_rad


class FrameRegistry:
    """Every frame that the site knows, and those that messages bring."""

    def __init__(self, datums: Sequence[Datum], vendors: Sequence[Vendor]) -> None:
        """Raises `FitError` for readings that fit nothing, naming the vendor and the datum."""
        by_id = {datum.id: datum for datum in datums}
        self._datums = {datum.id: _of_datum(datum) for datum in datums}
        self.in_degrees = frozenset(name for name, frame in self._datums.items() if frame.projection)
        """Datums of the site whose locations may be nowhere."""
        self._maps = {
            (vendor.name, one.datum): _of_map(vendor, one, by_id[one.site_datum])
            for vendor in vendors
            for one in vendor.maps
        }

    def frame(self, vendor: str, datum: str) -> Frame:
        """The vendor's own map of that name, else the site's datum, else a floor of its own.

        A datum that the site does not know names a floor that all who name it share, since by the standard its id
        is the frame's. A nil or missing datum names no frame and is compared with nothing.
        """
        found = self._maps.get((vendor, datum)) or self._datums.get(datum)
        if found:
            return found
        if datum in ("", NIL_DATUM):
            return Frame(f"unknown:{vendor}", known=False, comparable=False)
        return Frame(datum, known=False)


def fit_map(one: VendorMap, datum: Datum) -> Fit:
    """The fit of a vendor's readings to the datum's reference points, in floor metres. Raises `FitError`."""
    known = {point.id: (point.x, point.y) for point in datum.reference_points}
    missing = sorted(set(one.readings) - set(known))
    if missing:
        raise FitError(f"reads {', '.join(missing)}, which datum {datum.name!r} does not have")
    readings = np.array(list(one.readings.values()), np.float64).reshape(-1, 2)
    reference = np.array([known[point] for point in one.readings], np.float64).reshape(-1, 2)
    if datum.coordinates != "metres":
        reference = Projection(datum).points(reference)
    if not np.isfinite(reference).all():
        raise FitError(f"the reference points of datum {datum.name!r} are nowhere on Earth; x is latitude")
    return fit(readings, reference, tuple(one.readings), mirrored=one.mirrored)


def _of_datum(datum: Datum) -> Frame:
    projection = None if datum.coordinates == "metres" else Projection(datum)
    return Frame(datum.id, known=True, projection=projection)


def _of_map(vendor: Vendor, one: VendorMap, datum: Datum) -> Frame:
    try:
        return Frame(datum.id, known=True, transform=fit_map(one, datum).transform)
    except FitError as error:
        raise FitError(f"vendor {vendor.name!r}, map of {datum.name!r}: {error}") from error
