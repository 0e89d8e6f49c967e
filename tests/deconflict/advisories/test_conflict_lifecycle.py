from collections.abc import Sequence
from dataclasses import dataclass, field
from math import hypot
from uuid import RFC_4122, UUID

import numpy as np
import pytest

from deconflict.advisories.conflict_lifecycle import ConflictLifecycle
from deconflict.advisories.revision_rules import HELD_SHARE
from deconflict.advisories.words.conflict_wording import Party, new_id
from deconflict.advisories.words.words import Spot
from deconflict.foresight.conflict_predictions import Prediction
from deconflict.settings.site import Conflict
from deconflict.sweep.geometry.encounter import Encounter
from deconflict_client.advisory import AdvisoryState, ConflictAdvisory, EncounterClass, Severity
from ingest.batch import Pair
from tests.helpers.made_predictions import in_columns
from tests.helpers.made_scene import MadeScene

PAIR: Pair = ("a", "b")
SETTINGS = Conflict(
    clearance_m=0.3,
    confirm=(2, 3),
    urgent_s=2.0,
    evident_probability=1.0,
    clear_after_s=3.0,
    clear_margin_m=0.1,
    warning_s=5.0,
    critical_s=2.0,
)
ABSENT_AFTER_S = 60.0
UNLIKELY = round(SETTINGS.raise_probability * HELD_SHARE / 2, 3)
"""What an advisory tells of a conflict that is not likely enough to stand."""


@dataclass
class Story(MadeScene):
    """Two robots and their predictions, pass by pass, a second apart."""

    lifecycle: ConflictLifecycle = field(default_factory=lambda: ConflictLifecycle(SETTINGS, ABSENT_AFTER_S))
    now_s: float = 1000.0
    apart_m: float | None = 5.0
    floor: dict[str, Party] = field(
        default_factory=lambda: {
            "a": Party("Alder 1", "Alder", "path", standing=False),
            "b": Party("Corvid 2", "Corvid", "path", standing=False),
        }
    )
    x_m: float = 3.0

    def is_present(self, uuid: str) -> bool:
        return uuid in self.floor

    def party(self, uuid: str, now_s: float) -> Party:
        return self.floor[uuid]

    def stands(self, uuid: str) -> bool:
        return uuid in self.floor and self.floor[uuid].standing

    def encounter(self, pair: Pair, contact_s: float) -> Encounter:
        return Encounter(EncounterClass.CROSSING, 1.2, self.x_m, 4.0, 0)

    def separation_m(self, pair: Pair, now_s: float) -> float | None:
        return self.apart_m

    def spots(self, encounters: Sequence[Encounter]) -> list[Spot]:
        return [Spot("in Aisle 4 on Hall")] * len(encounters)

    def quiet(self, updated: bool = True) -> list[ConflictAdvisory]:
        """A pass in which no conflict is predicted; robot a has a new forecast if `updated`."""
        return self._step([], updated)

    def predicted(
        self,
        in_s: float,
        separation_m: float = 0.0,
        start_m: float = 5.0,
        fresh: bool = True,
        probability: float = 1.0,
        still: bool = False,
    ) -> list[ConflictAdvisory]:
        self.apart_m = start_m
        prediction = Prediction(PAIR, self.now_s + 1 + in_s, separation_m, start_m, fresh, probability, still=still)
        return self._step([prediction], fresh)

    def _step(self, predictions: list[Prediction], updated: bool) -> list[ConflictAdvisory]:
        self.now_s += 1.0
        return self.lifecycle.revise(self.now_s, in_columns(predictions), {"a"} if updated else set(), self)

    def raised(self, in_s: float = 8.0) -> ConflictAdvisory:
        self.predicted(in_s)
        (advisory,) = self.predicted(in_s - 1)
        assert advisory.state is AdvisoryState.RAISED
        return advisory


def test_an_unpredicted_conflict_is_updated_in_its_probability_until_it_is_cleared() -> None:
    story = Story()
    raised = story.raised(12)
    by_step = [story.quiet() for _ in range(2)]
    assert [[(advisory.state, advisory.probability, advisory.severity) for advisory in each] for each in by_step] == [
        [(AdvisoryState.UPDATED, UNLIKELY, raised.severity)],
        [],
    ]
    (back,) = story.predicted(9, probability=0.9)
    assert (back.state, back.probability) == (AdvisoryState.UPDATED, 0.9)


