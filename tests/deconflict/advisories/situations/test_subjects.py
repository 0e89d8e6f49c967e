"""What a situation is about stays: what joins shares it, and what is about something else is another situation."""

from collections.abc import Iterable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from deconflict.advisories.situations.situation_lifecycle import OVER_S, SituationLifecycle
from deconflict_client.advisory import AnyAdvisory, ClearedCode
from deconflict_client.situations import Situation
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

FAR_M = 16.0


def ended(advisory: AnyAdvisory, now_s: float, code: ClearedCode = ClearedCode.PASSED) -> AnyAdvisory:
    return advisory.cleared_revision(now_s, code)


def by_id(revisions: Iterable[Situation]) -> dict[str, Situation]:
    return {revision.id: revision for revision in revisions}


def parts(situations: SituationLifecycle) -> set[tuple[str, ...]]:
    return {each.advisories for each in situations.open()}


@pytest.mark.parametrize("pair", ["cd", "bc"])
def test_a_deadlock_does_not_end_as_a_meeting_that_is_16_m_away(pair: str) -> None:
    """Whether the meeting has a robot of the deadlock or not."""
    situations, locked = lifecycle(), deadlock("ab")
    (first,) = situations.revise(NOW_S, [locked])
    meeting = conflict(pair, x_m=FAR_M, left_s=60.0)
    situations.revise(NOW_S + 1, [meeting])
    (shown,) = [each for each in situations.open() if each.id == first.id]
    assert (shown.situation_kind, shown.subject_robots) == ("deadlock", ("a", "b"))
    assert ("c" in shown.robots) is (pair == "bc")
    situations.revise(NOW_S + 8, [])
    situations.revise(NOW_S + 9, [ended(locked, NOW_S + 9, ClearedCode.UNLOCKED), ended(meeting, NOW_S + 9)])
    situations.revise(NOW_S + 10, [conflict("cd", x_m=FAR_M, left_s=60.0, id="later")])
    cleared = by_id(situations.revise(NOW_S + 9 + OVER_S, []))[first.id]
    assert (cleared.situation_kind, cleared.cleared_code) == ("deadlock", ClearedCode.UNLOCKED)
    assert parts(situations) == {("later",)}


MEETINGS = st.lists(
    st.tuples(
        st.sampled_from(["ac", "bd", "cd", "ce", "de", "ef"]),
        st.sampled_from([0.0, 3.0, 9.0, FAR_M, 25.0]),  # how far from the deadlock
        st.integers(0, 20),  # when it is raised, s
        st.integers(1, 20),  # how long it lasts
    ),
    max_size=6,
)


@settings(max_examples=60, deadline=None)
@given(MEETINGS, st.integers(2, 25))
def test_a_deadlock_stays_a_deadlock_whatever_meets_around_it(
    drawn: list[tuple[str, float, int, int]], unlocked: int
) -> None:
    situations, locked, revisions = lifecycle(), deadlock("ab"), list[Situation]()
    for second in range(50):
        now_s = NOW_S + second
        changed: list[AnyAdvisory] = [locked] if second == 0 else []
        changed += [ended(locked, now_s, ClearedCode.UNLOCKED)] if second == unlocked else []
        for number, (pair, x_m, from_s, lasts_s) in enumerate(drawn):
            meeting = conflict(pair, 9.0, x_m, NOW_S + from_s, id=f"meeting {number}")
            changed += [meeting] if second == from_s else []
            changed += [ended(meeting, now_s)] if second == from_s + lasts_s else []
        revisions += situations.revise(now_s, changed)
    assert situations.open() == []
    first = next(each for each in revisions if each.situation_kind == "deadlock")
    chain = [each for each in revisions if each.id == first.id]
    assert {(each.situation_kind, each.subject_robots) for each in chain} == {("deadlock", ("a", "b"))}
    assert chain[-1].cleared_code is ClearedCode.UNLOCKED
    assert (chain[-1].updated_at.timestamp() - NOW_S) <= unlocked + OVER_S
    for each in revisions:
        assert set(each.subject_robots) & set(each.robots)


