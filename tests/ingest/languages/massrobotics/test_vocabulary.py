from uuid import UUID

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ingest.languages.massrobotics.vocabulary import STATES, datum, is_uuid, robot_uuid, state
from ingest.languages.rules import Findings, RejectedError

uuids = st.uuids(version=4)


@given(uuids)
def test_a_plain_uuid_is_itself(uuid: UUID) -> None:
    findings = Findings()
    assert robot_uuid(str(uuid), None, findings) == str(uuid)
    assert findings == {}


@given(uuids, st.sampled_from((str.upper, lambda text: text.replace("-", ""), lambda text: "{" + text + "}")))
def test_every_spelling_of_a_uuid_is_one_robot(uuid: UUID, spell) -> None:  # type: ignore[no-untyped-def]
    text = spell(str(uuid))
    assert is_uuid(text)
    assert robot_uuid(text, None, Findings()) == str(uuid)


@given(st.text(st.sampled_from("0123456789abcdefxX_+- \u0663")))
def test_nothing_else_that_a_number_may_hold_is_a_uuid(text: str) -> None:
    assert is_uuid(text) == (
        len(digits := text.strip().replace("-", "")) == 32 and set(digits) <= set("0123456789abcdef")
    )


def test_two_vendors_may_use_the_same_name() -> None:
    assert robot_uuid("7", "Alder", Findings()) != robot_uuid("7", "Basalt", Findings())
    assert robot_uuid("7", "Alder", Findings()) == robot_uuid("7", "Alder", Findings())


@pytest.mark.parametrize("text", ["", "  "])
def test_an_empty_name_is_no_robot(text: str) -> None:
    with pytest.raises(RejectedError, match="names_as_uuid"):
        robot_uuid(text, "Alder", Findings())


@pytest.mark.parametrize("text", sorted(STATES))
def test_a_state_of_the_standard_is_itself_in_any_case(text: str) -> None:
    for spelt in (text, text.upper(), text.lower()):
        assert state(spelt, Findings()) == (text, True)


def test_the_right_key_of_a_datum_wins_over_the_other() -> None:
    findings = Findings()
    assert datum("hall", "loft", findings, empty="datum-empty") == "hall"
    assert set(findings) == {"datum-key", "datum-not-uuid"}


def test_a_word_that_is_too_long_is_cut() -> None:
    assert len(datum("x" * 9999, None, Findings(), empty="datum-empty")) == 80
    assert len(state("x" * 9999, Findings())[0]) == 80
