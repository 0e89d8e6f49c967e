"""The operator's page in a real Chromium, on the real service, with the simulated vendors."""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import pytest

from deconflict.simulation.demo.demo_site import demo_site
from tests.deconflict.roles.made_service import free_ports
from tests.deconflict.roles.role_processes import children
from tests.helpers.patience import PATIENCE_S

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

    Scheme = Literal["dark", "light"]

sync_api = pytest.importorskip("playwright.sync_api", reason="playwright drives the browser")
CHROMIUM = shutil.which("chromium")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="chromium is the browser that the page is looked at with")

MEZZANINE = "7d2b1c8e-3f64-4a95-9c1d-5e8f20a6b302"
PICTURES = Path(__file__).parents[3] / "build" / "page"
PATIENCE_MS = 1000 * PATIENCE_S
WARNED = "#situations li, #machines:not([hidden])"
"""Selects what a page has once something is foreseen: a card of a situation, or warnings that need nobody."""


class Service:
    """The service and the simulated vendors, each a process; the service can be ended and started again."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._robots, self._face = free_ports(2)
        self._site = directory / "site.toml"
        ports = f"\n[receiver]\nport = {self._robots}\n\n[operator]\nport = {self._face}\n"
        self._site.write_text(demo_site().read_text() + ports)
        self.robots_url = f"ws://127.0.0.1:{self._robots}"
        self.url = f"http://127.0.0.1:{self._face}/"
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def start(self) -> None:
        self._run("serve", str(self._site), "--data", str(self._directory / "data"))

    def simulate(self) -> None:
        self._run("simulate", "--url", f"ws://127.0.0.1:{self._robots}", "--robots", "24")

    def role(self, name: str) -> int:
        """The process id of a role."""
        return children(self._running["serve"].pid)[name]

    def stop(self, command: str) -> None:
        process = self._running.pop(command)
        process.send_signal(signal.SIGINT)
        process.wait(PATIENCE_S)

    def stop_all(self) -> None:
        for command in reversed(list(self._running)):
            self.stop(command)

    def _run(self, command: str, *arguments: str) -> None:
        with (self._directory / f"{command}.log").open("ab") as log:
            self._running[command] = subprocess.Popen(
                [sys.executable, "-m", "deconflict", command, *arguments], stdout=log, stderr=log
            )


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    made_service = Service(tmp_path_factory.mktemp("page"))
    made_service.start()
    yield made_service
    made_service.stop_all()


@pytest.fixture(scope="module")
def floor(service: Service) -> Service:
    """The service once vendors talk to it; tests that need an empty floor come before those that need this."""
    service.simulate()
    return service


@pytest.fixture(scope="module")
def browser() -> Iterator["Browser"]:
    with sync_api.sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield chromium
        chromium.close()


@contextmanager
def opened(
    browser: "Browser", service: Service, width: int = 1400, height: int = 850, scheme: "Scheme" = "light"
) -> Iterator["Page"]:
    """The page once it is live; what it throws or is forbidden to load fails the test."""
    context = browser.new_context(viewport={"width": width, "height": height}, color_scheme=scheme)
    page, wrong = context.new_page(), []
    page.set_default_timeout(PATIENCE_MS)
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("console", lambda worker: wrong.append(worker.text) if "Content Security" in worker.text else None)
    arrive(page, service)
    yield page
    context.close()
    assert not wrong


def arrive(page: "Page", service: Service) -> None:
    """Open the page, once the service serves it."""
    until_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < until_s:
        try:
            page.goto(service.url)
            break
        except sync_api.Error:
            page.wait_for_timeout(100)
    page.wait_for_selector('[data-state="live"]')


def until(page: "Page", condition: str) -> None:
    """Wait for a condition in the page, asked from outside: the page's own policy forbids to evaluate text in it."""
    until_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < until_s:
        if page.evaluate(condition):
            return
        page.wait_for_timeout(50)
    raise AssertionError(condition)


def said_and_grey(words: str, part: str = "#stage") -> str:
    """A condition: the page says so, and a part of it is grey."""
    grey = f"getComputedStyle(document.querySelector('{part}')).filter.includes('grayscale')"
    return f"document.getElementById('status').textContent.includes('{words}') && {grey}"


def keep(page: "Page", name: str, *, full_page: bool = False) -> None:
    PICTURES.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=PICTURES / f"{name}.png", full_page=full_page)


def test_a_floor_without_robots_says_so(browser: "Browser", service: Service) -> None:
    with opened(browser, service) as page:
        page.wait_for_selector("#nothing:not([hidden])")
        until(page, "document.getElementById('nothing').textContent.startsWith('No robot has been heard yet')")
        assert page.is_visible("#none")
        keep(page, "empty")


