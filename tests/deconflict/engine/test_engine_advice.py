"""The advice of an engine beside crowds, whose robots' places are doubted."""

from collections.abc import Callable

from deconflict.advice.deferred_answers import Answer, PendingAnswer, answer_at_once
from deconflict.advice.requests.hold_requests import AGAIN_S
from deconflict.advisories.conflict_lifecycle import ConflictLifecycle
from deconflict.engine.engine_advice import EngineAdvice
from ingest.measures.measures import Measures
from tests.deconflict.engine.made_engine import NOW_S, SITE, Floor, eastward, northward
from tests.helpers.saying import robot


def test_nothing_is_asked_about_robots_in_a_crowd_until_they_have_left_it() -> None:
    floor = Floor({"A": eastward(x=-20.0), "B": northward(y=-20.4)})
    floor.run(12)
    conflicts = ConflictLifecycle(SITE.conflict, 30.0)
    conflicts.restore(floor.engine.conflicts())
    crowds, asked = dict[str, int](), list[float]()

    def submit(question: Callable[[], Answer]) -> PendingAnswer:
        asked.append(now_s)
        return answer_at_once(question)

    others = floor.engine.live, floor.engine._sweep.sweeper, Measures(), submit, None, crowds, lambda _: -1.0
    advice = EngineAdvice(SITE, *others)
    for now_s in (NOW_S + 12.0, NOW_S + 13.0, NOW_S + 15.5, NOW_S + 16.0):
        crowds.clear()
        if NOW_S + 13.0 <= now_s < NOW_S + 16.0:
            crowds[robot("A")] = 1
        advice.answers.set_pending(advice.answers.pending())
        advice.add_holds(now_s, conflicts)
    assert asked == [NOW_S + 12.0, NOW_S + 16.0]
    assert asked[0] + AGAIN_S < NOW_S + 15.5
