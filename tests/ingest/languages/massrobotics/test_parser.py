import json
from math import atan2, cos, isnan, sin
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from ingest.languages.massrobotics.conformance_rules import RULES
from ingest.languages.massrobotics.massrobotics_front_end import message_document
from ingest.languages.massrobotics.parser import read
from ingest.languages.model import MAX_REASON, MAX_TEXT, Identity, Path, Rejection, Status
from ingest.languages.rules import RejectedError
from tests.helpers.saying import HALL, angle, identity, points, robot, stamp, status
from tests.helpers.vectors import VECTORS, T, Vector, at, here, named, said, with_null

COLUMNS = {"t_s": 0, "x": 1, "y": 2, "yaw_rad": 3}

accepted = [vector for vector in VECTORS if not vector.rejected]
rejected = [vector for vector in VECTORS if vector.rejected]


def value(message: Any, where: str) -> Any:
    """An attribute of a message or of a part of it; `path.x` is a column of its poses."""
    name, _, part = where.partition(".")
    held = getattr(message, name)
    if part in COLUMNS:
        assert isinstance(held, Path)
        return [pose[COLUMNS[part]] for pose in held.poses]
    return getattr(held, part) if part else held


@pytest.mark.parametrize("vector", accepted, ids=lambda vector: vector.name)
def test_an_accepted_message_is_read_as_it_was_meant(vector: Vector) -> None:
    message = read(vector.raw, names_as_uuid=vector.names_as_uuid)
    assert not isinstance(message, Rejection), message
    assert sorted(message.findings) == sorted(vector.findings)
    for where, expected in vector.reads.items():
        assert value(message, where) == near(expected), where


def near(expected: Any) -> Any:
    """Numbers and lists of numbers to within rounding; anything else exactly."""
    return pytest.approx(expected, rel=1e-12, nan_ok=True) if isinstance(expected, float | list) else expected


@pytest.mark.parametrize("vector", rejected, ids=lambda vector: vector.name)
def test_a_rejection_names_the_rule_and_the_reason(vector: Vector) -> None:
    message = read(vector.raw)
    assert isinstance(message, Rejection)
    assert message.rule == vector.rejected
    assert RULES[message.rule].rejects
    assert 10 < len(message.reason) <= MAX_REASON
    for where, expected in vector.reads.items():
        assert getattr(message, where) == expected


@pytest.mark.parametrize(
    ("sent", "reason", "oddity"),
    [
        (
            {"location": None, "loction": here(), "operationalstate": "idle", "operationalState": None},
            "location: is missing; loction: did you mean location?",
            ("loction", "location"),
        ),
        (
            {"uuid": None, "uuids": robot("A-1")},
            "uuid: is missing; uuids: did you mean uuid?",
            ("uuids", "uuid"),
        ),
        ({"location": None, "battery": 3}, "location: is missing", None),
    ],
)
def test_a_missing_key_that_is_misspelt_is_named(
    sent: dict[str, Any], reason: str, oddity: tuple[str, str] | None
) -> None:
    message = read(said(**sent))
    assert isinstance(message, Rejection)
    assert (message.rule, message.reason) == ("key-missing", reason)
    found = [(odd.path, odd.nearest) for odd in message.oddities if odd.rule == "key-unknown"]
    assert found == ([oddity] if oddity else [])


MENDED = {rule for rule in RULES if rule.startswith("stamp-")} - {"stamp-unreadable", "stamp-absurd"} | {
    "battery-out-of-range",
    "byte-order-mark",
    "datum-key",
    "json-spelling",
    "key-spelling",
    "datum-upper-case",
    "load-out-of-range",
    "null-value",
    "number-as-text",
    "run-time-negative",
    "single-not-list",
    "state-alias",
    "text-as-number",
    "uuid-no-dashes",
    "uuid-upper-case",
    "value-unreadable",
}
"""Rules that a document no longer breaks."""


@pytest.mark.parametrize("vector", accepted, ids=lambda vector: vector.name)
def test_the_document_of_an_accepted_message_is_repaired(vector: Vector) -> None:
    again = read(json.dumps(message_document(vector.raw), allow_nan=False).encode(), names_as_uuid=vector.names_as_uuid)
    assert not isinstance(again, Rejection)
    assert set(again.findings) <= set(vector.findings) - MENDED


