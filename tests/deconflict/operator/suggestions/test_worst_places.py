"""The worst places of a made-up ledger: where they are, their cause, and what is said of them."""

from dataclasses import replace

import pytest

from deconflict.operator.ledger.loss_ledger import LedgerEntry
from deconflict.operator.suggestions.evidence import LossEvidence, Passes, PlaceKey
from deconflict.operator.suggestions.suggested_places import SuggestedPlaces
from deconflict.operator.suggestions.worst_places import changes_of, with_tried, worst_places
from deconflict.settings.shared_places import Zone
from deconflict_client.answers.suggestion_models import Saving, TriedChange, WorstPlace
from tests.deconflict.operator.suggestions.made_evidence import HALL, SITE, every_hour, evidence, loss

CORNER = Zone(
    id="corner",
    name="Corner",
    kind="crossing",
    datum=HALL,
    polygon=((80.0, 80.0), (90.0, 80.0), (90.0, 90.0), (80.0, 90.0)),
)
PLACES = SuggestedPlaces.of(SITE.model_copy(update={"zones": (*SITE.zones, CORNER)}))
LANE = PlaceKey(HALL, "Lane")
MEETING, FOLLOWER = loss("head_on", "Lane", 30.0, 21.0), loss("queue", "Lane", 24.0, 21.0, lost_s=100.0)
WAIT = loss("queue", "Yard", 5.0, 1.0)


def worst(*entries: LedgerEntry) -> list[WorstPlace]:
    return worst_places(made(*entries), PLACES, 7.0)


def made(*entries: LedgerEntry) -> LossEvidence:
    return evidence([each for entry in entries for each in every_hour(entry)])


@pytest.mark.parametrize(
    ("entry", "place", "cause"),
    [
        (MEETING, "Lane", "narrow_lane"),
        (WAIT, "Dock 1", "few_resources"),
        (loss("deadlock", "Corner", 85.0, 85.0), "Corner", "unordered_crossing"),
        (loss("crossing", "", 60.0, 30.0), "", "unordered_crossing"),
        (loss("blockage", "", 60.0, 30.0), "", "standing_robot"),
        (loss("following", "", 60.0, 30.0), "", "mixed"),
    ],
)
def test_each_place_has_its_cause(entry: LedgerEntry, place: str, cause: str) -> None:
    [found] = worst(entry)
    assert (found.place, found.cause, found.since_s) == (place, cause, 7.0)
    assert (found.evidence.losses, found.kinds) == (80, {entry.kind: 400.0})


def test_the_queue_behind_a_jam_does_not_hide_its_cause() -> None:
    [found] = worst(MEETING, FOLLOWER)
    assert found.cause == "narrow_lane"
    assert found.kinds == {"queue": 2000.0, "head_on": 400.0}


def test_an_aisle_that_one_vendor_drives_the_other_way_is_no_narrow_lane() -> None:
    one_way = {"Alder": Passes(40, 0), "Basalt": Passes(30, 1), "Corvid": Passes(0, 20), "Rare": Passes(1, 1)}
    [found] = worst_places(replace(made(MEETING), passes={LANE: one_way}), PLACES, 0.0)
    assert (found.cause, found.turned) == ("opposed_one_way", ["Corvid"])
    assert "but Corvid the other way than the rest" in found.text
    both = one_way | {"Basalt": Passes(15, 16)}
    [found] = worst_places(replace(made(MEETING), passes={LANE: both}), PLACES, 0.0)
    assert (found.cause, found.turned) == ("narrow_lane", [])


def test_outside_all_places_squares_are_told_apart_and_the_worst_come_first() -> None:
    near, far = loss("blockage", "", 61.0, 30.0), loss("blockage", "", 75.0, 30.0, lost_s=30.0)
    assert [found.x_m for found in worst(near, far)] == [75.0, 61.0]
    assert worst(near)[0].text.startswith("Around 61, 31 m: robots lose 7 min an hour (100% of all lost time)")


def test_there_are_at_most_five_and_none_with_a_few_losses() -> None:
    squares = [loss("blockage", "", 100.0 + 20 * number, 30.0) for number in range(7)]
    assert len(worst(*squares)) == 5
    assert worst_places(evidence([MEETING]), PLACES, 0.0) == []


