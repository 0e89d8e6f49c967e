"""Situations on the map of the operator's page, and what its filters show, in a real Chromium."""

import time
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from deconflict.operator.vendor_health import vendor_health
from deconflict.settings.shared_places import NamedArea
from deconflict_client.advisory import Severity
from ingest.measures.measures import Measures
from tests.deconflict.operator.http.served_face import HEARD, Served, served
from tests.deconflict.operator.opened_page import (
    CARDS,
    ROBOTS,
    Place,
    cleared,
    name,
    opened,
    shown,
    text,
    ticking,
    until,
)
from tests.helpers.saying import HALL, robot

if TYPE_CHECKING:
    from playwright.async_api import Browser, Page

pytestmark = pytest.mark.asyncio(loop_scope="module")


PICTURES = Path(__file__).parents[3] / "build" / "page"


async def test_the_map_marks_no_robots_of_what_is_far_ahead_or_over(browser: "Browser", face: Served) -> None:
    """The situation is at its first robot. Its last robot is at the other end of the map: marked robots have a ring."""
    ring_pixels = """(() => {
        const canvas = document.getElementById("map"), left = Math.round(0.7 * canvas.width);
        const ink = getComputedStyle(document.documentElement).getPropertyValue("--critical").trim();
        const rgb = [1, 3, 5].map((at) => parseInt(ink.slice(at, at + 2), 16));
        const { data } = canvas.getContext("2d").getImageData(left, 0, canvas.width - left, canvas.height);
        let count = 0;
        for (let i = 0; i < data.length; i += 4) count += rgb.every((value, channel) => data[i + channel] === value);
        return count;
    })()"""
    async with opened(browser, face) as page:

        async def after_two_pictures() -> int:
            await after_pictures(page)
            return int(await page.evaluate(ring_pixels))

        await face.publish(shown(1, 0, ROBOTS - 1, left_s=300.0, severity=Severity.CRITICAL))
        await page.wait_for_selector('[data-id="situation-1"].critical')
        assert await after_two_pictures() == 0
        await page.hover('[data-id="situation-1"]')
        await until(page, f"{ring_pixels} > 0")
        await page.mouse.move(10, 10)
        await until(page, f"{ring_pixels} === 0")
        await face.publish(shown(1, 0, ROBOTS - 1, revision=2, severity=Severity.CRITICAL))
        await until(page, f"{ring_pixels} > 0")
        over = shown(1, 0, ROBOTS - 1, revision=3, severity=Severity.CRITICAL, advice=None, advisories=())
        await face.publish(over)
        await until(page, f"{ring_pixels} === 0")


async def after_pictures(page: "Page") -> None:
    """After two more pictures of the map."""
    drawn = int(await page.evaluate("document.documentElement.dataset.frames"))
    await until(page, f"document.documentElement.dataset.frames > {drawn + 2}")


async def test_a_press_on_a_card_shows_it_on_the_map(browser: "Browser", face: Served) -> None:
    await face.publish(shown(1, 0, 1, severity=Severity.CRITICAL))
    async with opened(browser, face) as page:
        await page.click("#situations .what")
        await page.wait_for_selector('[data-id="situation-1"].chosen')
        assert await text(page, "#situations .show") == "Back"


async def test_another_press_on_a_card_shows_what_the_map_showed_before(browser: "Browser", face: Served) -> None:
    await face.publish(shown(1, 0, 1, severity=Severity.CRITICAL))
    async with opened(browser, face) as page:
        await page.click("#situations .show")
        await page.wait_for_selector('[data-id="situation-1"].chosen')
        await page.click("#situations .show")
        await until(page, "!document.querySelector('#situations .chosen')")
        assert await text(page, "#situations .show") == "Show on the map"


async def test_the_map_goes_back_when_the_situation_that_it_shows_is_over(browser: "Browser", face: Served) -> None:
    situation = shown(1, 0, 1, severity=Severity.CRITICAL)
    await face.publish(situation)
    async with opened(browser, face) as page:
        await page.click("#situations .show")
        await until(page, "document.getElementById('map').dataset.visited === 'situation-1'")
        await face.publish(cleared(situation, "nothing is foreseen there any more"))
        await until(page, "document.getElementById('map').dataset.visited === ''")


async def test_the_box_of_a_robot_closes(browser: "Browser", face: Served) -> None:
    await face.publish(shown(1, 0, 1))
    async with opened(browser, face) as page:
        await page.click("#situations .chip")
        await page.wait_for_selector("#detail:not([hidden])")
        assert "forecast from" in await text(page, "#detail")
        await page.click("#detail .close")
        await page.wait_for_selector("#detail", state="hidden")


