"""One or more messages for each rule that a message by itself can break, with the expected results."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import inf, nan, pi, sin
from typing import Any
from uuid import uuid5

from ingest.languages.massrobotics.vocabulary import NAMED_ROBOTS
from tests.helpers.saying import HALL, LOFT, angle, identity, points, robot, stamp, status

T = 1_700_000_000.0
"""2023-11-14T22:13:20Z, when every vector is stamped unless it says otherwise."""
UPRIGHT = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
NIL = "00000000-0000-0000-0000-000000000000"


@dataclass(frozen=True, slots=True)
class Vector:
    """A message, the rules that it breaks, and the attributes that it is read as."""

    name: str
    raw: bytes
    findings: tuple[str, ...] = ()
    rejected: str | None = None
    reads: dict[str, Any] = field(default_factory=dict)
    names_as_uuid: str | None = None


def said(**replaced: Any) -> bytes:
    return status("A-1", T, 1.0, 2.0, **replaced)


def named(**replaced: Any) -> bytes:
    return identity("A-1", T, **replaced)


def here(**replaced: Any) -> dict[str, Any]:
    """A location; a key given as None is left out."""
    location = {"x": 1.0, "y": 2.0, "angle": UPRIGHT, "planarDatum": HALL} | replaced
    return {key: value for key, value in location.items() if value is not None}


def _flat() -> bytes:
    """A status with the keys of its location beside it."""
    report = json.loads(said())
    return json.dumps(report | report.pop("location")).encode()


def at(t_s: float, x: float = 3.0, **replaced: Any) -> dict[str, Any]:
    """A point of a path; a key given as None is left out."""
    point = {"timestamp": stamp(t_s), "x": x, "y": 4.0, "angle": UPRIGHT} | replaced
    return {key: value for key, value in point.items() if value is not None}


def with_null(raw: bytes, key: str) -> bytes:
    return json.dumps(json.loads(raw) | {key: None}).encode()


def _rejections() -> Iterator[Vector]:
    def rejected(rule: str, name: str, raw: bytes, **reads: Any) -> Vector:
        return Vector(name, raw, rejected=rule, reads=reads)

    def known(rule: str, name: str, raw: bytes) -> Vector:
        return rejected(rule, name, raw, uuid=robot("A-1"))

    yield rejected("not-utf8", "no text at all", b"\xff\xfe")
    yield Vector("a text in latin-1", named(robotModel="Kaefer").replace(b"Kaefer", b"K\xe4fer"), ("text-not-utf8",))
    cut = named(robotModel="Kaefer").replace(b"Kaefer", b"K\\ud83d")
    yield Vector("half a letter", cut, ("text-not-utf8",))
    yield rejected("not-json", "cut short", said()[:-5], uuid=None)
    yield rejected("not-json", "nothing at all", b"")
    yield rejected("not-json", "two reports in one message", said() + said())
    yield rejected("report-unknown", "half a surrogate pair", b'{"uuid": "\\ud800"}')
    yield rejected("too-deep", "an unclosed tower", b"[" * 100_000)
    yield rejected("too-deep", "a tower inside a report", said()[:-1] + b', "a": ' + b"[" * 300 + b"]" * 300 + b"}")
    yield rejected(
        "not-object",
        "a list of reports",
        b"[" + said() + b", " + said() + b"]",
        reason="JSON array; send one JSON object a message",
    )
    yield rejected("not-object", "null", b"null")
    yield known("number-not-finite", "NaN in a location", said(location=here(x=nan)))
    yield known("number-not-finite", "1e999 in a location", said(location=here(x=1234.5)).replace(b"1234.5", b"1e999"))
    yield rejected("report-unknown", "a heartbeat", b'{"timestamp": "2023-11-14T22:13:20Z"}')
    yield known("key-missing", "no location", said(location=None))
    yield known("key-missing", "a location without y", said(location=here(y=None)))
    yield known("type-wrong", "a location that is a list", said(location=[1, 2]))
    yield known("type-wrong", "a coordinate that is a word", said(location=here(x="left")))
    yield known("type-wrong", "a coordinate that is the word NaN", said(location=here(x="NaN")))
    yield rejected("uuid-unreadable", "a name", said(uuid="forklift 7"), uuid=None)
    yield rejected("uuid-unreadable", "32 letters that Python's int would take", said(uuid="0x" + "1_" * 15))
    yield known("position-absurd", "a location of 1e308 m", said(location=here(x=1e308)))


def _who() -> Iterator[Vector]:
    upper, bare = robot("A-1").upper(), robot("A-1").replace("-", "")
    odd = "9e107d9d-372b-0826-e19d-b6d6d13a9d6b"
    yield Vector("upper case", said(uuid=upper), ("uuid-upper-case",), reads={"uuid": robot("A-1")})
    yield Vector("no dashes", named(uuid=bare), ("uuid-no-dashes",), reads={"uuid": robot("A-1")})
    yield Vector("a URN", said(uuid=f"urn:uuid:{robot('A-1')}"), ("uuid-no-dashes",), reads={"uuid": robot("A-1")})
    yield Vector("no version", said(uuid=odd.replace("-e19d", "-819d")), ("uuid-not-rfc4122",))
    yield Vector("no variant", said(uuid=odd.replace("-0826", "-4826")), ("uuid-not-rfc4122",))
    yield Vector("an md5", said(uuid=odd), ("uuid-not-rfc4122",), reads={"uuid": odd})
    yield Vector(
        "an md5 in upper case without dashes",
        said(uuid=odd.replace("-", "").upper()),
        ("uuid-no-dashes", "uuid-upper-case", "uuid-not-rfc4122"),
        reads={"uuid": odd},
    )
    yield Vector(
        "a name where names are allowed",
        said(uuid="forklift 7"),
        ("uuid-is-name",),
        reads={"uuid": str(uuid5(NAMED_ROBOTS, "Alder/forklift 7"))},
        names_as_uuid="Alder",
    )
    yield Vector(
        "a serial number without end",
        named(robotSerialNumber="7" * 9000),
        ("text-too-long",),
        reads={"serial": "7" * 100},
    )
    for sides, envelope_m in (
        ({"x": 1, "y": 0}, (1.0, 0.0, 0.0)),
        ({"x": 1, "y": 1, "z": -1}, (1.0, 1.0, 0.0)),
    ):
        yield Vector(
            f"an envelope of {sides}",
            named(baseRobotEnvelope=sides),
            ("envelope-not-positive",),
            reads={"envelope_m": envelope_m},
        )
    yield Vector(
        "an identity without its envelope",
        named(baseRobotEnvelope=None),
        ("envelope-not-positive",),
        reads={"envelope_m": (0.0, 0.0, 0.0)},
    )
    yield Vector(
        "an envelope in words",
        named(baseRobotEnvelope={"x": "wide", "y": 1}),
        ("value-unreadable", "envelope-not-positive"),
        reads={"envelope_m": (0.0, 0.0, 0.0)},
    )
    yield Vector("no serial number", named(robotSerialNumber=""), ("text-empty",), reads={"serial": ""})
    yield Vector(
        "an empty error code", said(errorCodes=["", "stuck"]), ("text-empty",), reads={"error_codes": ("stuck",)}
    )


def _keys_and_types() -> Iterator[Vector]:
    yield Vector("a byte order mark", b"\xef\xbb\xbf" + said(), ("byte-order-mark",), reads={"x": 1.0})
    yield Vector("a list of one report", b"[" + said() + b"]", ("single-not-list",), reads={"x": 1.0})
    tab = said(errorCodes=["a b"]).replace(b"a b", b"a\tb")
    yield Vector("a tab in a text", tab, ("json-spelling",), reads={"error_codes": ("a b",)})
    yield Vector("a key of its own", said(mood="good"), ("key-unknown",), reads={"x": 1.0})
    yield Vector("a key of its own in an angle", said(location=here(angle=UPRIGHT | {"deg": 0})), ("key-unknown",))
    yield Vector("a key of its own in a point", said(path=[at(T, speed=1.0)]), ("key-unknown",))
    for part, value in (
        ("velocity", {"linear": 1.0, "knots": 2}),
        ("velocity", {"linear": 1.0, "angular": UPRIGHT | {"deg": 0}}),
        ("destinations", [at(T, angle=UPRIGHT | {"deg": 0})]),
    ):
        yield Vector(f"a key of its own in {part}", said(**{part: value}), ("key-unknown",))
    yield Vector("a key of its own in a volume", named(cargoMaxVolume={"x": 1, "y": 1, "r": 2}), ("key-unknown",))
    yield Vector("a key of its own in an envelope", named(baseRobotEnvelope={"x": 1, "y": 1, "r": 2}), ("key-unknown",))
    yield Vector(
        "null for no battery",
        with_null(said(), "batteryPercentage"),
        ("null-value",),
        reads={"amounts.battery_pct": nan},
    )
    yield Vector("null in a list", said(errorCodes=[None]), ("null-value",), reads={"error_codes": ()})
    yield Vector("the word null", said(errorCodes=["null"]), reads={"error_codes": ("null",)})
    yield Vector(
        "a number as text", said(batteryPercentage="81.5"), ("number-as-text",), reads={"amounts.battery_pct": 81.5}
    )
    yield Vector("a coordinate as text", said(location=here(x="1.5")), ("number-as-text",), reads={"x": 1.5})
    yield Vector("a serial number", named(robotSerialNumber=7), ("text-as-number",), reads={"serial": "7"})
    yield Vector("an error number", said(errorCodes=[12]), ("text-as-number",), reads={"error_codes": ("12",)})
    yield Vector("a weight as a number", named(cargoMaxWeight=4000), ("text-as-number",))
    yield Vector("a decimal comma", said(location=here(x="1,5")), ("number-as-text",), reads={"x": 1.5})
    yield Vector("a location too deep", said(location={"location": here()}), ("nested-otherwise",), reads={"x": 1.0})
    yield Vector("a location too flat", _flat(), ("nested-otherwise",), reads={"x": 1.0})
    yield Vector(
        "a speed too flat", said(linear=0.5), ("nested-otherwise",), reads={"linear_mps": 0.5, "turn_rad_per_s": None}
    )
    yield Vector(
        "a speed too deep",
        said(velocity={"velocity": {"linear": 0.5}}),
        ("nested-otherwise",),
        reads={"linear_mps": 0.5, "turn_rad_per_s": None},
    )
    yield Vector("a report in an object", b'{"statusReport":' + said() + b"}", ("nested-otherwise",), reads={"x": 1.0})
    yield Vector("one error code", said(errorCodes="stuck"), ("single-not-list",), reads={"error_codes": ("stuck",)})
    yield Vector("one destination", said(destinations=at(T + 60)), ("single-not-list",))
    yield Vector(
        "an error code twice", said(errorCodes=["a", "a"]), ("duplicate-items",), reads={"error_codes": ("a", "a")}
    )
    codes = [f"E{number}" for number in range(150)]
    yield Vector(
        "many error codes", said(errorCodes=codes), ("codes-too-many",), reads={"error_codes": (*codes[:100],)}
    )
    yield Vector(
        "a long error code", said(errorCodes=["a" * 300]), ("codes-too-many",), reads={"error_codes": ("a" * 200,)}
    )
    yield Vector(
        "many numbers for error codes",
        said(errorCodes=[1] * 150),
        ("codes-too-many", "text-as-number", "duplicate-items"),
        reads={"error_codes": ("1",) * 100},
    )
    yield Vector("a destination twice", said(destinations=[at(T + 60)] * 2), ("duplicate-items",))
    yield Vector(
        "a battery in words", said(batteryPercentage="full"), ("value-unreadable",), reads={"amounts.battery_pct": nan}
    )
    yield Vector("a path in words", said(path="left"), ("value-unreadable",))
    yield Vector(
        "1e999 in a path", said(path=[at(T)]).replace(b"3.0", b"1e999"), ("value-unreadable", "point-unreadable")
    )
    yield Vector("Infinity in an optional value", said(batteryPercentage=inf), ("value-unreadable",), reads={"x": 1.0})
    yield Vector("NaN under an unknown key", said(mood=[{"level": nan}]), ("key-unknown",), reads={"x": 1.0})
    yield Vector("no state", said(operationalState=None), ("key-absent", "state-unknown"), reads={"x": 1.0})
    yield Vector("a state that is an object", said(operationalState={}), ("value-unreadable", "state-unknown"))
    yield Vector("a list for a serial number", named(robotSerialNumber=[]), ("value-unreadable", "text-empty"))
    yield Vector(
        "a name of the text",
        said(nextWorkingLocations=[at(T + 60)]),
        ("key-spelling",),
        reads={"destinations.x": [3.0]},
    )
    turned = {"qx": 0, "qy": 0, "qz": 1, "w": 0}
    yield Vector(
        "a pose and its quaternion by the names of the text",
        said(location=None, pose={"x": 7, "y": 2, "pose": turned, "planar datum ID": HALL}),
        ("key-spelling",),
        reads={"x": 7.0, "yaw_rad": pi, "datum": HALL},
    )
    yield Vector(
        "another case of a key", said(BatteryPercentage=81), ("key-spelling",), reads={"amounts.battery_pct": 81.0}
    )
    yield Vector(
        "a list of one location", said(location=[here()]), ("single-not-list",), reads={"x": 1.0, "datum": HALL}
    )
    yield Vector(
        "an error code that is an object",
        said(errorCodes=[{}, "a"]),
        ("value-unreadable",),
        reads={"error_codes": ("a",)},
    )
    yield Vector(
        "a velocity without speed",
        said(velocity={"angular": UPRIGHT}),
        ("key-absent",),
        reads={"linear_mps": None, "turn_rad_per_s": 0.0},
    )
    yield Vector(
        "a velocity whose turn is a number",
        said(velocity={"linear": 1.0, "angular": 0.5}),
        ("value-unreadable",),
        reads={"linear_mps": 1.0, "turn_rad_per_s": None},
    )
    yield Vector("a z of 1e9", said(location=here(z=1e9)), ("value-unreadable",), reads={"z": 0.0, "x": 1.0})
    yield Vector("a z in words", said(location=here(z="ground")), ("value-unreadable",), reads={"z": 0.0})


def _when() -> Iterator[Vector]:
    def stamped(text: Any, *findings: str, t_s: float = T, resolution_s: float = 1.0) -> Vector:
        reads = {"stamp_s": t_s, "stamp_resolution_s": resolution_s}
        return Vector(f"stamped {text!r}", said(timestamp=text), findings, reads=reads)

    for text in ("now", "", "2023-13-01T00:00:00Z"):
        yield stamped(text, "stamp-unreadable", t_s=0.0, resolution_s=inf)
    for text in ("9999-12-31T23:59:59Z", "1960-01-01T00:00:00Z"):
        yield stamped(text, "stamp-absurd", t_s=0.0, resolution_s=inf)
    yield Vector(
        "no stamp, but a path",
        said(timestamp=None, path=[at(T), at(T + 1)]),
        ("key-absent", "stamp-unreadable"),
        reads={"stamp_s": T, "x": 1.0},
    )
    yield stamped("2023-11-14T22:13:20Z")
    yield stamped("2023-11-14T22:13:20.250+00:00", t_s=T + 0.25, resolution_s=1e-3)
    yield stamped("2023-11-14T22:13:20+0000", "stamp-offset-no-colon")
    yield stamped("2023-11-14T22:13:20+00", "stamp-offset-no-colon")
    yield stamped("2023-11-14T17:13:20-05:00", "stamp-not-utc")
    yield stamped("2023-11-15T03:43:20.5+0530", "stamp-offset-no-colon", "stamp-not-utc", t_s=T + 0.5, resolution_s=0.1)
    yield stamped("2023-11-14T22:13:20", "stamp-no-offset")
    yield stamped("2023-11-14 22:13:20Z", "stamp-spelling")
    yield stamped("2023-11-14t22:13:20z", "stamp-spelling")
    yield stamped("2023-11-14T22:13:20,5Z", "stamp-spelling", t_s=T + 0.5, resolution_s=0.1)
    yield stamped("1700000000 250000000", "stamp-epoch", t_s=T + 0.25, resolution_s=1e-9)
    yield stamped("2023-11-14T22:13:20+00:00Z", "stamp-spelling")
    yield stamped("2023-11-14T23:13:20.5+01:00Z", "stamp-not-utc", "stamp-spelling", t_s=T + 0.5, resolution_s=0.1)
    yield stamped(1700000000, "stamp-epoch")
    yield stamped(1700000000.25, "stamp-epoch", t_s=T + 0.25, resolution_s=0.01)
    yield stamped(1700000000250, "stamp-epoch", t_s=T + 0.25, resolution_s=1e-3)


def _state() -> Iterator[Vector]:
    aliases = {
        "loadingUnloading": "waitingExternalEvent",
        "manualMode": "manualOverride",
        "manual mode": "manualOverride",
        "waiting": "waitingInternalEvent",
        "Navigating": "navigating",
        "WAITING_HUMAN_EVENT": "waitingHumanEvent",
    }
    for text, meant in aliases.items():
        reads = {"state": meant, "known_state": True}
        yield Vector(f"state {text!r}", said(operationalState=text), ("state-alias",), reads=reads)
    for text in ("", "dancing"):
        reads = {"state": text, "known_state": False}
        yield Vector(f"state {text!r}", said(operationalState=text), ("state-unknown",), reads=reads)
    yield Vector(
        "a state that nobody knows, while it drives",
        said(operationalState="dancing", velocity={"linear": 0.5}),
        ("state-unknown",),
        reads={"state": "navigating", "known_state": False},
    )
    yield Vector(
        "offline", said(operationalState="offline"), ("state-offline",), reads={"state": "offline", "known_state": True}
    )


def _where() -> Iterator[Vector]:
    def located(name: str, *findings: str, reads: dict[str, Any], **replaced: Any) -> Vector:
        return Vector(name, said(location=here(**replaced)), findings, reads=reads)

    def turned(name: str, *findings: str, yaw_rad: float, angle: Any) -> Vector:
        return located(name, *findings, reads={"yaw_rad": yaw_rad}, angle=angle)

    yield located("an upper-case datum", "datum-upper-case", reads={"datum": HALL}, planarDatum=HALL.upper())
    yield located("the key of a point", "datum-key", reads={"datum": HALL}, planarDatum=None, planarDatumUUID=HALL)
    yield located("no datum", "datum-missing", reads={"datum": ""}, planarDatum=None)
    yield located("an empty datum", "datum-missing", reads={"datum": ""}, planarDatum="")
    yield located("a nil datum", "datum-missing", reads={"datum": NIL}, planarDatum=NIL)
    yield located("a named frame", "datum-not-uuid", reads={"datum": "svy21"}, planarDatum="SVY21")
    yield turned("no angle", "angle-missing", yaw_rad=nan, angle=None)
    yield turned("an angle of no size", "angle-zero", yaw_rad=nan, angle=dict.fromkeys("xyzw", 0.0))
    yield turned("an angle of twice the size", "angle-not-unit", yaw_rad=pi / 2, angle={"x": 0, "y": 0, "z": 2, "w": 2})
    yield turned("an angle of 1e200", "angle-not-unit", yaw_rad=pi / 2, angle={"x": 0, "y": 0, "z": 1e200, "w": 1e200})
    yield turned(
        "an angle with one part missing",
        "value-unreadable",
        "angle-missing",
        yaw_rad=nan,
        angle={"x": 0, "y": 0, "z": 1},
    )
    upside_down = {"x": 1.0, "y": 0.0, "z": 0.0, "w": 0.0}
    yield turned("a robot rolled over keeps its heading", yaw_rad=0.0, angle=upside_down)
    yield turned("a right turn", yaw_rad=-0.5, angle={"x": 0, "y": 0, "z": -sin(0.25), "w": angle(0.5)["w"]})
    two = [at(T + 1, planarDatumUUID=""), at(T + 2, planarDatumUUID=LOFT)]
    yield Vector("a point without a datum", said(path=two), ("datum-empty",), reads={"path.datums": ("", LOFT)})
    documents = [at(T + 1, planarDatum=HALL.upper())]
    yield Vector(
        "the key of a location", said(path=documents), ("datum-key", "datum-upper-case"), reads={"path.datums": (HALL,)}
    )


def _amounts() -> Iterator[Vector]:
    yield Vector(
        "a battery of 104", said(batteryPercentage=104), ("battery-out-of-range",), reads={"amounts.battery_pct": 100.0}
    )
    yield Vector(
        "a battery of -1", said(batteryPercentage=-1), ("battery-out-of-range",), reads={"amounts.battery_pct": 0.0}
    )
    yield Vector(
        "a battery of 0.87", said(batteryPercentage=0.87), ("battery-fraction",), reads={"amounts.battery_pct": 0.87}
    )
    yield Vector("no time left", said(remainingRunTime=-0.1), ("run-time-negative",))
    yield Vector("a run time below zero", named(maxRunTime=-8), ("run-time-negative",))
    yield Vector(
        "a load of -10",
        said(loadPercentageStillAvailable=110),
        ("load-out-of-range",),
        reads={"amounts.load_used_pct": 0.0},
    )
    yield Vector(
        "the load used", said(loadPercentageUsed=30), ("load-used-key",), reads={"amounts.load_used_pct": 30.0}
    )
    yield Vector(
        "the load used beside what is left",
        said(loadPercentageUsed=30, loadPercentageStillAvailable=60),
        ("load-used-key",),
        reads={"amounts.load_used_pct": 40.0},
    )
    yield Vector("light speed", said(velocity={"linear": 3e8}), ("speed-absurd",), reads={"linear_mps": None})
    yield Vector("at most light speed", named(maxSpeed=3e8), ("speed-absurd",), reads={"max_speed_mps": None})
    yield Vector("at most backwards", named(maxSpeed=-1), ("speed-limit-not-positive",), reads={"max_speed_mps": None})


def _where_to() -> Iterator[Vector]:
    def heading(name: str, *findings: str, to: list[Any], times: list[float]) -> Vector:
        return Vector(name, said(destinations=to), findings, reads={"destinations.t_s": times})

    def going(name: str, *findings: str, along: list[Any], times: list[float]) -> Vector:
        return Vector(name, said(path=along), findings, reads={"path.t_s": times})

    def every(times: list[float]) -> list[dict[str, Any]]:
        return [at(t_s, x=float(i)) for i, t_s in enumerate(times)]

    minutes = [T + 60 * i for i in range(1, 12)]
    yield heading("eleven destinations", "destinations-too-many", to=every(minutes), times=minutes)
    yield heading("in 16 minutes", "destinations-too-far", to=every([T + 960]), times=[T + 960])
    yield heading("a minute ago", "destinations-past", to=every([T - 60]), times=[T - 60])
    yield heading("last one first", "destinations-unsorted", to=every([T + 60, T + 30]), times=[T + 30, T + 60])
    halves = [T + i / 2 for i in range(20)]
    yield going("twenty points", "path-too-many", along=every(halves), times=halves)
    many = [T + i / 40 for i in range(250)]
    yield going("250 points", "path-too-many", along=every(many), times=many[:200])
    tens = [T + 10.0 * i for i in range(1, 6)]
    yield going("a point every ten seconds", "path-too-far", along=every(tens), times=tens)
    yield going("an old path", "path-past", along=every([T - 9, T - 8]), times=[T - 9, T - 8])
    yield going("half an old path", "path-partly-past", along=every([T - 9, T + 1]), times=[T - 9, T + 1])
    yield going("times from nought", "path-times-1970", along=every([0.0, 1.0, 2.0]), times=[0.0, 1.0, 2.0])
    yield going("one time for all", "path-times-equal", along=every([T + 1, T + 1]), times=[T + 1, T + 1])
    yield going("back and forth", "path-unordered", along=every([T + 2, T + 1]), times=[T + 2, T + 1])
    broken = [at(T + 2, y=None), "left", at(T + 3)]
    yield going("points that can't be read", "point-unreadable", along=broken, times=[T + 3])
    untimed = [at(T + 1), at(T + 2, timestamp="soon"), at(T + 3), at(T + 4, timestamp="9999-12-31T23:59:60Z")]
    counted = [T + 1, T + 2, T + 3, T + 4]
    yield going("points whose times can't be read", "point-time-unreadable", along=untimed, times=counted)
    wild = [
        at(T + 1),
        at(T + 2, x=1e308),
    ]
    yield going("points off the map", "point-absurd", along=wild, times=[T + 1])
    yield Vector("no points", said(path=[], destinations=[]), reads={"path.t_s": [], "destinations.t_s": []})


def _official_dialect() -> Vector:
    """As the official sample sender speaks: see its README's remarks on case, offsets, horizon and keys."""

    def second(t_s: float) -> str:
        return stamp(t_s)[:19] + "+0000"

    along = [at(T + 10 * i, x=10.0 * i, timestamp=second(T + 10 * i), planarDatum=HALL.upper()) for i in range(1, 6)]
    raw = said(
        uuid=robot("A-1").upper(),
        timestamp=second(T),
        location=here(planarDatum=HALL.upper()),
        velocity={"linear": 1.0, "angular": angle(0.1)},
        path=along,
    )
    findings = (
        "uuid-upper-case",
        "stamp-offset-no-colon",
        "datum-upper-case",
        "datum-key",
        "path-too-far",
    )
    reads = {
        "uuid": robot("A-1"),
        "stamp_s": T,
        "datum": HALL,
        "turn_rad_per_s": 0.1,
        "path.t_s": [T + 10 * i for i in range(1, 6)],
        "path.datums": (HALL,) * 5,
    }
    return Vector("the official sample sender", raw, findings, reads=reads)


