"""The operator's page in a real Chromium, for situations that a test publishes."""

import asyncio
import shutil
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
import pytest_asyncio

from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import Site
from ingest.fleet.fleet import Fleet
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from tests.deconflict.operator.http.served_face import Served, served
from tests.deconflict.operator.opened_page import ROBOTS
from tests.helpers.saying import status

if TYPE_CHECKING:
    from playwright.async_api import Browser

TICK_S = 0.2


@asynccontextmanager
async def ticking(face: Served) -> AsyncIterator[None]:
    """Robots that stand in a row, 2 m apart, and report at each tick."""
    fleet = fleet_of(Site(), Measures())

    async def tick() -> None:
        while True:
            report(fleet, time.time())
            face.sources.whole = fleet.snapshot(time.time())
            face.sources.recent.add(time.time(), fleet.next_batch(time.time()).to_bytes())
            await asyncio.sleep(TICK_S)

    task = asyncio.create_task(tick())
    try:
        yield
    finally:
        task.cancel()


def report(fleet: Fleet, now_s: float) -> None:
    for i in range(ROBOTS):
        fleet.receive(status(f"A-{i}", now_s, 2.0 * i, 0.0), now_s, Connection(1))


@pytest_asyncio.fixture(loop_scope="module")
async def face(tmp_path: Path) -> AsyncIterator[Served]:
    async with served(tmp_path) as served_face, ticking(served_face):
        yield served_face


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def browser() -> AsyncIterator["Browser"]:
    """One for all tests. Each page has cookies, storage and permissions of its own."""
    async_api = pytest.importorskip("playwright.async_api", reason="playwright drives the browser")
    path = shutil.which("chromium") or pytest.skip("chromium is the browser that the page is looked at with")
    async with async_api.async_playwright() as playwright:
        chromium = await playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield chromium
        await chromium.close()
