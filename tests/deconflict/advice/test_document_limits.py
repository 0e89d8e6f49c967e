"""What an advisory may list and say."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic_core import to_json

from deconflict.advice.document_limits import (
    CUT,
    MOST_HOLDS,
    MOST_NAME_BYTES,
    MOST_NAMED,
    MOST_NOTE_BYTES,
    MOST_SLOTS,
    limited_advice,
    listed,
    short_text,
)
from deconflict_client.advisory import Action, Hold, Recommendation, Slot
from deconflict_client.situations import MOST_ACTIONS
from tests.helpers.made_advisories import START


def advice(count: int, note: str = "") -> Recommendation:
    """Holds and slots for so many robots."""
    robots = [f"r-{number:03d}" for number in range(count)]
    return Recommendation(
        holds=tuple(Hold(robot=robot, hold_s=1.0) for robot in robots),
        slots=tuple(Slot(robot=robot, resource="dock", start_at=START, end_at=START, wait_s=0.0) for robot in robots),
        cost_s=1.0,
        bound_s=0.0,
        proven_optimal=False,
        note=note,
    )


@given(st.text(alphabet=st.sampled_from('aé\U0001f916\x01"\\'), max_size=120), st.integers(3, 100))
def test_a_text_is_cut_by_its_size_in_a_document(text: str, most_bytes: int) -> None:
    short = short_text(text, most_bytes)
    assert len(to_json(short)) - 2 <= most_bytes
    fits = len(to_json(text)) - 2 <= most_bytes
    assert short == text if fits else short.endswith(CUT) and text.startswith(short.removesuffix(CUT))


def test_advice_within_the_limits_is_not_changed() -> None:
    whole = advice(MOST_SLOTS, "x" * MOST_NOTE_BYTES)
    assert limited_advice(whole, ()) is whole
    assert not {"more_holds", "more_slots"} & whole.model_dump().keys()


def test_holds_and_slots_of_the_advisorys_own_robots_are_kept_first_in_their_order() -> None:
    short = limited_advice(advice(220, "x" * 9_999), ("r-219", "r-100"))
    assert [hold.robot for hold in short.holds] == [f"r-{n:03d}" for n in range(MOST_HOLDS - 2)] + ["r-100", "r-219"]
    assert [slot.robot for slot in short.slots] == [f"r-{n:03d}" for n in range(MOST_SLOTS - 2)] + ["r-100", "r-219"]
    assert (short.more_holds, short.more_slots) == (220 - MOST_HOLDS, 220 - MOST_SLOTS)
    assert len(short.note.encode()) <= MOST_NOTE_BYTES


def test_the_first_actions_are_kept_and_their_texts_cut() -> None:
    look = Action(robot="r", name="n" * 999, action="look", where="w" * 999, reason="r" * 999)
    short = limited_advice(advice(1).model_copy(update={"actions": (look,) * 5}), ())
    assert len(short.actions) == MOST_ACTIONS
    assert len(short.actions[0].name.encode()) <= MOST_NAME_BYTES
    assert len(short.actions[0].model_dump_json()) < 900


@pytest.mark.parametrize(("count", "end"), [(1, "n0"), (2, "n0 and n1"), (3, "n0, n1 and n2")])
def test_few_names_are_all_listed(count: int, end: str) -> None:
    assert listed([f"n{number}" for number in range(count)]) == end


def test_many_names_are_listed_up_to_a_limit() -> None:
    names = [f"n{number}" for number in range(MOST_NAMED + 1)]
    assert listed(names) == ", ".join(names[:MOST_NAMED]) + " and others"
    assert listed(names[:MOST_NAMED]).endswith(f"n{MOST_NAMED - 2} and n{MOST_NAMED - 1}")
