"""Vendors' maps, proposed from what their robots and others drive; how far a map's readings are from that."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from math import degrees
from pathlib import Path

import numpy as np

from deconflict.settings.importers.driven_log import AS_SENT, DrivenLog, driven_log
from deconflict.settings.importers.toml_values import toml_value
from deconflict.settings.map_checks import places_m
from deconflict.settings.site import Site
from deconflict_client.counted_nouns import count_of
from ingest.batch import Floats
from ingest.frames.driven.driven_places import DrivenPlaces
from ingest.frames.driven.line_fit import TURN, FittedTransform
from ingest.frames.driven.map_search import Doubt, DrivenFrame, FoundMap, found_map
from ingest.frames.driven.shared_moments import Moments
from ingest.frames.fitting import FitError
from ingest.frames.frame_registry import fit_map
from ingest.frames.transforms import Affine
from ingest.languages.visible_text import visible
from ingest.settings import Datum, ReferencePoint, VendorMap

WHY = {
    Doubt.LITTLE: "too little was driven in the same aisles at the same time. Record for longer, at a busy hour",
    Doubt.OPEN: "what was driven leaves a shift or a turn open, as along a single aisle. Let its robots drive aisles "
    "in other directions and parts of the floor, where others drive too",
    Doubt.LIKENESS: "it fits the floor in more than one way, as a floor with equal aisles does. Record for longer, so "
    "that robots meet, or let it drive where the floor is not like itself",
    Doubt.APART: "nothing shows that its robots meet the others: they drive in other parts or at other times. Record "
    "when both drive in the same aisles",
    Doubt.STRETCHED: "its map is stretched, or its robots drive far off the lanes of the others. Read marks",
    Doubt.MIRRORED: "its map is mirrored (y is to the right of x, seen from above)",
}
FITTING = (Doubt.STRETCHED, Doubt.MIRRORED)
"""Then there is enough driving, and the vendor's map is wrong."""
OFF_M, OFF_ERRORS = 0.3, 2.0
"""A reading is questioned if it is farther off than both: metres, and uncertainties of the proposal."""


@dataclass(frozen=True, slots=True, eq=False)
class MapProposal:
    """What driving says of the frame of one vendor's datum."""

    vendor: str
    datum: str
    """As its robots send it."""
    site_datum: Datum
    robots: int
    found: FoundMap
    base: Affine
    """From what is sent to metres."""
    others: tuple[str, ...]
    """The vendors whose driving it was compared with."""
    corners_m: Floats
    """(4, 2) of the floor as driven, in its frame."""

    @property
    def fit(self) -> FittedTransform | None:
        """None if nothing is proposed."""
        return self.found.fit if self.found.doubt is None else None

    def transform(self, fit: FittedTransform) -> Affine:
        """From what is sent to the floor's frame."""
        return Affine(fit.matrix @ self.base.matrix, fit.matrix @ self.base.shift + fit.shift_m)


def proposals(log: DrivenLog, site: Site) -> list[MapProposal]:
    """One for each vendor's datum that is none of the site's, and that its robots sent."""
    site_datums = {datum.id for datum in site.datums}
    sent = sorted(frame for frame in log.frames if frame[1] not in site_datums)
    return [best for vendor, datum in sent if (best := _proposal(log, site, vendor, datum))]


def _proposal(log: DrivenLog, site: Site, vendor: str, datum: str) -> MapProposal | None:
    """The one on the floor of its map, or else on the floor where it fits."""
    known_map = _map_of(site, vendor, datum)
    floors = [floor for floor in site.datums if known_map is None or floor.id == known_map.site_datum]
    trials = [_on_floor(log, site, vendor, datum, floor) for floor in floors]
    fitting = [trial for trial in trials if trial.found.doubt is None]
    if len(fitting) > 1:
        return replace(fitting[0], found=replace(fitting[0].found, doubt=Doubt.LIKENESS))
    trials.sort(key=lambda trial: -(trial.found.fit.agreement if trial.found.fit else 0.0))
    return next(iter(fitting or trials), None)


