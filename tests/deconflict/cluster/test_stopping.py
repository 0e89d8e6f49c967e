"""Every part of a cluster stops quickly and quietly while no NATS server answers, with a real one that is gone."""

import asyncio
import signal
from pathlib import Path

import pytest

from deconflict.cluster.nats.bus import Bus
from deconflict.cluster.nats.member_roster import part_of
from deconflict.cluster.nats.nats_tasks import open_bus
from deconflict.settings.cluster_settings import Cluster
from tests.deconflict.cluster.made_cluster import Broker, Machines, needs_server
from tests.helpers.patience import PATIENCE_S

pytestmark = needs_server

IDLE_WITHIN_S = 2.0
"""A call that waits for a server waits for five seconds. Time on a busy processor does not count."""
PARTS = {"ingest": ("feed", "receiver"), "engine": ("engine",), "face": ("follower", "operator")}
CLIENTS = ("feed", "engine", "follower")


@pytest.mark.parametrize("gone", ["killed", "killed long ago", "frozen", "never there"])
async def test_each_part_stops_soon_and_without_errors_while_no_server_answers(tmp_path: Path, gone: str) -> None:
    broker = Broker(tmp_path / "nats")
    machines = Machines(tmp_path, broker)
    if gone == "never there":
        broker.kill()
    for part, roles in PARTS.items():
        machines.start(part, *roles)
    try:
        if gone == "never there":
            await logged(tmp_path, "the NATS server")
        else:
            await joined(machines.settings)
            broker.signal(signal.SIGSTOP if gone == "frozen" else signal.SIGKILL)
            if gone == "killed long ago":
                await logged(tmp_path, "the NATS server")
        for part, roles in PARTS.items():
            for role in roles:
                assert machines.idle_s_of_stop(part, role) < IDLE_WITHIN_S, f"people wait for the {role}"
                log = (tmp_path / part / f"{role}.log").read_text()
                assert "Traceback" not in log, log
                assert " ERROR " not in log, log
    finally:
        machines.end()
        broker.kill()


async def joined(settings: Cluster) -> None:
    """Wait until each part has sent heartbeats."""
    bus = Bus(settings, 1.0)
    assert await open_bus(bus, asyncio.Event())
    async with asyncio.timeout(PATIENCE_S):
        while {part_of(member) for member in bus.state.members()} != PARTS.keys():
            await asyncio.sleep(0.05)
    await bus.close()


async def logged(folder: Path, text: str) -> None:
    """Wait until each client of the servers has said so."""
    logs = [folder / part / f"{role}.log" for part, roles in PARTS.items() for role in roles if role in CLIENTS]
    async with asyncio.timeout(PATIENCE_S):
        while not all(text in log.read_text() for log in logs):
            await asyncio.sleep(0.05)