async def test_a_situation_without_a_place_has_no_map_button(browser: "Browser", face: Served) -> None:
    await face.publish(shown(1, 0, 1, location=None, outline=(), advice=None, situation_kind="identity"))
    async with opened(browser, face) as page:
        assert await page.is_visible("#situations .take")
        assert not await page.is_visible("#situations .show")


async def test_the_filter_of_places_compares_ids_and_reads_no_sentence(browser: "Browser", face: Served) -> None:
    script = """async () => {
        const { Filters } = await import("/page/list/filters.js");
        const filters = new Filters({ changed() {}, showRobot() {} }), square = [[0, 0], [4, 0], [4, 4], [0, 4]];
        const lane = (number) => ({ id: `lane-${number}`, name: `Lane ${number}`, polygon: square, floor: "hall" });
        filters.choices([], [lane(1), lane(10)], []);
        document.getElementById("by-place").value = "lane-1";
        const at = (x, ...ids) => ({
            severity: "warning", vendors: [], location: { datum: "hall", x, y: 1 }, summary: "near Lane 10",
            places: ids.length ? ids.map((id) => ({ id })) : undefined,
        });
        const found = [at(1), at(9), at(9, "lane-10"), at(9, null, "lane-1")].map((each) => filters.matches(each));
        document.getElementById("by-place").value = "";
        return found;
    }"""
    async with opened(browser, face) as page:
        assert await page.evaluate(script) == [True, False, False, True]


async def test_the_filter_hides_others_and_says_how_many(browser: "Browser", face: Served) -> None:
    borealis = ("Alder", "Borealis")
    await face.publish(shown(1, 0, 1, severity="critical"), shown(2, 4, 5, severity="caution", vendors=borealis))
    async with opened(browser, face) as page:
        await page.select_option("#by-severity", "critical")
        await until(page, f"{CARDS}.map((card) => card.dataset.id).join() === 'situation-1'")
        await until(page, "document.getElementById('filtered').textContent.startsWith('1 situation hidden')")
        await page.click("#all")
        await until(page, f"{CARDS}.length === 2")


async def test_the_age_of_a_robot_that_is_not_heard_stands_beside_it(browser: "Browser", face: Served) -> None:
    """At a scale at which other robots have no name."""
    script = """async () => {
        const { FloorMap } = await import("/page/map/floor_map.js");
        const { Vendors } = await import("/page/list/vendors.js");
        const camera = { width: 900, height: 100, scale: 9, px: (x) => 9 * x, py: (y) => 9 * y,
                         metres: (px, py) => [px / 9, py / 9] };
        const map = new FloorMap(document.createElement("canvas"), camera, new Vendors());
        const robots = [["", 1], ["quiet", 5], ["silent", 150]].map(([away, ageS], i) => ({
            uuid: `${i}`, name: `Robot ${i}`, away, vendor: "V", knots: [0, 20 + 25 * i, 5, 0], eventS: 0,
            arrivalS: -ageS, lengthM: 1, widthM: 1, doubtM: 0, trailers: [] }));
        const nobody = { involved: new Map(), advised: new Map(), contended: new Map(), highlighted: new Set(),
                         first: new Set(), picked: new Set(), areas: [], obstacles: [], marks: [], exits: [] };
        const texts = [];
        map.text = (text) => { if (text.startsWith("Robot")) texts.push(text); };
        map.draw({ ...nobody, theme: "light", situations: [], places: [], robots, poseS: () => 0, nowS: 0 });
        return texts;
    }"""
    async with opened(browser, face) as page:
        assert sorted(await page.evaluate(script)) == ["Robot 1, heard 5 s ago", "Robot 2 silent 2.5 min"]


async def test_a_robot_is_found_by_a_part_of_its_name(browser: "Browser", face: Served) -> None:
    async with opened(browser, face) as page:
        await until(page, "document.querySelectorAll('#names option').length > 2")
        await page.fill("#robot", robot("A-2")[:8])
        await page.keyboard.press("Enter")
        await until(page, f"document.getElementById('detail').textContent.includes('{robot('A-2')[:8]}')")


