"""The cost of dividing a floor among engines: how many foreign robots each engine sees, and the traffic on the broker.

Positions and forecasts are synthetic. Tiles, channels and ownership are those of the product. Nothing is sent. Run it
as `python -m benchmarks.sharding`, or with `--sites 300 --robots 100000 1000000` for many sites of different sizes.
"""

import argparse
from dataclasses import astuple, dataclass, fields
from functools import reduce
from operator import add

import numpy as np

from benchmarks.floors import NOW_S, crowd
from deconflict.cluster.tiles.tile_channels import EVERY, ChannelSorter, RobotExtents, reach_m
from deconflict.cluster.tiles.tile_owners import OwnerTable, revised_table
from deconflict.cluster.tiles.tiles import Area, Grid, Tile
from deconflict.settings.site import Conflict
from ingest.batch import AMOUNTS, Basis, Batch, Destinations, Forecasts

FASTEST_MPS = 2.0
TICKS_PER_S = 10
ROBOTS_AN_ENGINE = 5000
"""Robots for each engine on a site with several engines."""
ROUNDS = 400
"""After this many revisions of the table the load is balanced."""


def batch_of(forecasts: Forecasts) -> Batch:
    n = len(forecasts)
    names = tuple(f"{number:08d}-0000-4000-8000-000000000000" for number in range(n))
    zeros, none = np.zeros(n), np.zeros(0)
    return Batch(
        now_s=NOW_S,
        floors=("0d6f4f0e-9d0c-4a6f-8a55-0c9f5f4a1b01",),
        robots=names,
        vendors=("Alder",) * n,
        models=("A1",) * n,
        names=tuple(f"Alder {name[:8]}" for name in names),
        states=("navigating",) * n,
        statuses=np.ones(n, np.int64),
        first_arrival_s=zeros,
        arrival_s=zeros,
        event_s=zeros,
        basis=np.full(n, int(Basis.PATH)),
        doubt_m=zeros,
        reports_within_s=zeros,
        amounts=np.zeros(n, AMOUNTS),
        forecasts=forecasts,
        destinations=Destinations(np.zeros(n + 1, np.int64), none, none, none, np.zeros(0, np.int64)),
        gone=(),
    )


def shared(batch: Batch, grid: Grid, reach: float, engines: int) -> OwnerTable:
    """The table when every tile has an owner and the load is balanced."""
    sorter = ChannelSorter(grid, Conflict(), reach)
    sorter.sort(batch)
    roots, table = sorter.roots(), OwnerTable()
    extents = RobotExtents.of(batch, Conflict())
    cells, counts = np.unique(np.floor(extents.at / grid.side_m).astype(np.int64), axis=0, return_counts=True)
    load = {Tile(batch.floors[0], *cell): float(count) for cell, count in zip(cells.tolist(), counts, strict=True)}
    members = [f"engine-{number:03d}" for number in range(engines)]
    for _ in range(ROUNDS):
        loads = {member: {tile: load.get(tile, 0.0) for tile in table.of(member)} for member in members}
        before, table = table, revised_table(table, loads, roots, grid.side_m, float("inf"))
        if table == before:
            break
    return table


