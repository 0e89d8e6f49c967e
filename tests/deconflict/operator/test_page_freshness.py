"""What the page says of its own freshness is true, whatever becomes of answers and messages: in a real Chromium.

A robot stands at a place that tells the time of its report, and a card names the time of its revision. So each picture
tells of when it is.
"""

import asyncio
import re
import time
from bisect import bisect_right
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from random import Random
from typing import TYPE_CHECKING, Any

import pytest

from deconflict.operator.live.floor_frames import FloorFrames
from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import Site
from deconflict_client.situations import Situation
from ingest.fleet.fleet import Fleet
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from tests.deconflict.operator.bad_network import AT_ONCE, BadNetwork, Fate
from tests.deconflict.operator.http.served_face import Served, served
from tests.deconflict.operator.opened_page import cleared, shown, ticking, until
from tests.helpers.patience import PATIENCE_S
from tests.helpers.saying import robot, status

if TYPE_CHECKING:
    from playwright.async_api import Browser, Page, WebSocketRoute

pytestmark = pytest.mark.asyncio(loop_scope="module")

TELLER = "A-0"
"""The robot whose place tells the time."""
M_PER_S = 0.5
TICK_S, REVISION_S = 0.2, 0.5
HEAT_S = 180.0
"""A heat map of an hour is of now for so long."""
WITHIN_S = 3.0
"""How far what the page says may be from the truth."""
FRAME_S = 0.5
"""What the machine may take from the moment in which the page looks at its clock until the picture is looked at."""
STATE = (
    "({ status: document.getElementById('status').textContent, visible: document.visibilityState, "
    "frames: document.documentElement.dataset.frames })"
)
CLAIM = re.compile(r"(?:floor at|since|Showing) (\d\d:\d\d:\d\d)")
CARDS_CLAIM = re.compile(r"the warnings of (\d\d:\d\d:\d\d)")
MAP = """import(new URL("page/map/floor_map.js", location)).then(({{ FloorMap }}) => {{
    FloorMap.prototype.draw = () => {{ {} }};
}})"""
WATCH = """async (uuid) => {
    const { FloorMap } = await import(new URL("page/map/floor_map.js", location));
    const { draw } = FloorMap.prototype, text = (id) => document.getElementById(id).textContent;
    window.looks = [];
    FloorMap.prototype.draw = function (scene) {
        const counted = draw.call(this, scene), teller = scene.robots.find((robot) => robot.uuid === uuid);
        const card = document.querySelector("#situations > li .what");
        looks.push({ at_s: trueNow() / 1000, x_m: teller ? teller.x : null, card: card ? card.textContent : null,
                     status: text("status"), clock: text("clock"), beside_slider: text("shown"),
                     heat_s: scene.heat ? scene.heat.until_s : null });
        return counted;
    };
}"""


