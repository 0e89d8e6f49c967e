"""What happens stands in a field of its own, without time and advice: nobody has to cut it out of a summary."""

from collections.abc import Sequence

import pytest

from deconflict.advisories.conflict_lifecycle import ConflictLifecycle
from deconflict.advisories.words.words import Spot
from deconflict.foresight.conflict_predictions import Prediction
from deconflict.settings.site import Conflict
from deconflict.sweep.geometry.encounter import Encounter
from deconflict_client.advisory import (
    ADVISORY,
    AnyAdvisory,
    ClearedCode,
    ConflictAdvisory,
    Hold,
    NamedPlace,
    Recommendation,
)
from tests.deconflict.advisories.situations.made_situations import (
    NOW_S,
    action,
    advice,
    blockage,
    conflict,
    deadlock,
    head_on,
    queue,
    raised,
)
from tests.helpers.made_predictions import in_columns
from tests.helpers.made_scene import MadeScene

PAIR = ("a", "b")


class Bay(MadeScene):
    """Two meet at a place with a semicolon and a time in its name."""

    def spots(self, encounters: Sequence[Encounter]) -> list[Spot]:
        return [Spot("in Bay 1; open in 5 min", (NamedPlace(id="bay-1", name="Bay 1"),))] * len(encounters)


def test_what_a_conflict_is_stays_whole_whatever_is_advised_and_how_its_place_is_named() -> None:
    lifecycle = ConflictLifecycle(Conflict(confirm=(1, 1)), absent_after_s=10.0)
    prediction = Prediction(PAIR, NOW_S + 8.0, 0.0, 3.0, True, 0.95)
    (first,) = lifecycle.revise(NOW_S, in_columns([prediction]), set(PAIR), Bay())
    event = "Alder a and Alder b cross in 8 s, in Bay 1; open in 5 min"
    assert first.headline == "Alder a and Alder b cross, in Bay 1; open in 5 min"
    assert first.event == first.summary == event
    assert [place.id for place in first.places] == ["bay-1"]
    waits = Recommendation(
        holds=(Hold(robot="a", hold_s=2.0),), actions=(action("a"),), cost_s=2.0, bound_s=2.0, proven_optimal=True
    )
    advised = lifecycle.add_advice(PAIR, waits, NOW_S)
    assert advised
    assert advised.summary == f"{event}; Robot a should wait 4 s"
    kept = ADVISORY.validate_json(advised.model_dump_json())
    over = kept.cleared_revision(NOW_S + 1, ClearedCode.PASSED)
    assert (over.headline, over.summary) == (first.headline, event)


def test_a_conflict_of_an_older_release_is_advised_of_without_its_old_advice() -> None:
    lifecycle = ConflictLifecycle(Conflict(), absent_after_s=10.0)
    before = conflict("ab", summary="Robot a and Robot b cross in 8 s, in Aisle 3; Robot b should wait 4 s")
    lifecycle.restore([before])
    assert isinstance(before, ConflictAdvisory)
    note = Recommendation(cost_s=0.0, bound_s=0.0, proven_optimal=True, note="no hold helps")
    advised = lifecycle.add_advice(before.robots, note, NOW_S)
    assert advised
    assert advised.summary == "Robot a and Robot b cross; no hold helps"


@pytest.mark.parametrize(
    ("advisories", "headline"),
    [
        ([conflict("ab"), conflict("bc")], "3 robots get in each other's way, in Aisle 3"),
        ([conflict("ab")], "Robot a and Robot b cross, in Aisle 3"),
        ([deadlock("ab")], "Robot a and Robot b lock each other, in Aisle 3: each waits for the other"),
        ([queue("abc")], "2 robots have to wait for Dock 1, up to 40 s; 3 robots need it"),
        ([blockage("xab")], "Robot x has stood for over 30 s, in Aisle 3, in the way of Robot a and Robot b"),
    ],
)
def test_the_headline_of_a_situation_has_no_time_and_no_list_of_robots(
    advisories: list[AnyAdvisory], headline: str
) -> None:
    assert raised(advisories).headline == headline


def test_each_action_of_advice_has_its_sentence_and_the_last_says_who_goes_first() -> None:
    orders = advice(action("a", seconds=5.0, where="before Lift; left"), action("b", "go_first"))
    found = raised([head_on("ab", left_s=20.0, recommendation=orders)]).advice
    assert found
    wait, first = found.actions
    assert found.text == wait.text == "Robot a should wait 5 s before Lift; left, so that Robot b goes first"
    assert "text" not in first.model_dump()


def test_a_situation_names_the_place_that_its_robots_wait_for() -> None:
    (place,) = raised([queue("abc")]).places
    assert (place.id, place.name) == ("dock-1", "Dock 1")
    assert raised([queue("abc", resources=("dock-1", "dock-2"), resource_name="one of 2 docks")]).places == ()
