"""The table of watched pairs becomes shorter again after a rush."""

from deconflict.advisories.watched.watched_pairs import WatchedPairs
from deconflict.settings.site import Conflict
from deconflict.sweep.geometry.encounter import Encounters
from tests.helpers.made_predictions import in_columns

NOW_S = 1_790_000_000.0


def no_encounters(*_: object) -> Encounters:
    raise AssertionError


def test_rows_of_pairs_that_are_not_watched_any_more_are_dropped() -> None:
    pairs = WatchedPairs(Conflict())
    rush = [pairs.add((f"a{n}", f"b{n}")) for n in range(1000)]
    kept = rush[990:]
    for number, watched in enumerate(rush):
        pairs.set_predicted_s(watched, NOW_S - number)
        if watched not in kept:
            pairs.forget_if_idle(watched)
    found, unpredicted = pairs.examine(in_columns([]), NOW_S, no_encounters)
    assert found == []
    assert [watched for watched, _ in unpredicted] == kept
    assert len(pairs._pairs) == len(pairs._advisories) == len(pairs._by_row) < 100
    assert [pairs.predicted_s(watched) for watched in kept] == [NOW_S - number for number in range(990, 1000)]
    assert all(pairs.get(watched.pair) is watched for watched in kept)
    assert pairs.add(("new", "pair")).row not in {watched.row for watched in kept}
