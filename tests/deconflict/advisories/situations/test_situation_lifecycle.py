"""When situations are raised, updated, joined, split and cleared."""

from datetime import timedelta

from deconflict.advice.document_limits import MOST_DOCUMENT_BYTES
from deconflict.advisories.situations.situation_lifecycle import OVER_S, UPDATE_GAP_S, is_news
from deconflict_client.advisory import AdvisoryState, ClearedCode, EncounterClass, Severity, moment
from deconflict_client.situations import REVISION, Situation, most_urgent_first
from tests.deconflict.advisories.situations.made_situations import (
    NOW_S,
    action,
    advice,
    blockage,
    conflict,
    deadlock,
    head_on,
    lifecycle,
    queue,
    raised,
)
from tests.helpers.made_advisories import START, situation


def test_conflicts_that_share_a_robot_are_one_situation() -> None:
    situation = raised([conflict("ab"), conflict("bc", x_m=15.0)])
    assert situation.robots == ("a", "b", "c")
    assert set(situation.advisories) == {"conflict ab", "conflict bc"}


def test_conflicts_far_apart_are_two_situations() -> None:
    assert len(lifecycle().revise(NOW_S, [conflict("ab"), conflict("cd", x_m=30.0)])) == 2


def test_conflicts_on_two_floors_are_two_situations() -> None:
    upstairs = conflict("ac").location.model_copy(update={"datum": "another floor"})
    assert len(lifecycle().revise(NOW_S, [conflict("ab"), conflict("ac", location=upstairs)])) == 2


def test_what_nobody_can_prevent_makes_no_situation() -> None:
    assert lifecycle().revise(NOW_S, [conflict("ab", left_s=0.3)]) == []


def test_what_is_unlikely_makes_no_situation() -> None:
    assert lifecycle().revise(NOW_S, [conflict("ab", probability=0.1)]) == []


def test_a_revision_has_the_id_of_the_situation_that_was_open_before() -> None:
    situations, first = lifecycle(), conflict("ab")
    raised, situation = situations.published(NOW_S, [first])
    assert isinstance(situation, Situation)
    updated, *_ = situations.published(NOW_S + 1, [first.next_revision(updated_at=moment(NOW_S + 1))])
    assert (raised.situation_id, updated.situation_id) == (None, situation.id)


def test_an_advisory_without_an_open_situation_has_no_id_of_one() -> None:
    (revision,) = lifecycle().published(NOW_S, [conflict("ab", left_s=0.3)])
    assert revision.situation_id is None


def test_a_revision_that_clears_keeps_the_id_of_its_situation() -> None:
    situations, first = lifecycle(), conflict("ab")
    _, situation = situations.published(NOW_S, [first])
    cleared, _ = situations.published(NOW_S + 1, [first.cleared_revision(NOW_S + 1, ClearedCode.PASSED, "they passed")])
    assert cleared.situation_id == situation.id


def test_a_situation_is_cleared_once_nothing_is_left_of_it() -> None:
    situations, first = lifecycle(), conflict("ab")
    situations.revise(NOW_S, [first])
    situations.revise(NOW_S + 5, [])
    situations.revise(NOW_S + 6, [first.cleared_revision(NOW_S + 6, ClearedCode.PASSED, "they passed")])
    assert situations.revise(NOW_S + 4 + OVER_S, []) == []
    (cleared,) = situations.revise(NOW_S + 5 + OVER_S, [])
    assert (cleared.state, cleared.cleared_because) == (AdvisoryState.CLEARED, "they passed")
    assert cleared.cleared_code is ClearedCode.PASSED
    assert situations.open() == []


def test_two_open_situations_stay_two_however_near_they_come() -> None:
    situations = lifecycle()
    (older,) = situations.revise(NOW_S, [conflict("ab")])
    later = conflict("cd", x_m=30.0, left_s=12.0)
    (younger,) = situations.revise(NOW_S + 1, [later])
    near = later.next_revision(location=conflict("cd", x_m=2.0).location)
    situations.revise(NOW_S + 6, [near, conflict("bc")])
    assert {each.id for each in situations.open()} == {older.id, younger.id}


def test_what_leaves_refers_to_its_situation() -> None:
    situations = lifecycle()
    pairs = ["ab", "cd", "ef", "gh", "ij"]
    conflicts = [conflict(pair, x_m=index) for index, pair in enumerate(pairs)]
    (whole,) = situations.revise(NOW_S, conflicts)
    away = conflicts[-1].next_revision(location=conflict("ij", x_m=40.0).location)
    part = next(revision for revision in situations.revise(NOW_S + UPDATE_GAP_S, [away]) if revision.id != whole.id)
    assert (part.split_from, part.robots) == (whole.id, ("i", "j"))
    assert next(each for each in situations.open() if each.id == whole.id).robots == tuple("abcdefgh")