def test_what_was_tried_is_listed_and_the_best_that_pays_is_named() -> None:
    facts = made(MEETING)
    [found] = worst_places(facts, PLACES, 0.0)
    assert found.best
    assert (found.best.kind, found.best.saving and found.best.saving.by) == ("one_way", "rule")
    one_way, widen, order = changes_of(found, facts, PLACES)
    assert order.check == "deconflict whatif LOG --site SITE.toml --order Lane"
    tried = with_tried(found, [saves(one_way, 120.0, 240.0), saves(widen, 180.0, 360.0), saves(order, -60.0, 600.0)])
    assert tried.best
    assert tried.best.kind == "widen"
    assert "Lane one-way: saves 2 to 4 min an hour; " in tried.text
    assert "one side at a time: no clear change (-60 to +600 s an hour)." in tried.text
    assert tried.text.endswith("Best: Lane wider, which would save 3 to 6 min an hour.")


def test_where_nothing_pays_it_says_so() -> None:
    facts = made(MEETING)
    [found] = worst_places(facts, PLACES, 0.0)
    first, second, _ = changes_of(found, facts, PLACES)
    assert "Nothing was tried yet. Expected to help: Lane one-way, which would save" in found.text
    tried = with_tried(found, [saves(first, -600.0, -60.0), second.model_copy(update={"note": "it is too wide"})])
    assert tried.best is None
    assert "one-way: loses time (-600 to -60 s an hour); Lane wider: not simulated, since it is too wide." in tried.text
    assert tried.text.endswith("Nothing found that pays.")
    unknown = with_tried(found, [second.model_copy(update={"note": "it is too wide"})])
    assert unknown.best == found.best


def test_what_was_not_tried_is_not_said_to_pay_nothing() -> None:
    [little] = worst_places(evidence([MEETING._replace(lost_s=20.0)] * 6), PLACES, 0.0)
    assert little.best is None
    assert little.text.endswith("Nothing was tried yet. Too little is lost for an expectation of what would help.")
    [blocked] = worst(loss("blockage", "", 61.0, 30.0))
    assert blocked.text.endswith("Nothing was tried yet. No change of the floor is known that would help.")


def test_a_place_with_few_long_losses_is_listed_and_says_that_they_are_few() -> None:
    [found] = worst_places(evidence([MEETING._replace(lost_s=60.0)] * 4), PLACES, 0.0)
    assert found.best is None
    assert found.text.endswith("Too few losses yet (4) for an expectation of what would help.")


def test_what_people_lose_to_people_is_no_reason_for_an_order_of_robots() -> None:
    crossing = loss("crossing", "Corner", 85.0, 85.0)
    on_foot = replace(PLACES, people=frozenset(("Alder", "Corvid")))
    [found] = worst_places(made(crossing), on_foot, 0.0)
    assert found.best is None
    [found] = worst_places(made(crossing, crossing._replace(by_vendor="Basalt")), on_foot, 0.0)
    assert found.best
    assert found.best.saving
    [as_robots] = worst_places(made(crossing, crossing._replace(by_vendor="Basalt")), PLACES, 0.0)
    assert as_robots.best
    assert as_robots.best.saving
    assert found.best.saving.high_s_per_hour < as_robots.best.saving.high_s_per_hour


def test_a_change_that_may_lose_time_is_not_expected_to_help() -> None:
    [found] = worst(loss("crossing", "Corner", 85.0, 85.0))
    assert "Simulate this first: Corner entered from one side at a time. It may save up to" in found.text
    assert found.text.endswith("an hour, or lose time.")


def test_at_a_crossing_the_vendor_that_loses_most_may_go_first() -> None:
    facts = made(loss("crossing", "Corner", 85.0, 85.0))
    [found] = worst_places(facts, PLACES, 0.0)
    assert [(change.kind, change.subject) for change in changes_of(found, facts, PLACES)] == [
        ("order", "Corner"),
        ("priority", "Alder"),
    ]


def saves(change: TriedChange, low_s: float, high_s: float) -> TriedChange:
    saving = Saving(low_s_per_hour=low_s, high_s_per_hour=high_s, by="model")
    return change.model_copy(update={"saving": saving})
