"""`deconflict check`: what a person should see of a site file before robots rely on it."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import degrees, dist
from pathlib import Path
from typing import TextIO

import numpy as np
import shapely

from deconflict.settings.map_checks import map_problems
from deconflict.settings.shared_places import PRIOR_SERVICE_S, Resource, Zone, outlines
from deconflict.settings.site import Site, SiteError, datum_of, fit_problems, load
from ingest.frames.fitting import Fit, FitError, Method
from ingest.frames.frame_registry import FrameRegistry, Pose, fit_map
from ingest.frames.projection import Projection
from ingest.settings import Datum, Vendor, VendorMap

METRE_LIKE = (0.8, 1.25)
METRE_MAP = (0.98, 1.02)
"""A scale within the wider of these and outside the narrower is a metre map misread rather than another unit."""


@dataclass(frozen=True, slots=True, eq=False)
class MapReport:
    """One vendor's map, judged."""

    vendor: str
    map: VendorMap
    datum: Datum
    fit: Fit | None
    """None where the readings fit nothing."""
    problems: tuple[str, ...]
    """What makes it fail."""
    notes: tuple[str, ...]
    """What a person should look at, though it may be right."""


@dataclass(frozen=True, slots=True, eq=False)
class SiteReport:
    """A site, judged."""

    site: Site
    maps: tuple[MapReport, ...]
    problems: tuple[str, ...]
    """Every problem of the site, the maps' included, with its key; empty where it can be relied on."""


def check(path: Path, out: TextIO) -> int:
    """Print each vendor's fit and each problem of the site file; 0 where there is none, else 1."""
    try:
        site = load(path)
    except SiteError as error:
        out.write(f"{error}\n")
        return 1
    judged = site_report(site)
    out.writelines(f"{line}\n" for line in report_lines(judged))
    return 1 if judged.problems else 0


def site_report(site: Site) -> SiteReport:
    """How well the site's vendors fit its datums."""
    maps = tuple(_judged(vendor, one, datum_of(site, one)) for vendor in site.vendors for one in vendor.maps)
    return SiteReport(site, maps, tuple(fit_problems(site)))


def report_lines(judged: SiteReport) -> Iterator[str]:
    """The report as text."""
    site = judged.site
    yield f"{site.name}: {len(site.datums)} datums, {len(site.vendors)} vendors, {len(judged.maps)} own maps"
    for datum in site.datums:
        yield from _datum_lines(datum)
    for vendor in site.vendors:
        if not vendor.maps:
            yield f"\n{vendor.name}: sends in the datums' own coordinates"
    for one in judged.maps:
        yield from _map_lines(one)
    yield from _place_lines(site)
    yield ""
    for problem in judged.problems:
        yield f"FAILS {problem}"
    yield f"FAILED: {len(judged.problems)} to correct" if judged.problems else "PASSED"


def _judged(vendor: Vendor, one: VendorMap, datum: Datum) -> MapReport:
    found_problems = tuple(map_problems(one, datum))
    try:
        found = fit_map(one, datum)
    except FitError:
        return MapReport(vendor.name, one, datum, None, found_problems, ())
    return MapReport(vendor.name, one, datum, found, found_problems, tuple(_notes(found, one)))


def _notes(found: Fit, one: VendorMap) -> Iterator[str]:
    points, scale = tuple(one.readings), found.affine.scales[0]
    if METRE_LIKE[0] < scale < METRE_LIKE[1] and not METRE_MAP[0] < scale < METRE_MAP[1]:
        yield f"one unit of the map is {scale:z.3f} m; if it is a map in metres, a reading is wrong"
    if found.method is Method.SIMILARITY:
        yield "two points can't show a wrong reading or a mirrored map; read at least two more"
    elif not np.isnan(found.left_out_m).all() and np.nanmax(found.left_out_m) > one.tolerance_m:
        worst = int(np.nanargmax(found.left_out_m))
        yield f"the others put {points[worst]} {found.left_out_m[worst]:z.3f} m off; read that one again first"