@dataclass
class Floor:
    """A floor that tells the time, and the revisions that it published."""

    face: Served
    began_s: float
    revisions_s: list[float] = field(default_factory=list)
    situation: Situation | None = None
    runs: bool = True
    tells: bool = True

    def report(self, fleet: Fleet, at_s: float) -> None:
        x_m = M_PER_S * (at_s - self.began_s)
        fleet.receive(status(TELLER, at_s, x_m, operationalState="charging"), at_s, Connection(1))

    async def past(self, at_s: float) -> str:
        """The recorded floor, which this floor computes."""
        fleet, frames = fleet_of(Site(), Measures()), FloorFrames()
        self.report(fleet, at_s)
        frames.add_batch(fleet.snapshot(at_s), whole=True)
        return frames.since(0)

    async def tick(self) -> None:
        fleet = fleet_of(Site(), Measures())
        while True:
            now_s = time.time()
            self.report(fleet, now_s)
            if self.runs:
                self.face.sources.whole = fleet.snapshot(now_s)
                self.face.sources.recent.add(now_s, fleet.next_batch(now_s).to_bytes())
            await asyncio.sleep(TICK_S)

    async def publish(self) -> None:
        while True:
            if self.tells:
                await self.revise()
            await asyncio.sleep(REVISION_S)

    async def revise(self) -> None:
        now_s, number = time.time(), len(self.revisions_s)
        summary = f"Alder A-0 and others meet at second {now_s - self.began_s:.2f}"
        self.situation = shown(1, 0, 1, revision=number + 1, summary=summary)
        self.revisions_s.append(now_s)
        await self.face.publish(self.situation)

    def clock_s(self, clock: str, near_s: float) -> float:
        """The time that a clock of the page says."""
        day = datetime.fromtimestamp(near_s, UTC)
        hours, minutes, seconds = map(int, clock.split(":"))
        return day.replace(hour=hours, minute=minutes, second=seconds, microsecond=0).timestamp()

    def untrue(self, look: dict[str, Any]) -> str | None:
        """What of a picture is not as the page says; None if everything is."""
        if look["x_m"] is None:
            return None if "Live" not in look["status"] else "nothing is drawn"
        sentence, at_s = look["status"], look["at_s"]
        floor_s = self.began_s + look["x_m"] / M_PER_S
        claim = CLAIM.search(sentence)
        claimed_s = at_s if "Live" in sentence else self.clock_s(claim[1], at_s) if claim else None
        if claimed_s is not None and abs(claimed_s - floor_s) > WITHIN_S + FRAME_S:
            return f"the floor is {at_s - floor_s:.1f} s old, and is said to be {at_s - claimed_s:.1f}"
        if claimed_s is not None and abs(self.clock_s(look["clock"], at_s) - floor_s) > WITHIN_S + FRAME_S + 1:
            return f"the clock says {look['clock']} over a floor {at_s - floor_s:.1f} s old"
        if look["beside_slider"] == "live" and "Live" not in sentence:
            return "the slider says live"
        of_s, may_be_s = (floor_s, WITHIN_S) if "Showing" in sentence else (at_s, HEAT_S)
        if look["heat_s"] is not None and abs(look["heat_s"] - of_s) > may_be_s:
            return f"the heat map is of {of_s - look['heat_s']:.1f} s before"
        return self._untrue_card(look, floor_s)

    def _untrue_card(self, look: dict[str, Any], floor_s: float) -> str | None:
        if look["card"] is None:
            return None
        card_s, at_s, sentence = self.began_s + float(look["card"].split()[-1]), look["at_s"], look["status"]
        newer = bisect_right(self.revisions_s, card_s + 0.02)
        true_until_s = self.revisions_s[newer] if newer < len(self.revisions_s) else float("inf")
        claim = CARDS_CLAIM.search(sentence)
        if "Showing" in sentence:
            of_s = floor_s
        elif claim:
            of_s = self.clock_s(claim[1], at_s)
        else:
            of_s = at_s if "Live" in sentence else floor_s
        if true_until_s < of_s - WITHIN_S - FRAME_S:
            return f"the card is {of_s - true_until_s:.1f} s older than it is said to be"
        if "Showing" in sentence and card_s > floor_s + WITHIN_S:
            return f"the card is {card_s - floor_s:.1f} s newer than the floor"
        return None


@dataclass
class Watched:
    """A page with a network of which a test decides, and whose pictures are all looked at."""

    page: "Page"
    network: BadNetwork
    floor: Floor
    wrong: list[str]
    """What the page has thrown."""

    async def verify(self) -> None:
        looks = await self.page.evaluate("looks.splice(0)")
        wrong = [(problem, look) for look in looks if (problem := self.floor.untrue(look))]
        assert not wrong, f"{len(wrong)} of {len(looks)} pictures, as: {wrong[0]}"

    async def for_s(self, seconds: float) -> None:
        """Look at the page for some seconds."""
        await asyncio.sleep(seconds)
        await self.verify()

    async def until(self, condition: str) -> None:
        """Look at the page until a condition holds."""
        until_s = time.monotonic() + PATIENCE_S
        while not await self.page.evaluate(condition):
            state = await self.page.evaluate(STATE)
            assert time.monotonic() < until_s, f"not {condition}: {state}; thrown: {self.wrong}"
            await self.for_s(0.2)

    async def until_said(self, words: str) -> None:
        await self.until(f"/{words}/.test(document.getElementById('status').textContent)")

    async def go(self, back_s: float) -> float:
        """Choose a moment that lies so far back."""
        chosen_s = time.time() - back_s
        await self.page.evaluate(
            """(atS) => {
                const moment = Object.assign(document.getElementById("moment"), { min: 0, max: 1e11, step: "any" });
                moment.value = atS;
                moment.dispatchEvent(new Event("input"));
            }""",
            chosen_s,
        )
        return chosen_s

    async def press_live(self) -> None:
        await self.page.evaluate("document.getElementById('live').click()")

    async def until_held(self, kind: str, count: int = 1) -> None:
        async with asyncio.timeout(PATIENCE_S):
            while self.network.held(kind) < count:
                await asyncio.sleep(0.01)


