"""Whether a site's datums and vendors' maps can be relied on, beyond being well-formed."""

from collections.abc import Iterator

import numpy as np

from ingest.frames.fitting import Fit, FitError, Method
from ingest.frames.frame_registry import fit_map
from ingest.frames.projection import Projection
from ingest.frames.transforms import Adjusted
from ingest.settings import Datum, VendorMap

MAX_DISTORTION = 0.02
"""Three points can't show that a map stretches one way more than another, so beyond this share it is a misreading."""
MAX_BEND = 0.2
"""Largest change of a length (as a share) or a heading (radians) that ADJUST may make within a triangle."""
MAX_SITE_M = 20_000.0
"""Reference points in degrees lie nearer than this to the reference location, unless x and y are exchanged."""


def datum_problems(datum: Datum) -> Iterator[str]:
    """Each begins with the key within the datum."""
    if datum.coordinates == "metres" or not datum.reference_points:
        return
    degrees = np.array([(point.x, point.y) for point in datum.reference_points])
    for row, metres in enumerate(Projection(datum).points(degrees)):
        if not np.hypot(*metres) < MAX_SITE_M:
            yield (
                f"reference_points[{row}]: lies more than {MAX_SITE_M / 1000:.0f} km from reference_location; "
                f"expected x = latitude, y = longitude, in degrees ({datum.coordinates})"
            )


def map_problems(one: VendorMap, datum: Datum) -> Iterator[str]:
    """Each begins with the key within the map."""
    try:
        found = fit_map(one, datum)
    except FitError as error:
        yield f"readings: {error}"
        return
    if found.affine.mirrored and not one.mirrored:
        yield (
            "mirrored: the readings are mirrored; set mirrored = true if that map is left-handed, "
            "else look for exchanged x and y, a wrong sign or exchanged points"
        )
    if one.mirrored and not found.affine.mirrored:
        yield "mirrored: found true, but the readings are not mirrored"
    yield from _misfits(found, one)


def _misfits(found: Fit, one: VendorMap) -> Iterator[str]:
    points = tuple(one.readings)
    worst = int(found.residuals_m.argmax())
    if found.residuals_m[worst] > one.tolerance_m:
        yield (
            f"readings.{points[worst]}: is off by {found.residuals_m[worst]:.3f} m; "
            f"expected at most tolerance_m = {one.tolerance_m}"
        )
    if found.method is Method.AFFINE and found.affine.distortion > MAX_DISTORTION:
        yield (
            f"readings: the fit stretches one direction {100 * found.affine.distortion:.1f} % more than another; "
            "correct the wrong reading, or read a fourth point to show that the map is like that"
        )
    if isinstance(found.transform, Adjusted):
        bend, rows = found.transform.bend()
        if bend > MAX_BEND:
            yield (
                f"readings: between {', '.join(points[row] for row in rows)} the correction bends the map by "
                f"{100 * bend:.0f} %; they lie too near each other for how far they are off; leave one out"
            )
