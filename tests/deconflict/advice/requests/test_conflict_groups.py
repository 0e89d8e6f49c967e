"""Groups of conflicts that share robots."""

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np
import pytest

from deconflict.advice.expected_loss import expected_loss_s
from deconflict.advice.requests.hold_requests import MOST_ASKED, ConflictGroup, ConflictGroups
from deconflict_client.advisory import ConflictAdvisory, Hold, Recommendation, moment
from ingest.batch import Pair
from tests.deconflict.engine.made_engine import NOW_S
from tests.helpers.made_advisories import made

PAIRS = list(combinations("abcdefghijklmnop", 2))
HELD = Recommendation(holds=(Hold(robot="a", hold_s=1.0),), cost_s=1.0, bound_s=1.0, proven_optimal=True)


def conflict(rng: np.random.Generator, pair: tuple[str, str], now_s: float) -> ConflictAdvisory:
    advice = HELD if rng.random() < 0.3 else None
    return made(1, robots=pair, predicted_at=moment(now_s + rng.uniform(-0.5, 5.0)), recommendation=advice)


def changes(
    before: Mapping[Pair, ConflictAdvisory], conflicts: Mapping[Pair, ConflictAdvisory]
) -> dict[Pair, ConflictAdvisory | None]:
    pairs = before.keys() | conflicts.keys()
    return {pair: conflicts.get(pair) for pair in pairs if before.get(pair) is not conflicts.get(pair)}


def is_connected(pairs: Sequence[Pair]) -> bool:
    """Whether one reaches each robot of the pairs from the first one, over shared robots."""
    reached = set(pairs[0])
    for _ in pairs:
        for pair in pairs:
            if not reached.isdisjoint(pair):
                reached.update(pair)
    return reached.issuperset(robot for pair in pairs for robot in pair)


@pytest.mark.parametrize("seed", range(10))
def test_groups_hold_all_conflicts_ahead_and_share_no_robot(seed: int) -> None:
    rng, groups, sizes = np.random.default_rng(seed), ConflictGroups(), set[int]()
    conflicts: dict[Pair, ConflictAdvisory] = {}
    for step in range(50):
        now_s, before = NOW_S + step / 10, conflicts
        rows = rng.choice(len(PAIRS), rng.integers(12), replace=False)
        conflicts = {PAIRS[row]: conflict(rng, PAIRS[row], now_s) for row in rows}
        groups.update(now_s, changes(before, conflicts))
        ahead = sorted(pair for pair, advisory in conflicts.items() if advisory.predicted_at > moment(now_s))
        assert sorted(pair for pairs in groups.all for pair in pairs) == ahead
        robots = [{robot for pair in pairs for robot in pair} for pairs in groups.all]
        assert sum(map(len, robots)) == len(set[str]().union(*robots))
        assert all(groups.group_of(pair) is group for group in groups.all.values() for pair in group.pairs)
        assert all(is_connected(pairs) for pairs in groups.all)
        sizes |= {len(pairs) for pairs in groups.all}
    assert len(sizes) > 3


@pytest.mark.parametrize("seed", range(10))
def test_groups_that_are_kept_are_those_that_would_be_made(seed: int) -> None:
    rng, groups, conflicts = np.random.default_rng(seed), ConflictGroups(), dict[Pair, ConflictAdvisory]()
    for step in range(60):
        now_s, before = NOW_S + (step if step < 30 else step - 20) / 10, dict(conflicts)
        for row in rng.choice(len(PAIRS), rng.integers(4), replace=False):
            if conflicts.pop(PAIRS[row], None) is None:
                conflicts[PAIRS[row]] = conflict(rng, PAIRS[row], now_s)
        groups.update(now_s, changes(before, conflicts))
        made_anew = ConflictGroups()
        made_anew.update(now_s, conflicts)
        assert groups.all == made_anew.all
        assert all(groups.group_of(pair) == made_anew.group_of(pair) for pair in conflicts)


LOSS_S, CHAIN = expected_loss_s(made(1)), (("a", "b"), ("b", "c"))


def test_a_group_holds_the_conflicts_that_share_robots_and_begins_with_the_first() -> None:
    groups = ConflictGroups()
    conflicts = {
        pair: made(1, robots=pair, predicted_at=moment(NOW_S + in_s))
        for pair, in_s in {("b", "c"): 4.0, ("a", "b"): 3.0, ("x", "y"): 2.0}.items()
    }
    groups.update(NOW_S, conflicts)
    assert set(groups.all.values()) == {
        ConflictGroup(moment(NOW_S + 3.0), CHAIN, (), (LOSS_S, LOSS_S), CHAIN),
        ConflictGroup(moment(NOW_S + 2.0), (("x", "y"),), (), (LOSS_S,), (("x", "y"),)),
    }


def test_advice_is_asked_for_the_soonest_conflicts_of_a_large_group() -> None:
    groups, n = ConflictGroups(), MOST_ASKED + 20
    conflicts = {
        pair: made(1, robots=pair, predicted_at=moment(NOW_S + 1.0 + (7 * row) % n / 10))
        for row, pair in enumerate((f"r{row:03}", f"r{row + 1:03}") for row in range(n))
    }
    groups.update(NOW_S, conflicts)
    (group,) = groups.all.values()
    assert len(group.pairs) == n
    assert len(group.asked) == MOST_ASKED
    latest = max(conflicts[pair].predicted_at for pair in group.asked)
    assert all(conflicts[pair].predicted_at > latest for pair in set(group.pairs) - set(group.asked))