@asynccontextmanager
async def watched(browser: "Browser", directory: Path, **fates: Callable[[], Fate]) -> AsyncIterator[Watched]:
    """A page that has been asked for, with a network that has these fates from the beginning."""
    async with served(directory) as face:
        floor = Floor(face, time.time() - 20)
        face.sources.floor_at = floor.past  # type: ignore[method-assign]
        running = [asyncio.create_task(floor.tick()), asyncio.create_task(floor.publish())]
        context = await browser.new_context(timezone_id="UTC")
        page, wrong, network = await context.new_page(), [], BadNetwork()
        page.on("pageerror", lambda error: wrong.append(str(error)))
        await page.add_init_script(
            "window.trueNow = Date.now.bind(Date); const { timeout } = AbortSignal;"
            "AbortSignal.timeout = (ms) => timeout.call(AbortSignal, Math.min(ms, 3000));"
        )
        await network.between(page)
        network.fates.update(fates)
        try:
            await page.goto(face.http)
            await page.evaluate(WATCH, robot(TELLER))
            yield Watched(page, network, floor, wrong)
        finally:
            for task in running:
                task.cancel()
            await context.close()
    assert not wrong


async def test_an_answer_of_the_past_that_comes_after_live_was_pressed_is_dropped(
    browser: "Browser", tmp_path: Path
) -> None:
    async with watched(browser, tmp_path) as seen:
        await seen.until_said("^Live")
        seen.network.hold("past")
        await seen.go(15)
        await seen.until_held("past")
        await seen.press_live()
        await seen.until_said("^Live")
        seen.network.release("past")
        await seen.for_s(1)
        await seen.until_said("^Live")


async def test_answers_of_the_past_in_any_order_are_shown_as_what_they_are(browser: "Browser", tmp_path: Path) -> None:
    async with watched(browser, tmp_path) as seen:
        await seen.until_said("^Live")
        await seen.go(8)
        await seen.until_said("^Showing")
        seen.network.hold("past")
        await seen.go(15)
        await seen.until_held("past")
        await seen.for_s(0.5)
        await seen.press_live()
        chosen_s = await seen.go(5)
        await seen.until_held("past", 2)
        seen.network.release("past", lambda answers: answers.reverse())
        await seen.until_said(f"^Showing {datetime.fromtimestamp(chosen_s, UTC):%H:%M:%S}")
        await seen.for_s(0.5)


async def test_the_heat_map_is_of_the_moment_that_is_shown_in_whatever_order_answers_come(
    browser: "Browser", tmp_path: Path
) -> None:
    async with watched(browser, tmp_path) as seen:
        await seen.until_said("^Live")
        seen.network.hold("heat")
        await seen.page.click("#heat")
        await seen.until_held("heat")
        await seen.go(15)
        await seen.until_said("^Showing")
        await seen.until_held("heat", 2)
        seen.network.release("heat", lambda answers: answers.reverse())
        await seen.until("looks.some((look) => look.heat_s !== null)")
        await seen.press_live()
        await seen.until("looks.some((look) => look.status.startsWith('Live') && look.heat_s !== null)")


async def test_a_lost_answer_of_the_past_keeps_no_later_one_away(browser: "Browser", tmp_path: Path) -> None:
    async with watched(browser, tmp_path) as seen:
        await seen.until_said("^Live")
        seen.network.lose("past")
        await seen.go(15)
        await seen.for_s(0.5)
        await seen.press_live()
        seen.network.clear_up()
        await seen.go(8)
        await seen.until_said("^Showing")


async def test_an_answer_of_the_past_that_does_not_come_in_time_is_asked_for_again(
    browser: "Browser", tmp_path: Path
) -> None:
    async with watched(browser, tmp_path) as seen:
        await seen.until_said("^Live")
        late = iter([[3.5]])
        seen.network.fates["past"] = lambda: next(late, AT_ONCE)
        await seen.go(8)
        await seen.until_said("^Showing")


async def test_messages_that_are_all_late_from_the_first_on_are_not_live(browser: "Browser", tmp_path: Path) -> None:
    async with watched(browser, tmp_path, live=lambda: [3.5]) as seen:
        await seen.until_said("behind")
        await seen.for_s(2)
        seen.network.clear_up()
        await seen.until_said("^Live")


