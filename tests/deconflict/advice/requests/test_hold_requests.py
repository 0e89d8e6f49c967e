"""Advice through the whole engine: given at event times, followed or ignored."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from threading import Event

import pytest
from shapely import Polygon, box
from shapely.affinity import rotate, translate

from deconflict.advice.deferred_answers import ANSWER_AFTER_S, Answer, PendingAnswer, ReadyAnswer
from deconflict.advice.holds.hold_windows import NearbyRobots
from deconflict.advice.requests.hold_requests import MOST_PAIRS, PAIRS_PER_S, HoldRequests
from deconflict.advice.vendor_burden import Burden
from deconflict.engine.engine import Engine
from deconflict_client.advisory import AdvisoryState, ClearedCode, ConflictAdvisory, Recommendation, moment
from ingest.batch import Pair
from ingest.measures.measures import Measures
from tests.deconflict.advice.made_near import near, until_advised
from tests.deconflict.engine.made_engine import NOW_S, SITE, Course, Floor, eastward, northward
from tests.helpers.made_advisories import made
from tests.helpers.patience import PATIENCE_S
from tests.helpers.saying import robot


def crossing() -> Floor:
    return Floor({"A": eastward(x=-12.0), "B": northward(y=-12.4)})


def held(course: Course, from_s: float, hold_s: float) -> Course:
    return lambda t: course(t if t < from_s else max(from_s, t - hold_s))


def envelope(course: Course, t: float) -> Polygon:
    x, y, yaw = course(t)
    return translate(rotate(box(-0.5, -0.25, 0.5, 0.25), yaw, (0, 0), use_radians=True), x, y)


def closest_m(floor: Floor, until_s: float) -> float:
    a, b = floor.courses.values()
    return float(min(envelope(a, k / 20).distance(envelope(b, k / 20)) for k in range(round(until_s * 20))))


def test_advice_that_is_followed_ends_the_conflict_at_the_promised_cost() -> None:
    floor = crossing()
    advisory, at_s = until_advised(floor)
    assert advisory.recommendation
    (hold,) = advisory.recommendation.holds
    assert hold.hold_s == advisory.recommendation.cost_s
    assert advisory.recommendation.proven_optimal
    name = next(course for course in floor.courses if robot(course) == hold.robot)
    free = floor.courses[name]
    floor.courses[name] = held(free, at_s, hold.hold_s)
    after = floor.run(40, at_s + 0.25)
    assert closest_m(floor, 40) > SITE.conflict.clearance_m
    assert after[-1].state is AdvisoryState.CLEARED
    assert after[-1].cleared_code is ClearedCode.UNPREDICTED
    assert floor.courses[name](40) == pytest.approx(free(40 - advisory.recommendation.cost_s))
    assert floor.engine._advice.burden.burdens_s == {"Alder": hold.hold_s}, "who waited as advised has yielded"


def test_a_robot_that_ignores_advice_keeps_its_advisory() -> None:
    floor = crossing()
    revisions = floor.run(40)
    assert any(revision.recommendation and revision.recommendation.holds for revision in revisions)
    assert closest_m(floor, 40) == 0
    assert revisions[-1].cleared_code is ClearedCode.PASSED


def test_the_summary_says_who_should_wait_through_every_revision() -> None:
    """As long as people can have it wait: for 3 s, though 2 s are enough."""
    advisory, _ = until_advised(floor := crossing())
    later = floor.run(12, advisory.updated_at.timestamp() - NOW_S + 0.25)
    for revision in [advisory, *later]:
        if revision.recommendation and revision.recommendation.holds:
            wait, first = revision.recommendation.actions
            assert (wait.action, first.action) == ("wait", "go_first")
            assert revision.summary.endswith(f"should wait {wait.seconds:g} s")


def test_an_answer_from_a_thread_is_given_at_the_same_event_time() -> None:
    def run(floor: Floor) -> list[ConflictAdvisory]:
        return floor.run(20)

    def in_time(work: Callable[[], Answer]) -> PendingAnswer:
        """Here time passes faster than any thread can follow."""
        answer = pool.submit(work)
        answer.result()
        return answer

    with ThreadPoolExecutor(1) as pool:
        threaded = crossing()
        threaded.engine = Engine(threaded.site, submit=in_time)
        assert run(threaded) == run(crossing())


NO_HOLDS = Recommendation(cost_s=0.0, bound_s=0.0, proven_optimal=True)


class Asking:
    """A desk that is asked of open conflicts, a step each quarter of a second; which pairs it answers, and when."""

    def __init__(self) -> None:
        self.desk = HoldRequests(SITE, Burden(), Measures(), lambda _: ReadyAnswer(NO_HOLDS))
        self.now_s = NOW_S
        self.open: list[Pair] = []

    def steps(self, count: int, *pairs: str) -> list[tuple[float, str]]:
        """The pairs that are answered while these are open, and when."""
        answers = []
        for _ in range(count):
            changed: dict[Pair, ConflictAdvisory | None] = dict.fromkeys(self.open)
            self.open = [(pair[0], pair[1]) for pair in pairs]
            changed |= {pair: made(1, robots=pair, predicted_at=moment(NOW_S + 30)) for pair in self.open}
            due = self.desk.step(self.now_s, changed, lambda _: near([]))
            answers += [(self.now_s - NOW_S, "".join(pair)) for pair, _ in due]
            self.now_s += 0.25
        return answers


def test_a_group_that_grows_while_it_is_worked_out_is_answered_as_a_whole() -> None:
    asking = Asking()
    assert asking.steps(1, "ab") == []
    assert asking.steps(4, "ab", "bc", "xy") == [(0.75, "ab"), (0.75, "bc"), (0.75, "xy")]


def test_a_group_that_gets_smaller_is_not_asked_of_again_before_its_time() -> None:
    asking = Asking()
    assert asking.steps(3, "ab", "bc") == [(0.5, "ab"), (0.5, "bc")]
    assert asking.steps(11, "ab") == []
    assert asking.steps(1, "ab") == [(3.5, "ab")]


def test_a_group_that_keeps_growing_is_answered_nevertheless() -> None:
    asking, pairs = Asking(), ["ab", "bc", "cd", "de", "ef", "fg"]
    answers = [step for count in range(1, 7) for step in asking.steps(1, *pairs[:count])]
    assert answers == []
    assert asking.steps(1, *pairs) == [(1.5, pair) for pair in pairs[:5]]


def test_a_late_answer_delays_nothing_and_is_counted() -> None:
    free = Event()

    def slow(work: Callable[[], Answer]) -> PendingAnswer:
        return pool.submit(lambda: (free.wait(PATIENCE_S), work())[1])

    with ThreadPoolExecutor(1) as pool:
        floor = crossing()
        floor.engine = Engine(floor.site, submit=slow)
        late = floor.run(8)
        assert floor.engine.measures.values["deconflict_advice_late_total"] == {(): 1}
        free.set()
        wait([pool.submit(lambda: None)])
        after = floor.run(9, 8)
    assert any(advisory.state is AdvisoryState.RAISED for advisory in late)
    assert all(advisory.recommendation is None for advisory in late)
    assert any(advisory.recommendation for advisory in after)


class Slow:
    """An answer that is not there the first times that somebody looks."""

    def __init__(self, work: Callable[[], Answer]) -> None:
        self._advice, self._looks = work(), 0

    def done(self) -> bool:
        self._looks += 1
        return self._looks > 6

    def result(self) -> Answer:
        assert self._looks > 6
        return self._advice


def test_a_late_answer_is_as_late_in_a_replay() -> None:
    live, prompt = crossing(), crossing()
    live.engine = Engine(SITE, submit=Slow)
    revisions = live.run(20)
    assert revisions != prompt.run(20)
    again = crossing()
    again.pending = live.pending
    assert again.run(20) == revisions


def test_a_crowded_floor_is_advised_in_parts_the_soonest_conflicts_first() -> None:
    pairs = round(MOST_PAIRS) + 40
    conflicts: dict[Pair, ConflictAdvisory] = {
        (f"a{n}", f"b{n}"): made(n, robots=(f"a{n}", f"b{n}"), predicted_at=moment(NOW_S + 5 + (pairs - n) / 100))
        for n in range(pairs)
    }
    asked: list[set[str]] = []

    def nobody(group: set[str]) -> NearbyRobots:
        asked.append(group)
        return near([])

    measures = Measures()
    desk = HoldRequests(SITE, Burden(), measures)
    desk.step(NOW_S, conflicts, nobody)
    assert asked == [{f"a{n}", f"b{n}"} for n in reversed(range(40, pairs))]
    assert measures.values["deconflict_advice_waiting"] == {(): 40}
    desk.step(NOW_S + 1, {}, nobody)
    assert len(asked) == MOST_PAIRS + PAIRS_PER_S
    desk.step(NOW_S + 2, {}, nobody)
    assert sorted(map(sorted, asked)) == sorted(map(sorted, conflicts))


def test_advice_comes_no_sooner_than_its_time() -> None:
    advisory, _ = until_advised(floor := crossing())
    raised = next(advisory for advisory in floor.advisories if advisory.state is AdvisoryState.RAISED)
    late_s = (advisory.updated_at - raised.raised_at).total_seconds()
    assert ANSWER_AFTER_S <= late_s < ANSWER_AFTER_S + 0.3


@pytest.mark.parametrize("burdened", ["Alder", "Basalt"])
def test_the_vendor_that_waited_before_does_not_wait_again(burdened: str) -> None:
    """Both plans cost the same here, so the burden decides."""
    floor = Floor({"A": eastward(x=-12.0), "B": northward(y=-12.0)}, makers={"B": "Basalt"})
    floor.engine = Engine(floor.site, burdens_s={burdened: 60.0})
    advisory, _ = until_advised(floor)
    assert advisory.recommendation
    (hold,) = advisory.recommendation.holds
    assert advisory.vendors[advisory.robots.index(hold.robot)] != burdened


def test_what_was_advised_is_charged_when_the_advisory_ends() -> None:
    floor = Floor({"A": eastward(x=-12.0), "B": northward(y=-12.0)})
    first, _ = until_advised(floor)
    assert floor.engine._advice.burden.burdens_s == {}
    floor.run(40, first.updated_at.timestamp() - NOW_S + 0.25)
    ended = [advisory for advisory in floor.advisories if advisory.state is AdvisoryState.CLEARED]
    assert floor.engine._advice.burden.burdens_s == ended[0].advised_wait_s
    assert sum(ended[0].advised_wait_s.values()) > 0
    assert ended[0].recommendation is None
