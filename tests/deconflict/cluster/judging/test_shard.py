"""Shards tell what one engine would tell, whatever the tiling."""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable
from math import pi

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from deconflict.advisories.advisory_counts import NEAR_MISSES
from deconflict.cluster.tiles.tiles import Grid, Tile
from deconflict_client.advisory import AdvisoryState, ClearedCode, ConflictAdvisory
from metrics.monitoring.exposition import combine
from tests.deconflict.cluster.made_shards import NOW_S, REACH_M, TICKS, Course, Ingests, Shards, Single, crossing
from tests.helpers.saying import HALL, LOFT

pytestmark = pytest.mark.usefixtures("untaught")


def by_id(advisories: Iterable[ConflictAdvisory]) -> dict[str, list[ConflictAdvisory]]:
    revisions = defaultdict(list)
    for advisory in advisories:
        revisions[advisory.id].append(advisory)
    return dict(revisions)


def compared(courses: dict[str, Course], datums: dict[str, str], shards: Shards, seconds: int) -> Counter[str]:
    """Runs both; how often each thing happened, once they are seen to be equal."""
    ingests, single = Ingests(courses, datums), Single()
    whole: list[ConflictAdvisory] = []
    parts: list[ConflictAdvisory] = []
    for tick in range(TICKS * seconds):
        batches = ingests.batches(tick)
        whole += single.step(tick, batches)
        parts += [shard_revision.advisory for shard_revision in shards.step(tick, batches)]
        assert sorted(parts, key=lambda part: (part.updated_at, part.robots, part.revision)) == sorted(
            whole, key=lambda advisory: (advisory.updated_at, advisory.robots, advisory.revision)
        )
    near = single.engine.measures.values[NEAR_MISSES]
    assert joined_sum(shards, NEAR_MISSES) == near
    return Counter(advisory.state.value for advisory in whole) | Counter({NEAR_MISSES: int(near[()])})


def joined_sum(shards: Shards, name: str) -> dict[tuple[str, ...], float]:
    """What all shards measure together."""
    return combine([measure for shard in shards.shards for measure in shard.measures()]).values[name]


def strips(grid: Grid, count: int, half_m: float) -> Callable[[Tile], int]:
    """Owners side by side from west to east."""

    def owner(tile: Tile) -> int:
        west_m, _, side_m = grid.square(tile)
        return min(max(int((west_m + side_m / 2 + half_m) / (2 * half_m) * count), 0), count - 1)

    return owner


@settings(max_examples=6, derandomize=True, phases=[Phase.explicit, Phase.reuse, Phase.generate])
@given(
    seed=st.integers(0, 10_000),
    side_m=st.sampled_from([6.0, 12.5, 25.0, 40.0]),
    count=st.integers(2, 4),
    halvings=st.integers(0, 2),
    mixed=st.booleans(),
)
def test_shards_publish_what_one_engine_publishes_whatever_the_tiling(
    seed: int, side_m: float, count: int, halvings: int, mixed: bool
) -> None:
    rng, grid = np.random.default_rng(seed), Grid(side_m)
    courses = {"X": crossing_at(0.0, 9.0, 0.0), "Y": crossing_at(0.0, 0.0, 9.0)}
    courses |= {f"R-{number}": crossing(rng, (90.0, 12.0)) for number in range(22)}
    datums = {name: str(rng.choice([HALL, LOFT], p=[0.8, 0.2])) for name in courses if "R" in name}
    split = {Tile(HALL, column, row) for column in range(-20, 20) for row in range(-4, 4) if rng.random() < 0.3}
    if halvings > 1:
        split |= {tile.quarters()[1] for tile in split}
    shards = Shards(grid, count, split if halvings else ())
    shards.cover((HALL, LOFT), 100.0, (lambda _: int(rng.integers(count))) if mixed else strips(grid, count, 90.0))
    counts = compared(courses, datums, shards, 16)
    assert counts.pop(NEAR_MISSES) > 0
    counted = joined_sum(shards, "deconflict_advisories_total")
    assert counted == {("conflict", state): float(count) for state, count in counts.items()}
    assert counts[AdvisoryState.RAISED.value] > 0
    assert mixed or shards.heard < 0.9 * count * shards.rows


def behind(t: float) -> tuple[float, float, float]:
    """Comes up to the robot in front of it, stays close for half a minute, and falls back."""
    return -21.0 + 1.6 * t + 0.1 * min(t, 20.0) - 0.3 * max(t - 50.0, 0.0), 0.0, 0.0


def halves(shards: Shards) -> Shards:
    """The west of the hall is the first shard's."""
    shards.cover((HALL, LOFT), 200.0, lambda tile: int(tile.column >= 0))
    return shards


