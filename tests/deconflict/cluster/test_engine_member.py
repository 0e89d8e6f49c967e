"""An engine of a cluster over its own end and over a changed site file, with a real NATS server."""

import asyncio
import time
from contextlib import AsyncExitStack
from math import sin
from pathlib import Path
from threading import Event
from typing import Any

import pytest

from deconflict.cluster.engine_member import EngineMember
from deconflict.cluster.judging import pass_watch
from deconflict.cluster.nats.bus import Bus
from deconflict.cluster.nats.nats_tasks import end_tasks, open_bus
from deconflict.settings.cluster_settings import Cluster
from deconflict.settings.hot_reload import SITE_FILE, write
from deconflict.settings.site import Site
from ingest.measures.measures import joined_values
from tests.deconflict.cluster.made_cluster import (
    REFUSALS,
    Broker,
    Faltering,
    Machines,
    cluster,
    ingest,
    needs_server,
    running,
    until,
)
from tests.deconflict.roles.made_service import Course, drive
from tests.helpers.patience import PATIENCE_S

pytestmark = needs_server


TO_AND_FRO: dict[str, Course] = {
    "A": lambda t: (6.0 * sin(t / 6.0), 0.0, 0.0),
    "B": lambda t: (-6.0 * sin(t / 6.0), 2.0, 0.0),
}
"""Two that pass each other every nineteen seconds, 1.5 m apart."""


async def measured(machines: Machines, member: EngineMember, name: str) -> dict[tuple[str, ...], float]:
    """What a member says of a measure, once it does."""
    bus = Bus(machines.settings, 1.0)
    await bus.open()
    async with asyncio.timeout(300):
        while True:
            document: dict[str, Any] = bus.state.members().get(member.name, {})
            if values := joined_values(document.get("measures", ())).get(name):
                await bus.close()
                return values
            await asyncio.sleep(0.2)


async def test_a_new_engine_resumes_with_the_learned_state_of_an_earlier_one(tmp_path: Path) -> None:
    name = "deconflict_forecast_error_metres"
    async with cluster(tmp_path) as (machines, _):
        first, second = (EngineMember(machines.site(), machines.settings, tmp_path) for _ in range(2))
        async with ingest(machines, tmp_path / "ingest") as url, running(first):
            driving = asyncio.create_task(drive(url, TO_AND_FRO, 300, time.time()))
            learned = await measured(machines, first, name)
            driving.cancel()
        async with running(second):
            again = await measured(machines, second, name)
    assert again.keys() == learned.keys()


async def test_a_running_engine_applies_a_changed_site_file(tmp_path: Path) -> None:
    async with cluster(tmp_path) as (machines, operator), AsyncExitStack() as stack:
        base, site = f"http://127.0.0.1:{operator.port}", machines.site()
        url = await stack.enter_async_context(ingest(machines, tmp_path / "ingest"))
        member = EngineMember(site, machines.settings, tmp_path)
        await stack.enter_async_context(running(member))
        driving = asyncio.create_task(drive(url, TO_AND_FRO, 300, time.time()))
        await measured(machines, member, "deconflict_forecast_error_metres")
        await until(base, "/advisories?state=all", lambda listed: listed["advisories"] == [])
        changed = site.model_copy(update={"conflict": site.conflict.model_copy(update={"clearance_m": 1.6})})
        write(tmp_path / SITE_FILE, Site.model_dump_json(changed))
        listed = await until(base, "/advisories", lambda listed: listed["advisories"])
        driving.cancel()
    assert {advisory["clearance_m"] for advisory in listed["advisories"]} == {1.6}


async def test_each_channel_is_subscribed_once_though_one_of_a_group_is_refused(
    tmp_path: Path,
) -> None:
    broker = Broker(tmp_path)
    settings = Cluster(nats=(broker.address,))
    bus, member = Faltering(settings), EngineMember(Site(), settings, tmp_path)
    member._bus, member._needed = bus, {"first", "refused", "second"}
    listening = asyncio.create_task(_listening(bus, member))
    try:
        async with asyncio.timeout(300):
            while not member._needed <= member._subscribed.keys():
                await asyncio.sleep(0.05)
    finally:
        await end_tasks(listening)
        await bus.close()
        broker.kill()
    assert bus.begun == {"first": 1, "refused": REFUSALS + 1, "second": 1}


async def test_an_engine_whose_pass_hangs_ends_so_that_others_take_its_tiles(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pass_watch, "SILENCE_LIMIT_S", 1.0)
    goes_on = Event()
    async with cluster(tmp_path) as (machines, _):
        member = EngineMember(machines.site(), machines.settings, tmp_path)
        monkeypatch.setattr(member, "_run_pass", lambda *_: goes_on.wait(PATIENCE_S))
        try:
            with pytest.raises(pass_watch.HangingPassError, match="the engine has not ended"):
                async with asyncio.timeout(PATIENCE_S):
                    await member.run(asyncio.Event())
        finally:
            goes_on.set()


async def _listening(bus: Bus, member: EngineMember) -> None:
    assert await open_bus(bus, asyncio.Event())
    await member._listen()