def test_contact_is_published_as_no_more_probable_than_the_conflict() -> None:
    """Also where the conflict is held at a bound. The story is certain of contact."""
    story = Story()
    story.predicted(12, probability=0.7)
    (raised,) = story.predicted(11, probability=0.7)
    assert (raised.probability, raised.contact_probability) == (0.7, 0.7)


def test_a_conflict_that_has_begun_is_updated_in_its_probability_and_severity() -> None:
    story = Story()
    story.raised(3)
    story.predicted(0)
    shares = (0.95, 0.2, 0.2, 0.0, 0.9)
    by_step = [story.predicted(-1, start_m=0.35, probability=probability) for probability in shares]
    assert [
        [(advisory.time_to_conflict_s, advisory.probability, advisory.severity) for advisory in each]
        for each in by_step
    ] == [
        [],
        [],
        [(0.0, 0.2, Severity.CAUTION)],
        [(0.0, UNLIKELY, Severity.CAUTION)],
        [(0.0, 0.9, Severity.CRITICAL)],
    ]


def test_a_probability_that_is_published_as_a_lower_one_is_no_news_by_itself() -> None:
    story, held = Story(), SETTINGS.raise_probability * HELD_SHARE
    story.raised()
    story.predicted(6, probability=UNLIKELY + 0.155)
    assert story.predicted(5, probability=held - 0.001) == []


def test_two_that_draw_apart_without_new_forecasts_may_raise_a_new_advisory() -> None:
    story = Story()
    assert story.predicted(0, separation_m=0.2, start_m=0.2) == []
    assert story.predicted(0, separation_m=0.2, start_m=0.5, fresh=False) == []
    (advisory,) = story.predicted(1, separation_m=0.2, start_m=0.35)
    assert advisory.state is AdvisoryState.RAISED


def test_a_conflict_that_had_begun_and_will_begin_again_is_updated_without_a_new_forecast() -> None:
    story = Story()
    story.raised(3)
    (begun,) = story.predicted(0)
    assert begun.time_to_conflict_s == 0
    assert story.predicted(0, fresh=False) == []
    (later,) = story.predicted(3, fresh=False)
    assert later.time_to_conflict_s == 3.0


def clear(story: Story) -> None:
    """Neither robot reports until the advisory is cleared."""
    while not any(advisory.state is AdvisoryState.CLEARED for advisory in story.quiet(updated=False)):
        pass


def test_looks_at_a_conflict_that_has_begun_count_after_it_is_cleared() -> None:
    story = Story()
    story.raised(3)
    assert story.predicted(0)
    assert story.predicted(0) == []
    assert story.predicted(0) == []
    clear(story)
    assert story.predicted(9) == []
    assert story.predicted(8)


def test_looks_within_the_update_gap_count_after_the_advisory_is_cleared() -> None:
    story = Story()
    story.raised(8)
    story.now_s -= 0.5
    assert story.predicted(7) == []
    clear(story)
    assert story.predicted(9, probability=0.0) == []
    assert story.predicted(8)


def test_ids_are_in_the_order_of_their_times_and_differ_between_pairs_and_within_a_millisecond() -> None:
    now_s = 1_790_000_000.0
    stories = [Story(now_s=now_s + n / 7) for n in range(40)]
    ids = [UUID(story.raised().id) for story in stories]
    assert ids == sorted(set(ids))
    assert {(each.version, each.variant) for each in ids} == {(7, RFC_4122)}
    assert [each.int >> 80 for each in ids] == [int(story.now_s * 1000) for story in stories]
    abouts = [("a b", now_s), ("a c", now_s), ("a b", now_s + 2e-6)]
    assert len({new_id(about, at_s) for about, at_s in abouts}) == 3
    assert len({new_id(f"a {number}", now_s)[-12:] for number in range(500)}) == 500
    assert [UUID(new_id("a b", at_s)).version for at_s in (-1.0, 1e15)] == [7, 7]
    assert new_id("a b", now_s) == new_id("a b", now_s)


def test_two_looks_of_three_raise() -> None:
    story = Story()
    assert story.predicted(9) == []
    assert story.quiet() == []
    (advisory,) = story.predicted(7)
    assert advisory.state is AdvisoryState.RAISED
    assert advisory.robots == PAIR
    assert advisory.time_to_conflict_s == pytest.approx(7)
    assert advisory.summary == "Alder 1 and Corvid 2 cross in 7 s, in Aisle 4 on Hall"


def test_one_look_of_three_does_not_raise() -> None:
    story = Story()
    assert [*story.predicted(9), *story.quiet(), *story.quiet(), *story.predicted(9)] == []