async def test_a_search_that_finds_no_robot_or_several_says_so(browser: "Browser", face: Served) -> None:
    async with opened(browser, face) as page:
        await until(page, "document.querySelectorAll('#names option').length > 2")
        await page.fill("#robot", "Nobody")
        await page.keyboard.press("Enter")
        await until(page, "document.getElementById('not-found').textContent === 'No robot has “Nobody” in its name.'")
        await page.fill("#robot", "unknown")
        assert not await text(page, "#not-found")
        await page.keyboard.press("Enter")
        await until(page, f"document.getElementById('not-found').textContent.startsWith('{ROBOTS} robots have')")
        assert not await page.is_visible("#detail")


@pytest.mark.parametrize(("width", "height"), [(360, 740), (800, 740), (820, 1180), (1024, 768), (1180, 820)])
async def test_on_a_phone_and_a_tablet_the_box_of_a_robot_covers_no_part_of_the_map(
    browser: "Browser", face: Served, width: int, height: int
) -> None:
    async with opened(browser, face, width, height) as page:
        await until(page, "document.querySelectorAll('#names option').length > 2")
        await page.fill("#robot", robot("A-2")[:8])
        await page.keyboard.press("Enter")
        await page.wait_for_selector('#detail .follow[aria-pressed="true"]')
        of_map, of_box = [await page.locator(each).bounding_box() for each in ("#map", "#detail")]
        assert of_map
        assert of_box
        assert of_map["y"] >= 0
        assert of_map["height"] > (0.5 if width <= 800 else 0.39) * height
        assert of_box["y"] >= of_map["y"] + of_map["height"]
        assert of_box["y"] + 60 < height, "title and buttons of the box are on the screen"
        PICTURES.mkdir(parents=True, exist_ok=True)
        await page.screenshot(path=PICTURES / f"phone-robot-{width}.png")


async def test_clearing_the_search_closes_the_box_of_the_robot_that_it_found(browser: "Browser", face: Served) -> None:
    async with opened(browser, face) as page:
        await until(page, "document.querySelectorAll('#names option').length > 2")
        await page.fill("#robot", robot("A-2")[:8])
        await page.keyboard.press("Enter")
        await page.wait_for_selector("#detail:not([hidden])")
        assert robot("A-2")[:8] in await page.input_value("#robot")
        await page.fill("#robot", "")
        await page.wait_for_selector("#detail", state="hidden")
        await page.fill("#robot", robot("A-2")[:8])
        await page.keyboard.press("Enter")
        await page.click("#detail .close")
        await until(page, "document.getElementById('robot').value === ''")


async def test_a_robot_that_was_found_is_followed_until_the_map_is_moved_by_hand(
    browser: "Browser", face: Served
) -> None:
    async with opened(browser, face) as page:
        await until(page, "document.querySelectorAll('#names option').length > 2")
        await page.fill("#robot", robot("A-2")[:8])
        await page.keyboard.press("Enter")
        await page.wait_for_selector('#detail .follow[aria-pressed="true"]')
        await page.keyboard.press("Tab")
        await page.focus("#map")
        await page.keyboard.press("+")
        await until(page, "document.querySelector('#detail .follow').ariaPressed === 'true'")
        await page.keyboard.press("ArrowLeft")
        await page.wait_for_selector('#detail .follow[aria-pressed="false"]')
        await page.click("#detail .follow")
        await page.wait_for_selector('#detail .follow[aria-pressed="true"]')


async def test_the_box_says_what_a_robot_is_doing_as_far_as_it_says(browser: "Browser", face: Served) -> None:
    doing = {"destination": {"floor": HALL, "x": 4.0, "y": 1.0, "expected_s": time.time() + 1000}, "battery_pct": 83.0}
    face.sources.heard = [
        {**HEARD, "uuid": robot("A-2"), "vendor": "Alder", "age_s": 0.1, **doing, "load_used_pct": 0.0}
    ]
    async with opened(browser, face) as page:
        await until(page, "document.querySelectorAll('#names option').length > 2")
        await page.fill("#robot", robot("A-2")[:8])
        await page.keyboard.press("Enter")
        await until(page, "document.getElementById('detail').textContent.includes('goes to4.0, 1.0, in 1')")
        detail = await text(page, "#detail")
    assert "battery83 %load" in detail
    assert "loadnonelast message" in detail


async def test_a_person_on_foot_walks_and_drives_nothing(browser: "Browser", face: Served) -> None:
    script = """async () => {
        const { fillTable } = await import("/page/list/robots.js"), body = document.querySelector("table tbody");
        const here = { state: "navigating", knots: [0, 0, 0], arrivalS: 0 };
        const both = ["person", "robot"].map((participant) => ({ ...here, name: participant, participant }));
        fillTable(body, both, 0, () => false, new Map());
        return [...body.rows].map((row) => row.cells[1].textContent);
    }"""
    async with opened(browser, face) as page:
        assert await page.evaluate(script) == ["walks", "drives"]


