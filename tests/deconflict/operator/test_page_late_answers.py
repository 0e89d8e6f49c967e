"""Answers that come late, in another order or not at all change nothing else on the page: in a real Chromium."""

import asyncio
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import pytest

from tests.deconflict.operator.http.served_face import HEARD, Served
from tests.deconflict.operator.opened_page import opened, shown, text, until
from tests.helpers.patience import PATIENCE_S
from tests.helpers.saying import robot

if TYPE_CHECKING:
    from playwright.async_api import Browser, Page, Route

pytestmark = pytest.mark.asyncio(loop_scope="module")

DECISIONS = re.compile(r"/(acknowledgement|off-floor)$")
REPORTS = re.compile(r"/robots/[^/]*$")
BOX = "document.getElementById('detail').textContent"
CUT_MS = "const { timeout } = AbortSignal; AbortSignal.timeout = () => timeout.call(AbortSignal, 500);"


@dataclass
class Held:
    """Requests that wait until a test answers them, in the order in which the page sent them."""

    routes: list["Route"] = field(default_factory=list)

    def add(self, route: "Route") -> None:
        self.routes.append(route)

    async def next(self) -> "Route":
        async with asyncio.timeout(PATIENCE_S):
            while not self.routes:
                await asyncio.sleep(0.01)
        return self.routes.pop(0)

    async def report_until_shown(self, page: "Page", battery_pct: int) -> None:
        """Answer what was asked for last, until the box says the level."""
        async with asyncio.timeout(PATIENCE_S):
            while f"battery{battery_pct} %" not in await text(page, "#detail"):
                if self.routes:
                    await report(self.routes.pop(), battery_pct)
                await asyncio.sleep(0.05)


async def refuse(route: "Route") -> None:
    await route.fulfill(status=503, json={"detail": "the store is full"})


async def report(route: "Route", battery_pct: int) -> None:
    await route.fulfill(json=HEARD | {"uuid": robot("A-2"), "vendor": "Alder", "battery_pct": battery_pct})


@asynccontextmanager
async def held(page: "Page", address: "re.Pattern[str]") -> AsyncIterator[Held]:
    requests = Held()
    await page.route(address, requests.add)
    yield requests
    await page.unroute_all(behavior="ignoreErrors")


async def find(page: "Page", name: str) -> None:
    await until(page, "document.querySelectorAll('#names option').length > 3")
    await page.fill("#robot", robot(name)[:8])
    await page.press("#robot", "Enter")


async def press_take(page: "Page", number: int) -> None:
    await page.click(f'[data-id="situation-{number}"] .take')


async def fill(page: "Page", reason: str) -> None:
    await page.fill("#who", "Kim")
    await page.fill("#why", reason)


async def test_an_acknowledgement_that_fails_late_leaves_the_dialog_of_another_alone(
    browser: "Browser", face: Served
) -> None:
    await face.publish(shown(1, 0, 1), shown(2, 4, 5))
    async with opened(browser, face) as page:
        await press_take(page, 2)
        await page.wait_for_selector('[data-id="situation-2"].answered')
        async with held(page, DECISIONS) as decisions:
            await press_take(page, 1)
            await press_take(page, 2)
            await fill(page, "both called back")
            await refuse(await decisions.next())
            await until(page, "document.getElementById('notice').textContent.includes('the store is full')")
            assert "at Column 1" in await text(page, "#notice")
            assert "at Column 2" in await text(page, "#acknowledge-what")
            assert await text(page, "#refused") == ""
            assert await page.input_value("#why") == "both called back"
            await page.keyboard.press("Enter")
            assert "/situation-2/" in (await decisions.next()).request.url


@pytest.mark.parametrize("is_stored", [True, False])
async def test_a_late_answer_of_a_dialog_that_was_cancelled_leaves_the_next_one_open(
    browser: "Browser", face: Served, is_stored: bool
) -> None:
    await face.publish(shown(1, 0, 1), shown(2, 4, 5))
    async with opened(browser, face) as page:
        for number in (1, 2):
            await press_take(page, number)
            await page.wait_for_selector(f'[data-id="situation-{number}"].answered')
        async with held(page, DECISIONS) as decisions:
            await press_take(page, 1)
            await fill(page, "called back")
            await page.keyboard.press("Enter")
            first = await decisions.next()
            await page.click("#acknowledge button[value='']")
            await press_take(page, 2)
            await fill(page, "waved through")
            if is_stored:
                await first.continue_()
                await until(page, "document.getElementById('situations').textContent.includes('Kim: called back')")
            else:
                await refuse(first)
                await until(page, "document.getElementById('notice').textContent.includes('the store is full')")
            assert await page.is_visible("#acknowledge")
            assert await text(page, "#refused") == ""
            assert await page.input_value("#why") == "waved through"


async def test_a_late_answer_about_a_robot_leaves_the_dialog_of_another_open(browser: "Browser", face: Served) -> None:
    async with opened(browser, face) as page, held(page, DECISIONS) as decisions:
        await find(page, "A-3")
        await page.click("text=Off the floor…")
        await page.fill("#off-floor-who", "Petra")
        await page.click("text=It is off the floor")
        first = await decisions.next()
        await page.click("#off-floor button[value='']")
        await find(page, "A-2")
        await page.click("text=Off the floor…")
        await first.fulfill(json={})
        await asyncio.sleep(0.3)
        assert await page.is_visible("#off-floor")
        assert f"{robot('A-2')[:8]} counts as nowhere" in await text(page, "#off-floor-what")


async def test_a_decision_without_an_answer_is_given_up(browser: "Browser", face: Served) -> None:
    refusal = "Not stored: no answer yet; look whether it is there before you send it again"
    await face.publish(shown(1, 0, 1))
    async with opened(browser, face) as page, held(page, DECISIONS):
        await page.evaluate(CUT_MS)
        await press_take(page, 1)
        await until(page, f"document.getElementById('refused').textContent === '{refusal}'")


async def test_an_older_report_of_a_robot_replaces_no_newer_one(browser: "Browser", face: Served) -> None:
    async with opened(browser, face) as page, held(page, REPORTS) as reports:
        await find(page, "A-2")
        first = await reports.next()
        await reports.report_until_shown(page, 42)
        await report(first, 83)
        await asyncio.sleep(0.5)
        assert "battery83 %" not in await text(page, "#detail")


async def test_what_a_robot_reported_is_shown_for_some_seconds_after_it_was_asked_for(
    browser: "Browser", face: Served
) -> None:
    async with opened(browser, face) as page, held(page, REPORTS) as reports:
        await find(page, "A-2")
        await reports.report_until_shown(page, 42)
        await refuse(await reports.next())
        await until(page, f"!{BOX}.includes('battery') && {BOX}.includes('last message')")
        assert await page.get_attribute("html", "data-state") == "live"
        await reports.report_until_shown(page, 41)
