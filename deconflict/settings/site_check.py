"""`deconflict check`: a report on a site file, to read before robots depend on it."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from math import degrees, dist
from pathlib import Path
from typing import TextIO
from uuid import UUID

import numpy as np
import shapely

from deconflict.settings.map_checks import METRE_LIKE, map_problems
from deconflict.settings.shared_places import PRIOR_SERVICE_S, Resource, Zone, outlines
from deconflict.settings.site import Site
from deconflict.settings.site_file import SiteError, datum_of, fit_problems, load
from deconflict_client.counted_nouns import count_of
from deconflict_client.participant_kinds import NOUNS
from ingest.frames.fitting import Fit, FitError, Method
from ingest.frames.frame_registry import FrameRegistry, Pose, fit_map
from ingest.frames.projection import Projection
from ingest.languages.visible_text import visible, visible_lines
from ingest.security.certificates import CertificateError
from ingest.security.tokens import SecretError
from ingest.settings import Datum, Envelope, Vendor, VendorMap

METRE_MAP = (0.998, 1.002)
"""A scale inside `METRE_LIKE` and outside `METRE_MAP` is probably a wrong reading of a map in metres."""


@dataclass(frozen=True, slots=True, eq=False)
class MapReport:
    """The checks of one vendor's map."""

    vendor: str
    map: VendorMap
    datum: Datum
    fit: Fit | None
    """None if there is no fit of the readings."""
    problems: tuple[str, ...]
    """What makes the check fail."""
    notes: tuple[str, ...]
    """What a person should check, though it may be right."""


@dataclass(frozen=True, slots=True, eq=False)
class SiteReport:
    """The checks of a site."""

    site: Site
    maps: tuple[MapReport, ...]
    problems: tuple[str, ...]
    """Every problem of the site and its maps, with its key; empty if the check passes."""


FAULTY = 2
"""Exit code for a site file that can't be used, as `serve` ends with."""


LARGE_ENVELOPE_M, LARGE_CLEARANCE_M = 10.0, 5.0
"""Larger values are questioned: they may be in another unit."""


def check(
    path: Path,
    out: TextIO,
    verify: Callable[[Site], Iterable[str]] = lambda _: (),
    needs: Callable[[Site], Iterable[str]] = lambda _: (),
    logs: Sequence[Path] = (),
) -> int:
    """Print the verdict, each problem and each vendor's fit. Returns 0 if there is no problem, else 2.

    `verify` gives a sentence for each reason why this machine can't serve the site; it raises `SecretError` or
    `CertificateError`. `needs` says what the site needs of the machine. `logs` show where robots drive, to compare maps
    with that.
    """
    try:
        site = load(path)
    except SiteError as error:
        out.write(f"FAILED: {visible_lines(str(error))}\n")
        return FAULTY
    report = site_report(site, verify)
    driven = _driven_lines(report, logs) if logs else ()
    out.writelines(f"{visible(line)}\n" for line in chain(report_lines(report), driven, needs(site)))
    return FAULTY if report.problems else 0


def _driven_lines(report: SiteReport, logs: Sequence[Path]) -> Iterator[str]:
    """How far each vendor's map is from what its robots drive."""
    from deconflict.settings.importers import driven_log, proposed_maps  # noqa: PLC0415 - loads numba

    maps = {(each.vendor, each.map.datum): each.map for each in report.maps}
    for proposal in proposed_maps.proposals(driven_log.driven_log(logs, report.site), report.site):
        yield ""
        yield from proposed_maps.difference_lines(proposal, maps.get((proposal.vendor, proposal.datum)))


def site_report(site: Site, verify: Callable[[Site], Iterable[str]] = lambda _: ()) -> SiteReport:
    maps = tuple(
        _map_report(vendor, vendor_map, datum_of(site, vendor_map))
        for vendor in site.vendors
        for vendor_map in vendor.maps
    )
    problems = fit_problems(site)
    try:
        problems += verify(site)
    except (SecretError, CertificateError) as error:
        problems.append(str(error))
    return SiteReport(site, maps, tuple(problems))