def test_the_document_has_everything_that_was_said() -> None:
    raw = said(
        uuid=robot("A-1").upper(),
        timestamp="2023-11-14T17:13:20-05:00",
        operationalState="manual mode",
        location=here(planarDatum=None, planarDatumUUID=HALL.upper()),
        batteryPercentage="104",
        loadPercentageUsed=30,
        remainingRunTime=-1,
        path=[at(T + 1, planarDatum=HALL.upper(), timestamp="1700000001")],
        mood={"level": 3},
    )
    assert message_document(raw) == {
        "uuid": robot("A-1"),
        "timestamp": "2023-11-14T22:13:20.000000Z",
        "operationalState": "manualOverride",
        "location": {"x": 1.0, "y": 2.0, "z": 0.0, "angle": angle(0.0), "planarDatum": HALL},
        "batteryPercentage": 100.0,
        "loadPercentageUsed": 30,
        "loadPercentageStillAvailable": 70.0,
        "remainingRunTime": 0.0,
        "path": [
            {
                "timestamp": "2023-11-14T22:13:21.000000Z",
                "x": 3.0,
                "y": 4.0,
                "z": 0.0,
                "angle": angle(0.0),
                "planarDatumUUID": HALL,
            }
        ],
        "mood": {"level": 3},
    }


def test_the_document_keeps_a_weight_as_text() -> None:
    assert message_document(named(cargoMaxWeight=4000))["cargoMaxWeight"] == "4000"


def test_the_document_of_a_rejected_message_is_refused() -> None:
    with pytest.raises(RejectedError, match="not-json"):
        message_document(b"{")


def test_a_reason_is_short_however_long_the_message() -> None:
    long = "x" * 50_000
    emoji = json.dumps(dict.fromkeys(chr(0x1F600 + i) * 99 for i in range(9))).encode()
    for raw in (
        said(uuid=long),
        said(location=here(x=long)),
        b'{"%s": 1}' % long.encode(),
        emoji,
        said(location={long: long}),
    ):
        message = read(raw)
        assert isinstance(message, Rejection)
        assert len(message.reason) <= MAX_REASON


def test_a_rejection_says_what_had_been_found_by_then() -> None:
    message = read(said(uuid=robot("A-1").upper(), timestamp="soon", location=here(x=1e9)))
    assert isinstance(message, Rejection)
    assert message.findings == ("uuid-upper-case", "stamp-unreadable")


names = st.text(st.characters(codec="utf-8"), min_size=1, max_size=MAX_TEXT).filter(str.strip)
coordinates = st.floats(-1e6, 1e6)
yaws_rad = st.floats(-3.1, 3.1)
shares_pct = st.floats(1, 100)
milliseconds = st.integers(0, 4_000_000_000_000).map(lambda ms: ms / 1000)


@given(
    milliseconds,
    coordinates,
    coordinates,
    yaws_rad,
    st.lists(yaws_rad, max_size=10),
    shares_pct,
    st.lists(names, unique=True),
)
def test_a_conforming_status_is_read_without_changes(
    t_s: float, x: float, y: float, yaw_rad: float, turns_rad: list[float], share_pct: float, codes: list[str]
) -> None:
    along = [(t_s + i, x + i, y - i, turn_rad) for i, turn_rad in enumerate(turns_rad)]
    raw = status("A-1", t_s, x, y, yaw_rad, path=points(*along), batteryPercentage=share_pct, errorCodes=codes)
    message = read(raw)
    assert isinstance(message, Status)
    assert message.findings == ()
    assert (message.uuid, message.x, message.y, message.amounts.battery_pct) == (robot("A-1"), x, y, share_pct)
    assert (message.stamp_s, message.yaw_rad) == pytest.approx((t_s, yaw_rad), rel=1e-12, abs=1e-12)
    assert message.error_codes == tuple(codes)
    expected = np.array(along).reshape(-1, 4)
    np.testing.assert_allclose(np.array(message.path.poses).reshape(-1, 4), expected, rtol=1e-12, atol=1e-9)


@given(milliseconds, names, names, names, st.floats(0.01, 100), st.floats(0.01, 100), st.floats(0.01, 100))
def test_a_conforming_identity_is_read_without_changes(
    t_s: float, maker: str, model: str, serial: str, length_m: float, width_m: float, speed_mps: float
) -> None:
    raw = identity(
        "A-1",
        t_s,
        manufacturerName=maker,
        robotModel=model,
        robotSerialNumber=serial,
        baseRobotEnvelope={"x": length_m, "y": width_m},
        maxSpeed=speed_mps,
    )
    message = read(raw)
    assert isinstance(message, Identity)
    assert message.findings == ()
    assert (message.manufacturer, message.model, message.serial) == (maker, model, serial)
    assert message.envelope_m == (length_m, width_m, 0.0)
    assert message.max_speed_mps == speed_mps
    assert message.stamp_s == pytest.approx(t_s, rel=1e-12)


