"""Reads the site file: one TOML file, validated with errors that name the key."""

import difflib
import json
import re
import tomllib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from deconflict.settings.cluster_settings import cluster_contradictions
from deconflict.settings.floor_plan import plan_problems
from deconflict.settings.map_checks import datum_problems, map_problems
from deconflict.settings.outlet_settings import outlet_problems, retry_problems
from deconflict.settings.shared_places import floor_part_problems, place_problems
from deconflict.settings.site import Site
from deconflict_client.counted_nouns import count_of
from ingest.plain_files import MOST_GIVEN_BYTES, decoded, read_file
from ingest.settings import NIL_DATUM, Datum, Vendor, VendorMap
from ingest.sizes.site_sizes import size_problems

SECRETS = ("password", "secret", "token")
"""Keys whose value no error contains: somebody may have put the secret itself there."""
MOST_PROBLEMS = 100
"""Problems of one file that are written out."""
_LONG_KEY = re.compile(r"""(?:^|(?<=[\s,{\[]))(?:(?:"[^"\n]*+"|'[^'\n]*+'|[^\s,{\[."'=]++)[ \t]*+\.[ \t]*+){50}""")
"""For a dotted key `tomllib` takes time with the square of its parts: hours for one of 100 kB."""


class SiteError(ValueError):
    """The site file, or another `source` of settings, can't be used. `problems` has a line for each thing to change."""

    def __init__(self, problems: Iterable[str], source: str = "the site file") -> None:
        self.problems = tuple(problems)
        super().__init__(f"{source} has problems:\n" + "\n".join(f"  {problem}" for problem in self.problems))


def load(path: Path) -> Site:
    """The site in a TOML file. Raises `SiteError`, which names each wrong key.

    Does not check whether readings fit: see `fit_problems`.
    """
    try:
        raw = read_file(path, MOST_GIVEN_BYTES)
    except OSError as error:
        raise SiteError([f"{path} can't be read: {error}"]) from error
    return site_from_toml(raw, path)


def site_from_toml(raw: bytes, path: Path) -> Site:
    """The site in the bytes of a TOML file. Raises `SiteError`, which names each wrong key; `path` is for its text."""
    try:
        document = parsed_toml(decoded(raw))
    except UnicodeDecodeError as error:
        raise SiteError([f"{path} can't be read: {error}"]) from error
    except ValueError as error:
        raise SiteError([f"{path} is not TOML: {error}"]) from error
    except RecursionError as error:
        raise SiteError([f"{path}: a value or a key has too many parts"]) from error
    return site_from_document(document)


def parsed_toml(text: str) -> dict[str, Any]:
    """A TOML document, in a time that does not grow beyond its length. Raises `ValueError` and `RecursionError`."""
    if _LONG_KEY.search(text):
        raise RecursionError
    return tomllib.loads(text)


def site_from_document(document: Mapping[str, Any]) -> Site:
    """The site of a parsed TOML document. Raises `SiteError`, which names each wrong key."""
    try:
        text = json.dumps(document, default=str)
    except (ValueError, RecursionError) as error:
        raise SiteError([f"a value can't be read: {error}"]) from error
    try:
        site = Site.model_validate_json(text, strict=True)
    except ValidationError as error:
        problems = [_explained(problem) for problem in error.errors(include_url=False)]
        raise SiteError(_first(problems, document)) from error
    contradictions = list(_contradictions(site))
    if contradictions:
        raise SiteError(_first(contradictions, document))
    return site


def _first(problems: list[str], document: Mapping[str, Any]) -> Iterator[str]:
    """The first `MOST_PROBLEMS` with names. Nobody reads more, and each takes as long as the file is."""
    yield from (_with_names(problem, document) for problem in problems[:MOST_PROBLEMS])
    if len(problems) > MOST_PROBLEMS:
        yield f"and {count_of(len(problems) - MOST_PROBLEMS, 'more problem')}"