def _datum_lines(datum: Datum) -> Iterator[str]:
    yield f"\ndatum {datum.name}, {datum.id}, level {datum.level}: {len(datum.reference_points)} reference points"
    if datum.coordinates == "metres":
        return
    yield f"  in degrees ({datum.coordinates}); (0, 0) of the floor is at {datum.reference_location}, x east, y north"
    chart = Projection(datum)
    for point in datum.reference_points:
        x_m, y_m = chart.points(np.array([[point.x, point.y]]))[0]
        yield f"  {_short(point.name or point.id):24} {point.x:12.7f} {point.y:12.7f}  ->  {x_m:z10.3f} {y_m:z10.3f} m"
    yield "  yaw 0 deg (north) becomes 90 deg on the floor, yaw 90 deg (east) becomes 0 deg"


def _place_lines(site: Site) -> Iterator[str]:
    """What robots share, floor by floor."""
    names = {datum.id: datum.name for datum in site.datums}
    places: list[Resource | Zone] = [*site.resources, *site.zones]
    for place in places:
        floors = " and ".join(names[datum] for datum, _ in outlines(place))
        area_m2 = shapely.Polygon(place.polygon).area
        yield f"\n{place.kind} {place.label}, {place.id}, on {floors}: {area_m2:.1f} m2, capacity {place.capacity}"
        if isinstance(place, Resource):
            group = f", one of group {place.group}" if place.group else ""
            told = (
                f"{place.service_s:g} s" if place.service_s else f"learned, {PRIOR_SERVICE_S[place.kind]:g} s at first"
            )
            yield f"  service {told}{group}"
        elif place.axis:
            yield f"  single lane of {dist(*place.axis):.1f} m"


def _map_lines(judged: MapReport) -> Iterator[str]:
    one, found = judged.map, judged.fit
    yield f"\n{judged.vendor}: own map {one.datum or '(no datum sent)'} on datum {judged.datum.name}"
    if found:
        yield from _fit_lines(found)
        yield from _point_lines(found, one, judged.datum)
        yield from _example_lines(judged)
    for note in judged.notes:
        yield f"  NOTE {note}"
    yield "  FAILS, see below" if judged.problems else f"  fits within tolerance_m = {one.tolerance_m}"


def _fit_lines(found: Fit) -> Iterator[str]:
    affine = found.affine
    (along_x, along_y), (x_m, y_m) = affine.scales, affine.shift
    yield (
        f"  method {found.method}, {'mirrored' if affine.mirrored else 'not mirrored'}, "
        f"rotation {degrees(affine.rotation_rad):z.3f} deg, translation ({x_m:z.3f}, {y_m:z.3f}) m"
    )
    yield f"  one unit is {along_x:.6g} m along x, {along_y:.6g} m along y; shear {degrees(affine.shear_rad):z.3f} deg"


def _point_lines(found: Fit, one: VendorMap, datum: Datum) -> Iterator[str]:
    names = {point.id: point.name or point.id for point in datum.reference_points}
    yield f"  {'reference point':24} {'map x':>11} {'map y':>11}  ->  {'floor x':>9} {'floor y':>9}  residual  left out"
    for row, (point, reading) in enumerate(one.readings.items()):
        x_m, y_m = found.transform(np.array([reading]))[0]
        left_out = "-" if np.isnan(found.left_out_m[row]) else f"{found.left_out_m[row]:z.3f} m"
        yield (
            f"  {_short(names[point]):24} {reading[0]:z11.3f} {reading[1]:z11.3f}  ->  {x_m:z9.3f} {y_m:z9.3f}"
            f"  {found.residuals_m[row]:z6.3f} m  {left_out:>8}"
        )


def _example_lines(judged: MapReport) -> Iterator[str]:
    """Where the map's origin lies, and a robot in the middle of the readings, as the service will place it."""
    vendor = Vendor(name=judged.vendor, maps=(judged.map,))
    frame = FrameRegistry([judged.datum], [vendor]).frame(judged.vendor, judged.map.datum)
    x, y = np.mean(list(judged.map.readings.values()), axis=0).tolist()
    poses = [(0.0, 0.0, 0.0), (x, y, 0.0)]
    for what, sent, placed in zip(("its origin", "a robot"), poses, frame.placed(poses), strict=True):
        yield f"  {what} at {_pose(sent)} on the map is at {_pose(placed)} on the floor"


def _pose(pose: Pose) -> str:
    return f"({pose[0]:z.3f}, {pose[1]:z.3f}), yaw {degrees(pose[2]):.1f} deg"


def _short(name: str) -> str:
    return name if len(name) <= 24 else f"{name[:23]}…"
