"""What is said of the worst places stands for a shift."""

from datetime import UTC, datetime

import pytest

from deconflict.operator.suggestions.suggested_places import SuggestedPlaces
from deconflict.operator.suggestions.suggestion_routes import StandingPlaces, shift_begin, standing
from deconflict.operator.suggestions.worst_places import worst_places
from deconflict_client.answers.suggestion_models import Saving, WorstPlace
from tests.deconflict.operator.suggestions.made_evidence import SITE, every_hour, evidence, loss

NOTHING: list[WorstPlace] = []


def place(name: str, low_s: float, high_s: float, since_s: float) -> WorstPlace:
    [found] = worst_places(evidence(every_hour(loss("head_on", "Lane", 30.0, 21.0))), SuggestedPlaces.of(SITE), since_s)
    assert found.best
    best = found.best.model_copy(update={"saving": Saving(low_s_per_hour=low_s, high_s_per_hour=high_s)})
    return found.model_copy(update={"place": name, "best": best})


@pytest.mark.parametrize(("clock", "begin"), [("05:29", 21), ("05:30", 5), ("13:00", 5), ("21:30", 21)])
def test_a_shift_begins_at_a_time_of_the_site_file_maybe_on_the_day_before(clock: str, begin: int) -> None:
    now, day = datetime.fromisoformat(f"2026-03-04T{clock}:00+00:00"), 3 if clock == "05:29" else 4
    assert shift_begin(now, ("05:30", "21:30")).replace(minute=0) == datetime(2026, 3, day, begin, tzinfo=UTC)


@pytest.mark.parametrize(("low_s", "since_s"), [(290.0, 1.0), (310.0, 2.0)])
def test_only_what_is_better_beyond_the_doubt_replaces_what_stands(low_s: float, since_s: float) -> None:
    [stands] = standing([place("Lane", 100.0, 300.0, 1.0)], [place("Lane", low_s, 900.0, 2.0)])
    assert stands.since_s == since_s


def test_within_a_shift_places_are_added_up_to_five_and_none_goes() -> None:
    kept = [place(name, 100.0, 300.0, 1.0) for name in "ABCD"]
    found = [place(name, 100.0, 300.0, 2.0) for name in "XYZ"]
    assert [each.place for each in standing(kept, found)] == ["A", "B", "C", "D", "X"]


def test_a_change_of_shift_makes_it_anew() -> None:
    keeper = StandingPlaces()
    assert keeper.update(1.0, NOTHING, [place("A", 100.0, 300.0, 5.0)])[0].since_s == 5.0
    assert keeper.update(1.0, NOTHING, [place("A", 100.0, 300.0, 6.0)])[0].since_s == 5.0
    assert [each.place for each in keeper.update(9.0, [place("B", 1.0, 2.0, 9.0)], NOTHING)] == ["B"]