def test_severity_rises_at_once_and_other_news_waits() -> None:
    situations = lifecycle()
    first = conflict("ab", left_s=20.0, probability=0.5)
    situations.revise(NOW_S, [first])
    joined = situations.revise(NOW_S + 0.1, [conflict("bc", left_s=40.0, probability=0.1)])
    assert joined == []
    (worse,) = situations.revise(NOW_S + 0.2, [blockage("xabcd", recommendation=advice(action("x", "look")))])
    assert worse.severity is Severity.CRITICAL


def test_a_robot_that_joins_is_listed_sooner_than_other_news() -> None:
    situations, first = lifecycle(), conflict("ab")
    situations.revise(NOW_S, [first])
    assert situations.revise(NOW_S + 2, [first.next_revision(predicted_at=moment(NOW_S + 20))]) == []
    (joined,) = situations.revise(NOW_S + 2.1, [conflict("bc")])
    assert joined.robots == ("a", "b", "c")


def test_the_first_advice_is_published_at_once() -> None:
    situations, first = lifecycle(), head_on("ab")
    situations.revise(NOW_S, [first])
    (advised,) = situations.revise(NOW_S + 0.5, [first.next_revision(recommendation=advice(action("a")))])
    assert advised.advice is not None


def test_advice_names_robots_of_the_situation_only() -> None:
    advised = conflict("ab", recommendation=advice(action("z"), action("a")))
    assert raised([advised]).advice is None


def test_the_last_advisory_takes_the_advice_with_it() -> None:
    situations, first = lifecycle(), conflict("ab", recommendation=advice(action("a")))
    situations.revise(NOW_S, [first])
    (empty,) = situations.revise(NOW_S + 1, [first.cleared_revision(NOW_S + 1, ClearedCode.PASSED, "they passed")])
    assert (empty.advice, empty.advisories, empty.severity) == (None, (), Severity.CAUTION)
    assert empty.state is AdvisoryState.UPDATED


def test_a_conflict_that_does_not_pass_keeps_its_situation() -> None:
    situations = lifecycle()
    (situation,) = situations.revise(NOW_S, [conflict("ab", 6.0)])
    for second in range(1, 60):
        assert {revision.id for revision in situations.revise(NOW_S + second, [])} <= {situation.id}
    assert [each.id for each in situations.open()] == [situation.id]


def test_an_advisory_that_changes_its_floor_leaves_the_others() -> None:
    situations = lifecycle()
    conflicts = [conflict("ab"), conflict("cd", x_m=1.0)]
    situations.revise(NOW_S, conflicts)
    upstairs = conflict("cd").location.model_copy(update={"datum": "another floor"})
    situations.revise(NOW_S + UPDATE_GAP_S, [conflicts[1].next_revision(location=upstairs)])
    floors = {each.location.datum: each.robots for each in situations.open() if each.location}
    assert sorted(floors.values()) == [("a", "b"), ("c", "d")]


def test_queues_at_several_docks_are_situations_of_their_own() -> None:
    docks = [
        queue("abc", id=f"dock {at}", resource=f"dock-{at}", location=conflict("ab", x_m=60.0 * at).location)
        for at in range(5)
    ]
    assert len(lifecycle().revise(NOW_S, docks)) == 5


def test_a_clock_that_goes_back_freezes_nothing() -> None:
    situations, first = lifecycle(), conflict("ab")
    situations.revise(NOW_S, [first])
    situations.revise(NOW_S - 3600, [first.cleared_revision(NOW_S - 3600, ClearedCode.PASSED, "they passed")])
    (cleared,) = situations.revise(NOW_S - 3600 + OVER_S, [])
    assert cleared.state is AdvisoryState.CLEARED


def test_a_severity_falls_only_after_a_while() -> None:
    backing = advice(action("a", "back_out", where="of Aisle 3"))
    situations, first = lifecycle(), head_on("ab", 25.0, recommendation=backing)
    situations.revise(NOW_S, [first])
    likely, unlikely = (first.next_revision(probability=p) for p in (0.8, 0.08))
    for second in range(1, 20):
        situations.revise(NOW_S + second, [(likely, unlikely)[second % 2]])
        assert [each.severity for each in situations.open()] == [Severity.WARNING]