def test_what_goes_on_when_the_subject_is_over_is_another_situation() -> None:
    situations, first, near = lifecycle(), conflict("ab", left_s=60.0), conflict("cd", x_m=2.0, left_s=60.0)
    (whole,) = situations.revise(NOW_S, [first])
    situations.revise(NOW_S + 1, [near])
    assert parts(situations) == {("conflict ab", "conflict cd")}
    situations.revise(NOW_S + 5, [])
    situations.revise(NOW_S + 6, [ended(first, NOW_S + 6)])
    later = by_id(situations.revise(NOW_S + 6 + OVER_S, []))
    (other,) = later.keys() - {whole.id}
    assert (later[other].split_from, later[other].subject_robots) == (whole.id, ("c", "d"))
    cleared = later[whole.id]
    assert cleared.summary.startswith("Robot a and Robot b got in each other's way, or were about to")
    assert cleared.cleared_code is ClearedCode.PASSED


def test_a_meeting_stays_that_of_its_two_robots_while_one_of_them_meets_a_third() -> None:
    situations, first, after = lifecycle(), conflict("ab", left_s=60.0), conflict("bc", left_s=60.0)
    (whole,) = situations.revise(NOW_S, [first])
    situations.revise(NOW_S + 1, [after])
    (both,) = situations.open()
    assert (both.id, both.situation_kind, both.subject_robots) == (whole.id, "knot", ("a", "b"))
    over, later = (by_id(situations.revise(NOW_S + 5 + s, [ended(first, NOW_S + 5)])) for s in (0, OVER_S))
    (other,) = later.keys() - {whole.id}
    assert (later[other].split_from, later[other].subject_robots) == (whole.id, ("b", "c"))
    assert later[whole.id].cleared_code is ClearedCode.PASSED
    assert later[whole.id].names == over[whole.id].names


def test_a_knot_goes_on_while_two_of_its_robots_are_in_each_others_way() -> None:
    situations, sides = lifecycle(), [conflict(pair, left_s=60.0) for pair in ("ab", "bc", "ac")]
    (knot,) = situations.revise(NOW_S, sides)
    situations.revise(NOW_S + 5, [ended(sides[0], NOW_S + 5), ended(sides[1], NOW_S + 5), conflict("cd", left_s=60.0)])
    (after,) = situations.open()
    assert (after.id, after.subject_robots) == (knot.id, ("a", "b", "c"))
    situations.revise(NOW_S + 9, [ended(sides[2], NOW_S + 9)])
    assert parts(situations) == {()}
    situations.revise(NOW_S + 9 + OVER_S, [])
    assert parts(situations) == {("conflict cd",)}


@pytest.mark.parametrize(("left_s", "is_urgent"), [(60.0, False), (20.0, True)])
def test_what_goes_on_waits_until_the_card_before_is_gone_unless_it_is_urgent(left_s: float, is_urgent: bool) -> None:
    near = head_on("cd", left_s, recommendation=advice(action("c", "back_out", where="of Aisle 3")))
    situations, first = lifecycle(), conflict("ab", left_s=60.0)
    (whole,) = situations.revise(NOW_S, [first])
    situations.revise(NOW_S + 1, [near])
    situations.revise(NOW_S + 6, [])
    at_once, later = (by_id(situations.revise(NOW_S + 6 + s, [ended(first, NOW_S + 6)])) for s in (0, OVER_S - 0.1))
    assert len({*at_once, *later} - {whole.id}) == is_urgent


def test_a_knot_counts_the_robots_that_it_lists() -> None:
    situations = lifecycle()
    situations.revise(NOW_S, [conflict("ab", 9.0), conflict("ac", 9.0), conflict("bc", 9.0), conflict("cd", 9.0)])
    (knot,) = situations.open()
    assert (knot.situation_kind, knot.headline.split(" robots")[0]) == ("knot", str(len(knot.robots)))


