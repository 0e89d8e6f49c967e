"""Robots that stand for each other before a free crossing: who should go first, and how long that counts."""

import pytest

from deconflict.advice.actions.action_text import action_text
from deconflict.adviser.advice_lifecycle import AnsweredAdvice
from deconflict.advisories.words.finding_words import mutual_wait
from deconflict.advisories.words.words import RevisionWords
from deconflict_client.advisory import Action, AdvisoryState, AnyAdvisory, DeadlockAdvisory
from ingest.settings import Vendor
from tests.deconflict.contention.scenes import NOW_S, cleared, raised, standoff
from tests.helpers.saying import robot


def actions(advisory: AnyAdvisory) -> list[tuple[str, str]]:
    assert advisory.recommendation
    return [(action.action, action.robot) for action in advisory.recommendation.actions]


@pytest.mark.parametrize("number", range(5))
def test_one_of_the_two_should_go_first(number: int) -> None:
    (advisory,) = raised(standoff(number).run(24), "deadlock")
    assert isinstance(advisory, DeadlockAdvisory)
    assert [kind for kind, _ in actions(advisory)] == ["wait", "go_first"]
    assert {uuid for _, uuid in actions(advisory)} == {robot("a"), robot("b")}
    assert {wait.where for wait in advisory.cycle} == {"path"}


@pytest.mark.parametrize("number", range(5))
def test_who_has_agreed_to_go_first_goes_first(number: int) -> None:
    """Advice to machines and to people says the same."""
    scene = standoff(number)
    second = 0
    while not (asked := [advice for advice in scene.asked if advice.verb == "go_first"]):
        scene.run(second + 1, from_s=second)
        second += 1
    first = asked[0]
    scene.engine.advise(NOW_S + second, [AnsweredAdvice(first.id, "accepted", "")])
    scene.run(second + 15, from_s=second)
    newest = [revision for revision in scene.advisories if revision.kind == "deadlock"][-1]
    assert first.robot in newest.robots
    assert actions(newest)[-1] == ("go_first", first.robot)


def test_it_is_over_once_one_drives_on() -> None:
    scene = standoff(1)
    (advisory,) = raised(scene.run(24), "deadlock")
    goes = scene.robots["a"]
    _, x, y = goes.knots[-1]
    dx, dy = (x - goes.knots[0][1]) / 8, (y - goes.knots[0][2]) / 8
    goes.knots = [*goes.knots, (24.0, x, y), (44.0, x + 20 * dx, y + 20 * dy)]
    (over,) = cleared(scene.run(44, from_s=24), "deadlock")
    assert over.id == advisory.id
    assert over.state is AdvisoryState.CLEARED


def test_nobody_tells_people_on_foot_who_goes_first() -> None:
    people = (Vendor(name="Birch", participant="person"),)
    assert not raised(standoff(2, vendors=people).run(30), "deadlock")


def test_a_wait_without_a_time_is_one_until_the_other_has_passed() -> None:
    action = Action(robot=robot("a"), name="A 1", action="wait", where="before the crossing")
    assert action_text(action) == "A 1 should wait before the crossing"
    assert action_text(action.model_copy(update={"seconds": 12.0})) == "A 1 should wait 12 s before the crossing"


def test_people_read_how_long_they_have_stood_and_who_goes_first() -> None:
    sentences: RevisionWords = mutual_wait(["A 1", "B 2"], 11.0, "B 2")
    assert sentences.summary == (
        "A 1 and B 2 have stood for 11 s before a free crossing: each waits for the other; B 2 should go first"
    )
    assert "11 s" not in sentences.headline
