"""Checks whether the reference points of datums, and vendors' readings of them, fit each other."""

from collections.abc import Callable, Iterable, Iterator
from itertools import combinations

import numpy as np

from ingest.batch import Floats
from ingest.frames.fitting import Fit, FitError, Method
from ingest.frames.frame_registry import fit_map
from ingest.frames.projection import Projection
from ingest.frames.transforms import Adjusted
from ingest.settings import Datum, ReferencePoint, VendorMap

MAX_DISTORTION = 0.02
"""Largest difference of scale between two directions. From three points, a larger one counts as a wrong reading."""
METRE_LIKE = (0.8, 1.25)
"""A map whose unit has a length between these, in metres, is in metres."""
MAX_BEND = 0.2
"""Largest change of a length (as a share) or a heading (radians) that ADJUST may make within a triangle."""
MAX_SITE_M = 20_000.0
"""Reference points in degrees lie nearer than this to the reference location, unless x and y are swapped."""
DEGREE_M = 5_000.0
"""A longer unit of a map is a degree: 111 km of latitude, and of longitude less the further from the equator."""


SLIPS: tuple[tuple[str, Callable[[Floats], Floats]], ...] = (
    ("seems to be in millimetres", lambda reading: reading / 1000.0),
    ("seems to be in centimetres", lambda reading: reading / 100.0),
    ("seems to be in feet", lambda reading: reading * 0.3048),
    ("seems to be in inches", lambda reading: reading * 0.0254),
    ("has x and y exchanged", lambda reading: reading[::-1]),
    ("has the wrong sign of x", lambda reading: reading * (-1.0, 1.0)),
    ("has the wrong sign of y", lambda reading: reading * (1.0, -1.0)),
)
"""Usual slips in one reading, and how to undo each. They are told apart by whether the others then fit."""


def datum_problems(datum: Datum) -> Iterator[str]:
    """A sentence for each problem. Each begins with the key within the datum."""
    if datum.coordinates == "metres" or not datum.reference_points:
        return
    degrees = np.array([(point.x, point.y) for point in datum.reference_points])
    for point, metres in zip(datum.reference_points, Projection(datum).points(degrees), strict=True):
        if not np.hypot(*metres) < MAX_SITE_M:
            yield (
                f"reference_points.{point.id}: lies more than {MAX_SITE_M / 1000:.0f} km from reference_location; "
                f"expected x = latitude, y = longitude, in degrees ({datum.coordinates})"
            )


def map_problems(vendor_map: VendorMap, datum: Datum) -> Iterator[str]:
    """A sentence for each problem. Each begins with the key within the map."""
    try:
        fit = fit_map(vendor_map, datum)
    except FitError as error:
        key, cause = likely_cause(vendor_map, datum) or ("", str(error))
        yield f"readings{key}: {cause}"
        return
    names = tuple(_names(vendor_map, datum))
    mistaken, misfit = fit.affine.mirrored != vendor_map.mirrored, _misses(fit, vendor_map) or _stretches(fit)
    slip = likely_cause(vendor_map, datum) if mistaken or misfit else None
    if mistaken and not (misfit and slip):
        yield _mirroring(fit.affine.mirrored, slip)
    if misfit:
        yield from _misfits(fit, vendor_map, names, slip)
    if not slip:
        yield from _bends(fit, names)


def _mirroring(mirrored: bool, slip: tuple[str, str] | None) -> str:
    """What to say of a map of which `mirrored` is not what it states."""
    exchanged = slip[1] if slip and not slip[0] else ""
    if mirrored:
        return (
            "mirrored: the readings are mirrored; set mirrored = true if that map is left-handed, "
            f"else {exchanged or 'look for swapped x and y, a wrong sign or swapped points'}"
        )
    return f"mirrored: found true, but the readings are not mirrored{exchanged and f', unless {exchanged}'}"


def _misses(fit: Fit, vendor_map: VendorMap) -> bool:
    return bool(fit.residuals_m.max() > vendor_map.tolerance_m)


def _stretches(fit: Fit) -> bool:
    return fit.method is Method.AFFINE and fit.affine.distortion > MAX_DISTORTION


def _misfits(fit: Fit, vendor_map: VendorMap, names: tuple[str, ...], slip: tuple[str, str] | None) -> Iterator[str]:
    worst = int(fit.residuals_m.argmax())
    if _misses(fit, vendor_map):
        key, why = slip or ("", "no single wrong reading, unit or exchange explains it: read all points again")
        yield (
            f"readings{key}: {why}; the fit of all misses {names[worst]} by "
            f"{fit.residuals_m[worst]:.3f} m, expected at most tolerance_m = {vendor_map.tolerance_m}"
        )
    if _stretches(fit):
        key, why = slip or (
            "",
            "three points always fit exactly, so nothing shows which is wrong; correct it, or read a fourth",
        )
        yield (
            f"readings{key}: the fit stretches one direction {100 * fit.affine.distortion:.1f} % more than another; "
            f"{why}"
        )


