"""The table of watched pairs becomes shorter again after a rush, and a pass looks only at what may change."""

from deconflict.advisories.watched.watched_pairs import WatchedPairs
from deconflict.foresight.conflict_predictions import Prediction
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
        else:
            pairs._pairs["inside"][watched.row] = True
    everyone = {uuid for watched in kept for uuid in watched.pair}
    found, unpredicted = pairs.examine(in_columns([]), everyone, NOW_S, no_encounters)
    assert found == []
    assert [watched for watched, _ in unpredicted] == kept
    assert len(pairs._pairs) == len(pairs._advisories) == len(pairs._by_row) < 100
    assert [pairs.predicted_s(watched) for watched in kept] == [NOW_S - number for number in range(990, 1000)]
    assert all(pairs.get(watched.pair) is watched for watched in kept)
    assert pairs.add(("new", "pair")).row not in {watched.row for watched in kept}


def test_of_pairs_without_an_advisory_or_a_prediction_only_those_with_an_updated_robot_are_looked_at() -> None:
    pairs, ring = WatchedPairs(Conflict()), [("a", "b"), ("b", "c"), ("c", "d"), ("a", "d")]
    within = in_columns([Prediction(pair, NOW_S, 0.1, 0.1, fresh=True, probability=1.0) for pair in ring])
    for _ in range(2):
        pairs.examine(within, {"a", "b", "c", "d"}, NOW_S, no_encounters)
    looks = [
        pairs.examine(in_columns([]), updated, NOW_S, no_encounters).unpredicted
        for updated in (set[str](), {"b", "elsewhere"}, {"a", "b"}, set[str]())
    ]
    assert [[watched.pair for watched, _ in look] for look in looks] == [[], ring[:2], [*ring[:2], ring[3]], []]


def test_pairs_are_found_by_their_robots_until_they_are_forgotten() -> None:
    pairs = WatchedPairs(Conflict())
    first, second, _ = (pairs.add(pair) for pair in (("a", "b"), ("b", "c"), ("c", "d")))
    assert pairs.among({"a", "b", "c"}, {"a", "b", "d"}) == [first, second]
    pairs.forget_if_idle(first)
    assert pairs.among({"a", "b", "c"}, {"a", "b", "d"}) == [second]
    assert pairs.among({"a", "b", "c"}, set()) == []


def test_a_pair_of_which_nothing_is_left_to_remember_is_looked_at() -> None:
    pairs = WatchedPairs(Conflict())
    idle = pairs.add(("a", "b"))
    assert [watched for watched, _ in pairs.examine(in_columns([]), set(), NOW_S, no_encounters).unpredicted] == [idle]
