"""What comes back to a place and ends by itself there is said to, and nobody is asked to end it."""

from typing import Any

from deconflict.advisories.situations.advice.recurrences import OFTEN, WITHIN_S
from deconflict.advisories.situations.situation_lifecycle import SituationLifecycle
from deconflict_client.advisory import ClearedCode, DeadlockAdvisory, EncounterClass, Severity, moment
from deconflict_client.situations import Situation
from tests.deconflict.advisories.situations.made_situations import (
    NOW_S,
    action,
    advice,
    conflict,
    deadlock,
    lifecycle,
)

EVERY_S = 90.0


def lock(number: int, now_s: float, **fields: Any) -> DeadlockAdvisory:
    times = {"raised_at": moment(now_s), "updated_at": moment(now_s), "predicted_at": moment(now_s)}
    by_hand = advice(action("a", "look"))
    return deadlock(
        "ab", **(times | {"id": f"lock {number}", "time_to_conflict_s": 0.0, "recommendation": by_hand} | fields)
    )


def locked(
    times: int, lasting_s: float = 11.0, every_s: float = EVERY_S, **fields: Any
) -> tuple[SituationLifecycle, float]:
    """Situations after so many locks, each of which ended, and the time of the next one."""
    situations = lifecycle()
    for number in range(times):
        now_s = NOW_S + number * every_s
        first = lock(number, now_s)
        situations.revise(now_s, [first])
        situations.revise(
            now_s + lasting_s, [first.cleared_revision(now_s + lasting_s, ClearedCode.PASSED, "they drive")]
        )
        situations.revise(now_s + lasting_s + 12, [])
    return situations, NOW_S + times * every_s


def newest(situations: SituationLifecycle, now_s: float, **fields: Any) -> Situation:
    (situation,) = situations.revise(now_s, [lock(99, now_s, **fields)])
    return situation


def test_what_ends_by_itself_each_time_asks_nobody_for_anything() -> None:
    situations, now_s = locked(OFTEN - 1)
    third = newest(situations, now_s)
    assert third.summary.endswith("; third time in 10 min, ended by itself within 11 s each time before")
    assert (third.severity, third.advice) == (Severity.CAUTION, None), "programs can't look"


def test_a_second_time_is_said_to_be_one_and_is_as_severe_as_the_first() -> None:
    second = newest(*locked(OFTEN - 2))
    assert second.summary.endswith("; second time in 10 min, ended by itself within 11 s the first time")
    assert second.severity is Severity.CRITICAL
    assert second.advice


def test_a_conflict_within_it_asks_nobody_for_anything_either() -> None:
    situations, now_s = locked(OFTEN - 1)
    slow = advice(action("a", "slow_down", seconds=14.0, speed_mps=0.5), action("b", "go_first"))
    meets = conflict("ab", 9.0, now_s=now_s, encounter_class=EncounterClass.HEAD_ON, recommendation=slow)
    (third,) = situations.revise(now_s, [lock(99, now_s, recommendation=None), meets])
    assert third.severity is Severity.CAUTION
    assert third.advice
    assert not third.advice.for_people, "programs may do something"


def test_what_lasts_longer_than_each_time_before_is_as_severe_as_any() -> None:
    situations, now_s = locked(OFTEN - 1)
    newest(situations, now_s)
    for second in range(1, 40):
        situations.revise(now_s + second, [])
    (lasting,) = situations.open()
    assert lasting.severity is Severity.CRITICAL
    assert lasting.advice
    assert lasting.advice.for_people


def test_what_came_back_but_lasted_long_keeps_its_order() -> None:
    situations, now_s = locked(OFTEN - 1, lasting_s=40.0)
    third = newest(situations, now_s)
    assert third.severity is Severity.CRITICAL
    assert third.summary.endswith("; third time in 10 min")


def test_what_is_elsewhere_of_others_or_long_ago_has_not_come_back() -> None:
    situations, now_s = locked(OFTEN - 1)
    far = conflict("ab", x_m=40.0).location
    assert "time in" not in newest(situations, now_s, location=far).summary
    situations, now_s = locked(OFTEN - 1)
    assert "time in" not in newest(situations, now_s, vendors=("Acme", "Borealis")).summary
    situations, now_s = locked(OFTEN - 1)
    assert "time in" not in newest(situations, now_s + WITHIN_S).summary


def test_what_comes_back_at_once_has_not_been_away() -> None:
    situations, now_s = locked(OFTEN + 1, lasting_s=11.0, every_s=24.0)
    assert "time in" not in newest(situations, now_s).summary