def _conforming() -> Iterator[Vector]:
    reads = {
        "x": 1.0,
        "y": 2.0,
        "z": 0.0,
        "yaw_rad": 0.0,
        "datum": HALL,
        "state": "navigating",
        "amounts.battery_pct": nan,
    }
    yield Vector("the least a status may say", said(), reads=reads)
    along = points(*((T + i, float(i), 0.0, 0.1 * i) for i in range(10)))
    full = said(
        location=here(z=0.2),
        velocity={"linear": -0.5, "angular": angle(-0.2)},
        batteryPercentage=81.5,
        remainingRunTime=2.5,
        loadPercentageStillAvailable=60,
        errorCodes=["battery low"],
        destinations=points((T + 900, 9.0, 9.0, 0.0)),
        path=along,
    )
    reads = {
        "z": 0.2,
        "linear_mps": -0.5,
        "turn_rad_per_s": -0.2,
        "amounts.battery_pct": 81.5,
        "amounts.load_used_pct": 40.0,
        "error_codes": ("battery low",),
        "path.yaw_rad": [0.1 * i for i in range(10)],
        "destinations.t_s": [T + 900],
    }
    yield Vector("all a status may say", full, reads=reads)
    size = {"envelope_m": (1.0, 0.5, 0.4), "manufacturer": "Alder", "model": "A1", "serial": "A-1", "stamp_s": T}
    yield Vector("the least an identity may say", named(), reads=size | {"max_speed_mps": None})
    yield Vector("how fast it goes", named(maxSpeed=1.5), reads={"max_speed_mps": 1.5})
    flat = named(baseRobotEnvelope={"x": 1, "y": 2})
    yield Vector("an envelope without height", flat, reads={"envelope_m": (1.0, 2.0, 0.0)})
    twice = said()[:-1] + b', "uuid": "' + robot("A-2").encode() + b'"}'
    yield Vector("a key twice", twice, reads={"uuid": robot("A-2")})


VECTORS = (
    *_conforming(),
    _official_dialect(),
    *_rejections(),
    *_who(),
    *_keys_and_types(),
    *_when(),
    *_state(),
    *_where(),
    *_amounts(),
    *_where_to(),
)
