"""Any history of predictions, absences, restarts and answers: what it makes of the advisories that are stored."""

from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from deconflict.advisories.conflict_lifecycle import Lives
from deconflict.advisories.conflict_wording import Party, Prediction, Scene
from deconflict.advisory import Acknowledgement, AdvisoryState, AnyAdvisory, EncounterClass
from deconflict.operator.store.store import Store
from deconflict.settings.site import Conflict
from deconflict.sweep.geometry.encounter import Encounter
from ingest.batch import Pair
from tests.helpers.made_predictions import each, in_columns

SETTINGS = Conflict()
ABSENT_AFTER_S = 20.0
ROBOTS = ("a", "b", "c")
PAIRS: tuple[Pair, ...] = (("a", "b"), ("a", "c"), ("b", "c"))
SHARES = st.sampled_from((0.0, 0.1, 0.2, 0.4, 0.6, 0.9, 1.0))


class Histories(RuleBasedStateMachine):
    """Three robots, their lives and the store that the revisions go to."""

    @initialize()
    def begin(self) -> None:
        self.folder = TemporaryDirectory()
        self.store = Store(Path(self.folder.name))
        self.lives = Lives(SETTINGS, ABSENT_AFTER_S)
        self.now_s = 1_790_000_000.0
        self.apart_m: dict[Pair, float] = {}
        self.here = set(ROBOTS)
        self.answers: dict[str, str] = {}

    def scene(self) -> Scene:
        def meet(*_: object) -> Encounter:
            return Encounter(EncounterClass.CROSSING, 1.2, 3.0, 4.0, 0)

        return Scene(
            here=self.here.__contains__,
            absence=lambda _: None,
            party=lambda uuid: Party(f"Alder {uuid}", "Alder", "path", standing=False),
            stands=lambda _: False,
            meet=meet,
            encounters=each(meet),
            separation_m=lambda pair, _: self.apart_m.get(pair, 9.0),
            datum=lambda _: "datum-1",
            places=lambda met: ["in Aisle 4"] * len(met),
        )

    @rule(
        said=st.dictionaries(
            st.sampled_from(PAIRS),
            st.tuples(st.floats(0.0, 10.0), SHARES, st.sampled_from((0.0, 0.2, 0.35, 1.0, 5.0)), SHARES, st.booleans()),
        ),
        news=st.sets(st.sampled_from(ROBOTS)),
        after_s=st.sampled_from((0.1, 0.5, 1.0, 3.0, 30.0)),
        reach_s=st.sampled_from((5.0, float("inf"))),
    )
    def passes(self, said: dict[Pair, Any], news: set[str], after_s: float, reach_s: float) -> None:
        self.now_s += after_s
        predictions = []
        for pair, (in_s, separation_m, start_m, probability, fresh) in said.items():
            self.apart_m[pair] = start_m
            if self.here.issuperset(pair) and in_s <= reach_s:
                predictions.append(
                    Prediction(pair, self.now_s + in_s, min(separation_m, start_m), start_m, fresh, probability)
                )
        said_now = in_columns(predictions)
        told = self.lives.step(self.now_s, said_now, news & self.here, self.scene(), self.now_s + reach_s)
        stored = self.store.append(told)
        assert self.store.append(told) == stored, "a sender that sends again doubles nothing"

    @rule(uuid=st.sampled_from(ROBOTS))
    def comes_or_goes(self, uuid: str) -> None:
        self.here ^= {uuid}

    @rule()
    def restarts(self) -> None:
        """What runs goes on from what is stored, as a new engine does."""
        self.store.close()
        self.store = Store(Path(self.folder.name))
        self.lives = Lives(SETTINGS, ABSENT_AFTER_S, self.store.encounters())
        self.lives.restore(one for one in self.store.open() if one.kind == "conflict")

    @precondition(lambda self: self.store.open())
    @rule(data=st.data(), name=st.sampled_from(("Kim", "Lee")))
    def is_acknowledged(self, data: st.DataObject, name: str) -> None:
        one = data.draw(st.sampled_from(self.store.open()))
        self.answers[one.id] = name
        self.store.acknowledge(
            one.id, Acknowledgement(name=name, reason="seen", at=datetime.fromtimestamp(self.now_s, UTC))
        )

    @invariant()
    def what_runs_is_what_is_stored_as_open(self) -> None:
        running = {one.id: one.revision for one in self.lives.told.values()}
        assert running == {one.id: one.revision for one in self.store.open()}
        assert len({one.robots for one in self.lives.told.values()}) == len(running), "two are open on one pair"

    @invariant()
    def every_story_is_whole(self) -> None:
        stories: dict[str, list[AnyAdvisory]] = {}
        every = self.store.after(0, 100_000)
        assert [one.seq for one in every] == list(range(1, len(every) + 1))
        for one in every:
            stories.setdefault(one.id, []).append(one)
        ordinals = [(one[0].robots, getattr(one[0], "encounter", 0)) for one in stories.values()]
        assert len(set(ordinals)) == len(ordinals), "two encounters of a pair have one number"
        for story in stories.values():
            self._is_whole(story)

    def _is_whole(self, story: list[AnyAdvisory]) -> None:
        decided = list({one.revision: one for one in reversed(story)}.values())[::-1]
        states = [one.state for one in decided]
        assert [one.revision for one in decided] == list(range(1, len(decided) + 1))
        assert states[0] is AdvisoryState.RAISED
        assert all(state is AdvisoryState.UPDATED for state in states[1:-1])
        assert AdvisoryState.RAISED not in states[1:]
        assert len({(one.robots, one.raised_at) for one in story}) == 1
        assert all(a.updated_at <= b.updated_at for a, b in pairwise(story))
        answer = story[-1].acknowledgement
        assert (answer.name if answer else None) == self.answers.get(story[0].id), "an answer is lost"
        assert (story[-1].cleared_because is None) == (story[-1].state is not AdvisoryState.CLEARED)

    def teardown(self) -> None:
        if hasattr(self, "store"):
            self.store.close()
            self.folder.cleanup()


def test_any_history_tells_each_encounter_as_one_whole_story_with_its_answer() -> None:
    effort = settings(max_examples=30, stateful_step_count=40, deadline=None, suppress_health_check=list(HealthCheck))
    run_state_machine_as_test(Histories, settings=effort)
