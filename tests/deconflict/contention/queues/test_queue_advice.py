"""Slots are worked out aside: asked for at one look, given at the next, and waited for by nobody."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from threading import Event

import pytest

from deconflict.advice.deferred_answers import Answer, PendingAnswer, answer_at_once
from deconflict.contention.queues import queue_advice
from deconflict.contention.queues.queue_advice import MOST_SOLVED
from deconflict.engine.engine import Engine
from deconflict_client.advisory import AnyAdvisory
from tests.deconflict.contention.scenes import Scene, Script, raised, resource, site
from tests.helpers.patience import PATIENCE_S
from tests.helpers.saying import robot


def waits(_: float) -> str:
    return "waitingExternalEvent"


def queues(chargers: int = 1) -> Scene:
    """At each charger one waits for another one to leave."""
    places, robots = [], {}
    for row in range(chargers):
        y = 40.0 * row
        places.append(resource(f"c{row}", 0, y, kind="charger", service_s=100.0))
        robots[f"A{row}"] = Script([(0, 0, y)], state=lambda _: "charging")
        robots[f"B{row}"] = Script([(0, 30, y + 10)], [(60, 0, y)], state=waits)
    return Scene(site(*places), robots)


def test_an_answer_from_a_thread_is_given_at_the_same_look() -> None:
    def in_time(work: Callable[[], Answer]) -> PendingAnswer:
        answer = pool.submit(work)
        answer.result()
        return answer

    with ThreadPoolExecutor(1) as pool:
        threaded = queues()
        threaded.engine = Engine(threaded.site, submit=in_time)
        assert threaded.run(20) == queues().run(20)


def test_a_late_answer_delays_no_look_and_is_given_when_it_is_ready() -> None:
    free = Event()

    def slow(work: Callable[[], Answer]) -> PendingAnswer:
        return pool.submit(lambda: (free.wait(PATIENCE_S), work())[1])

    with ThreadPoolExecutor(1) as pool:
        scene = queues()
        scene.engine = Engine(scene.site, submit=slow)
        (advisory,) = raised(scene.run(8), "contention")
        assert advisory.recommendation is None
        assert scene.engine.measures.values["deconflict_advice_late_total"] == {(): 1}
        free.set()
        wait([pool.submit(lambda: None)])
        advisories = scene.run(12, 8)
    assert any(later.id == advisory.id and later.recommendation for later in advisories)


def test_of_a_long_queue_the_first_have_slots_advised(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(queue_advice, "MOST_ADVISED", 2)
    scene = queues()
    for number in range(4):
        scene.robots[f"C{number}"] = Script([(0, 30, 20 + number)], [(61 + number, 0, 0)], state=waits)
    (advisory,) = raised(scene.run(20), "contention")
    assert advisory.recommendation
    slots = advisory.recommendation.slots
    assert [slot.robot for slot in slots] == [robot("B0"), robot("C0")]


def test_a_crowd_is_in_no_queue() -> None:
    scene = Scene(site(resource("c", 0, 0, kind="charger", service_s=100.0)), {"A": Script([(0, 0, 0)])})
    for number in range(12):
        scene.robots[f"C{number}"] = Script([(0, 30 + 0.01 * number, 10)], [(60, 0, 0)], state=waits)
    advisories = scene.run(20)
    assert raised(advisories, "crowd")
    assert raised(advisories, "contention") == []


@pytest.mark.parametrize("chargers", [MOST_SOLVED, 3 * MOST_SOLVED])
def test_many_contended_places_get_their_advice_in_turn(chargers: int) -> None:
    asked = [0]

    def counted(work: Callable[[], Answer]) -> PendingAnswer:
        asked[-1] += 1
        return answer_at_once(work)

    scene = queues(chargers)
    scene.engine = Engine(scene.site, submit=counted)
    advisories: list[AnyAdvisory] = []
    for second in range(12):
        asked.append(0)
        advisories += scene.run(second + 1, second)
    assert max(asked) == MOST_SOLVED
    advised = {advisory.id for advisory in advisories if advisory.recommendation}
    assert len(advised) == chargers == len(raised(advisories, "contention"))