def report_lines(report: SiteReport) -> Iterator[str]:
    """The report as text."""
    site = report.site
    yield f"FAILED: {len(report.problems)} to correct" if report.problems else "PASSED"
    for problem in report.problems:
        yield f"FAILS {problem}"
    for question in questions(site):
        yield f"NOTE {question}"
    yield ""
    counts = {"datum": site.datums, "vendor": site.vendors, "own map": report.maps}
    counted = (count_of(len(found), noun) for noun, found in counts.items())
    yield f"{site.name}: {', '.join(counted)}"
    for datum in site.datums:
        yield from _datum_lines(datum)
    for vendor in site.vendors:
        if not vendor.maps:
            yield ""
            yield f"{vendor.name}: sends in the datums' own coordinates"
    yield from _kind_lines(site)
    for map_report in report.maps:
        yield from _map_lines(map_report)
    yield from _place_lines(site)
    for source in site.mqtt_sources:
        makers = ", ".join(source.manufacturers) or "all manufacturers"
        yield ""
        yield f"broker {source.name}, {source.host}:{source.port}: {source.language} of {makers}"
    if site.cluster:
        expected = (f"{count or 'all seen'} {part}s" for part, count in site.cluster.expected().items())
        yield ""
        yield f"cluster {site.cluster.name}, expected members: {', '.join(expected)}"


def questions(site: Site) -> Iterator[str]:
    """What may be right, but is more often a slip."""
    for datum in site.datums:
        if not _is_uuid(datum.id):
            yield f"datum {datum.name}: its id {datum.id!r} is no UUID; MassRobotics robots send one, VDA 5050 a mapId"
    if site.conflict.clearance_m > LARGE_CLEARANCE_M:
        yield f"conflict.clearance_m = {site.conflict.clearance_m:g}: robots that pass at that distance are warned of"
    for key, size_m in _envelopes(site):
        if max(size_m[:2]) > LARGE_ENVELOPE_M:
            yield f"{key}: an envelope of {size_m[0]:g} x {size_m[1]:g}; is it in metres?"


def _envelopes(site: Site) -> Iterator[tuple[str, Envelope]]:
    sizes_m: list[tuple[str, Envelope | None]] = [("reading", site.reading.default_envelope_m)]
    for vendor in site.vendors:
        sizes_m.append((f"vendor {vendor.name}", vendor.default_envelope_m))
        for name, model in vendor.models.items():
            sizes_m += [
                (f"vendor {vendor.name}, model {name}", size_m)
                for size_m in (model.envelope_m, model.loaded_envelope_m)
            ]
    return ((key, size_m) for key, size_m in sizes_m if size_m)


def _is_uuid(text: str) -> bool:
    try:
        UUID(text)
    except ValueError:
        return False
    return True


def _map_report(vendor: Vendor, vendor_map: VendorMap, datum: Datum) -> MapReport:
    problems = tuple(map_problems(vendor_map, datum))
    try:
        fit = fit_map(vendor_map, datum)
    except FitError:
        return MapReport(vendor.name, vendor_map, datum, None, problems, ())
    return MapReport(vendor.name, vendor_map, datum, fit, problems, () if problems else tuple(_notes(fit, vendor_map)))


def _notes(fit: Fit, vendor_map: VendorMap) -> Iterator[str]:
    points, scale = tuple(vendor_map.readings), fit.affine.scales[0]
    if METRE_LIKE[0] < scale < METRE_LIKE[1] and not METRE_MAP[0] < scale < METRE_MAP[1]:
        yield f"one unit of the map is {scale:z.3f} m; if it is a map in metres, a reading is wrong"
    if fit.method is Method.SIMILARITY:
        yield "two points can't show a wrong reading or a mirrored map; read at least two more"
    elif fit.method is Method.AFFINE:
        yield "three points always fit exactly, so they can't show which reading is wrong; read a fourth"
    elif (
        max(fit.residuals_m) <= vendor_map.tolerance_m
        and not np.isnan(fit.left_out_m).all()
        and np.nanmax(fit.left_out_m) > vendor_map.tolerance_m
    ):
        worst = int(np.nanargmax(fit.left_out_m))
        p, off_m = points[worst], fit.left_out_m[worst]
        yield f"a fit without {p} places it {off_m:z.3f} m from its reference point; read {p} again first"


def _datum_lines(datum: Datum) -> Iterator[str]:
    yield ""
    yield f"datum {datum.name}, {datum.id}, level {datum.level}: {len(datum.reference_points)} reference points"
    if datum.coordinates == "metres":
        return
    yield f"  in degrees ({datum.coordinates}); (0, 0) of the floor is at {datum.reference_location}, x east, y north"
    chart = Projection(datum)
    for point in datum.reference_points:
        x_m, y_m = chart.points(np.array([[point.x, point.y]]))[0]
        yield f"  {_short(point.name or point.id):24} {point.x:12.7f} {point.y:12.7f}  ->  {x_m:z10.3f} {y_m:z10.3f} m"
    yield "  yaw 0 deg (north) becomes 90 deg on the floor, yaw 90 deg (east) becomes 0 deg"


