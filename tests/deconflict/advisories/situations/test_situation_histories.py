"""Drawn histories of advisories: whatever joins and splits, no id of a situation is lost, doubled or used again."""

from collections import defaultdict
from datetime import UTC, datetime
from math import hypot
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from deconflict.advisories.situations.advice.stakes import stakes_of, urgency_of_stakes
from deconflict.advisories.situations.grouping import NEAR_M
from deconflict.advisories.situations.situation_lifecycle import OVER_S, SituationLifecycle, is_worth
from deconflict.advisories.words.words import Spot
from deconflict_client.advisory import AdvisoryState, ClearedCode, ConflictAdvisory, Location, Severity, moment
from deconflict_client.situations import MOST_ACTIONS, Situation
from tests.deconflict.advisories.situations.made_situations import action, advice
from tests.helpers.made_advisories import made

START_S = datetime(2024, 5, 1, 8, 0, tzinfo=UTC).timestamp()
PASS_S = 0.5
FLOORS = ("floor-a", "floor-b")
CHANGES = st.lists(
    st.tuples(
        st.integers(0, 11),  # number of the advisory
        st.sampled_from(["open", "open", "clear"]),
        st.tuples(st.integers(0, 19), st.integers(0, 19)),  # its robots
        st.tuples(st.sampled_from([2, 4, 6, 8, 20, 30]), st.integers(0, 7)),  # its place, metres
        st.floats(0, 12),  # time left
        st.floats(0, 1),  # probability
    ),
    max_size=4,
)


class History:
    """Open advisories that change, the situations that follow, and every revision of a situation."""

    def __init__(self) -> None:
        self.now_s, self.advisories = START_S, dict[str, ConflictAdvisory]()
        self.lifecycle = SituationLifecycle(lambda points: [Spot("here")] * len(points))
        self.revisions: defaultdict[str, list[Situation]] = defaultdict(list)
        self.raised = 0

    def advance(self, changes: list[tuple[int, str, tuple[int, int], tuple[int, int], float, float]]) -> None:
        self.now_s += PASS_S
        revisions = [revision for change in changes if (revision := self._changed(*change))]
        newest = {revision.id: revision for revision in revisions}
        for situation in self.lifecycle.revise(self.now_s, list(newest.values())):
            self.revisions[situation.id].append(situation)

    def _changed(
        self,
        number: int,
        change: str,
        pair: tuple[int, int],
        place: tuple[int, int],
        left_s: float,
        probability: float,
    ) -> ConflictAdvisory | None:
        known = next((each for each in self.advisories.values() if each.encounter == number + 1), None)
        if change == "clear":
            if known is None:
                return None
            return self.advisories.pop(known.id).cleared_revision(self.now_s, ClearedCode.PASSED, "they passed")
        robots = tuple(f"robot-{number}" for number in sorted({pair[0], (pair[1] + pair[0] + 1) % 21}))[:2]
        if len(robots) < 2:
            return None
        fields: dict[str, Any] = {
            "updated_at": moment(self.now_s),
            "predicted_at": moment(self.now_s + left_s),
            "time_to_conflict_s": left_s,
            "probability": probability,
            "location": Location(datum=FLOORS[place[0] == 30], x=place[0], y=place[1]),
            "recommendation": advice(action(robots[number % 2], seconds=9.0 if place[1] else 4.0)),
        }
        if known is None:
            self.raised += 1
            whole: dict[str, Any] = {
                "id": f"advisory-{self.raised}",
                "encounter": number + 1,
                "raised_at": moment(self.now_s),
            }
            revision = made(number, **whole, robots=robots, **fields)
        else:
            revision = known.next_revision(**fields)
        self.advisories[revision.id] = revision
        return revision

    def restart(self) -> None:
        situations = [Situation.model_validate_json(each.model_dump_json()) for each in self.lifecycle.open()]
        advisories = [ConflictAdvisory.model_validate_json(each.model_dump_json()) for each in self.advisories.values()]
        self.lifecycle = SituationLifecycle(lambda points: [Spot("here")] * len(points))
        self.lifecycle.restore(situations, advisories)

    def last(self) -> None:
        """Clear every advisory, and wait until no situation is open."""
        for advisory in list(self.advisories.values()):
            self.advance([(advisory.encounter - 1, "clear", (0, 0), (0, 0), 0.0, 0.0)])
        for _ in range(60):
            self.advance([])


