"""Each kind of suggestion from a made-up ledger, and no suggestion where the evidence is too thin."""

import pytest

from deconflict.operator.ledger.loss_ledger import LedgerEntry
from deconflict.operator.ledger.loss_questions import HOUR_S
from deconflict.operator.suggestions.evidence import VendorForecasts, WarningCounts
from deconflict.operator.suggestions.found_suggestions import (
    NOTHING_STANDS_OUT,
    TOO_LITTLE,
    found_suggestions,
    none_because,
)
from deconflict.operator.suggestions.suggested_places import SuggestedPlaces
from deconflict.settings.site_file import load
from deconflict.simulation.demo.demo_site import demo_site
from tests.deconflict.operator.suggestions.made_evidence import (
    HOURS,
    SITE,
    START_S,
    every_hour,
    evidence,
    loss,
    suggestions,
)

QUEUE = loss("queue", "Yard", 5.0, 1.0)
MEETING = loss("head_on", "Lane", 30.0, 21.0)
CROSSING = loss("crossing", "Yard", 60.0, 60.0)
BLOCKAGE = loss("blockage", "Yard", 60.0, 60.0)
TWO_VENDORS = {"Alder": VendorForecasts(10, "B"), "Corvid": VendorForecasts(10, "E")}


def test_a_queue_at_a_dock_suggests_one_more() -> None:
    [found] = suggestions(evidence(every_hour(QUEUE)))
    assert (found.kind, found.place) == ("dock", "Dock 1")
    assert found.evidence.lost_s_per_hour == 400.0
    assert (found.evidence.share, found.evidence.hours, found.evidence.losses) == (1.0, HOURS, 80)
    assert (found.evidence.pairs[0].vendor, found.evidence.pairs[0].by) == ("Alder", "Corvid")
    assert found.saving
    assert 0 < found.saving.low_s_per_hour < 160.0
    assert 400.0 < found.saving.high_s_per_hour < 600.0
    assert found.check == "deconflict whatif LOG --site SITE.toml --dock 'Dock 1'"
    assert found.text.startswith(
        "Add a dock beside Dock 1: robots that wait there lose 7 min an hour (100% of all lost"
    )


def test_the_first_hour_of_a_ledger_counts_from_its_first_loss_on() -> None:
    late = [
        entry._replace(from_s=entry.from_s + 2400.0) for entry in every_hour(QUEUE) if entry.from_s < START_S + HOUR_S
    ]
    [found] = suggestions(evidence(late))
    assert found.evidence.hours == pytest.approx(1 / 3, abs=0.01)
    assert found.evidence.lost_s_per_hour == pytest.approx(1200.0)


def test_the_range_of_a_saving_is_narrower_with_more_evidence() -> None:
    """What few losses cost is by chance more or less than usual."""
    widths_s = []
    for times in (4, 16, 64):
        [found] = suggestions(evidence(every_hour(loss("queue", "Yard", 5.0, 1.0, lost_s=1600.0 / times), times)))
        assert found.saving
        widths_s.append(found.saving.high_s_per_hour - found.saving.low_s_per_hour)
    assert widths_s[0] > widths_s[1] > widths_s[2] > 0.6 * 1600.0


def test_head_on_losses_in_an_aisle_suggest_one_way() -> None:
    [found] = suggestions(evidence(every_hour(MEETING)))
    assert (found.kind, found.place) == ("one_way", "Lane")
    assert found.check.endswith("--one-way Lane")


def test_losses_at_crossings_suggest_that_the_vendor_goes_first_that_loses_most() -> None:
    [found] = suggestions(evidence(every_hour(CROSSING)))
    assert (found.kind, found.vendor, found.place) == ("priority", "Alder", "Yard")
    assert found.check.endswith("--priority Alder")


def test_people_are_not_asked_to_go_first_or_to_forecast() -> None:
    places = SuggestedPlaces(people=frozenset({"Alder", "Corvid"}))
    found = evidence(every_hour(CROSSING) + every_hour(BLOCKAGE), TWO_VENDORS)
    assert not found_suggestions(found, places)
    assert SuggestedPlaces.of(load(demo_site())).people == {"Walkers"}