def fit_problems(site: Site) -> list[str]:
    """A sentence for each problem of the reference points and of the vendors' readings of them."""
    return [
        *(
            f"datum {datum.name}: {problem}"
            for datum in site.datums
            for problem in (*datum_problems(datum), *plan_problems(datum))
        ),
        *(
            f"vendor {vendor.name}, map {vendors_map.datum or '(no datum sent)'}: {problem}"
            for vendor in site.vendors
            for vendors_map in vendor.maps
            for problem in map_problems(vendors_map, datum_of(site, vendors_map))
        ),
    ]


def datum_of(site: Site, vendor_map: VendorMap) -> Datum:
    """The site's datum that a vendor's map belongs to."""
    return next(datum for datum in site.datums if datum.id == vendor_map.site_datum)


def _explained(error: Mapping[str, Any]) -> str:
    """A validation error as text: the key as in TOML, what was found and what was expected."""
    location = error["loc"]
    key = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location).lstrip(".")
    if error["type"] == "extra_forbidden":
        known = list(_schema_at(location[:-1]).get("properties", {}))
        return f"{key}: there is no such key; {_nearest(str(location[-1]), known)}"
    if error["type"] == "missing":
        schema = _schema_at(location)
        return f"{key}: is missing; expected {schema.get('description') or schema.get('type', 'a value')}"
    if location[-1] in SECRETS:
        return f"{key}: expected env:NAME or file:PATH, not the secret itself"
    message = error["msg"][0].lower() + error["msg"][1:]
    return f"{key}: {message}; found {str(error['input'])[:80]!r}"


def _with_names(problem: str, document: Mapping[str, Any]) -> str:
    """A problem whose keys have names instead of numbers: "vendors.Corvid.token", not "vendors[0].token"."""
    return _NUMBERED_KEY.sub(lambda key: _named_key(key[0], document), problem)


_NUMBERED_KEY = re.compile(r"\b\w+\[\d+\](?:\.\w+(?:\[\d+\])?)*")


def _named_key(key: str, document: Any) -> str:
    """Entries without a name of their own keep their number."""
    named, at = "", document
    for part, row in re.findall(r"(\w+)(?:\[(\d+)\])?", key):
        at = at.get(part) if isinstance(at, Mapping) else None
        named += f".{part}" if named else part
        if row:
            entries = at if isinstance(at, list) else []
            names = [_name_of(entry) for entry in entries]
            at, name = (entries[int(row)], names[int(row)]) if int(row) < len(entries) else (None, None)
            named += f".{name}" if name and names.count(name) == 1 else f"[{row}]"
    return named


def _name_of(entry: Any) -> str | None:
    names = (entry.get(key) for key in ("name", "id", "datum")) if isinstance(entry, Mapping) else ()
    return next((name for name in names if isinstance(name, str) and name), None)


def _nearest(found: str, known: list[str]) -> str:
    near = difflib.get_close_matches(found, known, 1)
    return f"did you mean {near[0]}?" if near else f"expected one of {', '.join(known) or 'none'}"


@cache
def _schema() -> dict[str, Any]:
    return Site.model_json_schema()


def _schema_at(location: Iterable[Any]) -> Any:
    """The JSON Schema of the key at `location`."""
    schema = _schema()
    at: Any = schema
    for part in location:
        inner = at.get("items", {}) if isinstance(part, int) else at.get("properties", {}).get(part)
        at = at.get("additionalProperties", {}) if inner is None else inner
        at = at.get("anyOf", [at])[0]
        at = schema["$defs"][at["$ref"].rsplit("/", 1)[1]] if "$ref" in at else at
    return at


