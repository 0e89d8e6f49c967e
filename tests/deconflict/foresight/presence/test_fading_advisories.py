"""Advisories on robots that may have left: raised, kept and cleared by the probability that both are present."""

from dataclasses import dataclass, field

from deconflict.advisories.conflict_lifecycle import ConflictLifecycle
from deconflict.advisories.words.conflict_wording import Absence
from deconflict.foresight.conflict_predictions import Prediction
from deconflict.settings.site import Conflict
from deconflict_client.advisory import AdvisoryState, ClearedCode, ConflictAdvisory
from ingest.batch import Pair
from tests.helpers.made_predictions import in_columns
from tests.helpers.made_scene import MadeScene

SETTINGS = Conflict(clearance_m=0.3, confirm=(1, 1), clear_after_s=1.0, raise_probability=0.4)
PAIR: Pair = ("a", "b")
START_S = 1_790_000_000.0


@dataclass
class Story(MadeScene):
    """A drives at b, which may have left."""

    lifecycle: ConflictLifecycle = field(default_factory=lambda: ConflictLifecycle(SETTINGS, 60.0))
    now_s: float = START_S
    why_absent: Absence | None = None
    advisories: list[ConflictAdvisory] = field(default_factory=list)

    def absence(self, uuid: str) -> Absence | None:
        return self.why_absent if uuid == "b" else None

    def separation_m(self, pair: Pair, now_s: float) -> float | None:
        return 0.1

    def passes(self, seconds: float, start_m: float, probability: float, there: float) -> list[AdvisoryState]:
        """Looks four times a second. Returns the revisions."""
        advisories: list[ConflictAdvisory] = []
        for _ in range(round(seconds * 4)):
            self.now_s += 0.25
            prediction = Prediction(PAIR, self.now_s + 1.0, 0.0, start_m, True, probability * there, both_present=there)
            advisories += self.lifecycle.revise(self.now_s, in_columns([prediction]), set(PAIR), self)
        self.advisories += advisories
        return [advisory.state for advisory in advisories if advisory.state is not AdvisoryState.UPDATED]


def test_within_the_clearance_an_advisory_is_cleared_once_a_robot_has_probably_left() -> None:
    story = Story()
    assert story.passes(1.0, 3.0, 0.9, 1.0) == [AdvisoryState.RAISED]
    assert story.passes(5.0, 0.2, 0.9, 0.6) == []
    story.why_absent = Absence(ClearedCode.LEFT_IN_SILENCE)
    assert story.passes(5.0, 0.2, 0.9, 0.04) == [AdvisoryState.CLEARED]
    assert story.advisories[-1].cleared_because == "Alder b is silent and has probably left"


def test_within_the_clearance_an_unlikely_advisory_stays_open_if_both_are_present() -> None:
    story = Story()
    story.passes(1.0, 3.0, 0.9, 1.0)
    assert story.passes(5.0, 0.2, 0.03, 1.0) == []


def test_no_contact_is_announced_with_a_robot_that_has_probably_left() -> None:
    story = Story()
    story.passes(1.0, 0.25, 0.9, 0.3)
    assert story.passes(3.0, 0.2, 0.9, 0.3) == []
    story = Story()
    assert story.passes(3.0, 0.2, 0.9, 1.0) == [AdvisoryState.RAISED]


def test_an_advisory_that_is_no_longer_predicted_is_cleared_while_a_robot_is_probably_gone() -> None:
    story = Story()
    story.passes(1.0, 3.0, 0.9, 1.0)
    story.why_absent = Absence(ClearedCode.LEFT_IN_SILENCE)
    for _ in range(12):
        story.now_s += 0.25
        story.advisories += story.lifecycle.revise(story.now_s, in_columns([]), set(PAIR), story)
    assert story.advisories[-1].cleared_because == "Alder b is silent and has probably left"


def test_an_advisory_ends_at_once_when_a_robot_has_probably_left_however_likely_it_was() -> None:
    story = Story()
    assert story.passes(1.0, 3.0, 1.0, 1.0) == [AdvisoryState.RAISED]
    story.why_absent = Absence(ClearedCode.LEFT_IN_SILENCE)
    assert story.passes(0.25, 3.0, 1.0, 0.35) == [AdvisoryState.CLEARED]
    story = Story()
    story.passes(1.0, 3.0, 1.0, 1.0)
    story.why_absent = Absence(ClearedCode.LEFT_IN_SILENCE)
    (cleared,) = story.lifecycle.revise(story.now_s + 0.25, in_columns([]), set(), story)
    assert cleared.cleared_because == "Alder b is silent and has probably left"
