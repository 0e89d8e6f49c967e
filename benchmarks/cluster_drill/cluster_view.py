"""What the drill knows of the cluster's members: which machine has the global judge, and which server leads."""

import asyncio
import logging
from pathlib import Path

from benchmarks.cluster_drill.drilled_machines import MACHINES
from deconflict.cluster.nats.bus import Bus
from deconflict.cluster.nats.nats_tasks import open_bus
from deconflict.cluster.nats.shared_state import LEASE_S
from deconflict.settings import site_file

RETRY_S = 0.2


class ClusterView:
    """A member that only looks. Engines tell their names and not their machines, so it notes which comes when."""

    def __init__(self, site: Path, ca: str) -> None:
        settings = site_file.load(site)
        if settings.cluster is None:
            raise SystemExit(f"{site} has no [cluster]")
        logging.getLogger("deconflict.cluster").setLevel(logging.ERROR)
        self._bus = Bus(settings.cluster.model_copy(update={"ca": ca}), settings.store.keep_days)
        self._engine_of: dict[int, str] = {}
        """The name of each machine's engine."""

    async def open(self) -> None:
        await open_bus(self._bus, asyncio.Event())

    async def close(self) -> None:
        await self._bus.close()

    async def wait_for_engine(self, machine: int) -> None:
        """Wait for the engine of a machine that is the only one with a new engine."""
        others = {name for each, name in self._engine_of.items() if each != machine}
        while not (new := self._engines() - others):
            await asyncio.sleep(RETRY_S)
        self._engine_of[machine] = new.pop()

    async def judge(self) -> int:
        """The machine with the global judge. Of engines that came at the same time one is as good as another."""
        await asyncio.sleep(LEASE_S)
        self._note_new()
        _, table = await self._bus.state.table()
        named = [each for each, name in self._engine_of.items() if table and name == table["watch"]]
        return named[0] if named else MACHINES[-1]

    async def leader(self) -> int:
        """The number of the server that leads the stream of revisions."""
        info = await self._bus.connection.js.stream_info(f"{self._bus.name}-told")
        name = info.cluster.leader if info.cluster else None
        return int((name or f"nats-{MACHINES[-1]}").removeprefix("nats-"))

    def _note_new(self) -> None:
        """Give new engines to the machines whose engine is gone."""
        engines = self._engines()
        gone = [machine for machine in MACHINES if self._engine_of.get(machine) not in engines]
        for machine, name in zip(gone, sorted(engines - set(self._engine_of.values())), strict=False):
            self._engine_of[machine] = name

    def _engines(self) -> set[str]:
        return {name for name, document in self._bus.state.members().items() if "loads" in document}
