"""Any history of predictions, absences, restarts and answers: what it makes of the advisories that are stored."""

from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
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

from deconflict.advisories import encounter_numbers
from deconflict.advisories.conflict_lifecycle import ConflictLifecycle
from deconflict.advisories.encounter_numbers import EncounterNumbers
from deconflict.foresight.conflict_predictions import Prediction
from deconflict.operator.store import pruning
from deconflict.operator.store.store import Store
from deconflict.settings.site import Conflict
from deconflict_client.advisory import Acknowledgement, AdvisoryState, AnyAdvisory
from deconflict_client.situations import advisories_of
from ingest.batch import Pair
from tests.helpers.made_predictions import in_columns
from tests.helpers.made_scene import MadeScene

SETTINGS = Conflict()
ABSENT_AFTER_S = 20.0
ROBOTS = ("a", "b", "c")
PAIRS: tuple[Pair, ...] = (("a", "b"), ("a", "c"), ("b", "c"))
SHARES = st.sampled_from((0.0, 0.1, 0.2, 0.4, 0.6, 0.9, 1.0))


class ChangingScene(MadeScene):
    """Robots that come and go, and how far apart each pair is."""

    def __init__(self) -> None:
        self.present = set(ROBOTS)
        self.left = set[str]()
        """Robots that have left since the last pass."""
        self.apart_m: dict[Pair, float] = {}

    def is_present(self, uuid: str) -> bool:
        return uuid in self.present

    def separation_m(self, pair: Pair, now_s: float) -> float | None:
        return self.apart_m.get(pair, 9.0)


class Histories(RuleBasedStateMachine):
    """Three robots, the life of their advisories, and the store that the revisions go to."""

    @initialize()
    def begin(self) -> None:
        self.folder = TemporaryDirectory()
        self.store = Store(Path(self.folder.name))
        self.lifecycle = ConflictLifecycle(SETTINGS, ABSENT_AFTER_S)
        self.now_s = 1_790_000_000.0
        self.scene = ChangingScene()
        self.answers: dict[str, str] = {}

    @rule(
        predicted=st.dictionaries(
            st.sampled_from(PAIRS),
            st.tuples(st.floats(0.0, 10.0), SHARES, st.sampled_from((0.0, 0.2, 0.35, 1.0, 5.0)), SHARES, st.booleans()),
        ),
        updated=st.sets(st.sampled_from(ROBOTS)),
        after_s=st.sampled_from((0.1, 0.5, 1.0, 3.0, 30.0)),
        reach_s=st.sampled_from((5.0, float("inf"))),
    )
    def passes(self, predicted: dict[Pair, Any], updated: set[str], after_s: float, reach_s: float) -> None:
        self.now_s += after_s
        predictions = []
        for pair, (in_s, separation_m, start_m, probability, fresh) in predicted.items():
            self.scene.apart_m[pair] = start_m
            if self.scene.present.issuperset(pair) and in_s <= reach_s:
                predictions.append(
                    Prediction(pair, self.now_s + in_s, min(separation_m, start_m), start_m, fresh, probability)
                )
        updated = updated & self.scene.present | self.scene.left
        self.scene.left.clear()
        until_s = self.now_s + reach_s
        revisions = self.lifecycle.revise(self.now_s, in_columns(predictions), updated, self.scene, until_s)
        self._watches_nobody_who_left()
        stored = self.store.append(revisions)
        assert self.store.append(revisions) == stored, "revisions that are sent again are stored once"

    @rule(uuid=st.sampled_from(ROBOTS))
    def comes_or_goes(self, uuid: str) -> None:
        self.scene.present ^= {uuid}
        self.scene.left = self.scene.left | {uuid} if uuid not in self.scene.present else self.scene.left - {uuid}

    def _watches_nobody_who_left(self) -> None:
        for pair in PAIRS:
            watched = self.lifecycle.pairs.get(pair)
            assert watched is None or watched.advisory or self.scene.present.issuperset(pair)

    @rule()
    def restarts(self) -> None:
        """What runs goes on from what is stored, as a new engine does."""
        self.store.close()
        self.store = Store(Path(self.folder.name))
        pruning.forget_surplus_pairs(self.store.connections)
        numbers = EncounterNumbers(dict(self.store.encounters_after(("", ""), 100)))
        self.lifecycle = ConflictLifecycle(SETTINGS, ABSENT_AFTER_S, numbers)
        self.lifecycle.restore(
            advisory for advisory in self.store.latest("open").advisories if advisory.kind == "conflict"
        )

    @precondition(lambda self: self.store.latest("open").advisories)
    @rule(data=st.data(), name=st.sampled_from(("Kim", "Lee")))
    def is_acknowledged(self, data: st.DataObject, name: str) -> None:
        advisory = data.draw(st.sampled_from(self.store.latest("open").advisories))
        self.answers[advisory.id] = name
        self.store.acknowledge(
            advisory.id, Acknowledgement(name=name, reason="seen", at=datetime.fromtimestamp(self.now_s, UTC))
        )

    @invariant()
    def what_runs_is_what_is_stored_as_open(self) -> None:
        running = {advisory.id: advisory.revision for advisory in self.lifecycle.advisories.values()}
        assert running == {advisory.id: advisory.revision for advisory in self.store.latest("open").advisories}
        assert len({advisory.robots for advisory in self.lifecycle.advisories.values()}) == len(running), (
            "two are open on one pair"
        )

    @invariant()
    def every_story_is_whole(self) -> None:
        stories: dict[str, list[AnyAdvisory]] = {}
        every = advisories_of(self.store.after(0, 100_000))
        assert [revision.seq for revision in every] == list(range(1, len(every) + 1))
        for advisory in every:
            stories.setdefault(advisory.id, []).append(advisory)
        ordinals = [(story[0].robots, getattr(story[0], "encounter", 0)) for story in stories.values()]
        assert len(set(ordinals)) == len(ordinals), "two encounters of a pair have one number"
        for story in stories.values():
            self._is_whole(story)

    def _is_whole(self, story: list[AnyAdvisory]) -> None:
        decided = list({advisory.revision: advisory for advisory in reversed(story)}.values())[::-1]
        states = [advisory.state for advisory in decided]
        assert [advisory.revision for advisory in decided] == list(range(1, len(decided) + 1))
        assert states[0] is AdvisoryState.RAISED
        assert all(state is AdvisoryState.UPDATED for state in states[1:-1])
        assert AdvisoryState.RAISED not in states[1:]
        assert len({(advisory.robots, advisory.raised_at) for advisory in story}) == 1
        assert all(a.updated_at <= b.updated_at for a, b in pairwise(story))
        answer = story[-1].acknowledgement
        assert (answer.name if answer else None) == self.answers.get(story[0].id), "an answer is lost"
        assert (story[-1].cleared_because is None) == (story[-1].state is not AdvisoryState.CLEARED)

    def teardown(self) -> None:
        if hasattr(self, "store"):
            self.store.close()
            self.folder.cleanup()


@pytest.mark.parametrize("most_pairs", [100, 2])
def test_in_any_history_each_encounter_has_one_complete_advisory_with_its_acknowledgement(
    most_pairs: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also if the numbers of few pairs are known."""
    for module in (encounter_numbers, pruning):
        monkeypatch.setattr(module, "MOST_PAIRS", most_pairs)
    effort = settings(max_examples=30, stateful_step_count=40, deadline=None, suppress_health_check=list(HealthCheck))
    run_state_machine_as_test(Histories, settings=effort)
