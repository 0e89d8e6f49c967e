"""ConflictGroups that are kept from step to step are those that would be found anew."""

from itertools import combinations

import numpy as np
import pytest

from deconflict.advice.conflict_groups import ConflictGroup, ConflictGroups
from deconflict.advisory import ConflictAdvisory, Hold, Recommendation, moment
from tests.deconflict.engine.made_engine import NOW_S
from tests.helpers.made_advisories import made

PAIRS = list(combinations("abcdefghijklmnop", 2))
HELD = Recommendation(holds=(Hold(robot="a", hold_s=1.0),), cost_s=1.0, bound_s=1.0, proven_optimal=True)


def conflict(rng: np.random.Generator, pair: tuple[str, str], now_s: float) -> ConflictAdvisory:
    advice = HELD if rng.random() < 0.3 else None
    return made(1, robots=pair, predicted_at=moment(now_s + rng.uniform(-0.5, 5.0)), recommendation=advice)


def as_sets(groups: ConflictGroups) -> set[tuple[ConflictGroup, frozenset[str]]]:
    """Each group, and the robots that lead to it."""
    return {
        (group, frozenset(robot for pair in group.pairs for robot in pair if groups.group_of((robot, "")) is group))
        for group in groups.all.values()
    }


@pytest.mark.parametrize("seed", range(10))
def test_updated_groups_are_the_same_as_groups_built_anew(seed: int) -> None:
    rng, kept, sizes = np.random.default_rng(seed), ConflictGroups(), set[int]()
    conflicts: dict[tuple[str, str], ConflictAdvisory] = {}
    for step in range(200):
        now_s = NOW_S + step / 10
        changed = {PAIRS[row] for row in rng.integers(len(PAIRS), size=rng.integers(3))}
        for pair in changed:
            conflicts.pop(pair, None)
            if rng.random() < 0.7:
                conflicts[pair] = conflict(rng, pair, now_s)
        kept.update(now_s, conflicts, changed)
        anew = ConflictGroups()
        anew.update(now_s, conflicts, conflicts)
        assert as_sets(kept) == as_sets(anew)
        sizes |= {len(group.pairs) for group in anew.all.values()}
        ahead = {pair for pair, advisory in conflicts.items() if advisory.predicted_at > moment(now_s)}
        assert {pair for pairs in kept.all for pair in pairs} == ahead
    assert len(sizes) > 3


def test_a_group_holds_the_conflicts_that_share_robots_and_begins_with_the_first() -> None:
    groups = ConflictGroups()
    conflicts = {
        pair: made(1, robots=pair, predicted_at=moment(NOW_S + in_s))
        for pair, in_s in {("b", "c"): 4.0, ("a", "b"): 3.0, ("x", "y"): 2.0}.items()
    }
    groups.update(NOW_S, conflicts, conflicts)
    assert set(groups.all.values()) == {
        ConflictGroup(moment(NOW_S + 3.0), (("a", "b"), ("b", "c")), None),
        ConflictGroup(moment(NOW_S + 2.0), (("x", "y"),), None),
    }