def test_what_people_can_do_nothing_about_is_not_critical() -> None:
    assert raised([blockage("xabcd")]).severity is Severity.CAUTION
    assert raised([deadlock("ab")]).severity is Severity.WARNING
    assert raised([blockage("xabcd", recommendation=advice(action("x", "look")))]).severity is Severity.CRITICAL
    assert raised([conflict("ab", encounter_class=EncounterClass.HEAD_ON)]).severity is Severity.CAUTION


def test_a_robot_that_two_situations_ask_for_goes_to_the_more_urgent() -> None:
    situations = lifecycle()
    (first,) = situations.revise(NOW_S, [conflict("ab", recommendation=advice(action("a")))])
    blocked = blockage("xacd", location=conflict("cd", x_m=40.0).location, recommendation=advice(action("a", "look")))
    revisions = situations.revise(NOW_S + 1, [blocked])
    assert [each.id for each in revisions if each.advice] == [
        each.id for each in situations.open() if each.id != first.id
    ]
    assert next(each for each in situations.open() if each.id == first.id).advice is None


def test_of_two_deadlocks_that_cost_the_same_a_situation_is_about_the_older() -> None:
    older, newer = deadlock("ab", id="1"), deadlock("ac", id="2")
    both = ([older, newer], [newer, older])
    assert {raised(advisories).subject_robots for advisories in both} == {("a", "b")}


def test_robots_that_stand_in_the_way_are_a_situation_each() -> None:
    assert len(lifecycle().revise(NOW_S, [blockage("xab", id="1"), blockage("ycd", id="2")])) == 2


def test_a_robot_has_one_thing_to_do_in_situations_of_equal_urgency() -> None:
    situations = lifecycle()
    situations.revise(NOW_S, [head_on("ab", recommendation=advice(action("a")))])
    situations.revise(NOW_S + 1, [head_on("ac", x_m=40.0, recommendation=advice(action("a")))])
    assert [each.advice is None for each in situations.open()] == [False, True]


def test_what_is_far_ahead_no_more_is_news_since_it_has_another_place_in_the_order() -> None:
    far = situation(1, predicted_at=START + timedelta(seconds=300))
    later = far.model_copy(update={"updated_at": far.predicted_at - timedelta(seconds=91)})
    near = far.model_copy(update={"updated_at": far.predicted_at - timedelta(seconds=89)})
    assert not is_news(far, later)
    assert is_news(far, near)
    assert most_urgent_first([later, near]) == [near, later]


def test_the_sentence_follows_the_time_left() -> None:
    situations, first = lifecycle(), conflict("ab", 20.0)
    (situation,) = situations.revise(NOW_S, [first])
    assert situation.summary == "Robot a and Robot b cross in 20 s, in Aisle 3"
    later = [revision for second in range(1, 25) for revision in situations.revise(NOW_S + second, [])]
    assert "Robot a and Robot b cross now, in Aisle 3" in [revision.summary for revision in later]


def test_a_restored_situation_goes_on_under_its_id() -> None:
    before, first = lifecycle(), conflict("ab")
    (situation,) = before.revise(NOW_S, [first])
    after = lifecycle()
    after.restore(before.open(), [first])
    assert after.revise(NOW_S + 1, []) == []
    (updated,) = after.revise(NOW_S + UPDATE_GAP_S, [conflict("bc")])
    assert (updated.id, updated.revision) == (situation.id, 2)


def test_a_claim_without_a_place_is_a_situation_of_its_own() -> None:
    elsewhere = queue("ab").model_copy(update={"location": None})
    situations = lifecycle().revise(NOW_S, [elsewhere, conflict("ab")])
    assert sorted(len(situation.advisories) for situation in situations) == [1, 1]
    assert {situation.outline == () for situation in situations} == {True, False}


def test_the_document_of_a_situation_is_bounded() -> None:
    letters = [chr(0x4E00 + index) for index in range(400)]
    pairs = [a + b for a, b in zip(letters[::2], letters[1::2], strict=True)]
    crowd = [
        conflict(pair, x_m=index / 100, names=("\x01" * 16,) * 2, recommendation=advice(action(pair[0])))
        for index, pair in enumerate(pairs)
    ]
    situation = raised(crowd)
    assert (len(situation.robots), situation.more_robots) == (20, 380)
    assert (len(situation.advisories), situation.more_advisories) == (40, 160)
    assert len(situation.model_dump_json()) <= MOST_DOCUMENT_BYTES
    assert REVISION.validate_json(situation.model_dump_json()) == situation