def _on_floor(log: DrivenLog, site: Site, vendor: str, datum: str, floor: Datum) -> MapProposal:
    known = _known(log, site, floor, (vendor, datum))
    found, corners_m = FoundMap(None, None, Doubt.LITTLE), np.zeros((4, 2))
    if known:
        places = DrivenPlaces.joined([frame.places for frame in known.values()])
        moments = Moments.joined([frame.moments for frame in known.values()])
        found = found_map(log.frames[vendor, datum], DrivenFrame(places, moments))
        (west, south), (east, north) = places.points_m.min(axis=0), places.points_m.max(axis=0)
        corners_m = np.array([(west, south), (east, south), (east, north), (west, north)])
    others = tuple(sorted({name for name, _ in known}))
    base = log.bases.get((vendor, datum), AS_SENT)
    return MapProposal(vendor, datum, floor, log.robots[vendor, datum], found, base, others, corners_m)


def _known(log: DrivenLog, site: Site, floor: Datum, own: tuple[str, str]) -> dict[tuple[str, str], DrivenFrame]:
    """What is driven on a floor by robots that send its datum, or else by those of other maps."""
    direct = {sent: frame for sent, frame in log.frames.items() if sent[1] == floor.id and len(frame.places)}
    return direct or {
        sent: placed
        for sent, frame in log.frames.items()
        if sent != own and len(frame.places) and (placed := _by_its_map(log, site, floor, sent))
    }


def _by_its_map(log: DrivenLog, site: Site, floor: Datum, sent: tuple[str, str]) -> DrivenFrame | None:
    vendor_map = _map_of(site, *sent)
    if vendor_map is None or vendor_map.site_datum != floor.id:
        return None
    try:
        affine = fit_map(vendor_map, floor).affine
    except FitError:
        return None
    base, frame = log.bases[sent], log.frames[sent]
    matrix = affine.matrix @ np.linalg.inv(base.matrix)
    shift_m = affine.shift - matrix @ base.shift
    return DrivenFrame(frame.places.placed(matrix, shift_m), frame.moments.placed(matrix, shift_m))


def _map_of(site: Site, vendor: str, datum: str) -> VendorMap | None:
    maps = (vendor_map for each in site.vendors if each.name == vendor for vendor_map in each.maps)
    return next((vendor_map for vendor_map in maps if vendor_map.datum == datum), None)


def proposed_maps(logs: Sequence[Path], site: Site) -> str:
    """Maps as TOML, with how they were found; a comment for each vendor's datum of which none is proposed."""
    log = driven_log(logs, site)
    lines = [f"# Maps found from driving: {_source(logs, log)}."]
    for proposal in proposals(log, site):
        lines += ["", *(_map_lines(proposal) if proposal.fit else _refusal_lines(proposal))]
    if len(lines) == 1:
        lines += ["# No robot sent a datum that is not the site's: there is no map to find."]
    return "\n".join(map(visible, lines)) + "\n"


def _source(logs: Sequence[Path], log: DrivenLog) -> str:
    names = ", ".join(path.name for path in logs)
    if not log.frames:
        return f"{names}, in which no robot reports a place"
    first, last = (datetime.fromtimestamp(t_s, UTC) for t_s in (log.first_s, log.last_s))
    return f"{names}, {first:%Y-%m-%d %H:%M} to {last:%Y-%m-%d %H:%M} UTC"


def _refusal_lines(proposal: MapProposal) -> Iterator[str]:
    doubt = proposal.found.doubt
    title = "no map" if doubt in FITTING else "not enough driving in common"
    yield f"# {_subject(proposal)}: {title}."
    why = WHY[doubt] if doubt else ""
    if doubt is Doubt.STRETCHED and proposal.found.fit:
        why = f"one metre of the floor seems to be {1 / proposal.found.fit.scale:.4f} of its own: {why}"
    yield f"# {why[0].upper()}{why[1:]}."


def _subject(proposal: MapProposal) -> str:
    datum = proposal.datum or "(no datum sent)"
    return f"{proposal.vendor}, datum {datum}, {count_of(proposal.robots, 'robot')}"