def test_the_page_counts_the_robots_in_a_place_as_the_service_does(browser: "Browser", service: Service) -> None:
    """A zone has whoever touches it, corner or edge; a resource whoever's middle is inside."""
    script = """async () => {
        const { countIn } = await import("/page/map/places.js");
        const holds = (place, robot) => countIn([place], [robot])[0] === 1;
        const polygon = [[0, 0], [4, 0], [4, 2], [0, 2]], robot = { lengthM: 1, widthM: 0.5, yaw: 0 };
        const at = (kind, x, y, yaw = 0) => holds({ kind, polygon }, { ...robot, x, y, yaw });
        return {
            aisle: [at("aisle", 4.4, 1), at("aisle", 4.6, 1), at("aisle", 4.4, 1, Math.PI / 2), at("aisle", 2, 1)],
            dock: [at("dock", 4.4, 1), at("dock", 3.9, 1), at("dock", 2, 2.1)],
            across: holds({ kind: "door", polygon }, { x: 2, y: 1, yaw: 0, lengthM: 9, widthM: 0.5 }),
            unknown: holds({ kind: "door", polygon }, robot),
            apart: countIn([{ kind: "dock", polygon }], [-9.9, 0.1, 3.9, 10.1].map((x) => ({ ...robot, x, y: 1 }))),
        };
    }"""
    with opened(browser, service) as page:
        assert page.evaluate(script) == {
            "aisle": [True, False, False, True],
            "dock": [False, True, False],
            "across": True,
            "unknown": False,
            "apart": [2],
        }


def test_a_place_counts_a_robot_from_its_first_picture_on(browser: "Browser", service: Service) -> None:
    """Robots that have just reported are new to the map."""
    script = """async () => {
        const { FloorMap } = await import("/page/map/floor_map.js");
        const { Vendors } = await import("/page/list/vendors.js");
        const camera = { width: 100, height: 100, scale: 10, px: (x) => 10 * x, py: (y) => 10 * y,
                         metres: (px, py) => [px / 10, py / 10] };
        const map = new FloorMap(document.createElement("canvas"), camera, new Vendors());
        const place = { id: "c", name: "C", kind: "charger", capacity: 1, polygon: [[0, 0], [4, 0], [4, 4], [0, 4]] };
        const robot = { uuid: "r", name: "R", vendor: "V", knots: [0, 2, 2, 0], eventS: 0, lengthM: 1, widthM: 1,
                        doubtM: 0, trailers: [] };
        const nobody = { involved: new Map(), advised: new Map(), contended: new Map(), highlighted: new Set(),
                         first: new Set(), picked: new Set(), areas: [], obstacles: [], marks: [], exits: [] };
        const shown = { ...nobody, theme: "light", situations: [], poseS: () => 0, nowS: 0 };
        map.draw({ ...shown, places: [place], robots: [robot] });
        return place.taken;
    }"""
    with opened(browser, service) as page:
        assert page.evaluate(script) == 1


def test_keys_alone_reach_the_floors_the_map_and_the_slider(browser: "Browser", floor: Service) -> None:
    with opened(browser, floor) as page:
        page.focus('#tabs [aria-selected="true"]')
        page.keyboard.press("ArrowRight")
        until(page, "document.querySelector('#tabs [aria-selected=true]').textContent.startsWith('Mezz')")
        until(page, "document.getElementById('map').ariaLabel.startsWith('Map of Mezzanine')")
        page.focus("#map")
        for key in ("ArrowLeft", "+", "-", "0"):
            page.keyboard.press(key)
        missing = {"theme", "moment"}
        for _ in range(400):
            page.keyboard.press("Tab")
            missing.discard(page.evaluate("document.activeElement.id"))
            if not missing:
                break
        assert not missing


def test_a_situation_of_the_service_is_a_card_and_is_shown_at_its_place(browser: "Browser", floor: Service) -> None:
    press_first = "document.querySelector('#situations li:not(.ended) .show:not([hidden])')?.click()"
    with opened(browser, floor) as page:
        until(page, f"({press_first}, document.querySelector('#situations li.chosen'))")
        keep(page, "situation")


def test_the_slider_goes_back_to_what_was_recorded_and_live_returns(browser: "Browser", floor: Service) -> None:
    with opened(browser, floor, scheme="dark") as page:
        until(page, "/: [1-9]/.test(document.getElementById('map').ariaLabel)")
        since_s = page.evaluate("Date.now() / 1000")
        until(page, f"((moment) => !moment.disabled && moment.max > {since_s} + 6)(document.getElementById('moment'))")
        page.focus("#moment")
        for _ in range(5):
            page.keyboard.press("ArrowLeft")
        page.wait_for_selector('[data-state="past"]')
        until(page, "/^Showing [0-9:]+, [0-9]+ s ago$/.test(document.getElementById('status').textContent)")
        until(page, "document.getElementById('shown').textContent === document.getElementById('clock').textContent")
        until(page, "/: [1-9]/.test(document.getElementById('map').ariaLabel)")
        keep(page, "past")
        page.click("#live")
        page.wait_for_selector('[data-state="live"]')
        until(page, "document.getElementById('shown').textContent === 'live'")


