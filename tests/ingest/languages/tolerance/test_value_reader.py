"""The rule by which values are read, on an object that has one key of each kind."""

from math import inf, nan
from sys import getrefcount
from typing import Any, Literal

import msgspec
import pytest

from ingest.languages.front_ends import FRONT_ENDS
from ingest.languages.model import Rejection, Status
from ingest.languages.rules import Findings
from ingest.languages.tolerance.spelling import folded, nearest
from ingest.languages.tolerance.value_kinds import object_kind
from ingest.languages.tolerance.value_reader import ValueReader
from tests.helpers import iso_saying, saying, vda_saying


class Part(msgspec.Struct, rename="camel"):
    x: float
    note: str | None = None


class Spot(msgspec.Struct, rename="camel"):
    x: float
    y: float


class Whole(msgspec.Struct, rename="camel"):
    length: float | None = None
    count: int | None = None
    map_id: str | None = None
    is_new: bool | None = None
    level: Literal["LOW", "VERY_HIGH", "UNKNOWN"] | None = None
    part: Part | None = None
    parts: list[Part] | None = None
    spots: list[Spot] | None = None
    names: list[str] | None = None
    timestamp: str | None = None


KIND = object_kind(Whole)


def read(**sent: Any) -> tuple[dict[str, Any], Findings]:
    findings = Findings()
    return ValueReader(findings, needed=frozenset(("length", "mapId"))).read(sent, KIND)[0], findings


CASES: tuple[tuple[str, Any, Any, str], ...] = (
    ("length", "1.5", 1.5, "number-as-text"),
    ("length", " 1e3 ", 1000.0, "number-as-text"),
    ("length", [2.5], 2.5, "single-not-list"),
    ("count", "3", 3, "number-as-text"),
    ("count", 3.0, 3, "number-as-text"),
    ("count", "3.0", 3, "number-as-text"),
    ("mapId", 3, "3", "text-as-number"),
    ("mapId", 3.0, "3", "text-as-number"),
    ("mapId", 2.5, "2.5", "text-as-number"),
    ("isNew", "True", True, "number-as-text"),
    ("isNew", 0, False, "number-as-text"),
    ("level", "low", "LOW", "word-spelling"),
    ("level", "Very-High", "VERY_HIGH", "word-spelling"),
    ("level", "ghastly", "UNKNOWN", "word-unknown"),
    ("level", 7, "UNKNOWN", "word-unknown"),
    ("part", [{"x": 1.0}], {"x": 1.0}, "single-not-list"),
    ("parts", {"x": 1.0}, [{"x": 1.0}], "single-not-list"),
    ("parts", {}, [], "single-not-list"),
    ("parts", [[{"x": 1.0}, {"x": 2.0}]], [{"x": 1.0}, {"x": 2.0}], "single-not-list"),
    (
        "parts",
        {"10": {"x": 3.0}, "2": {"x": 2.0}, "1": {"x": 1.0}},
        [{"x": 1.0 * x} for x in (1, 2, 3)],
        "single-not-list",
    ),
    ("spots", [[1, 2, 0.3], [3, 4]], [{"x": 1, "y": 2}, {"x": 3, "y": 4}], "single-not-list"),
    ("spots", [[1, 2]], [{"x": 1, "y": 2}], "single-not-list"),
    ("names", "a", ["a"], "single-not-list"),
    ("names", [1], ["1"], "text-as-number"),
)


@pytest.mark.parametrize(("key", "value", "expected", "rule"), CASES)
def test_a_value_whose_meaning_is_plain_is_read_and_counted(key: str, value: Any, expected: Any, rule: str) -> None:
    values, findings = read(**{key: value})
    assert values == {key: expected}
    assert type(values[key]) is type(expected)
    assert tuple(findings) == (rule,)
    assert findings.oddities[0].path.startswith(key)