def test_an_old_forecast_repeated_confirms_nothing() -> None:
    story = Story()
    assert story.predicted(9) == []
    assert [story.predicted(8 - i, fresh=False) for i in range(5)] == [[]] * 5


def test_an_evident_conflict_needs_no_confirmation() -> None:
    settings = SETTINGS.model_copy(update={"evident_probability": 0.6})
    assert Story(ConflictLifecycle(settings, ABSENT_AFTER_S)).predicted(9, probability=0.55) == []
    (advisory,) = Story(ConflictLifecycle(settings, ABSENT_AFTER_S)).predicted(9, probability=0.65)
    assert advisory.state is AdvisoryState.RAISED


def test_an_urgent_conflict_needs_no_confirmation() -> None:
    (advisory,) = Story().predicted(1.5)
    assert advisory.severity is Severity.CRITICAL


def test_a_pair_that_begins_close_and_draws_apart_does_not_alert() -> None:
    story = Story()
    for _ in range(5):
        assert story.predicted(0, separation_m=0.2, start_m=0.2) == []


def test_a_pair_that_begins_close_and_is_about_to_touch_alerts() -> None:
    (advisory,) = Story().predicted(0, separation_m=0.0, start_m=0.25)
    assert advisory.state is AdvisoryState.RAISED


def test_hovering_at_the_clearance_is_one_encounter() -> None:
    story = Story()
    story.predicted(0, separation_m=0.2, start_m=0.2)
    for start_m in (0.35, 0.25, 0.35, 0.38):
        assert story.predicted(0.5, separation_m=0.2, start_m=start_m) == []


def test_severity_rises_as_the_conflict_nears_and_is_updated_at_once() -> None:
    story = Story()
    assert story.raised().severity is Severity.CAUTION
    advisories = [advisory for in_s in (6, 5, 4, 3, 2, 1) for advisory in story.predicted(in_s)]
    assert [advisory.severity for advisory in advisories] == [Severity.WARNING, Severity.CRITICAL]
    assert [advisory.revision for advisory in advisories] == [2, 3]


def test_updates_keep_a_gap_unless_severity_rises() -> None:
    story = Story()
    story.raised()
    story.now_s -= 0.5
    assert story.predicted(5.5, separation_m=0.2) == []
    story.now_s -= 0.75
    (update,) = story.predicted(1.5)
    assert update.severity is Severity.CRITICAL


def test_a_shallow_conflict_is_one_level_less_severe() -> None:
    story = Story()
    story.predicted(8, separation_m=0.25)
    (advisory,) = story.predicted(4, separation_m=0.25)
    assert advisory.severity is Severity.CAUTION


def test_an_unchanged_prediction_is_not_repeated() -> None:
    story = Story()
    story.raised(9)
    assert story.predicted(7) == []
    assert story.predicted(6.2) == []


@pytest.mark.parametrize(("in_s", "x_m", "separation_m"), [(9.0, 3.0, 0.0), (6.0, 4.5, 0.0), (6.0, 3.0, 0.2)])
def test_a_changed_prediction_is_an_update(in_s: float, x_m: float, separation_m: float) -> None:
    story = Story()
    first = story.raised()
    story.x_m = x_m
    (update,) = story.predicted(in_s, separation_m=separation_m)
    assert update.state is AdvisoryState.UPDATED
    assert (update.id, update.raised_at, update.revision) == (first.id, first.raised_at, 2)


def test_an_advisory_clears_when_not_predicted_for_long_enough() -> None:
    story = Story()
    first = story.raised()
    by_step = [story.quiet() for _ in range(3)]
    assert [[advisory.state for advisory in each] for each in by_step[:2]] == [[AdvisoryState.UPDATED], []]
    (cleared,) = by_step[2]
    assert (cleared.id, cleared.state, cleared.cleared_because) == (
        first.id,
        AdvisoryState.CLEARED,
        "no longer predicted",
    )
    assert cleared.cleared_at is not None
    assert story.lifecycle.advisories == {}


def test_a_prediction_that_comes_back_keeps_the_advisory() -> None:
    story = Story()
    story.raised(12)
    faded, *back = [*story.quiet(), *story.quiet(), *story.predicted(8.2, fresh=False)]
    assert [(advisory.id, advisory.state, advisory.probability) for advisory in (faded, *back)] == [
        (faded.id, AdvisoryState.UPDATED, UNLIKELY),
        (faded.id, AdvisoryState.UPDATED, 1.0),
    ]
    assert len(story.lifecycle.advisories) == 1