async def test_a_connection_that_falls_silent_is_not_live_also_if_the_clock_is_set_back(
    browser: "Browser", tmp_path: Path
) -> None:
    async with watched(browser, tmp_path) as seen:
        await seen.until_said("^Live")
        await seen.page.evaluate("Date.now = () => trueNow() - 480_000")
        await seen.for_s(1)
        seen.network.lose("live")
        await seen.until_said("behind|lost")
        await seen.for_s(2)
        seen.network.clear_up()
        await seen.until_said("^Live")


async def test_a_floor_that_stands_still_at_the_service_is_not_live(browser: "Browser", tmp_path: Path) -> None:
    async with watched(browser, tmp_path) as seen:
        await seen.until_said("^Live")
        seen.floor.runs = False
        await seen.until_said("^Nothing new since")
        await seen.for_s(1)
        seen.floor.runs = True
        await seen.until_said("^Live")


async def test_cards_that_stand_still_beside_a_floor_of_now_are_not_live(browser: "Browser", tmp_path: Path) -> None:
    async with watched(browser, tmp_path) as seen:
        await seen.until("document.querySelectorAll('#situations > li').length === 1")
        seen.network.lose("stream")
        await seen.until_said("^No new warnings arrive")
        seen.floor.tells = False
        await seen.for_s(REVISION_S)
        assert seen.floor.situation
        await seen.floor.face.publish(cleared(seen.floor.situation, "they have passed each other"))
        await seen.until("document.querySelectorAll('#situations > li').length === 0")
        await seen.until_said("^Live")


async def test_lost_lists_are_read_again(browser: "Browser", tmp_path: Path) -> None:
    async with watched(browser, tmp_path, situations=list, presence=list, recorded=list) as seen:
        await seen.until_said("^Loading the warnings")
        seen.network.clear_up()
        await seen.until_said("^Live")


async def test_whatever_becomes_of_answers_and_messages_the_page_says_what_it_shows(
    browser: "Browser", tmp_path: Path
) -> None:
    await asyncio.gather(*(through_storms(browser, tmp_path / str(seed), Random(seed)) for seed in range(2)))


async def through_storms(browser: "Browser", directory: Path, random: Random) -> None:
    directory.mkdir()
    async with watched(browser, directory) as seen:
        await seen.until_said("^Live")
        await seen.page.click("#heat")
        for _ in range(10):
            seen.network.storm(random)
            await seen.for_s(random.uniform(0.3, 1.5))
            await (seen.press_live() if random.random() < 0.4 else seen.go(random.uniform(2, 18)))
        seen.network.clear_up()
        await seen.press_live()
        await seen.until_said("^Live")


async def test_a_page_that_gets_no_frames_says_what_time_it_shows(browser: "Browser", tmp_path: Path) -> None:
    async with watched(browser, tmp_path) as seen:
        await seen.until_said("^Live")
        await seen.page.evaluate("window.requestAnimationFrame = () => 0")
        await seen.for_s(1)
        seen.floor.runs = False
        await seen.until_said("^Nothing new since")


async def test_a_page_that_can_not_show_what_it_is_told_is_not_live(browser: "Browser", tmp_path: Path) -> None:
    """As a page that was opened before an upgrade of the service, which tells of what the page does not know."""
    async with served(tmp_path) as face, ticking(face):
        page = await browser.new_page()
        await page.route_web_socket(re.compile("/stream"), of_a_newer_release)
        await page.goto(face.http)
        await until(page, said("^Live"))
        await face.publish(situation := shown(1, 0, 1))
        await until(page, said("^This page can't show what the service says"))
        assert await page.evaluate("document.documentElement.dataset.state") == "stale"
        await face.publish(cleared(situation, "they have passed each other"))
        await until(page, said("^Live"))
        await page.evaluate(MAP.format("throw new Error('no room for the picture')"))
        await until(page, said("^This page can't show what the service says.*no room for the picture"))
        await page.evaluate(MAP.format("return 0"))
        await until(page, said("^Live"))
        await page.close()


def said(words: str) -> str:
    return f"/{words}/.test(document.getElementById('status').textContent)"


def of_a_newer_release(page: "WebSocketRoute") -> None:
    server = page.connect_to_server()
    page.on_message(server.send)
    server.on_message(lambda message: page.send(str(message).replace('_kind":"meeting"', '_kind":"of tomorrow"')))