UNREADABLE: dict[str, tuple[Any, ...]] = {
    "length": (nan, inf, "NaN", "1_000", "wide", True, {}, [], "", 10**400, [1.0, 2.0]),
    "count": (2.5, "two", False, nan),
    "mapId": ({}, [], nan),
    "isNew": ("perhaps", 2, [], nan),
    "level": ("", "  "),
    "part": ("here", {"note": "no x"}, {"x": "left"}, 3),
    "parts": ("none", 1.5, ""),
}


@pytest.mark.parametrize(("key", "value"), [(key, value) for key, values in UNREADABLE.items() for value in values])
def test_any_other_value_costs_itself(key: str, value: Any) -> None:
    values, findings = read(**{key: value, "timestamp": "2026-09-21T14:13:20Z"})
    assert values == {"timestamp": "2026-09-21T14:13:20Z"}
    assert "value-unreadable" in findings
    assert findings.oddities[-1].path.startswith(key)


def test_an_item_or_a_key_that_cannot_be_read_costs_itself() -> None:
    values, findings = read(parts=[{"x": 1.0, "note": {}}, {"x": "left"}, None, 7, {"x": 2.0}])
    assert values == {"parts": [{"x": 1.0}, {"x": 2.0}]}
    named = [(oddity.rule, oddity.path) for oddity in findings.oddities]
    assert named == [
        ("value-unreadable", "parts[0].note"),
        ("value-unreadable", "parts[1].x"),
        ("value-unreadable", "parts[1]"),
        ("null-value", "parts[2]"),
        ("value-unreadable", "parts[3]"),
    ]


def test_a_time_may_be_a_number() -> None:
    values, findings = read(timestamp=1790000000000)
    assert values == {"timestamp": "1790000000000"}
    assert not findings, "it is counted where it is read"


@pytest.mark.parametrize("key", ["map_id", "MapId", "MAPID", "map-id"])
def test_another_spelling_of_an_absent_key_is_read(key: str) -> None:
    values, findings = read(**{key: "hall"})
    assert values == {"mapId": "hall"}
    assert findings.oddities[0][:2] == ("key-spelling", key)
    assert findings.oddities[0].nearest == "mapId"


def test_a_likeness_of_a_needed_key_is_noticed_and_not_read() -> None:
    values, findings = read(lenght=1.0, isNow=True)
    assert values == {}
    assert [(oddity.path, oddity.nearest) for oddity in findings.oddities] == [("lenght", "length")]


def test_a_vendors_own_key_is_no_deviation() -> None:
    assert read(mapId="hall", length=1.0, lengthOfQueue=3, acme={"a": [None]}) == ({"mapId": "hall", "length": 1.0}, {})


def test_the_nearest_key_is_found_whatever_the_case() -> None:
    known = frozenset(("planarDatum", "angle", "x"))
    assert nearest("PLANAR_DATM", known) == "planarDatum"
    assert nearest("colour", known) == ""


def test_a_long_key_is_not_kept() -> None:
    key = "colour" * 1000
    held = getrefcount(key)
    assert nearest(key, frozenset(("planarDatum",))) == ""
    assert folded(key) == key[:80]
    assert getrefcount(key) == held


def test_of_a_long_value_the_first_letters_are_named() -> None:
    long = {"a": [{"b": "x" * 10_000}] * 10_000}
    _, findings = read(length=long, count=[long, long], isNew="y" * 10_000)
    assert [len(oddity.value) for oddity in findings.oddities] == [60, 60, 60]
    assert findings.oddities[0].value.startswith('{"a": [{"b": "xxx')


T = 1_790_000_000.0
WITH_NUMBER: tuple[tuple[str, str, bytes], ...] = (
    ("massrobotics", "", saying.status("A-1", T, 1.0, 2.0, batteryPercentage=-77, errorCodes=["é:nan,", '"'])),
    ("vda5050", vda_saying.topic("state"), vda_saying.state(T, 1.0, 2.0, velocity={"vx": -77}, zoneSetId="[nan]\\")),
    ("iso21423", iso_saying.topic("odometry"), iso_saying.odometry(T, 1.0, 2.0, 0.0, -77)),
)
NOT_FINITE = ("nan", "-nan", "NAN", "inf", "-inf", "+Inf", "infinity", "-nan(ind)", "-1.#IND", "1.#INF", "1.#INF00")