def _contradictions(site: Site) -> Iterator[str]:
    """A sentence for each contradiction between keys."""
    yield from _datum_contradictions(site)
    yield from _vendor_contradictions(site)
    yield from place_problems(site.resources, site.zones, (datum.id for datum in site.datums))
    yield from floor_part_problems(site.areas, site.obstacles, site.datums)
    yield from outlet_problems(site.webhooks, site.mqtt)
    yield from cluster_contradictions(site.cluster)
    yield from _ignored_by_cluster(site) if site.cluster else ()
    yield from _source_contradictions(site)
    yield from size_problems(site.vendors, site.reading)
    conflict, reading, recorder = site.conflict, site.reading, site.recorder
    if conflict.confirm[0] > conflict.confirm[1]:
        yield f"conflict.confirm: {list(conflict.confirm)} asks for more looks than it counts"
    yield from _not_above("conflict.critical_s", conflict.critical_s, "conflict.warning_s", conflict.warning_s)
    yield from _not_above("conflict.horizon_s", conflict.horizon_s, "reading.horizon_s", reading.horizon_s)
    yield from _not_above(
        "reading.quiet_after_s", reading.quiet_after_s, "reading.silent_after_s", reading.silent_after_s
    )
    yield from _not_above(
        "reading.silent_after_s", reading.silent_after_s, "reading.forget_after_s", reading.forget_after_s
    )
    yield from _not_above(
        "recorder.segment_bytes", recorder.segment_bytes, "recorder.total_bytes", recorder.total_bytes
    )
    first_s, longest_s = site.receiver.dial_backoff_s
    yield from _not_above("receiver.dial_backoff_s[0]", first_s, "receiver.dial_backoff_s[1]", longest_s)
    yield from _repeated(
        (f"operator.people[{row}].name", person.name) for row, person in enumerate(site.operator.people)
    )
    certificates = [(f"vendors[{row}]", vendor.certificate_names) for row, vendor in enumerate(site.vendors)]
    yield from _repeated((f"{key}.certificate_names", name.casefold()) for key, names in certificates for name in names)
    if any(names for _, names in certificates) and not (site.receiver.tls and site.receiver.tls.clients):
        yield "receiver.tls.clients: is missing; certificate_names need the authority that signs them"
    if site.receiver.port == site.operator.port != 0:
        yield f"operator.port: {site.operator.port} is receiver.port too; set another"


def _not_above(low_key: str, low: float, high_key: str, high: float) -> Iterator[str]:
    if low > high:
        yield f"{low_key}: found {low}; expected at most {high_key} = {high}"


def _datum_contradictions(site: Site) -> Iterator[str]:
    yield from _repeated((f"datums[{row}].id", datum.id) for row, datum in enumerate(site.datums))
    for row, datum in enumerate(site.datums):
        key = f"datums[{row}]"
        if datum.id in ("", NIL_DATUM):
            yield f"{key}.id: {datum.id!r} names no datum; expected a UUID of its own"
        points = enumerate(datum.reference_points)
        yield from _repeated((f"{key}.reference_points[{column}].id", point.id) for column, point in points)
        if datum.coordinates == "metres":
            continue
        if datum.reference_location is None:
            yield f"{key}.reference_location: is missing; coordinates in degrees need [latitude, longitude]"
        elif not (abs(datum.reference_location[0]) <= 90 and abs(datum.reference_location[1]) <= 180):
            yield f"{key}.reference_location: found {list(datum.reference_location)}; expected [latitude, longitude]"


def _vendor_contradictions(site: Site) -> Iterator[str]:
    yield from _repeated(name for row, vendor in enumerate(site.vendors) for name in _manufacturers(row, vendor))
    yield from _repeated(
        (f"vendors[{row}].robots[{column}]", uuid.lower())
        for row, vendor in enumerate(site.vendors)
        for column, uuid in enumerate(vendor.robots)
    )
    for row, vendor in enumerate(site.vendors):
        given = [(f"vendors[{row}].participants.{kind}", begins) for kind, begins in vendor.participants.items()]
        yield from _repeated((key, begin.lower()) for key, begins in given for begin in dict.fromkeys(begins))
        for key, begins in given:
            for begin in begins:
                if not begin or "*" in begin[:-1]:
                    yield f"{key}: found {begin!r}; expected a UUID, or how UUIDs begin with a * at the end"
        keys = [f"vendors[{row}].maps[{column}]" for column in range(len(vendor.maps))]
        maps = list(zip(keys, vendor.maps, strict=True))
        different = (maps[column] for column, each in enumerate(vendor.maps) if each not in vendor.maps[:column])
        yield from _repeated((f"{key}.datum", vendor_map.datum) for key, vendor_map in different)
        for key, vendor_map in maps:
            yield from _map_contradictions(site, key, vendor_map)
        for column, address in enumerate(vendor.dial):
            if not address.startswith(("ws://", "wss://")):
                yield f"vendors[{row}].dial[{column}]: found {address!r}; expected ws://HOST:PORT/PATH"


