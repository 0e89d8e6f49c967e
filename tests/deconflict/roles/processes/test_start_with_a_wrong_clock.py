"""A service that starts with its clock a month ahead: as it sees it, all of its data is a month old."""

import asyncio
import json
import os
import sqlite3
import time
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from websockets.asyncio.client import connect

from deconflict.operator.blackbox.archive import FOLDER, Archive
from deconflict.operator.ledger.loss_ledger import FILE_NAME as LOSSES
from deconflict.operator.ledger.loss_ledger import LossLedger
from deconflict.operator.store.store import Store
from deconflict.settings.site import LossSettings
from ingest.languages import timestamps
from ingest.recording.clock_notes import DAY_S
from tests.deconflict.operator.ledger.made_entries import QUEUED
from tests.deconflict.roles.made_service import Served, healthy
from tests.helpers.made_advisories import cleared
from tests.helpers.made_clock import put_notes
from tests.helpers.patience import PATIENCE_S

pytestmark = pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs Linux's /proc")

AHEAD_DAYS = 120.0
"""More than any data is kept."""
KINDS = {"log", FOLDER, "advisories", "losses"}


def put_data(data: Path, at_s: float) -> None:
    """One of each kind that is removed by its age."""
    for folder in ("log", FOLDER):
        (data / folder).mkdir(parents=True)
    segment = data / "log" / f"log-{round(at_s * 1e6):017d}.jsonl"
    segment.write_text("{}\n")
    os.utime(segment, (at_s, at_s))
    box = {"file": "blackbox-20200921T141500000Z.jsonl.zst", "bytes": 1, "sha256": "1" * 64, "near_misses": []}
    (data / FOLDER / str(box["file"])).write_bytes(b"x")
    Archive(data / FOLDER).add(box | {"until": timestamps.write(at_s)})
    with closing(Store(data)) as store:
        store.append([cleared(1, updated_at=datetime.fromtimestamp(at_s, UTC))])
    with closing(LossLedger(data, LossSettings())) as ledger:
        ledger.add("engine", 1, [QUEUED._replace(from_s=at_s)])


def kinds_left(data: Path, at_s: float) -> set[str]:
    left = {"log"} if [*data.glob(f"log/log-{round(at_s * 1e6):017d}.*")] else set()
    left |= {FOLDER} if [*data.glob(f"{FOLDER}/*.zst")] else set()
    rows = ("advisories.db", "SELECT 'advisories' FROM advisories"), (LOSSES, "SELECT 'losses' FROM losses")
    for file, named in rows:
        with closing(sqlite3.connect(data / file)) as db:
            left |= {name for (name,) in db.execute(named)}
    return left


def asks_for_the_clock(health: dict[str, Any]) -> bool:
    return "look at the clock" in (health.get("clock") or {}).get("reason", "")


async def page_notice(service: Served) -> str:
    async with connect(f"{service.face_url.replace('http', 'ws')}/live") as live:
        while True:
            if notice := json.loads(await live.recv()).get("health", {}).get("notice"):
                return str(notice)


async def test_a_start_with_the_clock_ahead_removes_nothing_and_one_with_a_confirmed_clock_does(tmp_path: Path) -> None:
    at_s, service = time.time() - AHEAD_DAYS * DAY_S, Served(tmp_path)
    put_data(tmp_path, at_s)
    put_notes(tmp_path, at_s)
    with service.running():
        health = await service.until("/healthz", asks_for_the_clock)
        assert health["status"] == "degraded"
        assert (await page_notice(service)).startswith(health["clock"]["reason"][:30])
        answer = await service.until("/advisories?state=all", lambda answer: "advisories" in answer)
        assert [advisory["id"] for advisory in answer["advisories"]] == ["advisory-1"]
    assert kinds_left(tmp_path, at_s) == KINDS
    put_notes(tmp_path, time.time())
    with service.running():
        await service.until("/healthz", healthy)
        await service.until("/advisories?state=all", lambda answer: answer["advisories"] == [])
        async with asyncio.timeout(PATIENCE_S):
            while kinds_left(tmp_path, at_s):
                await asyncio.sleep(0.05)
