"""What robots drove by a log, in the frame of each vendor's datum: places and moments, not the reports."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from math import inf, nan
from pathlib import Path

import numpy as np

from deconflict.settings.fleet_factory import fast_fleet_of
from deconflict.settings.map_checks import METRE_LIKE
from deconflict.settings.site import Site
from deconflict.settings.site_file import datum_of
from ingest.batch import Batch
from ingest.frames.driven.driven_places import DrivenPlacesSum
from ingest.frames.driven.map_search import DrivenFrame
from ingest.frames.driven.shared_moments import MomentsSum
from ingest.frames.fitting import FitError
from ingest.frames.frame_registry import fit_map
from ingest.frames.transforms import Affine
from ingest.measures.measures import Measures
from ingest.recording.log_reader import LogReader, Received, by_time
from ingest.settings import NIL_DATUM, Datum, ReferencePoint, Vendor, VendorMap

LOOK_S = 1.0
UNITS_M = (0.001, 0.01, 0.0254, 0.3048)
NEAR_UNIT = 0.05
CORNERS = ((0.0, 0.0), (100.0, 0.0), (0.0, 100.0))
AS_SENT = Affine(np.eye(2), np.zeros(2))
SentFrame = tuple[str, str]
"""A vendor, and the datum that its robots send."""


@dataclass(slots=True, eq=False)
class _Heard:
    places: DrivenPlacesSum = field(default_factory=DrivenPlacesSum)
    moments: MomentsSum = field(default_factory=MomentsSum)
    robots: set[str] = field(default_factory=set)


@dataclass(frozen=True, slots=True, eq=False)
class DrivenLog:
    """A log as maps are proposed from it."""

    frames: dict[SentFrame, DrivenFrame]
    """In metres, in the frame of each datum."""
    robots: dict[SentFrame, int]
    bases: dict[SentFrame, Affine]
    """From what is sent to metres in that frame, where that is not the same."""
    first_s: float
    last_s: float


def driven_log(logs: Iterable[Path], site: Site) -> DrivenLog:
    """Reads the logs once. People are left out: they walk across lanes."""
    bases = dict(_bases(site))
    fleet, heard = fast_fleet_of(_unaligned(site, bases), Measures()), dict[SentFrame, _Heard]()
    first_s, last_s, cut_s = inf, nan, -inf
    for event in LogReader().read(by_time(logs)):
        if not isinstance(event, Received) or event.refused:
            continue
        fleet.receive_recorded(event)
        first_s, last_s = min(first_s, event.arrival_s), event.arrival_s
        if event.arrival_s - cut_s >= LOOK_S:
            cut_s = event.arrival_s
            _take_in(heard, fleet.next_batch(cut_s))
    if first_s <= last_s:
        _take_in(heard, fleet.next_batch(last_s))
    frames = {sent: DrivenFrame(own.places.places(), own.moments.moments()) for sent, own in heard.items()}
    return DrivenLog(frames, {sent: len(own.robots) for sent, own in heard.items()}, bases, first_s, last_s)


def _take_in(heard: dict[SentFrame, _Heard], batch: Batch) -> None:
    forecasts, first = batch.forecasts, batch.forecasts.start[:-1]
    x_m, y_m, half_m = forecasts.x_m[first].tolist(), forecasts.y_m[first].tolist(), (forecasts.width_m / 2).tolist()
    for row, floor in enumerate(batch.datums(forecasts.floor[first])):
        if not floor or batch.participants[row] == "person" or not batch.statuses[row]:
            continue
        vendor, robot, t_s = batch.vendors[row], batch.robots[row], float(batch.event_s[row])
        own = heard.setdefault((vendor, _sent(floor)), _Heard())
        own.robots.add(robot)
        own.places.add(robot, t_s, x_m[row], y_m[row])
        own.moments.add(robot, t_s, x_m[row], y_m[row], half_m[row])


def _own_floor(vendor: str, datum: str) -> str:
    """The id of a made floor, on which only the robots of one vendor with one datum are."""
    return f"{vendor}\n{datum}"


def _sent(floor: str) -> str:
    return floor.rpartition("\n")[2]


def _bases(site: Site) -> Iterable[tuple[SentFrame, Affine]]:
    for vendor in site.vendors:
        datums = {vendor_map.datum: _base(vendor_map, datum_of(site, vendor_map)) for vendor_map in vendor.maps}
        for unnamed in ("", NIL_DATUM):
            datums.setdefault(unnamed, AS_SENT)
        for datum, base in datums.items():
            yield (vendor.name, datum), base


def _base(vendor_map: VendorMap, datum: Datum) -> Affine:
    """From what is sent to metres, right-handed: the unit of a map is known better than where it lies."""
    try:
        affine = fit_map(vendor_map, datum).affine
    except FitError:
        return AS_SENT
    flip = np.diag([1.0, -1.0 if vendor_map.mirrored else 1.0])
    unit_m = affine.scales[0]
    if METRE_LIKE[0] < unit_m < METRE_LIKE[1]:
        return Affine(flip, np.zeros(2))
    near = [unit for unit in UNITS_M if abs(unit_m / unit - 1) < NEAR_UNIT and affine.distortion < NEAR_UNIT]
    return Affine(flip * near[0], np.zeros(2)) if near else affine


def _unaligned(site: Site, bases: dict[SentFrame, Affine]) -> Site:
    """The site with each vendor's datum as a floor of its own."""
    datums = [_made_datum(*sent, base) for sent, base in bases.items()]
    vendors = tuple(
        _with_own_floors(vendor, [datum for name, datum in bases if name == vendor.name]) for vendor in site.vendors
    )
    return site.model_copy(update={"datums": (*site.datums, *datums), "vendors": vendors})


def _made_datum(vendor: str, datum: str, base: Affine) -> Datum:
    points = base(np.array(CORNERS)).tolist()
    marks = tuple(ReferencePoint(id=str(number), x=x, y=y) for number, (x, y) in enumerate(points))
    made = Datum(id="", name=datum, reference_points=marks)
    return made.model_copy(update={"id": _own_floor(vendor, datum)})


def _with_own_floors(vendor: Vendor, datums: Iterable[str]) -> Vendor:
    made = VendorMap(datum="", site_datum="", readings={str(number): corner for number, corner in enumerate(CORNERS)})
    floors = [(datum, _own_floor(vendor.name, datum)) for datum in datums]
    maps = tuple(made.model_copy(update={"datum": datum, "site_datum": floor}) for datum, floor in floors)
    return vendor.model_copy(update={"maps": maps})
