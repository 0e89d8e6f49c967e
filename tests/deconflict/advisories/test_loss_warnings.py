"""What had been published when a loss began."""

from collections.abc import Callable
from datetime import timedelta
from math import inf
from typing import Any

import pytest

from deconflict.advisories.loss_warnings import FORESEEN_S, KEPT_S, LossWarnings, nobody_asked
from deconflict.foresight.losses.loss import Loss, LossKind, LossNotice
from deconflict_client.advisory import ConflictAdvisory, Hold, Recommendation
from tests.helpers.made_advisories import ROBOTS, START, cleared, deadlock, made

RAISED_S = START.timestamp()
A, B = ROBOTS
NOTHING = LossNotice()
WARNED = LossNotice(is_warned=True)
ADVISED = LossNotice(is_warned=True, is_advised=True)
HEEDED = LossNotice(is_warned=True, is_advised=True, is_heeded=True)


def loss(from_s: float, until_s: float = RAISED_S + 50.0, **fields: Any) -> Loss:
    known = Loss(
        A, B, B, "Acme", "", "Borealis", "Borealis", LossKind.CROSSING, from_s, until_s, 4.0, 4.0,
        is_sure=True, floor=0, x_m=0.0, y_m=0.0,
    )  # fmt: skip
    return known._replace(**fields)


def never(_: str) -> float:
    return -inf


def warnings(
    *revisions: Any,
    last_wait_s: Callable[[str], float] = never,
    has_followed: Callable[[str, str, float], bool] = nobody_asked,
) -> LossWarnings:
    known = LossWarnings((), last_wait_s, has_followed)
    for revision in revisions:
        known.note(revision.updated_at.timestamp(), [revision])
    return known


def advises(robot: str, hold_s: float, **fields: Any) -> ConflictAdvisory:
    advice = Recommendation(
        holds=(Hold(robot=robot, hold_s=hold_s),), cost_s=hold_s, bound_s=hold_s, proven_optimal=True
    )
    return made(0, recommendation=advice, **fields)


@pytest.mark.parametrize(("after_s", "notice"), [(FORESEEN_S, WARNED), (FORESEEN_S - 0.1, NOTHING), (-5.0, NOTHING)])
def test_an_advisory_warns_if_it_stood_long_enough_before(after_s: float, notice: LossNotice) -> None:
    assert warnings(made(0)).notice_of(loss(RAISED_S + after_s)) == notice


def test_an_advisory_that_was_cleared_before_warns_of_nothing() -> None:
    known = warnings(made(0), cleared(0, revision=6))
    assert known.notice_of(loss(RAISED_S + 4.9)) == WARNED
    assert known.notice_of(loss(RAISED_S + 5.1, until_s=RAISED_S + 51.0)) == NOTHING


def test_an_advisory_of_other_robots_warns_of_nothing_but_that_of_the_root_does() -> None:
    other = "0c5b4a7e-0000-4000-8000-000000000003"
    assert warnings(made(0)).notice_of(loss(RAISED_S + 5.0, by=other, root=other)) == NOTHING
    assert warnings(made(0)).notice_of(loss(RAISED_S + 5.0, by=other)) == WARNED


def test_a_deadlock_warns_of_what_its_robots_lose_to_each_other() -> None:
    assert warnings(deadlock(A, "other", B)).notice_of(loss(RAISED_S + 5.0)) == WARNED


def test_a_robot_that_joins_an_advisory_is_warned_of_from_then_on() -> None:
    joined = deadlock(A, B).model_copy(update={"updated_at": START + timedelta(seconds=4), "id": "deadlock"})
    first = deadlock(A, "other").model_copy(update={"id": "deadlock"})
    assert warnings(first, joined).notice_of(loss(RAISED_S + 5.0)) == NOTHING
    assert warnings(first, joined).notice_of(loss(RAISED_S + 6.0)) == WARNED


@pytest.mark.parametrize("robot", [A, B])
def test_advice_to_either_robot_counts_and_is_heeded_if_that_robot_waited_since(robot: str) -> None:
    waits_s = {robot: RAISED_S + 6.0}
    given = advises(robot, 8.0)
    assert warnings(given).notice_of(loss(RAISED_S + 5.0)) == ADVISED
    heeded = warnings(given, last_wait_s=lambda uuid: waits_s.get(uuid, -inf))
    assert heeded.notice_of(loss(RAISED_S + 5.0)) == HEEDED
    before = warnings(given, last_wait_s=lambda _: RAISED_S - 1.0)
    assert before.notice_of(loss(RAISED_S + 5.0)) == ADVISED


def test_what_was_warned_of_is_heeded_if_one_of_the_two_then_did_what_it_was_asked_for_the_other() -> None:
    def has_followed(*following: Any) -> bool:
        return following in {(A, B, RAISED_S + 5.0), (A, "root", RAISED_S + 5.0)}

    known = warnings(made(0), has_followed=has_followed)
    assert known.notice_of(loss(RAISED_S + 5.0)) == HEEDED
    assert known.notice_of(loss(RAISED_S + 6.0, until_s=RAISED_S + 51.0)) == WARNED
    assert known.notice_of(loss(RAISED_S + 5.0, robot=B, by=A, root=A)) == WARNED
    assert warnings(has_followed=has_followed).notice_of(loss(RAISED_S + 5.0)) == NOTHING


def test_advice_that_was_withdrawn_when_the_loss_began_does_not_count() -> None:
    assert warnings(advises(A, 3.0)).notice_of(loss(RAISED_S + 5.0)) == ADVISED
    assert warnings(advises(A, 9.0), made(0, revision=4)).notice_of(loss(RAISED_S + 5.0)) == WARNED


def test_the_parts_of_a_long_loss_have_what_its_first_part_had() -> None:
    known = warnings(made(0))
    assert known.notice_of(loss(RAISED_S + 1.0, RAISED_S + 61.0)) == NOTHING
    assert known.notice_of(loss(RAISED_S + 61.0, RAISED_S + 121.0)) == NOTHING
    assert known.notice_of(loss(RAISED_S + 122.0, RAISED_S + 125.0)) == WARNED


def test_advisories_that_were_open_before_a_restart_count_from_when_they_were_raised() -> None:
    later = made(0, revision=31)
    for known in (LossWarnings([later], never), warnings(later)):
        assert known.notice_of(loss(RAISED_S + 20.0)) == WARNED


def test_what_ended_long_ago_is_forgotten() -> None:
    known = warnings(made(0), cleared(0))
    known.note(RAISED_S + 2 * KEPT_S, [])
    assert known.notice_of(loss(RAISED_S + 0.5 + FORESEEN_S)) == NOTHING
    assert not known._published
    assert not known._ids


def test_a_robot_that_stands_in_a_deadlock_does_not_wait_as_advised() -> None:
    waited = warnings(advises(A, 8.0), last_wait_s=lambda _: RAISED_S + 6.0)
    assert waited.notice_of(loss(RAISED_S + 5.0, kind=LossKind.DEADLOCK)) == ADVISED
    later = loss(RAISED_S + 5.0, until_s=RAISED_S + 65.0), loss(RAISED_S + 65.0, until_s=RAISED_S + 90.0)
    assert waited.notice_of(later[0]) == HEEDED
    assert waited.notice_of(later[1]._replace(kind=LossKind.DEADLOCK)) == ADVISED
    asked = warnings(advises(A, 8.0), last_wait_s=lambda _: RAISED_S + 6.0, has_followed=lambda *_: True)
    assert asked.notice_of(loss(RAISED_S + 5.0, kind=LossKind.DEADLOCK)) == HEEDED