def _map_lines(proposal: MapProposal) -> Iterator[str]:
    fit = proposal.fit
    if fit is None:
        return
    yield f"# {_subject(proposal)}. Paste below its [[vendors]], in place of a map with this datum."
    yield from (f"# {sentence}" for sentence in how_found(proposal, fit))
    marks = tuple(proposal.site_datum.reference_points)
    if len(marks) < 2:
        marks = _made_marks(proposal)
        yield f"# Datum {proposal.site_datum.name} has no marks to read. Add to it, or measure others there:"
        points = ", ".join(f'{{ id = "{mark.id}", x = {mark.x:z.3f}, y = {mark.y:z.3f} }}' for mark in marks)
        yield f"# reference_points = [{points}]"
    yield "[[vendors.maps]]"
    yield f"datum = {toml_value(proposal.datum)}"
    yield f"site_datum = {toml_value(proposal.site_datum.id)}"
    if proposal.base.mirrored:
        yield "mirrored = true"
    yield ""
    yield "[vendors.maps.readings]"
    transform = proposal.transform(fit)
    readings = (places_m(proposal.site_datum, marks) - transform.shift) @ np.linalg.inv(transform.matrix).T
    digits = max(0, round(3 + np.log10(transform.scales[0])))
    for mark, (x, y) in zip(marks, readings.tolist(), strict=True):
        yield f"{toml_value(mark.id)} = [{x:z.{digits}f}, {y:z.{digits}f}]"


def how_found(proposal: MapProposal, fit: FittedTransform) -> Iterator[str]:
    """How sure a proposal is, in sentences."""
    within = fit.sure_within
    error_deg = within * degrees(float(np.sqrt(fit.covariance[TURN, TURN])))
    overlaps = proposal.found.overlaps
    yield (
        f"{fit.common_m:,.0f} m driven in the lanes of {' and '.join(proposal.others)} on {proposal.site_datum.name}; "
        f"usual distance from their lanes {fit.residual_m:.2f} m."
    )
    yield (
        f"Uncertain (95 %) by {fit.error_m(0.0):.2f} m, by {fit.error_m(fit.reach_m):.2f} m at the rim, "
        f"and by {error_deg:.2f} degrees."
    )
    if overlaps:
        yield (
            f"Placed so, robots were in each other {count_of(overlaps.found, 'time')}; "
            f"if they did not see each other, {count_of(round(overlaps.expected), 'time')}."
        )


def _made_marks(proposal: MapProposal) -> tuple[ReferencePoint, ...]:
    corners = np.round(proposal.corners_m).tolist()
    return tuple(ReferencePoint(id=f"driven-{number}", x=x, y=y) for number, (x, y) in enumerate(corners, 1))


def difference_lines(proposal: MapProposal, vendor_map: VendorMap | None) -> Iterator[str]:
    """How far the readings of a map are from what is driven, for `deconflict check`."""
    fit = proposal.fit
    if fit is None:
        yield from (line.removeprefix("# ") for line in _refusal_lines(proposal))
        return
    yield f"{_subject(proposal)}: compared with driving"
    yield from (f"  {sentence}" for sentence in how_found(proposal, fit))
    try:
        read = fit_map(vendor_map, proposal.site_datum) if vendor_map else None
    except FitError:
        read = None
    if read is None or vendor_map is None:
        yield "  NOTE it has no map that fits; `deconflict site align` prints the one that was found"
        return
    driven = proposal.transform(fit)
    sent = (proposal.corners_m - driven.shift) @ np.linalg.inv(driven.matrix).T
    off_m = float(np.hypot(*(read.transform(sent) - proposal.corners_m).T).max())
    turn_deg = (degrees(read.affine.rotation_rad - driven.rotation_rad) + 180) % 360 - 180
    yield f"  the readings differ from it by {off_m:.2f} m at the floor's far corner and by {abs(turn_deg):.2f} degrees"
    yield from _wrong_readings(proposal, fit, vendor_map)


def _wrong_readings(proposal: MapProposal, fit: FittedTransform, vendor_map: VendorMap) -> Iterator[str]:
    marks = {mark.id: mark for mark in proposal.site_datum.reference_points}
    read = [marks[mark] for mark in vendor_map.readings]
    found_m = proposal.transform(fit)(np.array(list(vendor_map.readings.values())))
    for mark, place, found in zip(read, places_m(proposal.site_datum, read), found_m, strict=True):
        off_m, sure_m = float(np.hypot(*(found - place))), fit.error_m(float(np.hypot(*(place - fit.middle_m))))
        if off_m > max(OFF_M, OFF_ERRORS * sure_m):
            yield (
                f"  NOTE the reading of {mark.name or mark.id} is {off_m:.2f} m from where driving puts it, which is "
                f"known to {sure_m:.2f} m; read it again"
            )
