from math import inf, nan
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ingest.languages.massrobotics.repair import finite, is_number, number, repaired, without_misfits
from ingest.languages.massrobotics.report_models import IdentityReport, StatusReport
from ingest.languages.rules import Findings
from tests.helpers.vectors import T, at, here

REPORT: dict[str, Any] = {
    "uuid": "7",
    "timestamp": "2023-11-14T22:13:20Z",
    "operationalState": "idle",
    "location": here(),
    "path": [at(T + 1)],
    "errorCodes": ["stuck"],
}


def test_a_report_that_needs_no_repair_does_not_change() -> None:
    findings = Findings()
    assert repaired(REPORT, StatusReport, findings) == REPORT
    assert findings == {}


def test_the_given_report_is_not_changed() -> None:
    document = REPORT | {"batteryPercentage": "81", "path": at(T), "location": here(x="1") | {"z": None}}
    before = repr(document)
    without_misfits(repaired(document, StatusReport, Findings()), StatusReport, Findings())
    assert repr(document) == before


@pytest.mark.parametrize("timestamp", [1700000000, 1700000000.0])
def test_a_time_sent_as_a_number_becomes_its_digits(timestamp: float) -> None:
    assert repaired(REPORT | {"timestamp": timestamp}, StatusReport, Findings())["timestamp"] == "1700000000"


@pytest.mark.parametrize("value", [True, [], {}, nan])
def test_a_value_that_is_neither_text_nor_number_is_not_changed(value: Any) -> None:
    findings = Findings()
    copy = repaired(REPORT | {"uuid": value}, StatusReport, findings)
    assert copy["uuid"] is value
    assert findings == {}


def test_only_the_misfits_are_left_out() -> None:
    findings = Findings()
    document = REPORT | {
        "batteryPercentage": [],
        "velocity": {"linear": 1.0, "angular": {"x": 0}},
        "path": [at(T + 1), {"x": 1}, 7, at(T + 2, angle="north")],
        "remainingRunTime": 3,
    }
    kept = without_misfits(document, StatusReport, findings)
    assert kept == REPORT | {
        "velocity": {"linear": 1.0},
        "path": [at(T + 1), at(T + 2, angle=None)],
        "remainingRunTime": 3,
    }
    assert set(findings) == {"value-unreadable", "point-unreadable"}


def test_a_required_value_is_never_left_out() -> None:
    expected = {"uuid": 1, "robotModel": [], "baseRobotEnvelope": {"x": "wide", "z": {}}}
    kept = without_misfits(expected, IdentityReport, Findings())
    assert kept.keys() == expected.keys()


json_values = st.recursive(
    st.none() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
)


@given(json_values, st.sampled_from((nan, inf, -inf)))
def test_one_number_that_is_not_finite_is_found_at_any_depth(value: Any, odd: float) -> None:
    assert finite(value)
    assert not finite([value, {"a": [odd]}])


@pytest.mark.parametrize(("value", "expected"), [("12", 12.0), (" 1e3 ", 1000.0), ("left", "left"), (None, None)])
def test_a_text_that_spells_a_number_becomes_a_number(value: Any, expected: Any) -> None:
    assert number(value, Findings()) == expected


def test_a_truth_value_is_no_number() -> None:
    assert is_number(1)
    assert not is_number(True)
    assert not is_number("1")