def test_a_link_to_a_moment_shows_it_and_its_floor(browser: "Browser", floor: Service) -> None:
    with opened(browser, floor) as page:
        until(page, "document.querySelectorAll('#tabs [role=tab]').length === 2")
        until(
            page,
            "((moment) => !moment.disabled && moment.max > Number(moment.min) + 5)(document.getElementById('moment'))",
        )
        at = page.evaluate("new Date(1000 * (Number(document.getElementById('moment').min) + 2)).toISOString()")
        page.evaluate(f"location.hash = 'at={at}&floor={MEZZANINE}'")
        page.wait_for_selector('[data-state="past"]')
        until(page, "document.querySelector('#tabs [aria-selected=true]').textContent.startsWith('Mezzanine')")
        until(page, f"new Date(1000 * document.getElementById('moment').value).toISOString() === '{at}'")


def test_the_shift_summary_begins_when_something_is_known(browser: "Browser", floor: Service) -> None:
    with opened(browser, floor) as page:
        page.wait_for_selector(WARNED)
        page.click("#shift-open")
        until(
            page, "document.getElementById('shift-body').textContent.includes('(of the time before nothing is known)')"
        )


def test_what_it_costs_is_said_of_today(browser: "Browser", floor: Service) -> None:
    with opened(browser, floor) as page:
        page.wait_for_selector(WARNED)
        page.click("#costs-open")
        until(page, "document.getElementById('costs-body').textContent.includes(' robots and people lost')")
        assert page.locator("#costs-body h3").all_text_contents() == [
            "The five worst places today",
            "What to change",
            "The five worst pairs today",
            "Today by hour",
        ]
        page.click("#costs-close")


@pytest.mark.parametrize(
    ("name", "width", "height", "scheme"),
    [
        ("light", 1280, 800, "light"),
        ("dark", 1400, 850, "dark"),
        ("phone", 390, 844, "light"),
        ("tablet", 820, 1180, "dark"),
        ("wall", 2560, 1440, "dark"),
    ],
)
def test_the_page_fits_each_screen(
    browser: "Browser", floor: Service, name: str, width: int, height: int, scheme: "Scheme"
) -> None:
    with opened(browser, floor, width, height, scheme) as page:
        page.wait_for_selector(WARNED)
        until(page, "document.querySelectorAll('#vendors tbody tr').length === 4")
        # every vendor has a cell in every column, and the panel fits
        assert page.evaluate("[...document.querySelectorAll('#vendors tr')].every((row) => row.cells.length === 4)")
        assert page.evaluate("[...document.querySelectorAll('#figures tr')].every((row) => row.cells.length === 7)")
        assert page.evaluate("(aside => aside.scrollWidth <= aside.clientWidth)(document.querySelector('aside'))")
        assert page.evaluate("document.getElementById('map').clientWidth >= 0.6 * innerWidth")
        page.click("#heat")
        until(page, "document.getElementById('heat').ariaPressed === 'true'")
        page.click("#heat")
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        assert page.evaluate("document.documentElement.dataset.theme") == scheme
        keep(page, name, full_page=name in ("phone", "tablet"))


def test_a_lost_connection_is_shown_and_greys_the_map_and_the_page_reconnects(
    browser: "Browser", floor: Service
) -> None:
    with opened(browser, floor) as page:
        page.wait_for_selector(WARNED)
        floor.stop("serve")
        page.wait_for_selector('[data-state="lost"]')
        until(page, said_and_grey("lost"))
        until(page, "document.getElementById('none').textContent.startsWith('Not known: no connection')")
        assert page.is_visible(WARNED)
        keep(page, "lost")
        floor.start()
        page.wait_for_selector('[data-state="live"]')
        page.wait_for_selector(WARNED)
        until(page, "getComputedStyle(document.getElementById('stage')).filter === 'none'")


def test_a_stopped_engine_is_shown_and_greys_the_cards_while_robots_are_shown_on(
    browser: "Browser", floor: Service
) -> None:
    with opened(browser, floor) as page:
        engine = floor.role("engine")
        os.kill(engine, signal.SIGSTOP)
        try:
            until(page, said_and_grey("No warnings", "aside"))
            keep(page, "unwarned")
        finally:
            with suppress(ProcessLookupError):  # one that stands for long is killed
                os.kill(engine, signal.SIGCONT)
        page.wait_for_selector('[data-state="live"]')


def test_the_page_follows_the_dark_theme_of_the_system(browser: "Browser", floor: Service) -> None:
    with opened(browser, floor, scheme="light") as page:
        page.emulate_media(color_scheme="dark")
        page.wait_for_selector('[data-theme="dark"]')