def test_an_envelope_with_the_names_of_its_sides_is_read() -> None:
    message = read(identity("A-1", 0.0, baseRobotEnvelope={"length": 2.8, "Width": 1.2, "height": 2.0}))
    assert isinstance(message, Identity)
    assert (message.envelope_m, message.findings) == ((2.8, 1.2, 2.0), ("key-spelling",))


def test_a_height_beside_a_place_is_not_how_high_the_robot_is() -> None:
    message = read(said(location=here(height=2.0)))
    assert isinstance(message, Status)
    assert (message.z, message.findings) == (0.0, ("key-unknown",))


@given(*[st.floats(-1, 1)] * 4)
def test_a_heading_is_the_direction_of_the_turned_x_axis(x: float, y: float, z: float, w: float) -> None:
    norm = float(np.linalg.norm((x, y, z, w)))
    assume(norm > 1e-3)
    message = read(said(location=here(angle={"x": x, "y": y, "z": z, "w": w})))
    x, y, z, w = x / norm, y / norm, z / norm, w / norm
    forward = np.array([1 - 2 * (y * y + z * z), 2 * (x * y + w * z)])
    assume(np.linalg.norm(forward) > 1e-6)
    assert isinstance(message, Status)
    wanted = atan2(forward[1], forward[0])
    assert (cos(message.yaw_rad), sin(message.yaw_rad)) == pytest.approx((cos(wanted), sin(wanted)), abs=1e-6)


anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(st.characters(codec="utf-8")) | st.just(stamp(T)),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from(("x", "y", "angle", "timestamp")), inner)
    ),
    max_leaves=8,
)
reports = [
    json.loads(vector.raw.decode(errors="replace"), strict=False) for vector in accepted if vector.raw.startswith(b"{")
]
keys = sorted({key for report in reports for key in report})


@given(st.sampled_from(reports), st.dictionaries(st.sampled_from(keys), anything, max_size=3))
def test_any_value_under_any_key_gets_one_of_three_answers(report: dict[str, Any], replaced: dict[str, Any]) -> None:
    check(json.dumps(report | replaced).encode())


@given(st.sampled_from([vector.raw for vector in VECTORS if len(vector.raw) < 5000]), st.data())
def test_any_damage_to_the_bytes_gets_one_of_three_answers(raw: bytes, data: st.DataObject) -> None:
    start = data.draw(st.integers(0, len(raw)))
    end = data.draw(st.integers(start, min(len(raw), start + 8)))
    check(raw[:start] + data.draw(st.binary(max_size=4)) + raw[end:])


@given(st.binary(max_size=64))
def test_any_bytes_get_one_of_three_answers(raw: bytes) -> None:
    check(raw)


def check(raw: bytes) -> None:
    message = read(raw)
    assert set(message.findings) <= RULES.keys()
    if isinstance(message, Rejection):
        assert RULES[message.rule].rejects
        return
    assert json.loads(json.dumps(message_document(raw), allow_nan=False))["uuid"]
    if isinstance(message, Status):
        assert all(np.isfinite(pose[:3]).all() for path in (message.path, message.destinations) for pose in path.poses)
        assert abs(message.x) + abs(message.y) < 1e8


def test_hostile_lists_are_answered_without_reading_them_all() -> None:
    for item in ("{}", "1", '""', '{"x": 1}', "[]"):
        hostile = said(path="HERE").replace(b'"HERE"', b"[" + b",".join([item.encode()] * 6000) + b"]")
        message = read(hostile)
        assert isinstance(message, Status)
        assert message.findings == ("point-unreadable",)


def test_null_is_left_out_at_every_level() -> None:
    raw = with_null(said(location=here() | {"z": None}, path=[at(T + 1) | {"planarDatumUUID": None}]), "velocity")
    message = read(raw)
    assert isinstance(message, Status)
    assert message.findings == ("null-value",)
    assert message.path.datums == ("",)


def test_a_heading_that_is_not_sent_is_nan() -> None:
    message = read(said(path=[at(T + 1, angle=None)]))
    assert isinstance(message, Status)
    assert isnan(message.path.poses[0][3])
    assert message.findings == ("angle-missing",)