def check_open(history: History) -> None:
    """What holds at every moment."""
    situations = history.lifecycle.open()
    assert len({situation.id for situation in situations}) == len(situations)
    advised = [action.robot for each in situations if each.advice for action in each.advice.actions]
    assert len(set(advised)) == len(advised)
    for situation in situations:
        assert len(situation.robots) <= 20
        assert situation.advice is None or len(situation.advice.actions) <= MOST_ACTIONS
        assert situation == history.revisions[situation.id][-1]
    of = [history.lifecycle.situation_of(name) for name in history.advisories]
    assert {name for name in of if name} <= {situation.id for situation in situations}


def check_worth(history: History) -> None:
    """Every advisory that has been worth a reaction for a while is in an open situation. A caution may wait for the end
    of a situation that is told as over."""
    lately_s = history.now_s - 1.5
    is_told_as_over = any(
        not last.advisories and (last.state is not AdvisoryState.CLEARED or last.updated_at.timestamp() >= lately_s)
        for *_, last in history.revisions.values()
    )
    for advisory in history.advisories.values():
        if advisory.updated_at.timestamp() <= lately_s:
            stakes = [stakes_of([advisory], at_s) for at_s in (lately_s, history.now_s)]
            is_caution = any(urgency_of_stakes(each, None) is Severity.CAUTION for each in stakes)
            may_wait = not all(map(is_worth, stakes)) or (is_told_as_over and is_caution)
            assert may_wait or history.lifecycle.situation_of(advisory.id)


def check_bounds(history: History) -> None:
    """No situation outgrows its bounds."""
    parts = defaultdict(list)
    for name, advisory in history.advisories.items():
        if situation_id := history.lifecycle.situation_of(name):
            parts[situation_id].append(advisory)
    for advisories in parts.values():
        xs, ys = [each.location.x for each in advisories], [each.location.y for each in advisories]
        assert len({each.location.datum for each in advisories}) == 1
        assert hypot(max(xs) - min(xs), max(ys) - min(ys)) <= NEAR_M


def check_subject(history: History) -> None:
    """Of every situation some advisory is about its subject, or none is left."""
    for situation in history.lifecycle.open():
        advised = [each for name, each in history.advisories.items() if in_situation(history, name, situation.id)]
        assert not advised or any(set(situation.subject_robots) & set(each.robots) for each in advised)


def in_situation(history: History, advisory_id: str, situation_id: str) -> bool:
    return history.lifecycle.situation_of(advisory_id) == situation_id


def check_chain(revisions: list[Situation]) -> None:
    """Raised once, then updated, cleared once and never used again."""
    assert [each.revision for each in revisions] == list(range(1, len(revisions) + 1))
    states = [each.state for each in revisions]
    assert states[0] is AdvisoryState.RAISED
    assert states[-1] is AdvisoryState.CLEARED
    assert set(states[1:-1]) <= {AdvisoryState.UPDATED}
    raised, cleared = revisions[0], revisions[-1]
    assert (cleared.updated_at - raised.raised_at).total_seconds() >= OVER_S
    assert cleared.advice is None
    assert {each.subject_robots for each in revisions} == {raised.subject_robots}
    assert set(raised.subject_robots) <= set(raised.robots)
    for each in revisions:
        assert set(raised.subject_robots) & set(each.robots)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(CHANGES, st.booleans()), min_size=5, max_size=60), st.integers(0, 30))
def test_no_id_is_lost_doubled_or_used_again(history_of: list[tuple[list[Any], bool]], restarted_at: int) -> None:
    history = History()
    for number, (changes, is_quiet) in enumerate(history_of):
        if number == restarted_at:
            history.restart()
        history.advance([] if is_quiet else changes)
        check_open(history)
        check_bounds(history)
        check_subject(history)
        check_worth(history)
    history.last()
    assert history.lifecycle.open() == []
    for revisions in history.revisions.values():
        check_chain(revisions)
    known = set(history.revisions)
    for situation in (each for revisions in history.revisions.values() for each in revisions):
        assert situation.id != situation.split_from
        assert {situation.split_from} - {None} <= known
