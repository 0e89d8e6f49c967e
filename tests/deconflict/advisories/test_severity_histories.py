"""In any history of two robots, the severity of their advisory follows the conflict up at once and down in time."""

from collections.abc import Iterable
from math import inf
from typing import NamedTuple

from hypothesis import given, settings
from hypothesis import strategies as st

from deconflict.advisories.conflict_lifecycle import ConflictLifecycle
from deconflict.advisories.severity import FALLS_S, KEPT_SHARE, SEVERITIES, rises, severity_level
from deconflict.advisories.words.conflict_wording import Party
from deconflict.foresight.conflict_predictions import Prediction
from deconflict.settings.site import Conflict
from deconflict_client.advisory import AdvisoryState, ConflictAdvisory, Recommendation, Severity
from ingest.batch import Pair
from tests.helpers.made_predictions import in_columns
from tests.helpers.made_scene import MadeScene

SETTINGS = Conflict(confirm=(1, 1))
PAIR: Pair = ("a", "b")
ABSENT_AFTER_S = 20.0
KEPT_PROBABILITY = SETTINGS.raise_probability * KEPT_SHARE
"""A less likely conflict is a caution."""


class Predicted(NamedTuple):
    """A conflict of the two."""

    in_s: float
    separation_m: float
    start_m: float
    probability: float
    fresh: bool


class ChangingScene(MadeScene):
    """Two robots that come and go, and fall silent."""

    def __init__(self) -> None:
        self.present, self.silent, self.apart_m = set(PAIR), set[str](), 5.0

    def is_present(self, uuid: str) -> bool:
        return uuid in self.present

    def party(self, uuid: str, now_s: float) -> Party:
        return Party(uuid, "Alder", "path (silent)" if uuid in self.silent else "path", standing=False)

    def separation_m(self, pair: Pair, now_s: float) -> float | None:
        return self.apart_m


class Step(NamedTuple):
    """Some passes with one prediction, then an event."""

    predicted: Predicted | None
    after_s: float
    """Time between two passes."""
    passes: int
    reach_s: float
    event: str


STEPS = st.builds(
    Step,
    st.builds(
        Predicted,
        in_s=st.sampled_from((0.0, 1.0, 2.5, 4.0, 5.5, 9.0)),
        separation_m=st.sampled_from((0.0, 0.1, 0.18, 0.25)),
        start_m=st.sampled_from((0.2, 0.35, 5.0)),
        probability=st.sampled_from((0.0, 0.05, 0.25, 0.35, 0.5, 0.7, 0.9, 1.0)),
        fresh=st.booleans(),
    )
    | st.none(),
    after_s=st.sampled_from((0.125, 0.375, 1.0)),
    passes=st.sampled_from((1, 2, 12)),
    reach_s=st.sampled_from((5.0, inf, inf)),
    event=st.sampled_from(("", "", "silence", "advice", "absence", "restart", "restart alone", "another engine")),
)


class History:
    """The life of the advisories on two robots, with what must hold after each pass."""

    def __init__(self) -> None:
        self.lifecycle, self.scene = ConflictLifecycle(SETTINGS, ABSENT_AFTER_S), ChangingScene()
        self.now_s = 1_790_000_000.0
        self.newest: ConflictAdvisory | None = None
        self.changed_s = 0.0
        """When the newest advisory was raised, or its severity changed."""
        self.unlikely_since_s: float | None = None

    def takes(self, step: Step) -> None:
        for _ in range(step.passes):
            self.now_s += step.after_s
            self._pass(step)
        self._happens(step.event)

    def _pass(self, step: Step) -> None:
        found = [self._prediction(step.predicted)] if step.predicted and step.predicted.in_s <= step.reach_s else []
        found = found if self.scene.present.issuperset(PAIR) else []
        updated = set() if found and not found[0].fresh else {"a"} & self.scene.present
        until_s = self.now_s + step.reach_s
        self._check(self.lifecycle.revise(self.now_s, in_columns(found), updated, self.scene, until_s))
        for advisory in self.lifecycle.advisories.values():
            self._follows_up(advisory, *found)
            self._follows_down(advisory, until_s, *found)

    def _prediction(self, predicted: Predicted) -> Prediction:
        """The conflict stays as far ahead as it is."""
        self.scene.apart_m = predicted.start_m
        separation_m = min(predicted.separation_m, predicted.start_m)
        contact_s = self.now_s + predicted.in_s
        return Prediction(PAIR, contact_s, separation_m, predicted.start_m, predicted.fresh, predicted.probability)

    def _happens(self, event: str) -> None:
        self.scene.present = {"b"} if event in ("absence", "restart alone") else set(PAIR)
        if event == "silence":
            self.scene.silent ^= {"a"}
            self._check(self.lifecycle.mark_silent({"a"}, self.now_s, self.scene))
        elif event == "advice":
            advice = Recommendation(cost_s=1.0, bound_s=1.0, proven_optimal=True, note=f"at {self.now_s}")
            self._check(filter(None, [self.lifecycle.add_advice(PAIR, advice, self.now_s)]))
        elif event in ("restart", "restart alone", "another engine"):
            before, self.lifecycle = self.lifecycle, ConflictLifecycle(SETTINGS, ABSENT_AFTER_S)
            self.unlikely_since_s = None
            for advisory in before.advisories.values():
                self.lifecycle.adopt(advisory) if event == "another engine" else self.lifecycle.restore([advisory])

    def _check(self, revisions: Iterable[ConflictAdvisory]) -> None:
        for revision in revisions:
            before, self.newest = self.newest, revision
            if revision.state is AdvisoryState.CLEARED:
                continue
            is_warning = revision.severity is not Severity.CAUTION
            assert not is_warning or (revision.probability or 0.0) >= round(KEPT_PROBABILITY, 3)
            if before and before.id == revision.id:
                falls = rises(before.severity, revision.severity)
                assert not falls or self.now_s - self.changed_s >= FALLS_S, "it falls too soon"
            if before is None or before.id != revision.id or before.severity is not revision.severity:
                self.changed_s = self.now_s

    def _follows_up(self, advisory: ConflictAdvisory, prediction: Prediction | None = None) -> None:
        if prediction and advisory.time_to_conflict_s > 0:
            time_s = prediction.contact_s - self.now_s
            least = severity_level(time_s, prediction.separation_m, prediction.probability, SETTINGS, is_kept=False)
            assert SEVERITIES.index(advisory.severity) >= least, "it does not rise at once"

    def _follows_down(self, advisory: ConflictAdvisory, until_s: float, prediction: Prediction | None = None) -> None:
        predicted_s = advisory.predicted_at.timestamp()
        awaited_s = max(predicted_s, self.lifecycle.started_s or 0.0) + SETTINGS.clear_after_s
        is_awaited = not self.scene.present.issuperset(PAIR) and self.now_s < awaited_s
        is_unknown = not prediction and (is_awaited or predicted_s > until_s)
        if is_unknown or (prediction and prediction.probability >= KEPT_PROBABILITY):
            self.unlikely_since_s = None
            return
        self.unlikely_since_s = self.now_s if self.unlikely_since_s is None else self.unlikely_since_s
        has_lasted = self.now_s - self.unlikely_since_s >= FALLS_S
        assert not has_lasted or advisory.severity is Severity.CAUTION, "a warning stands on an unlikely conflict"


@settings(max_examples=100, deadline=None)
@given(st.lists(STEPS, min_size=15, max_size=30))
def test_in_any_history_a_severity_follows_the_conflict_up_at_once_and_down_after_a_second(steps: list[Step]) -> None:
    history = History()
    for step in steps:
        history.takes(step)
