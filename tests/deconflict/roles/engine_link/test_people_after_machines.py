"""People are asked only for what machines do not do: the real engine asks robots, and people get what is left."""

from collections.abc import Callable, Sequence

import pytest

from deconflict.advisories.situations.people_last import ACCEPTS_WITHIN_S, BETWEEN_S
from deconflict.advisories.situations.situation_lifecycle import SituationLifecycle
from deconflict.advisories.words.place_names import PlaceNames
from deconflict.operator.store.publisher import Publisher
from deconflict.operator.store.store import Store
from deconflict.roles.engine_link.live_situations import LiveSituations
from deconflict.settings.site import Site
from deconflict_client.advisory import Acknowledgement, AdvisoryState, ClearedCode, Severity, moment
from deconflict_client.advisory.robot_advice import RobotAdvice
from deconflict_client.situations import Situation, advice_of, situations_of
from ingest.measures.measures import Measures
from tests.deconflict.adviser.advised_floor import CANNOT, SILENT, UNBEGUN, AdvisedFloor, Reply, forward
from tests.deconflict.adviser.floors import START_S, Robot, before_crossing, face_to_face
from tests.deconflict.advisories.situations.made_situations import NOW_S, action, advice, deadlock, request
from tests.deconflict.roles.engine_link.told_floor import ToldFloor

FIRST_S, TOLD_S = 2.0, 5.0
"""When the first of two that face each other is asked, and when people are told of the standoff."""


def told(store: Store, robots: Sequence[Robot], *replies: Reply) -> ToldFloor:
    """The vendor of the first robot gives the first reply, and that of the other the last."""
    reply = dict(zip((robots[0].maker, robots[1].maker), (replies[0], replies[-1]), strict=True))
    return ToldFloor(AdvisedFloor(list(robots), lambda advice: reply[advice.vendor]), store)


def goes_late(robot: Robot, _: RobotAdvice, since_s: float) -> None:
    """Set out after 4 s, and go around the other at ease."""
    if since_s > 11.0:
        forward(robot, 1.0)
    elif since_s >= 4.0:
        robot.y_m += 0.15


async def test_what_a_machine_accepts_people_are_not_asked_for(store: Store) -> None:
    floor = await told(store, face_to_face(), Reply("accepted", moves=goes_late)).run(40)
    assert [line.split("; ")[1].split()[0] for line in floor.floor.asked()] == ["done"]
    (first, *_) = floor.situations
    assert (first.situation_kind, first.severity, first.advice) == ("deadlock", Severity.CRITICAL, None)
    assert first.people_wait_for == "robots"
    assert floor.asking() == []


async def test_what_is_asked_names_the_situation_once_people_are_told_of_it(store: Store) -> None:
    floor = await told(store, face_to_face(), CANNOT).run(20)
    asked = [each for each in advice_of(store.after(0, -1)) if each.state is AdvisoryState.RAISED]
    named = [(each.raised_at.timestamp() - START_S > TOLD_S, each.situation_id) for each in asked]
    assert set(named) == {(False, None), (True, floor.situations[0].id)}


@pytest.mark.parametrize("silent", [(SILENT,), (CANNOT, SILENT), (SILENT, CANNOT), (UNBEGUN, SILENT)])
async def test_people_are_asked_once_no_machine_has_done_it_for_10_s(store: Store, silent: Sequence[Reply]) -> None:
    """Whether nobody answers, or one of two, or one accepts and does not set out."""
    floor = await told(store, face_to_face(), *silent).run(40)
    ((asked_s, _),) = floor.asking()
    assert asked_s == FIRST_S + ACCEPTS_WITHIN_S
    assert {each.severity for each in floor.situations} == {Severity.CRITICAL}
    waits_for = [(each.updated_at.timestamp() - START_S < asked_s, each.people_wait_for) for each in floor.situations]
    assert set(waits_for) == {(True, "robots"), (False, None)}


@pytest.mark.parametrize(("robots", "asked_s"), [(face_to_face, TOLD_S), (before_crossing, 12.0)])
async def test_people_are_asked_as_soon_as_all_is_declined(
    store: Store, robots: Callable[[], Sequence[Robot]], asked_s: float
) -> None:
    floor = await told(store, robots(), CANNOT).run(30)
    assert [at_s for at_s, _ in floor.asking()] == [asked_s]