def test_an_advisory_stays_with_the_owner_of_its_home_however_far_the_pair_drives() -> None:
    """A pair that leaves its owner's reach with its advisory open, into a shard that never saw it begin."""
    courses: dict[str, Course] = {"A": behind, "B": lambda t: (-18.8 + 1.6 * t, 0.0, 0.0)}
    shards = halves(Shards(Grid(20.0), 2))
    compared(courses, {}, shards, 65)
    raised, *_, cleared = shards.revisions
    assert raised.home == cleared.home
    assert raised.home.x_m < 0
    cleared_s = cleared.advisory.updated_at.timestamp() - NOW_S
    assert behind(cleared_s)[0] > 20.0 + REACH_M


def test_a_robot_that_appears_elsewhere_leaves_no_copy_behind() -> None:
    courses: dict[str, Course] = {
        "A": lambda t: (-60.0 + t, 0.0, 0.0),
        "B": lambda t: (-33.0 - t, 0.0, pi),
        "C": lambda t: (20.0 + t, 8.0, 0.0),
    }
    ingests, single, shards = Ingests(courses), Single(), halves(Shards(Grid(20.0), 2))
    whole: list[ConflictAdvisory] = []
    for tick in range(TICKS * 40):
        if tick == TICKS * 8:
            courses["A"] = lambda t: (60.0 - t, 8.0, pi)
        batches = ingests.batches(tick)
        whole += single.step(tick, batches)
        shards.step(tick, batches)
    lives = [
        [(advisory.robots, advisory.state) for advisory in advisories if advisory.state is not AdvisoryState.UPDATED]
        for advisories in (whole, [shard_revision.advisory for shard_revision in shards.revisions])
    ]
    assert lives[0] == lives[1]
    assert len(lives[0]) == 4


def test_a_robot_faster_than_the_setting_goes_to_its_whole_floor() -> None:
    courses: dict[str, Course] = {
        "A": lambda t: (-110.0 + 5.0 * t, 0.0, 0.0),
        "B": lambda t: (6.0, -6.0 + 0.3 * t, 1.57),
    }
    assert compared(courses, {}, halves(Shards(Grid(20.0), 2)), 30)[AdvisoryState.RAISED.value] == 1


@pytest.mark.parametrize("told_in_time", [True, False])
def test_a_shard_that_takes_over_tiles_continues_their_advisories(told_in_time: bool) -> None:
    """The west's owner dies, once as all that it decided is told, once before its last revisions are."""
    courses = {"A": crossing_at(-12.0, 14.0, 0.0), "B": crossing_at(-12.0, 0.0, 14.0)}
    ingests, single, shards = Ingests(courses), Single(), halves(Shards(Grid(20.0), 2))
    whole: list[ConflictAdvisory] = []
    parts: list[ConflictAdvisory] = []
    for tick in range(TICKS * 25):
        batches = ingests.batches(tick)
        whole += single.step(tick, batches)
        if tick == TICKS * 8:
            assert {part.state for part in parts} <= {AdvisoryState.RAISED, AdvisoryState.UPDATED}
            shards.owners = dict.fromkeys(shards.owners, 1)
            shards.allot()
            shards.shards[0].set_tiles(())
        parts += [
            shard_revision.advisory
            for shard_revision in shards.step(tick, batches, lost=not told_in_time and tick < TICKS * 8)
        ]
    assert [part.id for part in parts] == [whole[0].id] * len(parts)
    assert [part.revision for part in parts] == list(range(1, len(parts) + 1))
    assert parts[-1].state is AdvisoryState.CLEARED
    assert not told_in_time or parts == whole


def test_a_shard_publishes_only_on_robots_that_it_hears_while_it_hears_no_others() -> None:
    """Robots of other ingests are silent for it, for so long that it takes them to have left."""
    courses = {"A": crossing_at(-12.0, 14.0, 0.0), "B": crossing_at(-12.0, 0.0, 14.0)}
    ingests, shards = Ingests(courses), Shards(Grid(20.0), 1)
    shards.cover((HALL,), 200.0, lambda _: 0)
    (shard,), lost_from, lost_to = shards.shards, TICKS * 9, TICKS * 200
    for tick in range(TICKS * 214):
        t_s = NOW_S + tick / TICKS
        shard.hear_only(set() if lost_from <= tick < lost_to else None, t_s)
        shards.step(tick, ingests.batches(tick) if not lost_from <= tick < lost_to else [])
        if lost_from <= tick < lost_to:
            ingests.batches(tick)
    written = [revision.advisory for revision in shards.revisions]
    assert [each.state for each in written if each.state is not AdvisoryState.UPDATED] == [
        AdvisoryState.RAISED,
        AdvisoryState.CLEARED,
    ]
    assert written[-1].cleared_code in (ClearedCode.PASSED, ClearedCode.UNPREDICTED)


def crossing_at(x_m: float, west_m: float, south_m: float) -> Course:
    """Comes to (x_m, 0) from the west or from the south."""
    if south_m:
        return lambda t: (x_m, t - south_m, pi / 2)
    return lambda t: (x_m + t - west_m, 0.0, 0.0)
