"""Checks whether the reference points of datums, and vendors' readings of them, fit each other."""

from collections.abc import Iterator

import numpy as np

from ingest.frames.fitting import Fit, FitError, Method
from ingest.frames.frame_registry import fit_map
from ingest.frames.projection import Projection
from ingest.frames.transforms import Adjusted
from ingest.settings import Datum, VendorMap

MAX_DISTORTION = 0.02
"""Largest difference of scale between two directions. From three points, a larger one counts as a wrong reading."""
MAX_BEND = 0.2
"""Largest change of a length (as a share) or a heading (radians) that ADJUST may make within a triangle."""
MAX_SITE_M = 20_000.0
"""Reference points in degrees lie nearer than this to the reference location, unless x and y are swapped."""


def datum_problems(datum: Datum) -> Iterator[str]:
    """A sentence for each problem. Each begins with the key within the datum."""
    if datum.coordinates == "metres" or not datum.reference_points:
        return
    degrees = np.array([(point.x, point.y) for point in datum.reference_points])
    for row, metres in enumerate(Projection(datum).points(degrees)):
        if not np.hypot(*metres) < MAX_SITE_M:
            yield (
                f"reference_points[{row}]: lies more than {MAX_SITE_M / 1000:.0f} km from reference_location; "
                f"expected x = latitude, y = longitude, in degrees ({datum.coordinates})"
            )


def map_problems(vendor_map: VendorMap, datum: Datum) -> Iterator[str]:
    """A sentence for each problem. Each begins with the key within the map."""
    try:
        fit = fit_map(vendor_map, datum)
    except FitError as error:
        yield f"readings: {error}"
        return
    if fit.affine.mirrored and not vendor_map.mirrored:
        yield (
            "mirrored: the readings are mirrored; set mirrored = true if that map is left-handed, "
            "else look for swapped x and y, a wrong sign or swapped points"
        )
    if vendor_map.mirrored and not fit.affine.mirrored:
        yield "mirrored: found true, but the readings are not mirrored"
    yield from _misfits(fit, vendor_map)


def _misfits(fit: Fit, vendor_map: VendorMap) -> Iterator[str]:
    points = tuple(vendor_map.readings)
    worst = int(fit.residuals_m.argmax())
    if fit.residuals_m[worst] > vendor_map.tolerance_m:
        yield (
            f"readings.{points[worst]}: is off by {fit.residuals_m[worst]:.3f} m; "
            f"expected at most tolerance_m = {vendor_map.tolerance_m}"
        )
    if fit.method is Method.AFFINE and fit.affine.distortion > MAX_DISTORTION:
        yield (
            f"readings: the fit stretches one direction {100 * fit.affine.distortion:.1f} % more than another; "
            "correct the wrong reading, or read a fourth point to show that the map is like that"
        )
    if isinstance(fit.transform, Adjusted):
        bend, rows = fit.transform.bend()
        if bend > MAX_BEND:
            yield (
                f"readings: between {', '.join(points[row] for row in rows)} the correction bends the map by "
                f"{100 * bend:.0f} %; these points are close together and their readings disagree; "
                "correct or remove one"
            )
