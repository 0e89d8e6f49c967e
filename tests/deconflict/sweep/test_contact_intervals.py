"""Contact intervals merged and summarised by pair, and the names of listed pairs."""

from itertools import groupby

import numpy as np

from deconflict.sweep.contact_intervals import CONTACT_INTERVAL, ContactIntervals, by_pair, merged
from ingest.batch import Ints

RNG = np.random.default_rng(21)
ROBOTS = 30
RANKS = RNG.permutation(ROBOTS)


def made(count: int, ranks: Ints) -> ContactIntervals:
    """So many different intervals, sorted. Many have equal separations."""
    chosen = RNG.choice(ROBOTS * ROBOTS * 12, count, replace=False)
    a, b, slab = chosen // (12 * ROBOTS), chosen // 12 % ROBOTS, 100 + chosen % 12
    order = np.lexsort((slab, ranks[b], ranks[a]))
    contact = slab + RNG.uniform(0, 1, count)
    separation = RNG.choice([0.0, 0.1, 0.2], count)
    rows = list(zip(a, b, slab, contact, separation, contact + 0.25, strict=True))
    return np.array(rows, CONTACT_INTERVAL)[order]


def test_a_pair_has_its_first_contact_and_the_first_of_its_smallest_separations() -> None:
    intervals = made(2000, RANKS)
    found, now_s, expected = np.arange(ROBOTS) % 4 == 0, 100.5, []
    for (a, b), some in groupby(intervals.tolist(), key=lambda row: row[:2]):
        every = list(some)
        *_, separation, at = min(every, key=lambda row: row[4])
        contact = max(min(row[3] for row in every), now_s)
        expected.append((a, b, contact, separation, at, bool(found[a] or found[b])))
    columns = by_pair(intervals, found, now_s)
    assert list(zip(*(column.tolist() for column in columns), strict=True)) == expected
    assert 100 < len(expected) < 1000


def test_parts_are_joined_in_the_order_of_keys_and_slabs() -> None:
    whole = made(2000, RANKS)
    part = RNG.integers(0, 4, len(whole))
    some = np.empty(0, CONTACT_INTERVAL)
    for number in range(4):
        some = merged(some, whole[part == number], RANKS)
        assert some.tolist() == whole[part <= number].tolist()
