"""Shards and a single engine in one process, over the same floor, tick by tick."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from numpy.random import Generator

from deconflict.cluster.judging.shard import Shard, ShardRevision, conflicts_only_site
from deconflict.cluster.tiles.tile_channels import ChannelSorter, reach_m
from deconflict.cluster.tiles.tiles import Grid, Tile
from deconflict.engine.engine import Engine
from deconflict.settings.site import Conflict, Site
from deconflict_client.advisory import ConflictAdvisory
from ingest.batch import Batch, FloorPoint
from ingest.fleet.fleet import Fleet
from ingest.fleet.owners.vendor_registry import VendorRegistry
from ingest.fleet.shown.quarantine import Quarantine
from ingest.frames.frame_registry import FrameRegistry
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.settings import Datum
from tests.helpers.saying import HALL, LOFT, identity, points, status

SITE = Site(
    datums=(Datum(id=HALL, name="Hall"), Datum(id=LOFT, name="Loft")),
    conflict=Conflict(clearance_m=0.3, confirm=(2, 3)),
)
NOW_S = 1_790_000_000.0
FASTEST_MPS = 2.0
REACH_M = reach_m(FASTEST_MPS, SITE.conflict)
TICKS = 2
"""A second."""

Pose = tuple[float, float, float]
Course = Callable[[float], Pose]
"""Seconds since the start to x, y, yaw."""


def fleet() -> Fleet:
    return Fleet(VendorRegistry(()), FrameRegistry(SITE.datums, SITE.vendors), SITE.reading, Measures(), Quarantine())


@dataclass
class Ingests:
    """Two, each with half of the robots, which report once a second at moments of their own."""

    courses: Mapping[str, Course]
    datums: Mapping[str, str] = field(default_factory=dict)
    fleets: tuple[Fleet, Fleet] = field(default_factory=lambda: (fleet(), fleet()))

    def batches(self, tick: int) -> list[Batch]:
        for number, name in enumerate(self.courses):
            if tick % TICKS == number // 2 % TICKS:
                self._report(self.fleets[number % 2], name, tick / TICKS)
        return [fleet.next_batch(NOW_S + tick / TICKS) for fleet in self.fleets]

    def _report(self, receiving_fleet: Fleet, name: str, t: float) -> None:
        line = Connection(1)
        if t < 1:
            receiving_fleet.receive(identity(name, NOW_S + t), NOW_S + t, line)
        x, y, yaw = self.courses[name](t)
        path = points(*((NOW_S + t + i, *self.courses[name](t + i)) for i in range(1, 11)))
        datum = self.datums.get(name, HALL)
        location = {"x": x, "y": y, "angle": path[0]["angle"], "planarDatum": datum}
        document: dict[str, Any] = {"path": path, "location": location}
        receiving_fleet.receive(status(name, NOW_S + t, yaw_rad=yaw, **document), NOW_S + t, line)


class Single:
    """What the service on one machine tells."""

    def __init__(self) -> None:
        self.engine = Engine(conflicts_only_site(SITE), conflicts_only=True)

    def step(self, tick: int, batches: Iterable[Batch]) -> list[ConflictAdvisory]:
        for batch in batches:
            self.engine.receive(batch)
        advisories = self.engine.step(NOW_S + tick / TICKS)
        return [advisory for advisory in advisories if isinstance(advisory, ConflictAdvisory)]


class Shards:
    """Engines that share the tiles of a grid, some of them split."""

    def __init__(self, grid: Grid, count: int, split: Iterable[Tile] = ()) -> None:
        self.grid, self._split = grid, frozenset(split)
        self.shards = [
            Shard(Engine(conflicts_only_site(SITE), conflicts_only=True), grid, REACH_M) for _ in range(count)
        ]
        self._sorters = [ChannelSorter(grid, SITE.conflict, REACH_M) for _ in range(2)]
        self.owners: dict[Tile, int] = {}
        self.revisions: list[ShardRevision] = []
        self.rows = self.heard = 0

    def cover(self, datums: Sequence[str], half_m: float, owner: Callable[[Tile], int]) -> None:
        """Give every leaf of a square about the middle of each floor an owner."""
        for datum in datums:
            for root in self.grid.roots_near([FloorPoint(datum, 0.0, 0.0)], half_m):
                self.owners |= {leaf: owner(leaf) for leaf in self._leaves(root)}
        self.allot()

    def allot(self) -> None:
        for number, shard in enumerate(self.shards):
            shard.set_tiles(tile for tile, owner in self.owners.items() if owner == number)

    def _leaves(self, tile: Tile) -> list[Tile]:
        if tile not in self._split:
            return [tile]
        return [leaf for quarter in tile.quarters() for leaf in self._leaves(quarter)]

    def step(self, tick: int, batches: Sequence[Batch], *, lost: bool = False) -> list[ShardRevision]:
        """Every parcel to all that hear its channel, a step of each, and what each told to all unless it is lost."""
        parcels = [
            parcel
            for sorter, batch in zip(self._sorters, batches, strict=bool(batches))
            for parcel in sorter.sort(batch).items()
        ]
        shard_revisions = []
        for shard in self.shards:
            heard = shard.channels()
            mine = [Batch.from_bytes(batch.to_bytes()) for name, batch in parcels if name in heard]
            self.rows, self.heard = self.rows + sum(map(len, batches)), self.heard + sum(map(len, mine))
            shard.receive(mine)
            shard_revisions += shard.step(NOW_S + tick / TICKS)
        shard_revisions = [] if lost else shard_revisions
        for shard in self.shards:
            for shard_revision in shard_revisions:
                shard.adopt(shard_revision)
        self.revisions += shard_revisions
        return shard_revisions


def crossing(rng: Generator, half_m: tuple[float, float]) -> Course:
    """A robot in a hall that goes straight for somewhere else, at a speed of its own, and stays there."""
    x, y, there_x, there_y = (rng.uniform(-1, 1, 4) * [*half_m, *half_m]).tolist()
    speed_mps = float(rng.uniform(0.5, FASTEST_MPS))
    away_m = float(max(((there_x - x) ** 2 + (there_y - y) ** 2) ** 0.5, 1.0))
    yaw = float(rng.uniform(-3, 3))

    def course(t: float) -> Pose:
        share = min(speed_mps * t / away_m, 1.0)
        return x + share * (there_x - x), y + share * (there_y - y), yaw

    return course
