"""When people are asked: after machines, and for one new thing a minute."""

from typing import Any

from deconflict.advisories.situations.people_last import (
    ACCEPTS_WITHIN_S,
    BETWEEN_S,
    FORGOTTEN_S,
    SETTLES_S,
    AskedRobots,
    PeopleLast,
    PeopleTurns,
)
from deconflict.advisories.situations.situation_lifecycle import UPDATE_GAP_S, SituationLifecycle
from deconflict.advisories.words.words import Spot
from deconflict_client.advisory import Acknowledgement, AdviceAnswer, ClearedCode, Location, Severity, moment
from deconflict_client.advisory.robot_advice import RobotAdvice
from deconflict_client.situations import Situation
from tests.deconflict.advisories.situations.made_situations import (
    NOW_S,
    action,
    advice,
    blockage,
    conflict,
    deadlock,
    queue,
    request,
)
from tests.helpers.saying import HALL


def answered(asked: RobotAdvice, answer: AdviceAnswer) -> RobotAdvice:
    given = Acknowledgement(name="Acme", reason="", at=asked.raised_at, answer=answer)
    return asked.model_copy(update={"acknowledgement": given})


def asked_robots(*requests: RobotAdvice) -> AskedRobots:
    asked = AskedRobots()
    asked.take(requests, NOW_S)
    return asked


RING = deadlock("ab", recommendation=advice(action("a", "look")))


def test_people_wait_for_what_a_machine_has_accepted_until_it_ends() -> None:
    accepted = answered(request(1, "a", "b"), "accepted")
    asked = asked_robots(accepted)
    assert asked.should_end(RING, NOW_S + 19)
    asked.take([accepted.cleared_revision(NOW_S + 20, ClearedCode.LAPSED)], NOW_S + 20)
    assert not asked.should_end(RING, NOW_S + 20)


def test_what_has_begun_counts_as_accepted() -> None:
    asked = asked_robots(request(1, "a", "b", begun_at=moment(NOW_S + 2)))
    assert asked.should_end(RING, NOW_S + 19)


def test_what_a_robot_has_done_has_some_time_to_show() -> None:
    done = answered(request(1, "a", "b"), "accepted").cleared_revision(NOW_S + 15, ClearedCode.DONE)
    asked = asked_robots(done)
    assert asked.should_end(RING, NOW_S + 15 + SETTLES_S - 0.1)
    assert not asked.should_end(RING, NOW_S + 15 + SETTLES_S)
    asked.take([request(2, "b", "a", 20.0)], NOW_S + 20)
    assert asked.should_end(RING, NOW_S + 20 + ACCEPTS_WITHIN_S - 0.1)


def test_machines_are_waited_for_again_once_the_standoff_before_is_forgotten() -> None:
    withdrawn = request(1, "a", "b").cleared_revision(NOW_S + 3, ClearedCode.WITHDRAWN)
    asked = asked_robots(withdrawn)
    asked.take([request(2, "a", "b", 20.0)], NOW_S + 20)
    assert not asked.should_end(RING, NOW_S + 20)
    asked = asked_robots(withdrawn)
    later_s = 3.0 + FORGOTTEN_S
    asked.take([request(2, "a", "b", later_s)], NOW_S + later_s)
    assert asked.should_end(RING, NOW_S + later_s)


def test_a_clock_that_goes_back_keeps_nobody_waiting() -> None:
    assert not asked_robots(request(1, "a", "b")).should_end(RING, NOW_S - 5)


def test_people_wait_only_for_what_is_asked_about_the_same_robots() -> None:
    asked = asked_robots(request(1, "a", "c"))
    assert not asked.should_end(RING, NOW_S)
    assert asked.should_end(deadlock("abc", recommendation=advice(action("a", "look"))), NOW_S)
    assert not asked.should_end(queue("abc", recommendation=advice(action("a"))), NOW_S)


def test_who_stands_still_in_the_way_needs_a_person_also_if_others_get_around() -> None:
    asked = asked_robots(answered(request(1, "b", "a"), "accepted"))
    assert not asked.should_end(blockage("ab", recommendation=advice(action("a", "look"))), NOW_S)
    assert asked.should_end(blockage("ab", recommendation=advice(action("a", "back_out"))), NOW_S)


def test_the_most_severe_has_the_next_turn_then_the_oldest() -> None:
    turns, now_s = PeopleTurns(), NOW_S
    assert turns.take("first", Severity.WARNING, NOW_S, now_s)
    waiting = {"new": (Severity.WARNING, 9.0), "old": (Severity.WARNING, 5.0), "critical": (Severity.CRITICAL, 9.0)}
    asked = list[tuple[float, str]]()
    for second in range(1, 200):
        for name, (severity, raised_s) in list(waiting.items()):
            if turns.take(name, severity, NOW_S + raised_s, now_s + second):
                asked.append((second, name))
                del waiting[name]
    assert asked == [(BETWEEN_S, "critical"), (2 * BETWEEN_S, "old"), (3 * BETWEEN_S, "new")]


def test_who_needs_no_turn_any_more_keeps_nobody_waiting() -> None:
    turns = PeopleTurns()
    assert turns.take("first", Severity.WARNING, NOW_S, NOW_S)
    assert not turns.take("ended", Severity.CRITICAL, NOW_S, NOW_S + 50)
    assert turns.take("left", Severity.WARNING, NOW_S, NOW_S + BETWEEN_S)


def asking(situations: list[Situation]) -> list[bool]:
    return [each.advice is not None and each.advice.for_people for each in situations]


def lifecycle() -> SituationLifecycle:
    return SituationLifecycle(lambda points: [Spot("in Aisle 3")] * len(points), PeopleLast())


def test_what_is_critical_for_a_person_waits_for_no_turn() -> None:
    def ring(robots: str, x_m: float) -> Any:
        place = Location(datum=HALL, x=x_m, y=0.0)
        return deadlock(robots, location=place, recommendation=advice(action(robots[0], "look")))

    rings = [ring("ab", 0.0), ring("cd", 50.0)]
    walking = [ring.model_copy(update={"participants": ("robot", "person")}) for ring in rings]
    assert asking(lifecycle().revise(NOW_S, rings)) == [True, False]
    assert asking(lifecycle().revise(NOW_S, walking)) == [True, True]


def test_what_people_were_asked_for_stands_when_a_machine_is_asked_later() -> None:
    people = PeopleLast()
    situations = SituationLifecycle(lambda points: [Spot("in Aisle 3")] * len(points), people)
    situations.revise(NOW_S, [RING])
    people.take([answered(request(1, "a", "b", 1.0), "accepted")], NOW_S + 1)
    for second in range(1, 15):
        situations.revise(NOW_S + second, [])
        assert asking(situations.open()) == [True]


def test_what_people_were_asked_for_needs_no_turn_in_the_situation_that_splits_off_with_it() -> None:
    situations, between, look = lifecycle(), conflict("bc", x_m=1.0), advice(action("c", "look"))
    standing = blockage("cd", location=Location(datum=HALL, x=2.0, y=0.0), recommendation=look)
    (whole,) = situations.revise(NOW_S, [blockage("ab"), between, standing])
    assert asking([whole]) == [True]
    now_s, far = NOW_S + 1 + UPDATE_GAP_S, Location(datum=HALL, x=60.0, y=0.0)
    situations.revise(
        now_s, [standing.next_revision(location=far), between.cleared_revision(now_s, ClearedCode.PASSED)]
    )
    advised = {each.robots: (each.split_from, asking([each])) for each in situations.open()}
    assert advised == {("a", "b"): (None, [False]), ("c", "d"): (whole.id, [True])}