def blocks(table: OwnerTable) -> OwnerTable:
    """The same tiles, with those of each engine side by side."""
    members = sorted(set(table.owners.values()))
    tiles = sorted(table.owners)
    return OwnerTable({tile: members[number * len(members) // len(tiles)] for number, tile in enumerate(tiles)})


def seen(batch: Batch, grid: Grid, reach: float, table: OwnerTable) -> list[int]:
    """The number of robots that each engine judges."""
    extents = RobotExtents.of(batch, Conflict())
    areas = [Area(grid, table.of(member)) for member in sorted(set(table.owners.values()))]
    return [int(area.within(batch.floors[0], extents.at, extents.at, reach).sum()) for area in areas]


def measured(robots: int, side_m: float, engines: int) -> str:
    batch, grid, reach = batch_of(crowd(robots, 25.0).forecasts(0.0)), Grid(side_m), reach_m(FASTEST_MPS, Conflict())
    table = shared(batch, grid, reach, engines)
    parts = ChannelSorter(grid, Conflict(), reach).sort(batch.take(np.arange(0, robots, TICKS_PER_S)))
    sent = sum(len(part.to_bytes()) for part in parts.values()) * TICKS_PER_S
    scattered, compact = (max(seen(batch, grid, reach, owners)) * engines / robots for owners in (table, blocks(table)))
    return (
        f"| {robots:,} | {side_m:g} | {engines} | {len(table.owners)} | {scattered:.2f} | {compact:.2f} "
        f"| {len(parts) * TICKS_PER_S:,} | {sent / 1e6:.1f} | {sent / robots:,.0f} |"
    )


@dataclass(frozen=True, slots=True)
class Shared:
    """The load of one site, or of all together, on a broker and on engines per second."""

    robots: int
    engines: int
    judged: int
    """Robots that engines judge. A robot counts once for each engine that judges it."""
    busiest: int
    """The largest number for one engine."""
    parcels: int
    bytes_in: int
    bytes_out: int

    def __add__(self, other: "Shared") -> "Shared":
        mine, others = astuple(self), astuple(other)
        summed = dict(
            zip([field.name for field in fields(self)], map(sum, zip(mine, others, strict=True)), strict=True)
        )
        return Shared(**summed | {"busiest": max(self.busiest, other.busiest)})


def site(robots: int, side_m: float, seed: int) -> Shared:
    """The load of a site with `robots` robots and as many engines as it needs."""
    grid, reach, engines = Grid(side_m), reach_m(FASTEST_MPS, Conflict()), -(-robots // ROBOTS_AN_ENGINE)
    batch = batch_of(crowd(robots, 25.0, seed=seed).forecasts(0.0))
    judged = seen(batch, grid, reach, shared(batch, grid, reach, engines))
    parts = ChannelSorter(grid, Conflict(), reach).sort(batch.take(np.arange(0, robots, TICKS_PER_S)))
    sent = {name: len(part.to_bytes()) * TICKS_PER_S for name, part in parts.items()}
    whole = sent[EVERY]
    by_tile = sum(sent.values()) - whole
    received = round(by_tile * sum(judged) / robots) + whole
    return Shared(robots, engines, sum(judged), max(judged), len(parts) * TICKS_PER_S, by_tile + whole, received)


def sizes(robots: int, sites: int, seed: int = 1) -> list[int]:
    """The number of robots of each site: a few sites have many, most have few."""
    share = np.random.default_rng(seed).lognormal(sigma=1.0, size=sites)
    return [max(round(robots * part), TICKS_PER_S) for part in (share / share.sum()).tolist()]


def group(robots: int, sites: int, side_m: float) -> str:
    of_sites = sizes(robots, sites)
    total = reduce(add, (site(size, side_m, seed) for seed, size in enumerate(of_sites)))
    return (
        f"| {total.robots:,} | {max(of_sites):,} | {total.engines} | {total.judged / total.robots:.2f} "
        f"| {total.busiest:,} | {total.parcels:,} | {total.bytes_in / 1e6:,.0f} | {total.bytes_out / 1e6:,.0f} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", type=int, nargs="*", default=[3000, 10_000])
    parser.add_argument("--sites", type=int, help="distribute the robots over this many sites")
    args = parser.parse_args()
    if args.sites:
        print("| robots | largest site | engines | judged | busiest engine | parcels/s | MB/s in | MB/s out |")
        print("| --- | --- | --- | --- | --- | --- | --- | --- |")
        for robots in args.robots:
            print(group(robots, args.sites, 64.0), flush=True)
        return
    print("| robots | tile, m | engines | tiles | judged | in strips | parcels/s | MB/s | bytes per status |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for robots in args.robots:
        for side_m in (32.0, 64.0, 128.0):
            for engines in (2, 4, 8):
                print(measured(robots, side_m, engines), flush=True)


if __name__ == "__main__":
    main()
