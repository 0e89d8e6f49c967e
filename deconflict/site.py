"""The site file: everything a person sets, in one TOML file, validated with errors that name the key."""

import difflib
import tomllib
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError

from ingest.fits import Fit, FitError, Method
from ingest.frames import fit_map
from ingest.settings import Datum, Metres, Reading, Receiver, Recorder, Seconds, Section, Vendor, VendorMap


MAX_DISTORTION = 0.05
"""Largest share by which a fit may stretch one direction more than another: survey errors stay below."""


class Conflict(Section):
    """What counts as a conflict, and when a person is told."""

    clearance_m: Metres = 0.3
    """Envelopes that come nearer than this are in conflict. Too large floods people, too small warns late."""
    horizon_s: Seconds = 10.0
    """How far ahead conflicts are looked for; a path reaches ten seconds."""
    confirm: tuple[Annotated[int, Field(ge=1)], Annotated[int, Field(ge=1)]] = (2, 3)
    """An advisory is raised when so many of so many looks predict it. [1, 1] raises at the first."""
    urgent_s: Seconds = 2.0
    """A conflict nearer than this needs no confirmation."""
    clear_after_s: Seconds = 3.0
    """An advisory is cleared when it has not been predicted for this long. Too short makes advisories flicker."""
    clear_margin_m: Metres = 0.1
    """How far beyond the clearance a pair must draw apart before its encounter is over."""
    warning_s: Seconds = 5.0
    """A conflict nearer than this is a warning; before, a caution."""
    critical_s: Seconds = 2.0
    """A conflict nearer than this is critical."""
    silent_growth_mps: Metres = 0.05
    """How fast the uncertainty of a quiet robot grows on every side, metres a second."""
    silent_growth_limit_m: Metres = 1.0
    """Where that growth ends."""


class Engine(Section):
    """The pace of the engine."""

    tick_s: Seconds = 0.1
    """Shortest time between two passes. Half of it is the mean wait of a message before it is looked at."""


class Operator(Section):
    """The operators' port: API, stream, metrics."""

    host: str = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65535)] = 8080
    """0 takes any free port."""
    stream_send_timeout_s: Seconds = 10.0
    """A subscriber that has not taken a message for this long is dropped."""


class StoreSettings(Section):
    """Where recordings and advisories are kept."""

    directory: str = "data"


class Site(Section):
    """One site. Without a file every default holds, and every datum that robots name is a floor of its own."""

    name: str = "site"
    datums: tuple[Datum, ...] = ()
    vendors: tuple[Vendor, ...] = ()
    receiver: Receiver = Receiver()
    recorder: Recorder = Recorder()
    reading: Reading = Reading()
    conflict: Conflict = Conflict()
    engine: Engine = Engine()
    operator: Operator = Operator()
    store: StoreSettings = StoreSettings()


DEFAULT = Site()


class SiteError(ValueError):
    """A site file that can't be used; `problems` says what to change, a line each."""

    def __init__(self, problems: Iterable[str]) -> None:
        self.problems = tuple(problems)
        super().__init__("the site file has problems:\n" + "\n".join(f"  {one}" for one in self.problems))


def load(path: Path) -> Site:
    """The site in a TOML file. Raises `SiteError` naming each wrong key."""
    try:
        told = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise SiteError([f"{path} can't be read: {error}"]) from error
    except tomllib.TOMLDecodeError as error:
        raise SiteError([f"{path} is not TOML: {error}"]) from error
    try:
        site = Site.model_validate(told)
    except ValidationError as error:
        raise SiteError(_explained(one) for one in error.errors(include_url=False)) from error
    contradictions = list(_contradictions(site))
    if contradictions:
        raise SiteError(contradictions)
    return site


def problems(site: Site) -> list[str]:
    """What is wrong with the vendors' maps, a sentence each; empty where every one fits."""
    return [
        f"{_map_key(row, column)}: {sentence}"
        for row, vendor in enumerate(site.vendors)
        for column, one in enumerate(vendor.maps)
        for sentence in _map_problems(one, datum_of(site, one))
    ]


def datum_of(site: Site, one: VendorMap) -> Datum:
    """The site's datum that a vendor's map belongs to."""
    return next(datum for datum in site.datums if datum.id == one.site_datum)


def _map_problems(one: VendorMap, datum: Datum) -> Iterator[str]:
    try:
        found = fit_map(one, datum)
    except FitError as error:
        yield str(error)
        return
    yield from _fit_problems(found, one)


