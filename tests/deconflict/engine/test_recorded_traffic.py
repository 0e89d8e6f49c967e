"""A recording of real traffic, sent over real sockets as its robots would have."""

import asyncio
import os
import time
from pathlib import Path

import pytest
from websockets.asyncio.client import connect

from deconflict.advisories.severity import SURE
from deconflict.roles.service import run_in_one_process
from deconflict.settings.site import Conflict, Operator, Site
from deconflict_client.advisory import AdvisoryState
from ingest.recording.log_reader import LogReader, Received
from ingest.settings import ReceiverSettings
from metrics.monitoring.exposition import render
from tests.deconflict.roles.made_service import Running

RECORDINGS = os.environ.get("DECONFLICT_RECORDINGS")
STRETCH_S = (20.0, 26.0)
"""Of the recording: long enough for people to meet."""

pytestmark = pytest.mark.skipif(not RECORDINGS, reason="DECONFLICT_RECORDINGS names no folder of recordings")


async def test_recorded_traffic_gives_advisories(tmp_path: Path) -> None:
    site = Site(receiver=ReceiverSettings(port=0), operator=Operator(port=0), conflict=Conflict(clearance_m=0.5))
    log = [
        event
        for event in LogReader().read([Path(RECORDINGS or "") / "zara02.cv.jsonl.gz"])
        if isinstance(event, Received)
    ]
    first_s = next(event.arrival_s for event in log if b"operationalState" in event.raw)
    async with run_in_one_process(site, tmp_path, render) as (receiver, operator):
        service = Running(receiver, operator)
        async with connect(service.robots_url) as socket:
            began_s = time.time()
            for event in log:
                since_s = event.arrival_s - first_s
                if since_s > STRETCH_S[1]:
                    break
                if since_s < 0 or since_s >= STRETCH_S[0]:
                    await asyncio.sleep(max(since_s - STRETCH_S[0] - (time.time() - began_s), 0))
                    await socket.send(event.raw)
        text = "/advisories?state=all&kind=conflict"
        answer = await service.until(text, lambda answer: len(answer["advisories"]) > 0)
        robots = (await service.get("/robots")).json()["robots"]
    assert {advisory["state"] for advisory in answer["advisories"]} <= set(AdvisoryState)
    raised = [advisory for advisory in answer["advisories"] if advisory["state"] == AdvisoryState.RAISED]
    assert all(0 <= row["min_separation_m"] <= 0.5 or row["probability"] >= SURE for row in raised)
    # the stamps are years old: the senders' clocks are seen to be off, and corrected
    assert all(robot["clock"]["offset_s"] > 1e8 for robot in robots if robot["status"])
    assert all(robot["age_s"] < 60 for robot in robots)