def _bends(fit: Fit, names: tuple[str, ...]) -> Iterator[str]:
    if not isinstance(fit.transform, Adjusted):
        return
    bend, rows = fit.transform.bend()
    if bend > MAX_BEND:
        yield (
            f"readings: between {', '.join(names[row] for row in rows)} the correction bends the map by "
            f"{100 * bend:.0f} %; these points are close together and their readings disagree; "
            "correct or remove one"
        )


def likely_cause(vendor_map: VendorMap, datum: Datum) -> tuple[str, str] | None:
    """Which one slip explains readings that do not fit: the key of the reading, and what is wrong with it.

    A slip explains them if without it all points fit a map of one scale. None if none does, or more than one, but for
    exchanges: of four points in a rectangle, two explain the same readings.
    """
    ids, names = tuple(vendor_map.readings), tuple(_names(vendor_map, datum))
    marks = {point.id: point for point in datum.reference_points}
    if not marks.keys() >= set(ids):
        return None
    readings = np.array(list(vendor_map.readings.values()))
    reference = places_m(datum, (marks[mark] for mark in ids))
    units = _units(readings, reference, datum)
    found = [
        cause
        for causes in (_exchanges(names, readings), _slips(ids, names, readings), _single(ids, names, readings))
        for cause, corrected, kept in causes
        if len(kept) > 2
        and _misfit_m(units * corrected[kept], reference[kept], vendor_map.mirrored) <= vendor_map.tolerance_m
    ]
    exact = [cause for cause in found if not cause[1].endswith(WRONG)] or found
    if len(exact) > 1 and not any(key for key, _ in exact):
        return "", ", or ".join(text for _, text in exact)
    return exact[0] if len(exact) == 1 else None


WRONG = "is wrong, all others fit each other; read it again"
_Trial = tuple[tuple[str, str], Floats, list[int]]
"""What would be wrong, the readings without it, and the rows that must then fit."""


def _exchanges(names: tuple[str, ...], readings: Floats) -> Iterator[_Trial]:
    for a, b in combinations(range(len(names)), 2):
        corrected = readings.copy()
        corrected[[a, b]] = readings[[b, a]]
        yield ("", f"{names[a]} and {names[b]} are exchanged"), corrected, list(range(len(names)))


def _slips(ids: tuple[str, ...], names: tuple[str, ...], readings: Floats) -> Iterator[_Trial]:
    for row, (point, name) in enumerate(zip(ids, names, strict=True)):
        for text, undo in SLIPS:
            corrected = readings.copy()
            corrected[row] = undo(readings[row])
            yield (f".{point}", f"{_this_reading(point, name)} {text}"), corrected, list(range(len(names)))


def _single(ids: tuple[str, ...], names: tuple[str, ...], readings: Floats) -> Iterator[_Trial]:
    for row, (point, name) in enumerate(zip(ids, names, strict=True)):
        cause = f".{point}", f"{_this_reading(point, name)} {WRONG}"
        yield cause, readings, [other for other in range(len(ids)) if other != row]


def _this_reading(point: str, name: str) -> str:
    return "this reading" if name == point else f"this reading of {name}"


def _names(vendor_map: VendorMap, datum: Datum) -> Iterator[str]:
    """The names of the points that a map has readings of, for people."""
    names = {point.id: point.name for point in datum.reference_points}
    return (names.get(point) or point for point in vendor_map.readings)


def _units(readings: Floats, reference: Floats, datum: Datum) -> Floats:
    """(2,) how long one unit of x and of y is, as a share of one of x: a degree of longitude is a short one."""
    if _spread(reference) < DEGREE_M * _spread(readings):
        return np.ones(2)
    latitude = float(np.median(readings[:, 0]))
    if abs(latitude) < 1 and datum.reference_location:
        latitude += datum.reference_location[0]
    return np.array([1.0, np.cos(np.radians(latitude))])


def _spread(points: Floats) -> float:
    """The usual distance from the middle, which one wrong point hardly changes."""
    return float(np.median(np.hypot(*(points - np.median(points, axis=0)).T)))


def _misfit_m(readings: Floats, reference: Floats, mirrored: bool) -> float:
    """The largest distance from the best fit of a rotation, a translation and one scale."""
    sent = readings @ (1.0, -1j if mirrored else 1j)
    wanted = reference @ (1.0, 1j)
    sent, wanted = sent - sent.mean(), wanted - wanted.mean()
    turn = np.vdot(sent, wanted) / np.vdot(sent, sent)
    return float(np.abs(wanted - turn * sent).max())


def places_m(datum: Datum, marks: Iterable[ReferencePoint]) -> Floats:
    """(marks, 2) where points of a datum are, metres."""
    points = np.array([(mark.x, mark.y) for mark in marks])
    return points if datum.coordinates == "metres" else Projection(datum).points(points)
