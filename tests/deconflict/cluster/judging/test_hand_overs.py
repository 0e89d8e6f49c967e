"""Tiles that change their engines at random, in simulated time: what is told stays whole.

As in a cluster, each engine reads the owner table a little later than another, hears a channel from when it needs it,
with the last seconds again, and its revisions are accepted only after those that they follow.
"""

from collections import defaultdict
from collections.abc import Sequence
from math import pi

import numpy as np
import pytest
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st

from deconflict.cluster.judging.shard import ShardRevision
from deconflict.cluster.judging.stream_writer import follows
from deconflict.cluster.nats.subscriptions import REPLAYED_S
from deconflict.cluster.tiles.tiles import Grid, Tile
from deconflict_client.advisory import AdvisoryState, ClearedCode, ConflictAdvisory
from ingest.batch import Batch, Pair
from tests.deconflict.cluster.made_shards import NOW_S, SITE, TICKS, Course, Ingests, Shards, Single
from tests.helpers.saying import HALL

SECONDS, HALF_M = 120, 120.0
LATEST_TICKS = 3
"""An engine reads a change of the table, or a revision of another, at most so much later."""
UNHEARD = {ClearedCode.LEFT, ClearedCode.LEFT_IN_SILENCE, ClearedCode.BOTH_SILENT}


pytestmark = pytest.mark.usefixtures("untaught")


class HandOvers(Shards):
    """Engines whose tiles change, and the stream that they write to."""

    def __init__(self, grid: Grid, count: int, seed: int) -> None:
        super().__init__(grid, count)
        self._rng = np.random.default_rng(seed)
        self._late = self._rng.integers(0, LATEST_TICKS + 1, count).tolist()
        """By engine, how many ticks it is behind with the table and the stream."""
        self._tables: list[tuple[int, dict[Tile, int]]] = []
        """Every owner table, and from which tick on it holds."""
        self._parcels: list[tuple[int, str, bytes]] = []
        self._subscribed: list[dict[str, int]] = [{} for _ in range(count)]
        """By engine, from which tick on it hears each channel that it needs."""
        self._read = [0] * count
        """By engine, how many records of the stream it has read."""
        self._written: list[tuple[int, ShardRevision]] = []
        self._last: dict[Pair, ConflictAdvisory] = {}

    @property
    def written(self) -> list[ConflictAdvisory]:
        return [revision.advisory for _, revision in self._written]

    def hand_over(self, tick: int) -> None:
        """Divide the hall anew, from west to east, among all engines or all but one."""
        count = len(self.shards)
        engines = self._rng.permutation(count)[: count - int(self._rng.integers(2))]
        cuts = np.sort(self._rng.uniform(-HALF_M, HALF_M, len(engines) - 1))
        for tile in self.owners:
            self.owners[tile] = int(engines[np.searchsorted(cuts, self.grid.square(tile)[0])])
        self._tables.append((tick, dict(self.owners)))

    def pass_of(self, tick: int, batches: Sequence[Batch]) -> None:
        for sorter, batch in zip(self._sorters, batches, strict=True):
            self._parcels += [(tick, name, parcel.to_bytes()) for name, parcel in sorter.sort(batch).items()]
        for number, shard in enumerate(self.shards):
            late = self._late[number]
            while self._read[number] < len(self._written) and self._written[self._read[number]][0] <= tick - late:
                shard.adopt(self._written[self._read[number]][1])
                self._read[number] += 1
            owners = next(table for since, table in reversed(self._tables) if since <= max(tick - late, 0))
            tiles = frozenset(tile for tile, owner in owners.items() if owner == number)
            if tiles != shard.area.tiles:
                shard.set_tiles(tiles)
            shard.receive(self._heard(number, tick, shard.channels()))
            for revision in shard.step(NOW_S + tick / TICKS):
                self._write(number, tick, revision)

    def _heard(self, number: int, tick: int, needed: set[str]) -> list[Batch]:
        """The parcels of this tick, and of channels that are new to an engine those of the last seconds."""
        begun = self._subscribed[number]
        self._subscribed[number] = {name: begun.get(name, tick + 1 + self._late[number]) for name in needed}
        since = tick - REPLAYED_S * TICKS
        return [
            Batch.from_bytes(parcel)
            for at, name, parcel in self._parcels
            if (from_tick := self._subscribed[number].get(name, tick + 1)) <= tick
            if at == tick or (from_tick == tick and at >= since)
        ]

    def _write(self, number: int, tick: int, revision: ShardRevision) -> None:
        last = self._last.get(revision.advisory.robots)
        if last is None or follows(revision.advisory, last):
            self._last[revision.advisory.robots] = revision.advisory
            self._written.append((tick, revision))
        else:
            standing = next(each for _, each in reversed(self._written) if each.advisory is last)
            self.shards[number].adopt(standing, overruled=True)