async def test_labels_cover_neither_robots_nor_each_other_and_stay_where_they_are(
    browser: "Browser", face: Served
) -> None:
    script = """async () => {
        const { Labels } = await import("/page/map/labels.js");
        const places = [[200, 200], [212, 204], [190, 196], [205, 214], [198, 186], [230, 190], [225, 215], [180, 210]];
        const things = places.map(([x, y]) =>
            ({ left: x - 8, right: x + 8, top: y - 5, bottom: y + 5, wide: 16, high: 10 }));
        const labels = new Labels(), frame = () => {
            labels.begin({ width: 600, height: 400 }, 1);
            for (const thing of things) labels.take(thing);
            return things.map((thing, i) => labels.place(i, thing, 90, 18, { must: true }));
        };
        const first = frame(), second = frame();
        const overlap = (a, b) =>
            a.left < b.left + b.wide && b.left < a.left + a.wide && a.top < b.top + b.high && b.top < a.top + a.high;
        return {
            covering: first.filter((a, i) => [...things, ...first.slice(i + 1)].some((b) => overlap(a, b))).length,
            still: JSON.stringify(first) === JSON.stringify(second),
            lines: first.filter(({ line }) => line).length,
        };
    }"""
    async with opened(browser, face) as page:
        found = await page.evaluate(script)
    assert (found["covering"], found["still"]) == (0, True)
    assert found["lines"] > 0, "a label that is far has a line to its robot"


async def test_a_situation_is_outlined_on_the_map_and_can_be_chosen_there(browser: "Browser", face: Served) -> None:
    await face.publish(shown(1, 0, 1, 2), shown(2, 6, 7, 8))
    async with opened(browser, face) as page:
        await page.click('[data-id="situation-2"] .show')
        await page.wait_for_selector('[data-id="situation-2"].chosen')
        box = await page.locator("#map").bounding_box()
        assert box
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        await page.mouse.click(x, box["y"] + 30)
        await page.wait_for_selector(".chosen", state="detached")
        await page.mouse.click(x, y)
        await page.wait_for_selector('[data-id="situation-2"].chosen')
        await page.click('[data-id="situation-1"] .chip >> nth=2')
        await until(page, f"document.getElementById('detail').textContent.includes('{robot('A-2')[:8]}')")
        await page.wait_for_selector('[data-id="situation-1"].chosen')


async def test_the_page_says_what_vendors_should_mend_and_who_is_compared_with_nobody(
    browser: "Browser", face: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    odd = {"rule": "key-unknown", "path": "location.planarDatm", "value": "3", "reading": "not at all"}
    value = odd | {"nearest": "planarDatum", "robots": 2, "count": 5, "last_received": "2026-01-01T00:00:00Z"}
    robots = [
        {"uuid": uuid, "name": called, "reason": why, "fault": "no map", "placed": placed}
        for uuid, called, why, placed in (
            (robot("A-0"), name(0), "its position names no map", True),
            ("other", "Alder A-99", "no position of it has come", False),
        )
    ]
    measures = Measures()
    measures.count("deconflict_messages_total", "Alder", "accepted")
    senders = [{"vendor": "Alder", "odd_values": [value], "not_compared": robots}]
    (vendor,) = vendor_health([measures.as_document()], senders)
    shown_vendor = vendor.model_dump(mode="json", exclude={"name"})
    monkeypatch.setitem(face.sources.live, "vendors", {"Alder": shown_vendor})
    monkeypatch.setitem(face.sources.live, "brokers", ["hall: set mqtt_sources.prefixes"])
    await face.publish(shown(1, 0, 1))
    async with opened(browser, face) as page:
        await until(page, "document.querySelectorAll('#to-mend li').length === 4")
        lines = await page.evaluate("[...document.querySelectorAll('#to-mend li')].map((line) => line.textContent)")
        assert lines == [
            "Alder A-0 is compared with nobody: its position names no map",
            "Alder A-99 is compared with nobody: no position of it has come",
            "Alder, 2 robots: location.planarDatm: sent 3, read: not at all (key-unknown); did you mean planarDatum?",
            "hall: set mqtt_sources.prefixes",
        ]
        assert "2 robots compared with nobody" in await text(page, "#vendors")
        await page.click("#robots summary")
        await until(page, "document.querySelector('#robots tbody').textContent.includes('Alder A-99on no floor')")
        await page.click("#situations .chip")
        await page.wait_for_selector("#detail:not([hidden])")
        assert "not comparedits position names no map" in await text(page, "#detail")


async def test_ground_to_keep_clear_is_hatched_and_in_the_legend(browser: "Browser", face: Served) -> None:
    square = ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0))
    areas = [NamedArea(name="Yard", floor=HALL, outline_m=square, keep_clear=is_kept) for is_kept in (False, True)]
    script = """async (areas) => {
        const { GroundLayer } = await import("/page/map/ground_layer.js");
        const camera = { width: 900, height: 600, scale: 50, px: (x) => 100 + 50 * x, py: (y) => 400 - 50 * y };
        const pen = document.createElement("canvas").getContext("2d");
        Object.assign(pen.canvas, { width: 900, height: 600 });
        new GroundLayer({ pen, camera, ink: { faint: "#ff0000" } }).keptClear({ areas });
        const inked = (x, y) => pen.getImageData(x, y, 40, 40).data.some((value) => value > 0);
        return [inked(150, 250), inked(310, 250), inked(150, 50), inked(150, 450)];
    }"""
    async with opened(browser, face) as page:
        assert await page.locator("#keep-clear").is_hidden()
        drawn = [{"polygon": square, "keep_clear": area.keep_clear} for area in areas]
        assert await page.evaluate(script, drawn) == [True, False, False, False]
        assert await page.evaluate(script, drawn[:1]) == [False] * 4
    face.app.state.site = face.app.state.site.model_copy(update={"areas": tuple(areas)})
    async with opened(browser, face) as page:
        await until(page, "!document.getElementById('keep-clear').hidden")
        assert (await page.locator("#keep-clear").inner_text()).strip() == "Keep clear: advice sends no robot there"


