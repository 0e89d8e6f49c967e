"""Somebody says on the page that a robot is off the floor, and puts it back."""

from typing import TYPE_CHECKING

import pytest

from tests.deconflict.operator.http.served_face import HEARD, Served
from tests.deconflict.operator.opened_page import name, opened, text, until
from tests.helpers.saying import HALL, robot

if TYPE_CHECKING:
    from playwright.async_api import Browser

pytestmark = pytest.mark.asyncio(loop_scope="module")

UUID = robot("A-3")
PLACED = {"floor": HALL, "comparable": True, "location": {"x": 6.0, "y": 0.0, "yaw_rad": 0.0}}


async def test_a_robot_is_said_to_be_off_the_floor_and_put_back_by_one_press(browser: "Browser", face: Served) -> None:
    face.sources.heard = [HEARD | {"uuid": UUID, "vendor": "Alder", "age_s": 0.5, "name": name(3)} | PLACED]
    note = {"by": "Petra", "at_s": 5.0, "floor": HALL, "x": 6.0, "y": 0.0, "still_heard": True, "age_s": 0.5}
    async with opened(browser, face) as page:
        await until(page, "document.querySelectorAll('#names option').length > 5")
        assert not await page.is_visible("#off-floor-list")
        await page.fill("#robot", UUID[:8])
        await page.press("#robot", "Enter")
        await page.click("text=Off the floor…")
        await page.click("text=It is off the floor")
        assert not face.sources.marks, "a name is required"
        await page.fill("#off-floor-who", "Petra")
        await page.click("text=It is off the floor")
        await until(page, "!document.getElementById('off-floor').open")
        mark = face.sources.marks[UUID]
        assert (mark.is_off, mark.by, mark.datum, mark.x_m) == (True, "Petra", HALL, 6.0)
        face.sources.live = {"off_floor": [note | {"uuid": UUID, "name": name(3), "vendor": "Alder", "back_s": None}]}
        await page.wait_for_selector("#off-floor-list", state="visible")
        assert await text(page, "#off-floor-count") == "Off the floor: 1 robot"
        assert f"{name(3)} is off the floor, says Petra since" in await text(page, "#off-floor-lines li")
        assert "It is still heard there." in await text(page, "#off-floor-lines li")
        await page.click("#off-floor-lines button")
        await until(page, "document.querySelector('#off-floor-lines button').disabled")
        assert not face.sources.marks[UUID].is_off


async def test_a_long_name_of_a_robot_that_is_off_the_floor_pushes_nothing_out_of_sight(
    browser: "Browser", face: Served
) -> None:
    off = {"uuid": robot("A-1"), "name": "W" * 141, "vendor": "Alder", "by": "Q" * 80, "at_s": 5.0, "back_s": None}
    face.sources.live = {"off_floor": [off | {"still_heard": False}]}
    async with opened(browser, face, width=360, height=740) as page:
        await until(page, "!document.getElementById('off-floor-list').hidden")
        assert await page.evaluate("document.documentElement.scrollWidth <= innerWidth")
