"""The operator's page while a test looks at it, and the situations that the test publishes."""

import asyncio
import time
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import Site
from deconflict_client.advisory import Action, ClearedCode, ConflictAdvisory, Location, moment
from deconflict_client.situations import Situation, SituationAdvice
from ingest.fleet.fleet import Fleet
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from tests.deconflict.operator.http.served_face import Served
from tests.helpers.made_advisories import made, situation
from tests.helpers.patience import PATIENCE_S
from tests.helpers.saying import HALL, robot, status

if TYPE_CHECKING:
    from playwright.async_api import Browser, Page

ROBOTS, TICK_S = 12, 0.2
Place = tuple[float, float]
"""x and y in metres."""
CARDS = "[...document.querySelectorAll('#situations > li:not([hidden])')]"


def name(i: int) -> str:
    return f"Alder A-{i}"


@asynccontextmanager
async def ticking(
    face: Served, others: Mapping[str, Place] = MappingProxyType({}), row: int = ROBOTS
) -> AsyncIterator[None]:
    """Robots that stand in a row, 2 m apart, and report at each tick. So do `others`, by name."""
    fleet = fleet_of(Site(), Measures())

    async def tick() -> None:
        while True:
            report(fleet, time.time(), row, others)
            face.sources.whole = fleet.snapshot(time.time())
            face.sources.recent.add(time.time(), fleet.next_batch(time.time()).to_bytes())
            await asyncio.sleep(TICK_S)

    task = asyncio.create_task(tick())
    try:
        yield
    finally:
        task.cancel()


def report(fleet: Fleet, now_s: float, row: int, others: Mapping[str, Place]) -> None:
    for robot_name, (x_m, y_m) in ({f"A-{i}": (2.0 * i, 0.0) for i in range(row)} | {**others}).items():
        fleet.receive(status(robot_name, now_s, x_m, y_m), now_s, Connection(1))


@asynccontextmanager
async def opened(browser: "Browser", face: Served, width: int = 1400, height: int = 850) -> AsyncIterator["Page"]:
    """The page once it is live. What it throws fails the test."""
    page, wrong = await browser.new_page(viewport={"width": width, "height": height}), []
    page.set_default_timeout(1000 * PATIENCE_S)
    page.on("pageerror", lambda error: wrong.append(str(error)))
    await page.goto(face.http)
    await page.wait_for_selector('[data-state="live"]')
    await until(page, "!document.getElementById('none').textContent.startsWith('Loading')")
    try:
        yield page
    finally:
        await page.close()
    assert not wrong


async def until(page: "Page", condition: str) -> None:
    async with asyncio.timeout(PATIENCE_S):
        while not await page.evaluate(condition):
            await asyncio.sleep(0.05)


async def text(page: "Page", selector: str) -> str:
    return await page.text_content(selector) or ""


def around(x: float) -> tuple[tuple[float, float], ...]:
    return ((x - 2, -2), (x + 2, -2), (x + 2, 2), (x - 2, 2))


def shown(number: int, *robots: int, revision: int = 1, left_s: float = 30.0, **fields: Any) -> Situation:
    """A situation of some robots, around the first of them, that begins soon."""
    now_s, x = time.time(), 2.0 * robots[0]
    whole = {
        "robots": tuple(robot(f"A-{i}") for i in robots),
        "names": tuple(name(i) for i in robots),
        "vendors": ("Alder",) * len(robots),
        "raised_at": moment(now_s),
        "updated_at": moment(now_s),
        "since_at": moment(now_s),
        "predicted_at": moment(now_s + left_s),
        "location": Location(datum=HALL, x=x, y=0.0),
        "outline": around(x),
        "summary": f"{name(robots[0])} and others meet in 5 s at Column {number}",
        "advice": advice(robots[0]),
    }
    return situation(number, revision, **(whole | fields))


def advice(i: int, seconds: float = 4.0, because: str = "") -> SituationAdvice:
    text = f"{name(i)} should wait {seconds:.0f} s"
    wait = Action(robot=robot(f"A-{i}"), name=name(i), action="wait", seconds=seconds, text=text)
    return SituationAdvice(actions=(wait,), text=text, since_at=moment(time.time()), changed_because=because)


def cleared(before: Situation, because: str, **fields: Any) -> Situation:
    ended = before.cleared_revision(time.time(), ClearedCode.PASSED, because)
    return ended.model_copy(update={"advice": None, "advisories": (), **fields})


def warning(number: int, situation_id: str | None = None) -> ConflictAdvisory:
    now = moment(time.time())
    place = Location(datum=HALL, x=0.0, y=0.0)
    summary, headline = "Tug 1 and Lift 2 cross in 4 s; Tug 1 should wait 3 s", "Tug 1 and Lift 2 cross"
    fields: dict[str, Any] = {
        "raised_at": now,
        "updated_at": now,
        "predicted_at": now,
        "location": place,
        "summary": summary,
        "headline": headline,
    }
    return made(number, situation_id=situation_id, **fields)