def test_how_it_ended_is_how_its_subject_ended() -> None:
    """And not how another meeting ended later that was part of it."""
    situations, first, near = lifecycle(), conflict("ab", left_s=60.0), conflict("cd", x_m=2.0, left_s=60.0)
    (whole,) = situations.revise(NOW_S, [first])
    situations.revise(NOW_S + 1, [near])
    situations.revise(NOW_S + 5, [])
    over = [ended(first, NOW_S + 6), ended(near, NOW_S + 6, ClearedCode.UNPREDICTED)]
    situations.revise(NOW_S + 6, over)
    assert by_id(situations.revise(NOW_S + 6 + OVER_S, []))[whole.id].cleared_code is ClearedCode.PASSED


def test_a_situation_of_a_robot_that_stands_ends_when_it_drives_on_and_crosses_another() -> None:
    situations, blocked = lifecycle(), blockage("xab")
    (stood,) = situations.revise(NOW_S, [blocked])
    situations.revise(NOW_S + 1, [conflict("cx", left_s=60.0)])
    situations.revise(NOW_S + 5, [ended(blocked, NOW_S + 5)])
    later = by_id(situations.revise(NOW_S + 5 + OVER_S, []))
    (other,) = later.keys() - {stood.id}
    assert (later[other].subject_robots, later[other].split_from) == (("c", "x"), stood.id)
    assert "stood in the way" in later[stood.id].summary


def test_robots_of_a_queue_change_and_it_stays_one_situation() -> None:
    situations, waiting = lifecycle(), queue("abc")
    (first,) = situations.revise(NOW_S, [waiting])
    others = queue("def", id=waiting.id, revision=2)
    (after,) = situations.revise(NOW_S + 5, [others])
    assert (after.id, after.robots) == (first.id, ("d", "e", "f"))
    assert (first.subject_place, first.subject_robots) == ("resource dock-1", ())


def test_a_conflict_in_a_queue_does_not_become_its_title() -> None:
    crossing = conflict("ab", 4.0, probability=1.0)
    situation = raised([queue("abc", wait_s=4.0), crossing])
    assert (situation.situation_kind, len(situation.advisories)) == ("queue", 2)


def test_what_stands_in_the_way_is_the_subject_whoever_comes() -> None:
    situations, first = lifecycle(), blockage("xab")
    (blocked,) = situations.revise(NOW_S, [first])
    (after,) = situations.revise(NOW_S + 5, [blockage("xcd", id=first.id, revision=2)])
    assert (after.id, after.robots, blocked.subject_robots) == (blocked.id, ("c", "d", "x"), ("x",))


def test_the_same_two_that_meet_again_at_once_are_one_situation_wherever_it_is() -> None:
    situations, first = lifecycle(), conflict("ab")
    (meeting,) = situations.revise(NOW_S, [first])
    situations.revise(NOW_S + 5, [])
    situations.revise(NOW_S + 6, [ended(first, NOW_S + 6)])
    situations.revise(NOW_S + 8, [conflict("ab", x_m=60.0, id="again", now_s=NOW_S + 8)])
    assert {each.id for each in situations.open()} == {meeting.id}


def test_a_subject_stays_over_a_restart() -> None:
    before, first, near = lifecycle(), conflict("ab", left_s=60.0), conflict("cd", x_m=2.0, left_s=60.0)
    (whole,) = before.revise(NOW_S, [first])
    before.revise(NOW_S + 1, [near])
    after = lifecycle()
    after.restore([Situation.model_validate_json(each.model_dump_json()) for each in before.open()], [first, near])
    after.revise(NOW_S + 5, [])
    after.revise(NOW_S + 6, [ended(first, NOW_S + 6)])
    assert [each.subject_robots for each in after.open()] == [("a", "b")]
    after.revise(NOW_S + 6 + OVER_S, [])
    assert {each.subject_robots: each.split_from for each in after.open()} == {("c", "d"): whole.id}
