"""One run: a cluster starts, is measured for some simulated seconds, and then loses an engine."""

import asyncio
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from math import isnan, nan
from pathlib import Path

import httpx
import numpy as np

from benchmarks import offer
from benchmarks.slow_motion.sampling import Moment, Sampler
from benchmarks.slow_motion.started_cluster import StartedCluster
from deconflict.cluster.nats.bus import Bus
from deconflict.cluster.nats.nats_tasks import end_tasks, open_bus
from deconflict.cluster.nats.stream_records import StreamPosition, StreamRecord
from deconflict.cluster.tiles.tile_channels import reach_m
from deconflict.cluster.tiles.tile_owners import OwnerTable
from deconflict.cluster.tiles.tiles import Area, Grid
from deconflict.settings.site import Conflict

START_WITHIN_S = 60.0
JUDGED_WITHIN_S = 15.0
CHECK_EVERY_S = 0.05


@dataclass(frozen=True)
class Takeover:
    """The death of an engine. Times are simulated seconds since then; nan if it has not happened in time."""

    tiles: int
    was_global: bool
    """Whether it ran the global judge."""
    noticed_s: float
    """Until all of its tiles have other owners."""
    judged_s: float
    """Until the new owners count statuses in all of its tiles with robots."""


@dataclass(frozen=True)
class Outcome:
    """What a run found."""

    robots: int
    engines: int
    stretch: float
    first: Moment
    """When all robots had reported. Between it and `before` the cluster settled."""
    before: Moment
    after: Moment
    sampler: Sampler
    tiles: list[int]
    """By engine, its tiles at the end."""
    seen: list[int]
    """By engine, the robots in its tiles and around them."""
    late_s: float
    """The greatest delay of a message of the loads."""
    takeover: Takeover | None = None
    faults: list[str] = field(default_factory=list)
    """What is wrong with the revisions of the whole run."""


async def run(
    robots: int, engines: int, stretch: float, began_s: float, settle_s: float, seconds: float, a_floor: int,
    calm: bool, tick_s: float, kill: bool,
) -> Outcome:  # fmt: skip
    """Run a cluster with about `a_floor` robots a floor, on calm floors or not.

    It is measured `settle_s` after all robots have reported. This process must be in the same stretched time.
    """
    floors = [len(part) for part in np.array_split(np.arange(robots), max(round(robots / a_floor), 1))]
    with tempfile.TemporaryDirectory(prefix="slow-") as folder:
        started = StartedCluster(Path(folder), stretch, began_s, floors, calm, tick_s)
        bus = Bus(started.cluster, started.site().store.keep_days)
        try:
            await open_bus(bus, asyncio.Event())
            async with httpx.AsyncClient(timeout=30.0, trust_env=False) as http:
                return await _measured(Sampler(started, bus, http), engines, settle_s, seconds, kill=kill)
        finally:
            await bus.close()
            started.kill()


async def _measured(sampler: Sampler, engines: int, settle_s: float, seconds: float, *, kill: bool) -> Outcome:
    started = sampler.started
    names = await _start(sampler, engines)
    sampling = asyncio.create_task(sampler.run())
    first = await sampler.moment()
    report("all robots report")
    await asyncio.sleep(settle_s)
    before = await sampler.moment()
    report("measuring")
    following = asyncio.create_task(sampler.follow_face())
    await asyncio.sleep(seconds)
    await end_tasks(following)
    after, table = await sampler.moment(), sampler.table
    report("measured")
    takeover = await _takeover(sampler, names[-1]) if kill else None
    late_s = max(load["late_s"] for load in started.end_loads())
    await end_tasks(sampling)
    return Outcome(
        robots=sum(started.floors),
        engines=engines,
        stretch=started.stretch,
        first=first,
        before=before,
        after=after,
        sampler=sampler,
        tiles=[len(table.of(name)) for name in names],
        seen=seen_robots(started, table),
        late_s=late_s,
        takeover=takeover,
        faults=await _faults(sampler),
    )


async def _start(sampler: Sampler, engines: int) -> list[str]:
    """Start everything, and wait until all robots report. Returns the names of the engines, oldest first."""
    started, names = sampler.started, list[str]()
    started.start_ingests()
    for _ in range(engines):
        started.start_engine()
        names += await _new_engine(sampler, set(names))
        report(f"engine {len(names)} runs")
    await _until(lambda: len(sampler.bus.state.ingests()) == len(started.floors))
    report("every ingest runs")
    started.start_loads()
    async with asyncio.timeout(START_WITHIN_S):
        while (await sampler.moment()).accepted() < 2 * sum(started.floors):  # the first of each is its identity
            await asyncio.sleep(CHECK_EVERY_S)
    return names


async def _new_engine(sampler: Sampler, known: set[str]) -> set[str]:
    """Wait for an engine that is not known yet. Returns its name."""
    await _until(lambda: sampler.engines().keys() > known)
    return sampler.engines().keys() - known


async def _until(is_so: Callable[[], bool]) -> None:
    async with asyncio.timeout(START_WITHIN_S):
        while not is_so():
            await asyncio.sleep(CHECK_EVERY_S)


async def _takeover(sampler: Sampler, engine: str) -> Takeover:
    """Kill the engine that started last, and wait until the others judge its tiles."""
    tiles, was_global = sampler.table.of(engine), sampler.table.global_engine == engine
    busy = {tile for tile, per_s in sampler.engines()[engine].items() if per_s}
    sampler.started.processes["engine"][-1].kill()
    died_s, noticed_s = time.time(), nan
    while (passed_s := time.time() - died_s) < JUDGED_WITHIN_S:
        await asyncio.sleep(CHECK_EVERY_S)
        if isnan(noticed_s) and not sampler.table.of(engine):
            noticed_s = passed_s
        loads = [loads for name, loads in sampler.engines().items() if name != engine]
        if not isnan(noticed_s) and all(any(each.get(tile) for each in loads) for tile in busy):
            return Takeover(len(tiles), was_global, noticed_s, passed_s)
    return Takeover(len(tiles), was_global, noticed_s, nan)


def seen_robots(started: StartedCluster, table: OwnerTable) -> list[int]:
    """By engine, the robots in its tiles and within its reach of them."""
    grid, floors = Grid(started.cluster.tile_m), started.floors
    reach, middles = (
        reach_m(started.cluster.fastest_mps, Conflict()),
        offer.calm_middles if started.calm else offer.middles,
    )
    seen = []
    for name in sorted(set(table.owners.values())):
        area, at = Area(grid, table.of(name)), [middles(robots) for robots in floors]
        near = [area.within(offer.datum_of(floor), at[floor], at[floor], reach) for floor in range(len(floors))]
        seen.append(int(sum(part.sum() for part in near)))
    return seen


async def _faults(sampler: Sampler) -> list[str]:
    """Revisions that are missing or doubled in the stream. Waits until the face has all."""
    records = list[StreamRecord]()
    waiting = await sampler.bus.revisions.follow(records.append, after=StreamPosition(0, "", 0))
    await _until(lambda: len(records) >= waiting)
    faults, last = [], dict[str, int]()
    for record in records:
        if record.advisory:
            number, before = record.advisory.revision, last.get(record.advisory.id, 0)
            if number != before + 1:
                faults.append(f"revision {number} of {record.advisory.id} follows {before}")
            last[record.advisory.id] = number
    async with asyncio.timeout(START_WITHIN_S):
        while await sampler.stored() < len(records):
            await asyncio.sleep(CHECK_EVERY_S)
    return faults


def report(text: str) -> None:
    print(f"{time.perf_counter():8.0f} s of wall time: {text}", file=sys.stderr, flush=True)
