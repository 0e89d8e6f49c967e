"""Senders that this project did not write: the virtual robots of npm's `vda-5050-lib` drive towards each other."""

import asyncio
import json
import time
from pathlib import Path
from typing import Any

import pytest
from aiomqtt import Client

from deconflict.settings.site import Site
from ingest.recording.log_reader import LogReader
from ingest.settings import Datum
from metrics.replay.conformance_counts import conform
from metrics.replay.replay import replay
from tests.deconflict.operator.outlets.made_outlets import broker, needs_mosquitto
from tests.helpers.node_libraries import ENVIRONMENT, needs_library
from tests.helpers.patience import PATIENCE_S

SENDERS = Path(__file__).with_name("virtual_agvs.js")
SECONDS = 15
VELOCITY_OF_MAP = "heading-contradicts-motion"
"""The library sends velocities in the frame of the map, so that a robot with its nose to the west drives backwards."""
SITE = Site(datums=(Datum(id="hall", name="Hall"),))
pytestmark = [needs_mosquitto, pytest.mark.slow, needs_library("vda-5050-lib")]


async def captured(port: int, path: Path) -> None:
    """Write everything that the broker passes on until cancelled."""
    async with Client("127.0.0.1", port) as client:
        await client.subscribe("uagv/#")
        with path.open("w") as file:
            async for message in client.messages:
                payload = bytes(message.payload).decode()
                file.write(json.dumps({"time": time.time(), "topic": message.topic.value, "payload": payload}) + "\n")


async def capture_of_two(path: Path) -> Path:
    async with broker() as port, asyncio.timeout(PATIENCE_S):
        capturing = asyncio.create_task(captured(port, path))
        senders = await asyncio.create_subprocess_exec("node", SENDERS, str(port), str(SECONDS), env=ENVIRONMENT)
        assert await senders.wait() == 0
        capturing.cancel()
        await asyncio.gather(capturing, return_exceptions=True)
    return path


async def test_the_meeting_of_two_virtual_robots_is_predicted_from_their_orders(tmp_path: Path) -> None:
    log = await capture_of_two(tmp_path / "first.jsonl")
    if not is_predicted(figures := scored(log)):  # the clock is real: on a busy machine they may drive unevenly
        log = await capture_of_two(tmp_path / "again.jsonl")
        assert is_predicted(scored(log)), figures
    (vendor,) = conform(LogReader(), LogReader().read([log]), SITE)["conformance"]
    assert vendor["rejected"] == 0
    assert {finding["rule"] for finding in vendor["findings"]} <= {"identity-missing", VELOCITY_OF_MAP}


def scored(log: Path) -> dict[str, Any]:
    """The figures of a capture, with the medians of the forecast error by horizon."""
    reader = LogReader()
    result = replay(reader, reader.read([log]), SITE, [0.3])
    (figures,) = result["scores"]
    errors_m = {row["horizon_s"]: row["distance_median_m"] for row in result["forecast_error"]["all"]}
    return figures | {"errors_m": errors_m}


def is_predicted(figures: dict[str, Any]) -> bool:
    exact = (figures["encounters"], figures["recall"], figures["precision"]) == (1, 1.0, 1.0)
    errors_m = figures["errors_m"]
    return bool(exact and figures["lead_time_s"]["median"] > 4 and errors_m[1] < 0.1 and errors_m[5] < 0.3)
