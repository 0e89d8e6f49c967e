"""The image below the live map, and the position of its pixels on the floor by the datum's reference points."""

from collections.abc import Iterator
from pathlib import Path

from deconflict.settings.map_checks import map_problems
from ingest.frames.frame_registry import fit_map
from ingest.settings import Datum, FloorPlan, VendorMap

IMAGES = {
    ".png": "image/png",
    ".jpg": "image/jpeg",
    ".jpeg": "image/jpeg",
    ".webp": "image/webp",
    ".svg": "image/svg+xml",
}
"""Content types by the suffix of the file name."""

Matrix = tuple[float, float, float, float, float, float]


def image_matrix(plan: FloorPlan, datum: Datum) -> Matrix:
    """(a, b, c, d, e, f) of x_m = a column + c row + e and y_m = b column + d row + f, as for a canvas' `transform`.

    It is the affine part of the fit of a vendor's map (`ingest/frames/fitting.py`). Raises `FitError`.
    """
    affine = fit_map(_as_map(plan, datum), datum).affine
    (a, c), (b, d) = affine.matrix.tolist()
    return a, b, c, d, float(affine.shift[0]), float(affine.shift[1])


def plan_problems(datum: Datum) -> Iterator[str]:
    """A sentence for each problem of a datum's plan. Each begins with the key within the datum."""
    plan = datum.plan
    if plan is None:
        return
    if Path(plan.image).suffix.casefold() not in IMAGES:
        yield f"plan.image: found {plan.image!r}; expected a file named {', '.join(IMAGES)}"
    elif not Path(plan.image).is_file():
        yield f"plan.image: there is no file {plan.image!r} in the working directory"
    for problem in map_problems(_as_map(plan, datum), datum):
        key, _, text = problem.partition(": ")
        if key == "mirrored":
            yield "plan.readings: are upside down; count rows downwards from the image's upper left corner"
        else:
            yield f"plan.{key}: {text}"


def _as_map(plan: FloorPlan, datum: Datum) -> VendorMap:
    """The image as a vendor's map. Its rows run downwards, so the map is mirrored."""
    return VendorMap(
        datum="plan", site_datum=datum.id, readings=plan.readings, mirrored=True, tolerance_m=plan.tolerance_m
    )