def test_a_vendor_with_bad_forecasts_that_stands_in_the_way_is_named() -> None:
    [found] = suggestions(evidence(every_hour(BLOCKAGE), TWO_VENDORS))
    assert (found.kind, found.vendor, found.check) == ("vendor", "Corvid", "")
    assert "Ask Corvid to announce stops" in found.text


def test_a_vendor_with_good_forecasts_is_not_blamed() -> None:
    assert not suggestions(evidence(every_hour(BLOCKAGE), {**TWO_VENDORS, "Corvid": VendorForecasts(10, "A")}))


def test_a_vendor_that_costs_no_more_than_the_others_is_not_blamed() -> None:
    entries = every_hour(BLOCKAGE) + every_hour(BLOCKAGE._replace(vendor="Corvid", by_vendor="Alder"))
    assert not suggestions(evidence(entries, TWO_VENDORS))


@pytest.mark.parametrize(
    ("other", "size"),
    [
        (WarningCounts(0.2, 70, 30, 100, 79), "smaller"),
        (WarningCounts(0.45, 110, 51, 100, 90), "larger"),
        (WarningCounts(0.2, 70, 30, 100, 60), ""),
        (WarningCounts(0.45, 150, 90, 100, 90), ""),
    ],
)
def test_a_clearance_is_suggested_only_if_it_is_clearly_better(other: WarningCounts, size: str) -> None:
    now = WarningCounts(0.3, 100, 50, 100, 80)
    found = suggestions(evidence([], warnings=[now, other]))
    assert [f"Make the clearance {size}" in each.text for each in found] == [True] * bool(size)
    assert all(each.saving is None for each in found)


@pytest.mark.parametrize(
    "entries",
    [
        every_hour(QUEUE, 2),
        every_hour(QUEUE._replace(lost_s=2.0), 200),
        every_hour(QUEUE._replace(x_m=15.0)),
        every_hour(QUEUE, 20) + every_hour(CROSSING._replace(x_m=5.0, y_m=1.0, vendor="Corvid"), 30),
        [entry._replace(from_s=QUEUE.from_s + 60.0) for entry in every_hour(QUEUE, 40)]
        + every_hour(loss("following", "Yard", 60.0, 60.0), 5),
        every_hour(MEETING, 5) + every_hour(loss("following", "Lane", 30.0, 21.0), 20),
        every_hour(MEETING._replace(place="Yard")),
        every_hour(CROSSING._replace(vendor="Corvid")),
    ],
    ids=[
        "too little",
        "no long waits",
        "far from the dock",
        "others cross near the dock",
        "a single jam",
        "few meetings among other losses",
        "no aisle",
        "one vendor only",
    ],
)
def test_thin_evidence_suggests_nothing(entries: list[LedgerEntry]) -> None:
    found = evidence(entries)
    assert not suggestions(found)
    assert none_because(found) == NOTHING_STANDS_OUT


def test_an_empty_ledger_says_that_too_little_was_lost() -> None:
    found = evidence([])
    assert not found_suggestions(found, SuggestedPlaces.of(SITE))
    assert none_because(found) == TOO_LITTLE


def test_no_more_than_five_are_suggested_the_largest_first() -> None:
    entries = every_hour(QUEUE) + every_hour(MEETING._replace(lost_s=40.0)) + every_hour(CROSSING._replace(lost_s=30.0))
    assert [found.kind for found in suggestions(evidence(entries))] == ["one_way", "dock", "priority"]


def test_aisles_are_zones_of_that_kind_and_long_areas() -> None:
    places = SuggestedPlaces.of(load(demo_site()))
    names = {key.place for key in places.aisles}
    assert {"Annex lane", "Aisle 4", "Dock aisle"} <= names
    assert names.isdisjoint({"Middle crossing", "Mezzanine", "Train yard"})
    assert {place.kind for place in places.served} == {"charger"}