def _kind_lines(site: Site) -> Iterator[str]:
    """What the devices of each vendor stand for, if not for robots alone."""
    for vendor in site.vendors:
        models = {name: model.participant for name, model in vendor.models.items() if model.participant}
        uuids = [f"{count_of(len(begins), 'UUID')}: {NOUNS[kind][1]}" for kind, begins in vendor.participants.items()]
        apart = [*(f"model {name}: {NOUNS[kind][1]}" for name, kind in models.items()), *uuids]
        if apart or vendor.participant != "robot":
            yield ""
            yield f"{vendor.name}: {'; '.join([NOUNS[vendor.participant][1], *apart])}"


def _place_lines(site: Site) -> Iterator[str]:
    """The places that robots share."""
    names = {datum.id: datum.name for datum in site.datums}
    places: list[Resource | Zone] = [*site.resources, *site.zones]
    for place in places:
        floors = " and ".join(names[datum] for datum, _ in outlines(place))
        area_m2 = shapely.Polygon(place.polygon).area
        yield ""
        yield f"{place.kind} {place.label}, {place.id}, on {floors}: {area_m2:.1f} m2, capacity {place.capacity}"
        if isinstance(place, Resource):
            group = f", one of group {place.group}" if place.group else ""
            service = (
                f"{place.service_s:g} s" if place.service_s else f"learned, {PRIOR_SERVICE_S[place.kind]:g} s at first"
            )
            yield f"  service {service}{group}"
        elif place.axis:
            yield f"  single lane of {dist(*place.axis):.1f} m"


def _map_lines(report: MapReport) -> Iterator[str]:
    vendor_map, fit = report.map, report.fit
    yield ""
    yield f"{report.vendor}: own map {vendor_map.datum or '(no datum sent)'} on datum {report.datum.name}"
    if fit:
        yield from _fit_lines(fit)
        yield from _point_lines(fit, vendor_map, report.datum)
        yield from _example_lines(report)
    for note in report.notes:
        yield f"  NOTE {note}"
    yield "  FAILS, see above" if report.problems else f"  fits within tolerance_m = {vendor_map.tolerance_m}"


def _fit_lines(fit: Fit) -> Iterator[str]:
    affine = fit.affine
    (along_x, along_y), (x_m, y_m) = affine.scales, affine.shift
    yield (
        f"  method {fit.method}, {'mirrored' if affine.mirrored else 'not mirrored'}, "
        f"rotation {degrees(affine.rotation_rad):z.3f} deg, translation ({x_m:z.3f}, {y_m:z.3f}) m"
    )
    yield f"  one unit is {along_x:.6g} m along x, {along_y:.6g} m along y; shear {degrees(affine.shear_rad):z.3f} deg"


def _point_lines(fit: Fit, vendor_map: VendorMap, datum: Datum) -> Iterator[str]:
    names = {point.id: point.name or point.id for point in datum.reference_points}
    yield f"  {'reference point':24} {'map x':>11} {'map y':>11}  ->  {'floor x':>9} {'floor y':>9}  residual  left out"
    digits = 3 if np.ptp(list(vendor_map.readings.values()), axis=0).max() >= 1 else 7
    for row, (point, reading) in enumerate(vendor_map.readings.items()):
        x_m, y_m = fit.transform(np.array([reading]))[0]
        left_out = "-" if np.isnan(fit.left_out_m[row]) else f"{fit.left_out_m[row]:z.3f} m"
        yield (
            f"  {_short(names[point]):24} {reading[0]:z11.{digits}f} {reading[1]:z11.{digits}f}"
            f"  ->  {x_m:z9.3f} {y_m:z9.3f}  {fit.residuals_m[row]:z6.3f} m  {left_out:>8}"
        )


def _example_lines(report: MapReport) -> Iterator[str]:
    """Where the service places the map's origin, and a robot in the middle of the readings."""
    vendor = Vendor(name=report.vendor, maps=(report.map,))
    frame = FrameRegistry([report.datum], [vendor]).frame(report.vendor, report.map.datum)
    x, y = np.mean(list(report.map.readings.values()), axis=0).tolist()
    for what, sent in (("its origin", (0.0, 0.0, 0.0)), ("a robot", (x, y, 0.0))):
        yield f"  {what} at {_pose(sent)} on the map is at {_pose(frame.pose(*sent))} on the floor"


def _pose(pose: Pose) -> str:
    return f"({pose[0]:z.3f}, {pose[1]:z.3f}), yaw {degrees(pose[2]):.1f} deg"


def _short(name: str) -> str:
    return name if len(name) <= 24 else f"{name[:23]}…"