COUNT_SEEN = """import(new URL("page/map/floor_map.js", location)).then(({ FloorMap }) => {
    const { draw } = FloorMap.prototype;
    FloorMap.prototype.draw = function (scene) {
        const seen = draw.call(this, scene), far = scene.robots.find((robot) => robot.x > 1000);
        window.seen = `${seen} of ${scene.robots.length} at ${this.camera.scale.toFixed(3)}, far: ${Boolean(far)}`;
    };
})"""
FAR = {"A-far": (12_000.0, 8_000.0)}
NEAR = {f"A-{i}": (10.0 + 2.0 * i, 20.0) for i in range(4)}


async def test_a_robot_that_says_it_is_far_away_puts_nobody_out_of_sight(browser: "Browser", tmp_path: Path) -> None:
    """As one that sends millimetres: no map shows it and the others at once."""
    others: dict[str, Place] = {}
    async with served(tmp_path) as face, ticking(face, others), opened(browser, face) as page:
        await page.evaluate(COUNT_SEEN)
        await until(page, f"window.seen?.startsWith('{ROBOTS} of {ROBOTS}')")
        before = await page.evaluate("window.seen")
        others["A-mm"] = (12_000.0, 0.0)
        with_it = before.replace(f"of {ROBOTS}", f"of {ROBOTS + 1}").replace("false", "true")
        await until(page, f"window.seen === '{with_it}'")
        await page.press("#map", "0")
        await after_pictures(page)
        assert await page.evaluate("window.seen") == with_it


@pytest.mark.parametrize(
    "steps",
    [
        pytest.param([(FAR, "1 of 1"), (NEAR, "4 of 5")], id="it is heard first"),
        pytest.param(
            [({"A-far": (10.0, 20.0)}, "1 of 1"), (FAR, "1 of 1"), ({"A-far": (10.0, 20.0)}, "1 of 1")],
            id="it comes back",
        ),
        pytest.param([({"A-0": (100.0, 200.0), "A-far": (12_000.0, -8_000.0)}, "1 of 2")], id="one of two"),
    ],
)
async def test_somebody_is_in_sight_wherever_robots_say_they_are(
    browser: "Browser", tmp_path: Path, steps: list[tuple[dict[str, Place], str]]
) -> None:
    """And as many as a map can show, though nobody asks for the whole floor again."""
    others: dict[str, Place] = {}
    async with served(tmp_path) as face, ticking(face, others, row=0), opened(browser, face) as page:
        await page.evaluate(COUNT_SEEN)
        for places, seen in steps:
            others |= places
            is_far = str(any(x_m > 1000.0 for x_m, _ in others.values())).lower()
            await until(page, f"/^{seen} at .*far: {is_far}$/.test(window.seen)")