def test_an_advisory_stays_until_the_two_have_drawn_apart() -> None:
    story = Story()
    story.raised()
    story.predicted(0, start_m=0.1)
    story.apart_m = 0.35
    (faded,) = [advisory for _ in range(6) for advisory in story.quiet()]
    assert (faded.state, faded.probability) == (AdvisoryState.UPDATED, UNLIKELY)
    story.apart_m = 0.45
    (cleared,) = story.quiet()
    assert cleared.cleared_because == "they have passed each other"


def test_an_advisory_that_becomes_unlikely_stands_for_a_while() -> None:
    story = Story()
    story.raised(12)
    by_step = [story.predicted(10, probability=0.0) for _ in range(3)]
    assert [[advisory.cleared_because for advisory in each] for each in by_step] == [
        [None],
        [],
        ["no longer predicted"],
    ]
    assert by_step[0][0].probability == UNLIKELY


def test_a_pair_that_touches_as_it_begins_does_not_alert() -> None:
    story = Story()
    assert [story.predicted(0.5, start_m=0.05) for _ in range(4)] == [[]] * 4
    assert story.predicted(0.5, start_m=0.2)


def test_having_met_before_the_advisory_is_not_having_passed_each_other() -> None:
    story = Story()
    story.predicted(0, separation_m=0.2, start_m=0.2)
    story.raised()
    story.apart_m = 5.0
    advisories = [advisory for _ in range(4) for advisory in story.quiet()]
    assert [advisory.cleared_because for advisory in advisories] == [None, "no longer predicted"]


def test_a_second_encounter_is_a_new_advisory_with_the_next_ordinal() -> None:
    story = Story()
    first = story.raised()
    while story.lifecycle.advisories:
        story.quiet()
    second = story.raised()
    assert (first.encounter, second.encounter) == (1, 2)
    assert first.id != second.id


def test_two_that_met_and_both_stand_are_cleared_and_not_raised_again_when_they_part() -> None:
    story = Story()
    story.raised()
    story.predicted(0, start_m=0.1)
    for uuid, party in story.floor.items():
        story.floor[uuid] = Party(party.name, party.vendor, "stationary", standing=True)
    revisions = [story.predicted(0, separation_m=0.1, start_m=0.1, still=True) for _ in range(6)]
    assert [[advisory.cleared_because for advisory in each] for each in revisions] == [
        [],
        [],
        [],
        ["they stand still"],
        [],
        [],
    ]
    assert [advisory for _ in range(4) for advisory in story.predicted(0, separation_m=0.1, start_m=0.1)] == []


def test_two_of_which_one_gives_way_are_cleared_and_say_so() -> None:
    story = Story()
    story.raised()
    revisions = [
        advisory for _ in range(5) for advisory in story.predicted(0, separation_m=0.6, start_m=0.6, still=True)
    ]
    assert [revision.cleared_because for revision in revisions if revision.cleared_because] == ["one gave way"]


def test_two_that_stand_raise_nothing_however_likely() -> None:
    story = Story()
    assert [advisory for _ in range(6) for advisory in story.predicted(1.5, still=True)] == []


def test_a_pair_within_the_clearance_that_is_unlikely_to_touch_raises_nothing() -> None:
    assert Story().predicted(0, separation_m=0.0, start_m=0.25, probability=0.05) == []


def test_a_robot_that_left_the_floor_ends_the_advisory() -> None:
    story = Story()
    story.raised()
    del story.floor["b"]
    (cleared,) = story.quiet()
    assert cleared.cleared_because == "Corvid 2 left the floor"


def restarted(advisory: ConflictAdvisory, after_s: float) -> Story:
    """A story that goes on with an advisory; no robot has reported yet."""
    later = Story(now_s=advisory.updated_at.timestamp() + after_s, floor={})
    later.lifecycle.restore([advisory])
    return later


def test_a_restored_advisory_waits_for_its_robots_and_keeps_its_id() -> None:
    story = Story()
    first = story.raised(8)
    later = restarted(first, after_s=1)
    assert [advisory for _ in range(8) for advisory in later.quiet()] == []
    later.floor = story.floor
    (update,) = later.predicted(4)
    assert (update.id, update.revision) == (first.id, 2)


def test_a_restored_advisory_fades_if_its_robots_are_not_heard_of_by_the_time_of_the_conflict() -> None:
    story = Story()
    critical = story.predicted(1)[-1]
    later = restarted(critical, after_s=1)
    (faded,) = [advisory for _ in range(50) for advisory in later.quiet()]
    assert (critical.severity, faded.severity, faded.probability) == (Severity.CRITICAL, Severity.CAUTION, UNLIKELY)
    assert (faded.updated_at - later.lifecycle.advisories[PAIR].raised_at).total_seconds() == 5
    later.floor = story.floor
    assert [advisory.id for advisory in later.predicted(4)] == [critical.id]


