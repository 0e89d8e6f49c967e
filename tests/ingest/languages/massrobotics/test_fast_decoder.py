from random import Random
from typing import Any

import pytest

from ingest.languages.massrobotics.fast_decoder import decoded, is_status
from ingest.languages.massrobotics.report_models import IdentityReport, StatusReport
from tests.helpers.vectors import VECTORS, T, at, named, said, with_null

NUMBERS = (
    b"NaN",
    b"-Infinity",
    b"1e999",
    b"-0",
    b"1E3",
    b"01",
    b"1.",
    b'"1"',
    b"true",
    b"9" * 400,
    b"12345678901234567890",
)
TEXTS = (
    b'"\xff"',
    b'"\\ud800"',
    b'"\\ud83d\\ude00"',
    b'"\\u0000"',
    b'"\xed\xa0\x80"',
    b'"a\nb"',
    b'"\\q"',
    b"1",
    b"[]",
)
NULLS = (
    *(with_null(said(), key) for key in ("path", "destinations", "velocity", "batteryPercentage", "errorCodes")),
    said(path=[at(T) | {"angle": None}]),
    said(destinations=[at(T) | {"planarDatum": None}, None]),
    said(velocity={"linear": 1.0, "angular": None}),
    with_null(named(), "maxSpeed"),
)


def validated(raw: bytes) -> dict[str, Any]:
    """What pydantic makes of a report; fails where it does not take it."""
    return (StatusReport if b'"operationalState"' in raw else IdentityReport).model_validate_json(raw).model_dump()


def told(part: object) -> object:
    """A decoded report as dictionaries."""
    if isinstance(part, list):
        return [told(each) for each in part]
    fields = getattr(part, "__struct_fields__", None)
    return {name: told(getattr(part, name)) for name in fields} if fields else part


def agrees(raw: bytes) -> bool:
    """Whether the report is decoded; then it is validated to the same."""
    report = decoded(raw)
    if report is None:
        return False
    assert repr(told(report)) == repr(validated(raw))
    return True


def test_every_conforming_message_is_decoded() -> None:
    assert [
        vector.name for vector in VECTORS if not agrees(vector.raw) and not (vector.findings or vector.rejected)
    ] == []


@pytest.mark.parametrize("value", [*NUMBERS, *TEXTS])
def test_a_value_is_taken_as_pydantic_takes_it_or_left_to_it(value: bytes) -> None:
    agrees(said(batteryPercentage="HERE").replace(b'"HERE"', value))
    agrees(said(operationalState="HERE").replace(b'"HERE"', value))
    agrees(named(robotModel="HERE").replace(b'"HERE"', value))


def test_what_is_decoded_of_damaged_messages_is_what_pydantic_takes() -> None:
    random, taken = Random(7), 0
    raw = said(path=[at(T)], errorCodes=["é"], velocity={"linear": 1.25})
    for _ in range(20_000):
        damaged = bytearray(raw)
        for _ in range(random.randint(1, 3)):
            damaged[random.randrange(len(damaged))] = random.choice(b'0123456789.-+eE"\\,:{}[] \n\x00\xff\xc3\xa9aZ')
        taken += agrees(bytes(damaged))
    assert taken > 1000


@pytest.mark.parametrize("raw", [said(mood="good"), *NULLS, named(hue=1)])
def test_keys_of_ones_own_and_nulls_are_left_to_pydantic(raw: bytes) -> None:
    assert decoded(raw) is None


def test_a_report_is_known_by_its_kind() -> None:
    for raw, expected in ((said(), True), (named(), False)):
        report = decoded(raw)
        assert report is not None
        assert is_status(report) is expected
    assert is_status(StatusReport.model_validate_json(said()))
