"""`deconflict serve` whose receiver is killed again and again while it packs the log: each message is there once."""

import asyncio
import os
import signal
import time
from collections import Counter
from itertools import count
from pathlib import Path

import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed

from ingest.recording.log_packing import UNFINISHED
from ingest.recording.log_reader import LogReader, Received, Tick
from tests.deconflict.roles.made_service import Served, healthy
from tests.deconflict.roles.role_processes import children
from tests.helpers.patience import PATIENCE_S
from tests.helpers.saying import identity, status

pytestmark = pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs Linux's /proc")
SITE = "[recorder]\nsegment_bytes = 3000\n"
KILLS = 3


async def test_a_receiver_killed_while_it_packs_leaves_each_message_in_the_log_once(tmp_path: Path) -> None:
    (tmp_path / "site.toml").write_text(SITE)
    log, sent, service = tmp_path / "data" / "log", list[bytes](), Served(tmp_path / "data", tmp_path / "site.toml")
    with service.running() as pid:
        for kill in range(KILLS):
            await service.until(
                "/healthz", lambda health, kill=kill: healthy(health) and health["restarts"].get("receiver", 0) == kill
            )
            saying = asyncio.create_task(say(service.robots_url, sent))
            receiver = children(pid)["receiver"]
            was_recorded = await asyncio.to_thread(kill_while_packing, log, receiver, sent)
            await saying
            recorded = messages(log)
            assert recorded[: len(was_recorded)] == was_recorded
    recorded = messages(log)
    assert set(Counter(recorded).values()) == {1}
    assert recorded == [message for message in sent if message in set(recorded)]
    ticks = [event.now_s for event in LogReader().read([log]) if isinstance(event, Tick)]
    assert sorted(set(ticks)) == ticks


async def say(url: str, sent: list[bytes]) -> None:
    """Say where a robot is until the service ends the connection."""
    try:
        async with connect(url) as socket:
            await socket.send(identity("A-1", time.time()))
            for number in count():
                sent.append(status("A-1", time.time(), x=number / 100))
                await socket.send(sent[-1])
                await asyncio.sleep(0.01)
    except ConnectionClosed:
        return


def kill_while_packing(log: Path, receiver: int, sent: list[bytes]) -> list[bytes]:
    """Kill it once it packs a segment that was just finished. Returns the messages that the log had shortly before."""
    until_s = time.monotonic() + PATIENCE_S
    begun = len(sent)
    while len(list(log.glob("*.zst"))) < 3 or len(sent) < begun + 100:
        assert time.monotonic() < until_s
        time.sleep(0.05)
    recorded = messages(log)
    while not (log / UNFINISHED).exists():
        assert time.monotonic() < until_s
    os.kill(receiver, signal.SIGKILL)
    return recorded


def messages(log: Path) -> list[bytes]:
    """The statuses in a log, in order."""
    events = LogReader().read([log])
    return [event.raw for event in events if isinstance(event, Received) and b"operationalState" in event.raw]