def test_a_restored_advisory_whose_robots_never_return_is_cleared_in_time() -> None:
    later = restarted(Story().raised(), after_s=90)
    advisories = [advisory for _ in range(70) for advisory in later.quiet(updated=False)]
    assert [advisory.state for advisory in advisories] == [AdvisoryState.UPDATED, AdvisoryState.CLEARED]


def test_pairs_no_longer_of_interest_are_forgotten() -> None:
    story = Story()
    story.predicted(9)
    for _ in range(3):
        story.quiet()
    assert len(story.lifecycle.pairs) == 0


def test_the_same_predictions_give_the_same_advisories() -> None:
    def tell() -> list[ConflictAdvisory]:
        story = Story()
        return [advisory for in_s in (9, 8, 6, 3, 2, 1) for advisory in story.predicted(in_s)]

    assert tell() == tell()
    assert hypot(tell()[0].location.x, tell()[0].location.y) == pytest.approx(5.0)


@pytest.mark.parametrize(
    ("probability", "separation_m", "raises"),
    [(0.3, 0.0, False), (0.6, 0.0, True), (0.6, 0.5, False), (0.9, 0.5, True)],
)
def test_raising_needs_a_probability_and_a_higher_one_if_the_forecasts_miss(
    probability: float, separation_m: float, raises: bool
) -> None:
    story = Story()
    advisories = [
        advisory for in_s in (8, 7, 6) for advisory in story.predicted(in_s, separation_m, probability=probability)
    ]
    assert [advisory.state for advisory in advisories] == [AdvisoryState.RAISED] * raises


def test_an_advisory_stands_until_its_conflict_is_unlikely() -> None:
    story = Story()
    story.raised()
    held = SETTINGS.raise_probability * HELD_SHARE
    assert all(
        advisory.state is AdvisoryState.UPDATED
        for n in range(5)
        for advisory in story.predicted(6 - n / 2, probability=held)
    )
    advisories = [advisory for n in range(5) for advisory in story.predicted(4 - n / 2, probability=held - 0.01)]
    assert [advisory.cleared_because for advisory in advisories] == ["no longer predicted"]


def test_an_unsure_conflict_is_one_level_less_severe() -> None:
    story = Story()
    story.predicted(5, probability=0.7)
    (advisory,) = story.predicted(4, probability=0.7)
    assert (advisory.severity, advisory.probability) == (Severity.CAUTION, 0.7)


def likely_at(*shares: float) -> list[list[Severity]]:
    """The severities of the revisions of a critical conflict that stays as near, with these probabilities."""
    story = Story()
    assert story.predicted(1.5)[-1].severity is Severity.CRITICAL
    return [[advisory.severity for advisory in story.predicted(1.5, probability=share)] for share in shares]


def test_a_severity_falls_with_the_probability_after_a_second_and_rises_at_once() -> None:
    assert likely_at(0.5, 0.5, 0.2, 0.2, 0.9) == [
        [],
        [Severity.WARNING],
        [],
        [Severity.CAUTION],
        [Severity.CRITICAL],
    ]


def test_a_severity_stands_if_the_probability_falls_for_less_than_a_second_or_stays_near_the_bound() -> None:
    assert likely_at(0.2, 1.0, 0.2, 1.0) == [[], [Severity.CRITICAL]] * 2
    assert likely_at(0.61, 0.8, 0.61) == [[Severity.CRITICAL]] * 3


def test_a_conflict_less_likely_than_raises_an_advisory_is_a_caution_however_near() -> None:
    story = Story()
    prediction = Prediction(PAIR, story.now_s + 1, 0.0, 5.0, True, probability=0.39)
    predictions = in_columns([prediction])._replace(deciding=np.array([0.41]))
    (advisory,) = story.lifecycle.revise(story.now_s, predictions, {"a"}, story)
    assert advisory.severity is Severity.CAUTION


def test_a_severity_falls_with_the_separation_if_it_is_well_beyond_half_the_clearance() -> None:
    story = Story()
    story.predicted(1.5)
    by_step = [story.predicted(1.5, separation_m=separation_m) for separation_m in (0.16, 0.16, 0.21, 0.21)]
    assert [[advisory.severity for advisory in each] for each in by_step] == [
        [Severity.CRITICAL],
        [Severity.CRITICAL],
        [],
        [Severity.WARNING],
    ]
