"""The site file: everything a person sets, in one TOML file, validated with errors that name the key."""

import difflib
import json
import tomllib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError

from deconflict.settings.cluster_settings import Cluster, cluster_contradictions
from deconflict.settings.floor_plan import plan_problems
from deconflict.settings.map_checks import datum_problems, map_problems
from deconflict.settings.outlet_settings import Mqtt, Webhook, outlet_problems
from deconflict.settings.shared_places import ContentionSettings, Resource, Zone, place_problems
from ingest.settings import (
    NIL_DATUM,
    Datum,
    Metres,
    Reading,
    Receiver,
    Recorder,
    Seconds,
    SecretSource,
    Section,
    Tls,
    Vendor,
    VendorMap,
)

Role = Literal["read", "acknowledge", "administer"]


class Conflict(Section):
    """What counts as a conflict, and when a person is told."""

    clearance_m: Metres = 0.3
    """Envelopes that come nearer than this are in conflict. Too large floods people, too small warns late."""
    horizon_s: Seconds = 10.0
    """How far ahead conflicts are looked for, at most `reading.horizon_s`. Too short warns late."""
    raise_probability: Annotated[float, Field(gt=0, le=1)] = 0.4
    """How likely a conflict must be for a person to be told. Low alerts early and often in vain, high late or never."""
    confirm: tuple[Annotated[int, Field(ge=1)], Annotated[int, Field(ge=1)]] = (3, 3)
    """An advisory is raised when so many of so many looks predict it. [1, 1] raises at the first, also false ones."""
    urgent_s: Seconds = 2.0
    """A conflict nearer than this needs no confirmation. Too long and single false looks raise advisories."""
    evident_probability: Annotated[float, Field(gt=0, le=1)] = 0.5
    """A conflict more likely than this needs no confirmation. 1 has all confirmed, which warns a second later."""
    clear_after_s: Seconds = 3.0
    """An advisory is cleared when it has not been predicted for this long. Too short makes advisories flicker."""
    clear_margin_m: Metres = 0.1
    """How far beyond the clearance a pair must draw apart before its encounter is over. 0 makes advisories flicker."""
    warning_s: Seconds = 5.0
    """A conflict nearer than this is a warning; before, a caution."""
    critical_s: Seconds = 2.0
    """A conflict nearer than this is critical. Not above `warning_s`."""
    silent_growth_mps: Metres = 0.05
    """How fast the uncertainty of a quiet robot grows on every side, metres a second. 0 trusts old poses for ever."""
    silent_growth_limit_m: Metres = 1.0
    """Where that growth ends. Too large and one silent robot is in conflict with a whole aisle."""

    @property
    def apart_m(self) -> float:
        """A pair that comes no nearer than this has drawn apart: its encounter is over."""
        return self.clearance_m + self.clear_margin_m


class Advice(Section):
    """What is advised, and how much work goes into it."""

    effort: Seconds = 0.1
    """What one question may cost, in the solver's deterministic time: about seconds of one processor."""
    longest_hold_s: Annotated[float, Field(gt=0, le=60, allow_inf_nan=False)] = 15.0
    """No robot is advised to wait longer. Too short and conflicts are said to need another route."""
    switch_s: Seconds = 2.0
    """Advice to hold another robot must save so much. 0 makes advice flicker."""


class Engine(Section):
    """The pace of the engine."""

    tick_s: Seconds = 0.1
    """Shortest time between two passes. Half of it is a message's mean wait; too short only burns processor time."""
    deadline_s: Seconds = 0.5
    """A pass that takes longer is late; where passes stay late, less is worked out. Too short and it is for nothing."""


class Person(Section):
    """Who may use the operators' port."""

    name: str
    """A person, or a service of the site."""
    role: Role = "read"
    """`read` sees everything, `acknowledge` may also answer advisories, `administer` may also reload the site file."""
    token: SecretSource
    """Where this person's bearer token is."""


class Operator(Section):
    """The operators' port: API, stream, metrics."""

    host: str = "127.0.0.1"
    """Address to listen on; "0.0.0.0" for all of this machine's."""
    port: Annotated[int, Field(ge=0, le=65535)] = 8080
    """0 takes any free port."""
    stream_send_timeout_s: Seconds = 10.0
    """A subscriber that has not taken a message for this long is dropped."""
    people: tuple[Person, ...] = ()
    """Once there is one, nobody else gets in."""
    tls: Tls | None = None
    """Serve `https://` and `wss://` with these certificates; plain `http://` if absent."""