def _fit_problems(found: Fit, one: VendorMap) -> Iterator[str]:
    if found.affine.mirrored and not one.mirrored:
        yield "the readings are mirrored; set mirrored = true if that map is left-handed, else swap its x and y back"
    if one.mirrored and not found.affine.mirrored:
        yield "mirrored = true, but the readings are not mirrored"
    worst_m = float(found.residuals_m.max())
    if worst_m > one.tolerance_m:
        point = list(one.readings)[int(found.residuals_m.argmax())]
        yield f"reference point {point} is off by {worst_m:.3f} m, more than tolerance_m = {one.tolerance_m}"
    if found.method is not Method.SIMILARITY and found.affine.distortion > MAX_DISTORTION:
        share = 100 * found.affine.distortion
        yield f"the fit stretches one direction {share:.0f} % more than another; a reading is wrong"


def _explained(error: Any) -> str:
    """One validation error as the key in TOML terms, what was found and what was expected."""
    key = _key(error["loc"])
    if error["type"] == "extra_forbidden":
        known = _known_keys(error["loc"][:-1])
        near = difflib.get_close_matches(str(error["loc"][-1]), known, 1)
        hint = f"did you mean {near[0]}?" if near else f"expected one of {', '.join(known)}"
        return f"{key}: there is no such key; {hint}"
    if error["type"] == "missing":
        return f"{key}: is missing"
    return f"{key}: {error['msg'].lower()}; found {str(error['input'])[:80]!r}"


def _key(location: Iterable[Any]) -> str:
    text = ""
    for part in location:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text


def _known_keys(location: Iterable[Any]) -> list[str]:
    """The keys of the section at `location`, from the schema."""
    schema = Site.model_json_schema()
    at: Any = schema
    for part in location:
        at = (
            at.get("items", at)
            if isinstance(part, int)
            else at.get("properties", {}).get(part, at.get("additionalProperties", {}))
        )
        at = schema["$defs"][at["$ref"].rsplit("/", 1)[1]] if "$ref" in at else at
    return list(at.get("properties", {}))


def _contradictions(site: Site) -> Iterator[str]:
    """What each key alone does not show."""
    yield from _repeated("datums", "id", (datum.id for datum in site.datums))
    yield from _repeated("vendors", "name", (vendor.name for vendor in site.vendors))
    yield from _repeated("vendors", "robots", (uuid.lower() for vendor in site.vendors for uuid in vendor.robots))
    for row, datum in enumerate(site.datums):
        yield from _repeated(f"datums[{row}].reference_points", "id", (point.id for point in datum.reference_points))
        if datum.coordinates != "metres" and datum.reference_location is None:
            yield f"datums[{row}].reference_location: is missing; coordinates in degrees need it"
    for row, vendor in enumerate(site.vendors):
        yield from _repeated(f"vendors[{row}].maps", "datum", (one.datum for one in vendor.maps))
        for column, one in enumerate(vendor.maps):
            yield from _map_contradictions(site, _map_key(row, column), one)
    if site.conflict.confirm[0] > site.conflict.confirm[1]:
        yield f"conflict.confirm: {list(site.conflict.confirm)} asks for more looks than it counts"
    if site.conflict.critical_s > site.conflict.warning_s:
        yield "conflict.critical_s: must not be above conflict.warning_s"
    if site.receiver.port == site.operator.port != 0:
        yield f"operator.port: {site.operator.port} is the receiver's port too; set another"


def _map_contradictions(site: Site, key: str, one: VendorMap) -> Iterator[str]:
    datum = next((datum for datum in site.datums if datum.id == one.site_datum), None)
    if datum is None:
        yield f"{key}.site_datum: no datum has the id {one.site_datum!r}"
        return
    known = {point.id for point in datum.reference_points}
    for point in one.readings:
        if point not in known:
            near = difflib.get_close_matches(point, known, 1)
            hint = f"; did you mean {near[0]}?" if near else ""
            yield f"{key}.readings.{point}: datum {datum.name!r} has no such reference point{hint}"


def _map_key(row: int, column: int) -> str:
    return f"vendors[{row}].maps[{column}]"


def _repeated(section: str, key: str, values: Iterable[str]) -> Iterator[str]:
    for value, count in Counter(values).items():
        if count > 1:
            yield f"{section}: {key} {value!r} is given {count} times"