async def test_a_wait_that_ends_with_a_declined_request_keeps_nobody_waiting(store: Store) -> None:
    """The vendor of the robot that should wait has not answered, and is not asked any more."""
    floor = AdvisedFloor(list(before_crossing()), lambda asked: CANNOT if asked.verb == "go_first" else SILENT)
    people = await ToldFloor(floor, store).run(30)
    assert "withdrawn" in "".join(floor.asked()[:4])
    assert [at_s for at_s, _ in people.asking()] == [12.0]


async def test_people_wait_for_an_accepted_request_also_over_a_restart(store: Store) -> None:
    ring, asked = deadlock("ab", recommendation=advice(action("a", "look"))), request(1, "a", "b")
    publisher = Publisher(store, Measures())
    live = LiveSituations(Site(), store, publisher)
    await live.publish([asked])
    await publisher.acknowledge(asked.id, Acknowledgement(name="", reason="", at=asked.raised_at, answer="accepted"))
    await live.publish([ring])
    live.follow([NOW_S + ACCEPTS_WITHIN_S])
    await live.settled()
    live = LiveSituations(Site(), store, publisher)
    await live.publish([ring.next_revision(updated_at=moment(NOW_S + 11))])
    live.follow([NOW_S + 11])
    await live.settled()
    (situation,) = situations_of(store.after(0, -1))
    assert situation.people_wait_for == "robots"
    await live.publish([asked.cleared_revision(NOW_S + 20, ClearedCode.LAPSED)])
    live.follow([NOW_S + 20])
    await live.settled()
    (*_, situation) = situations_of(store.after(0, -1))
    assert (situation.people_wait_for, situation.advice and situation.advice.for_people) == (None, True)


async def test_who_accepts_without_effect_does_not_keep_people_waiting(store: Store) -> None:
    floor = await told(store, face_to_face(), UNBEGUN).run(40)
    assert [at_s for at_s, _ in floor.asking()] == [FIRST_S + ACCEPTS_WITHIN_S]
    (asking, *_) = [each.advice for each in floor.situations if each.advice and each.advice.for_people]
    assert asking.changed_because == "Larch l and Rowan r were asked first, without effect"


@pytest.mark.parametrize("reply", [SILENT, CANNOT, UNBEGUN, Reply("accepted", moves=goes_late)])
@pytest.mark.parametrize("robots", [face_to_face, before_crossing])
async def test_a_situation_is_as_severe_whether_people_wait_or_not(
    store: Store, reply: Reply, robots: Callable[[], Sequence[Robot]]
) -> None:
    floor = told(store, robots(), reply)
    at_once = SituationLifecycle(PlaceNames.of(floor.floor.site).describe)
    now, without = dict[str, tuple[object, ...]](), dict[str, tuple[object, ...]]()
    for _ in range(40):
        await floor.run(1)
        at_once.revise(floor.floor.now_s, floor.floor.advisories)
        latest = {each.id: each for each in floor.situations}
        open_now = [each for each in latest.values() if each.cleared_at is None]
        now |= {f"{each.id} {floor.floor.second}": severity_of(each) for each in open_now}
        without |= {f"{each.id} {floor.floor.second}": severity_of(each) for each in at_once.open()}
    assert now == without


def severity_of(situation: Situation) -> tuple[object, ...]:
    return situation.severity, situation.situation_kind, situation.headline, situation.culprit


async def test_of_two_standoffs_in_a_minute_people_are_asked_for_one_and_told_of_both(store: Store) -> None:
    floor = await told(store, [*face_to_face(), *face_to_face(40.0, name="2")], CANNOT).run(80)
    assert [at_s for at_s, _ in floor.asking()] == [TOLD_S, TOLD_S + BETWEEN_S]
    first = {each.id: each for each in reversed(floor.situations)}.values()
    assert [each.updated_at.timestamp() - START_S for each in first] == [TOLD_S, TOLD_S]
    assert {each.severity for each in floor.situations} == {Severity.CRITICAL}
    assert sorted(each.people_wait_for or "" for each in first) == ["", "other_advice"]