class StoreSettings(Section):
    """Where recordings and advisories are kept."""

    directory: str = "data"
    """Relative to where the service is started. Two services must not share one."""
    keep_days: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 30.0
    """How long a cleared advisory is kept; open ones stay."""


class BlackBox(Section):
    """Around each near miss a file of what was heard and decided, which replays; needs `recorder.enabled`."""

    enabled: bool = True
    """Whether there are any."""
    before_s: Seconds = 60.0
    """How much is kept of what was before a near miss."""
    after_s: Seconds = 60.0
    """And of what came after."""
    files: Annotated[int, Field(gt=0)] = 500
    """The oldest go when there are more."""
    total_bytes: Annotated[int, Field(gt=0)] = 1024 * 1024 * 1024
    """And when they hold more."""
    keep_days: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 30.0
    """And when they are older."""


class Site(Section):
    """One site. Without a file every default holds, and every datum that robots name is a floor of its own."""

    name: str = "site"
    """What a person calls the site."""
    datums: tuple[Datum, ...] = ()
    """Floors that several vendors share."""
    vendors: tuple[Vendor, ...] = ()
    """Vendors that need more said of them than their messages say."""
    resources: tuple[Resource, ...] = ()
    """Docks, chargers, stations, lifts and parking that robots share."""
    zones: tuple[Zone, ...] = ()
    """Crossings, single-lane aisles and doors that robots share."""
    receiver: Receiver = Receiver()
    recorder: Recorder = Recorder()
    reading: Reading = Reading()
    conflict: Conflict = Conflict()
    advice: Advice = Advice()
    contention: ContentionSettings = ContentionSettings()
    engine: Engine = Engine()
    operator: Operator = Operator()
    webhooks: tuple[Webhook, ...] = ()
    """Addresses that advisories are posted to."""
    mqtt: Mqtt | None = None
    """A broker that holds the open advisories."""
    store: StoreSettings = StoreSettings()
    cluster: Cluster | None = None
    """The work is shared with other machines."""
    blackbox: BlackBox = BlackBox()


DEFAULT = Site()
SECRETS = ("password", "secret", "token")
"""Keys whose value is never told: somebody may have put the secret there."""


class SiteError(ValueError):
    """A site file that can't be used; `problems` says what to change, a line each."""

    def __init__(self, problems: Iterable[str]) -> None:
        self.problems = tuple(problems)
        super().__init__("the site file has problems:\n" + "\n".join(f"  {one}" for one in self.problems))


def load(path: Path) -> Site:
    """The site in a TOML file. Raises `SiteError` naming each wrong key.

    Readings that fit nothing pass: `fit_problems` judges those.
    """
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise SiteError([f"{path} can't be read: {error}"]) from error
    return site_from_toml(raw, path)


def site_from_toml(raw: bytes, path: Path) -> Site:
    """The site in the bytes of a TOML file, which problems call `path`. Raises `SiteError` naming each wrong key."""
    try:
        told = tomllib.loads(raw.decode())
    except UnicodeDecodeError as error:
        raise SiteError([f"{path} can't be read: {error}"]) from error
    except tomllib.TOMLDecodeError as error:
        raise SiteError([f"{path} is not TOML: {error}"]) from error
    return site_from_document(told)


def site_from_document(told: Mapping[str, Any]) -> Site:
    """The site that a TOML document tells. Raises `SiteError` naming each wrong key."""
    try:
        site = Site.model_validate_json(json.dumps(told, default=str), strict=True)
    except ValidationError as error:
        raise SiteError(_explained(one) for one in error.errors(include_url=False)) from error
    contradictions = list(_contradictions(site))
    if contradictions:
        raise SiteError(contradictions)
    return site


def fit_problems(site: Site) -> list[str]:
    """What is wrong with reference points and with vendors' readings of them, a sentence each; empty if nothing."""
    return [
        *(
            f"datums[{row}].{one}"
            for row, datum in enumerate(site.datums)
            for one in (*datum_problems(datum), *plan_problems(datum))
        ),
        *(
            f"vendors[{row}].maps[{column}].{one}"
            for row, vendor in enumerate(site.vendors)
            for column, vendors_map in enumerate(vendor.maps)
            for one in map_problems(vendors_map, datum_of(site, vendors_map))
        ),
    ]


def datum_of(site: Site, one: VendorMap) -> Datum:
    """The site's datum that a vendor's map belongs to."""
    return next(datum for datum in site.datums if datum.id == one.site_datum)


