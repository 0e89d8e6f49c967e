"""Predictions that say nothing new are left alone: what is told is the same as if each were weighed anew."""

from collections.abc import Set
from dataclasses import dataclass, field

import numpy as np
import pytest

from deconflict.advisories.conflict_lifecycle import ConflictLifecycle
from deconflict.advisories.watched.watched_pairs import Examination, WatchedPairs
from deconflict.advisories.words.conflict_wording import Party
from deconflict.foresight.conflict_predictions import Prediction, Predictions
from deconflict.settings.site import Conflict
from deconflict.sweep.geometry.encounter import CLASSES, ENCOUNTER, Encounter
from deconflict_client.advisory import ConflictAdvisory, EncounterClass
from ingest.batch import Pair
from tests.helpers.made_predictions import in_columns
from tests.helpers.made_scene import MadeScene

SETTINGS = Conflict(clearance_m=0.3, clear_after_s=1.0, clear_margin_m=0.1, warning_s=5.0, critical_s=2.0)
PAIRS: tuple[Pair, ...] = tuple(("a", f"b{n}") for n in range(20))
PASSES = 150


NOWHERE = np.array((np.nan, np.nan, -1, -1), ENCOUNTER)


class EveryPair(WatchedPairs):
    """Leaves no pair alone: whatever was weighed before, however the two meet, and whether they are updated."""

    def examine(self, predictions: Predictions, updated: Set[str], now_s: float, _: object) -> Examination:
        self._pairs["weighed_until_s"], self._pairs["updated"] = -np.inf, True
        return super().examine(predictions, updated, now_s, lambda pairs, _: np.full(len(pairs), NOWHERE))


class ThoroughLifecycle(ConflictLifecycle):
    """Weighs every prediction anew in each pass."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.pairs = EveryPair(self.settings)


@dataclass
class Meeting:
    """What two robots' newest forecasts say."""

    contact_s: float
    separation_m: float
    x_m: float
    probability: float
    encounter_class: EncounterClass = EncounterClass.CROSSING
    floor: int = 0


@dataclass
class Floor(MadeScene):
    """Pairs that draw near while their probabilities shift; some of them with news at a pass."""

    seed: int
    now_s: float = 1_790_000_000.0
    meetings: dict[Pair, Meeting] = field(default_factory=dict)
    standing: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.rng = np.random.default_rng(self.seed)

    def party(self, uuid: str, now_s: float) -> Party:
        return Party(uuid, "Alder", "path", standing=False)

    def stands(self, uuid: str) -> bool:
        return uuid in self.standing

    def encounter(self, pair: Pair, contact_s: float) -> Encounter:
        meeting = self.meetings[pair]
        return Encounter(meeting.encounter_class, 1.2, meeting.x_m, 4.0, meeting.floor)

    def datum(self, met: Encounter) -> str:
        return f"datum-{met.floor}"

    def tick(self) -> tuple[list[Prediction], set[str]]:
        """What is predicted, and the robots that have something new to say."""
        self.now_s += 0.1
        shift = self.rng.normal(0, 0.2 if self.rng.random() < 0.1 else 0.01)
        found, heard = [], set[str]()
        before = self.standing
        if self.rng.random() < 0.1:
            self.standing = {uuid for pair in PAIRS for uuid in pair if self.rng.random() < 0.7}
        for pair in PAIRS:
            fresh = pair not in self.meetings or bool(self.rng.random() < 0.1)
            fresh |= not (before ^ self.standing).isdisjoint(pair)
            if fresh:
                self.meetings[pair] = self._heard(self.meetings.get(pair))
                heard.update(pair)
            if self.now_s < self.meetings[pair].contact_s + 0.5 and self.rng.random() < 0.95:
                found.append(self._prediction(pair, fresh, shift))
        return found, heard

    def _heard(self, before: Meeting | None) -> Meeting:
        if before is None or before.contact_s < self.now_s - 2:
            in_s, separation_m, x_m = (
                self.rng.uniform(0, 10),
                float(self.rng.choice([0.0, 0.1, 0.25])),
                self.rng.uniform(0, 9),
            )
            return Meeting(self.now_s + in_s, separation_m, x_m, self._share())
        moved_m, later_s = self.rng.normal(0, 0.8), float(self.rng.choice([0.0, self.rng.normal(0, 0.4)]))
        probability = self._share() if self.rng.random() < 0.2 else before.probability
        encounter_class, floor = before.encounter_class, before.floor
        if self.rng.random() < 0.05:
            encounter_class, floor = CLASSES[self.rng.integers(len(CLASSES))], int(self.rng.integers(2))
        x_m, contact_s = before.x_m + moved_m, before.contact_s + later_s
        return Meeting(contact_s, before.separation_m, x_m, probability, encounter_class, floor)

    def _share(self) -> float:
        return float(self.rng.choice([0.07, 0.3, 0.5, 0.7, 0.95]))

    def _prediction(self, pair: Pair, fresh: bool, shift: float) -> Prediction:
        meeting = self.meetings[pair]
        if self.rng.random() < 0.01:
            meeting.separation_m = float(self.rng.choice([0.0, 0.1, 0.25]))
        start_m = (
            0.3 * max(meeting.contact_s - self.now_s, 0.0) + meeting.separation_m + float(self.rng.uniform(0, 0.15))
        )
        probability = float(np.clip(meeting.probability + shift, 0, 1))
        return Prediction(pair, max(meeting.contact_s, self.now_s), meeting.separation_m, start_m, fresh, probability)


@pytest.mark.parametrize("seed", range(20))
def test_predictions_that_are_left_alone_would_have_made_no_revision(seed: int) -> None:
    floor, lifecycle, thorough = Floor(seed), ConflictLifecycle(SETTINGS, 60.0), ThoroughLifecycle(SETTINGS, 60.0)
    advisories: list[ConflictAdvisory] = []
    for _ in range(PASSES):
        found, heard = floor.tick()
        now = lifecycle.revise(floor.now_s, in_columns(found), heard, floor)
        assert now == thorough.revise(floor.now_s, in_columns(found), heard, floor)
        advisories += now
    assert len({advisory.state for advisory in advisories}) == 3
    assert len(advisories) > 2 * len(PAIRS)