@settings(max_examples=2, derandomize=True, phases=[Phase.explicit, Phase.reuse, Phase.generate], deadline=None)
@given(seed=st.integers(0, 10_000), side_m=st.sampled_from([12.5, 20.0, 32.0]), count=st.integers(2, 3))
@example(seed=7, side_m=20.0, count=3)
@example(seed=11, side_m=20.0, count=3)
def test_advisories_stay_whole_while_tiles_change_their_engines(seed: int, side_m: float, count: int) -> None:
    rng = np.random.default_rng(seed)
    courses = {f"R-{number}": to_and_fro(rng) for number in range(10)}
    ingests, single, shards = Ingests(courses), Single(), HandOvers(Grid(side_m), count, seed)
    shards.cover((HALL,), HALF_M + 20.0, lambda _: 0)
    shards.hand_over(0)
    whole: list[ConflictAdvisory] = []
    due = 4
    for tick in range(TICKS * SECONDS):
        batches = ingests.batches(tick)
        whole += single.step(tick, batches)
        if tick == due:
            shards.hand_over(tick)
            due += int(rng.choice([4, 16, 40, 80]))
        shards.pass_of(tick, batches)
    assert [advisory.cleared_because for advisory in shards.written if advisory.cleared_code in UNHEARD] == []
    assert {each.robots for each in shards.written} == {each.robots for each in whole}
    assert raised_twice(shards.written) == []
    assert numbered(shards.written)


def to_and_fro(rng: np.random.Generator) -> Course:
    """A robot that drives between two places of a part of the hall, at a speed of its own, without end."""
    middle_m = float(rng.choice([-0.8, -0.3, 0.3, 0.8])) * HALF_M
    x, y, there_x, there_y = (rng.uniform(-1, 1, 4) * [12.0, 10.0, 12.0, 10.0]).tolist()
    way_m, speed_mps = float(np.hypot(there_x - x, there_y - y)), float(rng.uniform(0.5, 1.8))
    yaw = float(np.arctan2(there_y - y, there_x - x))

    def course(t: float) -> tuple[float, float, float]:
        laps, along_m = divmod(speed_mps * t, way_m)
        share = along_m / way_m if laps % 2 == 0 else 1.0 - along_m / way_m
        return middle_m + x + share * (there_x - x), y + share * (there_y - y), yaw + pi * (laps % 2)

    return course


def raised_twice(advisories: Sequence[ConflictAdvisory]) -> list[Pair]:
    """The pairs of which an advisory is on the same conflict as the one before."""
    last: dict[Pair, ConflictAdvisory] = {}
    pairs = []
    for each in advisories:
        before, last[each.robots] = last.get(each.robots), each
        if before and before.id != each.id:
            later_s = (each.predicted_at - before.predicted_at).total_seconds()
            pairs += [each.robots] if later_s <= SITE.conflict.clear_after_s else []
    return pairs


def numbered(advisories: Sequence[ConflictAdvisory]) -> bool:
    """Whether the revisions of each advisory are complete, and only the last one may clear it."""
    lives = defaultdict(list)
    for advisory in advisories:
        lives[advisory.id].append(advisory)
    return all(
        [each.revision for each in life] == list(range(1, len(life) + 1))
        and AdvisoryState.CLEARED not in [each.state for each in life[:-1]]
        for life in lives.values()
    )