def _explained(error: Mapping[str, Any]) -> str:
    """One validation error as the key in TOML terms, what was found and what was expected."""
    location = error["loc"]
    key = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location).lstrip(".")
    if error["type"] == "extra_forbidden":
        known = list(_schema_at(location[:-1]).get("properties", {}))
        return f"{key}: there is no such key; {_nearest(str(location[-1]), known)}"
    if error["type"] == "missing":
        what = _schema_at(location)
        return f"{key}: is missing; expected {what.get('description') or what.get('type', 'a value')}"
    message = error["msg"][0].lower() + error["msg"][1:]
    if location[-1] in SECRETS:
        return f"{key}: {message}; expected env:NAME or file:PATH, not the secret itself"
    return f"{key}: {message}; found {str(error['input'])[:80]!r}"


def _nearest(found: str, known: list[str]) -> str:
    near = difflib.get_close_matches(found, known, 1)
    return f"did you mean {near[0]}?" if near else f"expected one of {', '.join(known) or 'none'}"


@cache
def _schema() -> dict[str, Any]:
    return Site.model_json_schema()


def _schema_at(location: Iterable[Any]) -> Any:
    """What the schema says of the key at `location`."""
    schema = _schema()
    at: Any = schema
    for part in location:
        inner = at.get("items", {}) if isinstance(part, int) else at.get("properties", {}).get(part)
        at = at.get("additionalProperties", {}) if inner is None else inner
        at = schema["$defs"][at["$ref"].rsplit("/", 1)[1]] if "$ref" in at else at
    return at


def _contradictions(site: Site) -> Iterator[str]:
    """What no key shows alone."""
    yield from _datum_contradictions(site)
    yield from _vendor_contradictions(site)
    yield from place_problems(site.resources, site.zones, (datum.id for datum in site.datums))
    yield from outlet_problems(site.webhooks, site.mqtt)
    yield from cluster_contradictions(site.cluster)
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
    yield from _repeated((f"operator.people[{row}].name", one.name) for row, one in enumerate(site.operator.people))
    certificates = [(f"vendors[{row}]", one.certificate_names) for row, one in enumerate(site.vendors)]
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
    yield from _repeated(told for row, vendor in enumerate(site.vendors) for told in _manufacturers(row, vendor))
    yield from _repeated(
        (f"vendors[{row}].robots[{column}]", uuid.lower())
        for row, vendor in enumerate(site.vendors)
        for column, uuid in enumerate(vendor.robots)
    )
    for row, vendor in enumerate(site.vendors):
        keys = [f"vendors[{row}].maps[{column}]" for column in range(len(vendor.maps))]
        yield from _repeated((f"{key}.datum", one.datum) for key, one in zip(keys, vendor.maps, strict=True))
        for key, one in zip(keys, vendor.maps, strict=True):
            yield from _map_contradictions(site, key, one)
        for column, address in enumerate(vendor.dial):
            if not address.startswith(("ws://", "wss://")):
                yield f"vendors[{row}].dial[{column}]: found {address!r}; expected ws://HOST:PORT/PATH"


def _manufacturers(row: int, vendor: Vendor) -> Iterator[tuple[str, str]]:
    """Each key by which a `manufacturerName` is this vendor's, and that name as it is compared."""
    yield f"vendors[{row}].name", vendor.name.casefold()
    for column, manufacturer in enumerate(vendor.manufacturers):
        if manufacturer.casefold() != vendor.name.casefold():
            yield f"vendors[{row}].manufacturers[{column}]", manufacturer.casefold()


def _map_contradictions(site: Site, key: str, one: VendorMap) -> Iterator[str]:
    datums = {datum.id: datum for datum in site.datums}
    datum = datums.get(one.site_datum)
    if datum is None:
        yield f"{key}.site_datum: no datum has the id {one.site_datum!r}; {_nearest(one.site_datum, list(datums))}"
        return
    known = [point.id for point in datum.reference_points]
    for point in one.readings:
        if point not in known:
            yield f"{key}.readings.{point}: datum {datum.name!r} has no such point; {_nearest(point, known)}"


def _repeated(values: Iterable[tuple[str, str]]) -> Iterator[str]:
    """A problem for each value that several keys share."""
    told = list(values)
    for value, count in Counter(value for _, value in told).items():
        if count > 1:
            keys = [key for key, other in told if other == value]
            yield f"{keys[-1]}: {value!r} is given by {' and '.join(keys[:-1])} too; expected it once"
