"""The operator's page in a real Chromium, for situations that a test publishes."""

import shutil
from collections.abc import AsyncIterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
import pytest_asyncio

from tests.deconflict.operator.http.served_face import Served, served
from tests.deconflict.operator.opened_page import ticking

if TYPE_CHECKING:
    from playwright.async_api import Browser


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