def _manufacturers(row: int, vendor: Vendor) -> Iterator[tuple[str, str]]:
    """The names by which a `manufacturerName` is this vendor's: the key of each, and the name in lower case."""
    yield f"vendors[{row}].name", vendor.name.casefold()
    for column, manufacturer in enumerate(vendor.manufacturers):
        if manufacturer.casefold() != vendor.name.casefold():
            yield f"vendors[{row}].manufacturers[{column}]", manufacturer.casefold()


def _map_contradictions(site: Site, key: str, vendor_map: VendorMap) -> Iterator[str]:
    datums = {datum.id: datum for datum in site.datums}
    datum = datums.get(vendor_map.site_datum)
    if datum is None:
        hint = _nearest(vendor_map.site_datum, list(datums))
        yield f"{key}.site_datum: no datum has the id {vendor_map.site_datum!r}; {hint}"
        return
    known = [point.id for point in datum.reference_points]
    for point in vendor_map.readings:
        if point not in known:
            yield f"{key}.readings.{point}: datum {datum.name!r} has no such point; {_nearest(point, known)}"


def _repeated(values: Iterable[tuple[str, str]]) -> Iterator[str]:
    """A sentence for each value that several keys have."""
    pairs = list(values)
    for value, count in Counter(value for _, value in pairs).items():
        if count > 1:
            keys = [key for key, given in pairs if given == value]
            yield f"{keys[-1]}: {value!r} is given by {' and '.join(keys[:-1])} too; expected it once"


def _ignored_by_cluster(site: Site) -> Iterator[str]:
    """A sentence for each key that has no effect in a cluster."""
    if "blackbox" in site.model_fields_set and site.blackbox.enabled:
        yield "blackbox: a cluster writes no black boxes; remove the section"
    for row, vendor in enumerate(site.vendors):
        if "verbs" in vendor.model_fields_set and vendor.verbs:
            yield f"vendors[{row}].verbs: a cluster asks nothing of single robots; remove the key"
    for row, person in enumerate(site.operator.people):
        if person.role == "answer":
            yield f"operator.people[{row}].role: a cluster gives no advice to answer; expected another role"
    outlets = [(f"webhooks[{row}]", webhook) for row, webhook in enumerate(site.webhooks)]
    for key, outlet in (*outlets, ("mqtt", site.mqtt)):
        if outlet and "advice" in outlet.kinds:
            yield f"{key}.kinds: a cluster gives no advice to single robots; remove 'advice'"


def _source_contradictions(site: Site) -> Iterator[str]:
    names = Counter(source.name for source in site.mqtt_sources)
    for row, source in enumerate(site.mqtt_sources):
        key = f"mqtt_sources[{row}]"
        if names[source.name] > 1:
            yield f"{key}.name: {source.name!r} is taken; give each source a name of its own"
        yield from retry_problems(key, source.retry_s)
        if source.manufacturers and source.language == "iso21423":
            yield f"{key}.manufacturers: topics of iso21423 name none; remove the key"
        if source.ca and not source.tls:
            yield f"{key}.ca: is used over TLS alone; set tls = true"
        if source.password and not source.user:
            yield f"{key}.user: is missing; a broker reads a password only with a user name"
