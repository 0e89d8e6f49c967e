"""The order of situations: of two that differ in one thing, which comes first."""

from datetime import timedelta
from typing import Any

import pytest

from deconflict_client.advisory import Severity
from deconflict_client.situations import Situation, most_urgent_first
from tests.helpers.made_advisories import situation

SOON = situation(1).predicted_at
FAR = SOON + timedelta(seconds=100)


@pytest.mark.parametrize(
    ("first", "then"),
    [
        ({"severity": Severity.CAUTION}, {"advisories": (), "severity": Severity.CRITICAL}),
        ({"severity": Severity.CRITICAL}, {"participants": ("person", "driven")}),
        ({"participants": ("driven", "person"), "predicted_at": FAR}, {}),
        ({}, {"participants": ("person", "person"), "cost_s": 0.0, "predicted_at": SOON + timedelta(seconds=3)}),
        ({"preventable_s": None}, {"predicted_at": FAR}),
        ({}, {"preventable_s": None, "cost_s": 500.0}),
        ({"cost_s": 40.0, "predicted_at": SOON + timedelta(seconds=9)}, {}),
        ({"cost_s": 5.0}, {"cost_s": 7.0, "predicted_at": SOON + timedelta(seconds=9)}),
    ],
)
def test_of_two_situations_the_more_urgent_comes_first(first: dict[str, Any], then: dict[str, Any]) -> None:
    pair = situation(1, **{"id": "z"} | first), situation(1, **{"id": "a"} | then)
    assert most_urgent_first(reversed(pair)) == list(pair)


def test_the_order_is_in_the_document_and_is_the_same_when_that_is_read() -> None:
    document = situation(1, participants=("driven", "person")).model_dump(mode="json")
    assert document["order"][:3] == [0, 1, 0]
    assert list(Situation.model_validate(document | {"order": [9]}).order) == document["order"]