@pytest.mark.parametrize(("language", "topic", "raw"), WITH_NUMBER)
@pytest.mark.parametrize("number", NOT_FINITE)
def test_a_number_that_is_not_finite_costs_itself_as_c_prints_it_too(
    language: str, topic: str, raw: bytes, number: str
) -> None:
    front_end = FRONT_ENDS[language]
    printed = raw.replace(b"-77", number.encode() + b" ")
    assert printed != raw
    status, _ = front_end.read(printed, topic, None, None)
    usual, _ = front_end.read(raw.replace(b"-77", b"NaN"), topic, None, None)
    assert isinstance(status, Status)
    assert (status.x, status.y) == (1.0, 2.0)
    assert "value-unreadable" in status.findings
    assert status.oddities == usual.oddities
    assert isinstance(usual, Status)
    assert status.error_codes == usual.error_codes
    assert front_end.document(printed) == front_end.document(raw.replace(b"-77", b"NaN"))


PRINTED = {"+0.5": "0.5", "1.": "1.0", ".5": "0.5", "-.5": "-0.5", "01": "1", "-007.e1": "-7.0e1"} | {
    "True": "true",
    "False": "false",
    "None": "null",
}


@pytest.mark.parametrize(("language", "topic", "raw"), WITH_NUMBER)
@pytest.mark.parametrize("printed", PRINTED)
def test_a_value_is_read_as_programs_print_it(language: str, topic: str, raw: bytes, printed: str) -> None:
    front_end, plain = FRONT_ENDS[language], raw.replace(b"-77", PRINTED[printed].encode())
    sent = raw.replace(b"-77", printed.encode())
    status, _ = front_end.read(sent, topic, None, None)
    usual, _ = front_end.read(plain, topic, None, None)
    assert isinstance(status, Status)
    assert isinstance(usual, Status)
    assert [status.linear_mps, status.amounts] == [usual.linear_mps, usual.amounts]
    assert set(status.findings) == {"json-spelling", *usual.findings}
    named = next(odd for odd in status.oddities if odd.rule == "json-spelling")
    assert f'"{named.path}": {printed}'.encode() in sent
    assert (named.value, named.reading) == (f'"{printed}"', PRINTED[printed])
    assert front_end.document(sent) == front_end.document(plain)


@pytest.mark.parametrize(("language", "topic", "raw"), WITH_NUMBER)
def test_a_message_is_read_whatever_its_end_and_its_brackets(language: str, topic: str, raw: bytes) -> None:
    front_end = FRONT_ENDS[language]
    usual, _ = front_end.read(raw, topic, None, None)
    assert isinstance(usual, Status)
    for sent, rule in (
        (raw + b"\0\0", "json-spelling"),
        (raw[:-1] + b" , }", "json-spelling"),
        (raw.replace(b"{", b"{\x01", 1).replace(b'{\x01"', b'{"', 1) + b"\0", "json-spelling"),
        (b"[" + raw + b"]", "single-not-list"),
        (b"[" + raw + b",]\0", "single-not-list"),
    ):
        status, _ = front_end.read(sent, topic, None, None)
        assert isinstance(status, Status)
        assert (status.x, status.error_codes) == (usual.x, usual.error_codes)
        assert rule in status.findings
        assert front_end.document(sent) == front_end.document(raw)


@pytest.mark.parametrize(
    "broken",
    [
        b'{"a": nano}',
        b'{"a": nan',
        b"{nan: 1}",
        b'{"a": +}',
        b'{"a": .}',
        b'{"a": --1}',
        b"{}, {}",
        b'{"a": 1,,}',
        b'{"a": "' + b'\\"' * 50_000,
    ],
)
def test_other_bare_words_are_no_json(broken: bytes) -> None:
    message, _ = FRONT_ENDS["vda5050"].read(broken, vda_saying.topic("state"), None, None)
    assert isinstance(message, Rejection)
    assert message.rule == "not-json"
