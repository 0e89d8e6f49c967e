"""Numbers of encounters: a bounded number of pairs, and none twice."""

import random
from collections import defaultdict
from itertools import combinations

import pytest

from deconflict.advisories import encounter_numbers
from deconflict.advisories.encounter_numbers import FORGOTTEN, EncounterNumbers
from ingest.batch import Pair

ROBOTS = [f"robot-{number}" for number in range(30)]
PAIRS = list(combinations(ROBOTS, 2))
MOST = 40


@pytest.fixture(autouse=True)
def few_pairs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(encounter_numbers, "MOST_PAIRS", MOST)


@pytest.mark.parametrize("seed", range(5))
def test_of_many_pairs_few_are_known_and_no_number_is_given_twice(seed: int) -> None:
    chosen, numbers, given = random.Random(seed), EncounterNumbers({}), defaultdict[Pair, list[int]](list)
    for step in range(5000):
        pair = chosen.choice(PAIRS)
        given[pair].append(numbers.next(pair))
        assert len(numbers) <= MOST
        if step % 500 == 0:  # an engine that starts again, or one with other settings
            numbers = EncounterNumbers(dict(sorted(numbers.items())))
    assert all(found == sorted(set(found)) for found in given.values())


def test_those_that_met_last_are_known_longest() -> None:
    numbers = EncounterNumbers({})
    often, *others = PAIRS
    for pair in others[: 3 * MOST]:
        numbers.next(often)
        numbers.next(pair)
    assert numbers.next(often) == 3 * MOST + 1
    assert numbers.next(others[0]) == numbers[FORGOTTEN] + 1


def test_what_is_taken_from_another_engine_is_bounded_too() -> None:
    numbers = EncounterNumbers({})
    numbers.take(dict.fromkeys(PAIRS, 7))
    assert len(numbers) <= MOST
    assert numbers.next(PAIRS[0]) == 8
    numbers.note(PAIRS[0], 3)
    assert numbers.next(PAIRS[0]) == 9
