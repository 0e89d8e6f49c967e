"""The cards of situations on the operator's page, in a real Chromium, for situations that the test publishes."""

import re
import time
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from deconflict_client.advisory import Acknowledgement, Action, ClearedCode, Severity, moment
from deconflict_client.answers.vendor_models import VendorHealth
from tests.deconflict.operator.http.served_face import Served
from tests.deconflict.operator.opened_page import (
    CARDS,
    ROBOTS,
    advice,
    cleared,
    name,
    opened,
    shown,
    text,
    until,
    warning,
)
from tests.helpers.made_advisories import made_advice
from tests.helpers.patience import PATIENCE_S
from tests.helpers.plain_http import http_client
from tests.helpers.saying import robot

if TYPE_CHECKING:
    from playwright.async_api import Browser

pytestmark = pytest.mark.asyncio(loop_scope="module")

PICTURES = Path(__file__).parents[3] / "build" / "page"


NOTE_ALARMS = """() => {
  const started = OscillatorNode.prototype.start, Shown = Notification;
  Object.assign(window, { tones: 0, notices: [] });
  OscillatorNode.prototype.start = function (...at) { tones += 1; return started.apply(this, at); };
  window.Notification = class extends Shown {
    constructor(title, options) { super(title, options); notices.push(title); }
  };
}"""
"""Has the page count its tones and list its notifications, which it makes all the same."""


async def test_a_card_is_one_situation_and_the_most_urgent_comes_first(browser: "Browser", face: Served) -> None:
    sentence = f"4 robots get in each other's way in 5 s: {name(6)}, {name(7)} and 2 more, at Column 3"
    headline = "4 robots get in each other's way, at Column 3"
    steps = [advice(6).actions[0], Action(robot=robot("A-7"), name=name(7), action="look", text="look; and look")]
    orders = advice(6).model_copy(update={"actions": tuple(steps)})
    texts: dict[str, Any] = {"summary": sentence, "headline": headline, "advice": orders}
    critical = shown(3, 6, 7, severity="critical", situation_kind="knot", **texts)
    await face.publish(shown(1, 0, 1, left_s=60), shown(2, 3, 4, left_s=40), critical, warning(1), warning(2))
    async with opened(browser, face) as page:
        assert await page.evaluate(f"{CARDS}.map((card) => card.dataset.id)") == [f"situation-{i}" for i in (3, 2, 1)]
        card = await text(page, "#situations > li")
        assert "Critical" in card
        assert "Knot of robots" in card
        assert "4 robots get in each other's way, at Column 3" in card, "the countdown beside it says when"
        assert f"{name(7)}" not in card, "its robots are listed beside the sentence"
        assert (await text(page, "#situations .first")).startswith(f"{name(6)} should wait ")
        assert await text(page, "#situations .then") == "Then: look; and look"
        first = await text(page, "#situations .when")
        assert first.startswith("in ")
        await until(page, f"document.querySelector('#situations .when').textContent !== '{first}'")


async def test_advisories_are_behind_their_situation_and_the_others_are_only_counted(
    browser: "Browser", face: Served
) -> None:
    await face.publish(shown(1, 0, 1, advisories=("advisory-1", "advisory-2")))
    await face.publish(warning(1), warning(2), warning(3, "situation-1"), warning(4))
    async with opened(browser, face) as page:
        assert await page.evaluate(f"{CARDS}.length") == 1
        assert await text(page, "#situations .count") == "3 warnings behind it"
        assert (await text(page, "#machines-count")).startswith("1 warning for machines")
        await page.click("#situations .count")
        await until(page, "document.querySelectorAll('#situations .lines li').length === 3")
        assert "should wait" not in await text(page, "#situations .lines"), "a robot has one advice: that of the card"
        await page.click("#machines-count")
        await until(page, "document.querySelectorAll('#machines-lines li').length === 1")


async def test_when_nothing_is_open_the_page_says_so(browser: "Browser", face: Served) -> None:
    only = shown(1, 0, 1)
    async with opened(browser, face) as page:
        await until(page, "document.getElementById('none').textContent === 'Nothing needs you.'")
        await face.publish(only)
        await page.wait_for_selector("#none", state="hidden")
        await face.publish(cleared(only, "they have passed each other"))
        await until(page, "document.getElementById('none').offsetParent !== null")
        assert "They have passed each other" in await text(page, "#situations .ended .then")
        await page.wait_for_selector("#situations .ended", state="detached")


async def test_a_card_without_advice_says_how_it_ends(browser: "Browser", face: Served) -> None:
    await face.publish(shown(1, 0, 1, advice=None, ends="by itself, once they have passed each other"))
    async with opened(browser, face) as page:
        expected = "Nothing to do now. It ends by itself, once they have passed each other."
        assert await text(page, "#situations .advice") == expected
        await face.publish(shown(1, 0, 1, revision=2, advice=None, ends=f"once {name(1)} moves on"))
        await until(page, f"{CARDS}[0].textContent.includes('Nothing to do now. It ends once {name(1)} moves on.')")


async def test_a_card_tells_what_only_programs_have_time_for(browser: "Browser", face: Served) -> None:
    quick = advice(1).model_copy(update={"for_people": False})
    await face.publish(shown(1, 0, 1, advice=quick, ends="by itself, once they have passed each other"))
    async with opened(browser, face) as page:
        expected = "Nothing to do now. It ends by itself, once they have passed each other. Programs that move "
        assert (await text(page, "#situations .advice")).startswith(expected)


async def test_a_situation_that_needs_nobody_is_a_line_until_it_is_chosen(browser: "Browser", face: Served) -> None:
    await face.publish(shown(1, 0, 1, advice=None, severity=Severity.CAUTION))
    async with opened(browser, face) as page:
        await until(page, "document.getElementById('none').textContent.startsWith('Nothing needs you. 1 situation')")
        assert not await page.locator("#situations .robots").is_visible()
        await page.locator("#situations .card").click()
        await page.locator("#situations .robots").wait_for(state="visible")


async def test_the_time_of_advice_that_is_shown_is_what_is_left_of_it(browser: "Browser", face: Served) -> None:
    given = advice(0, 60.0)
    await face.publish(shown(1, 0, 1, advice=given.model_copy(update={"since_at": moment(time.time() - 20)})))
    async with opened(browser, face) as page:
        first = await text(page, "#situations .first")
        assert re.fullmatch(rf"{name(0)} should wait 60 s \((3\d|40) s left\)", first), first


async def test_a_card_says_who_has_the_advice_done_and_why_by_this_robot(browser: "Browser", face: Served) -> None:
    backs = Action(
        robot=robot("A-0"), name=name(0), action="back_out", reason="so they lose the least time in all", text="back"
    )
    orders = advice(0).model_copy(update={"actions": (backs,), "text": f"{name(0)} should back out"})
    await face.publish(shown(1, 0, 1, advice=orders))
    async with opened(browser, face) as page:
        expected = (
            "By the fleet control of Alder, or by hand at the robot. Why A-0: so they lose the least time in all."
        )
        assert await text(page, "#situations .by") == expected


async def test_a_card_says_what_machines_were_asked_and_what_became_of_it(browser: "Browser", face: Served) -> None:
    pair = robot("A-6"), robot("A-7")
    asked = made_advice(
        1,
        robots=pair,
        robot=pair[0],
        other=pair[1],
        vendor="Alder",
        headline=f"{name(6)} should drive around {name(7)}",
    )
    await face.publish(shown(1, 6, 7), shown(2, 0, 1), asked)
    async with opened(browser, face) as page, http_client(face.http) as client:
        of_pair = "document.querySelector('[data-id=situation-1] .asked').textContent"
        assert await page.evaluate(of_pair) == f"Asked: {asked.headline}; Alder has not answered."
        assert not await page.evaluate("document.querySelector('[data-id=situation-2] .asked').textContent")
        await client.post(f"/advice/{asked.id}/answer", json={"answer": "accepted", "name": "fleet"})
        await until(page, f"{of_pair}.endsWith('; Alder has accepted it.')")
        begun = asked.next_revision(begun_at=asked.raised_at)
        await face.publish(begun)
        await until(page, f"{of_pair}.endsWith('; it has begun.')")
        await face.publish(begun.cleared_revision(time.time(), ClearedCode.DONE))
        await until(page, f"!{of_pair}")


async def test_what_has_begun_says_for_how_long_it_has_been_going_on(browser: "Browser", face: Served) -> None:
    await face.publish(shown(1, 0, 1, left_s=-20.0), shown(2, 4, 5, left_s=-1.0))
    async with opened(browser, face) as page:
        times = await page.evaluate(f"{CARDS}.map((card) => card.querySelector('.when').textContent)")
        assert sorted(re.sub(r"\d+", "N", time_text) for time_text in times)[0] == "for N s"


async def test_the_vendors_table_tells_people_and_robots_of_one_vendor_apart(browser: "Browser", face: Served) -> None:
    script = """async (vendors) => {
        const { Vendors } = await import("/page/list/vendors.js");
        const words = document.querySelector("#vendors").tBodies[0], figures = document.querySelector("#figures tbody");
        new Vendors().tables(words, figures, { at_s: 1, vendors }, () => []);
        return [...words.rows].map((row) => row.cells[1].textContent);
    }"""
    own = VendorHealth(name="", grade_words="").model_dump(mode="json")
    vendors = {
        "Alder": own | {"robots": 10, "participants": {"robot": 9, "person": 1}},
        "Basalt": own | {"robots": 10, "silent": 3, "participants": {"person": 8, "driven": 2}},
        "Corvid": own | {"robots": 5},
    }
    async with opened(browser, face) as page:
        assert await page.evaluate(script, vendors) == [
            "9 robots, 1 person, all heard",
            "8 people, 2 driven vehicles, 7 heard, 3 silent",
            "5, all heard",
        ]


async def test_the_vendors_table_names_robots_that_drive_otherwise_than_announced(
    browser: "Browser", face: Served
) -> None:
    script = """async (vendor) => {
        const { Vendors } = await import("/page/list/vendors.js");
        const [words, figures] = ["vendors", "figures"].map((id) => document.querySelector(`#${id} tbody`));
        const table = new Vendors();
        return [["A-3"], ["A-3", "A-5"], ["A-3", "A-5", "A-6", "A-7"], []].map((names, i) => {
            const health = { at_s: i, vendors: { Alder: { ...vendor, messages: i, distrusted: names.length || 2 } } };
            table.tables(words, figures, health, () => names);
            return words.textContent.match(/nown(.*?)( may be wrong|$)/)[1];
        });
    }"""
    health = VendorHealth(name="Alder", robots=ROBOTS).model_dump(mode="json")
    async with opened(browser, face) as page:
        assert await page.evaluate(script, health) == [
            "A-3 moves otherwise than it announces: warnings of it",
            "A-3 and A-5 move otherwise than they announce: warnings of them",
            "A-3, A-5, A-6 and 1 more move otherwise than they announce: warnings of them",
            "nothing",
        ]


async def test_a_situation_whose_advisories_have_ended_is_over(browser: "Browser", face: Served) -> None:
    nothing: dict[str, Any] = {"advice": None, "advisories": (), "severity": Severity.CAUTION}
    await face.publish(shown(1, 0, 1, **nothing, ends="by itself: nothing is foreseen there any more"))
    async with opened(browser, face) as page:
        assert await text(page, "#situations .severity") == "✓ Over"
        assert not await text(page, "#situations .when")
        assert await text(page, "#situations .then") == "Nothing to do any more.", "and not how it will end"
        await until(page, "document.getElementById('none').textContent === 'Nothing needs you.'")


async def test_what_is_over_stands_last_and_is_not_counted(browser: "Browser", face: Served) -> None:
    over = shown(1, 0, 1, advice=None, advisories=(), severity=Severity.CRITICAL)
    await face.publish(over, shown(2, 4, 5, advice=None, severity=Severity.CAUTION))
    async with opened(browser, face) as page:
        expected = "Nothing needs you. 1 situation ends without you:"
        await until(page, f"document.getElementById('none').textContent === '{expected}'")
        assert await text(page, "#count") == "(1, 1 over)"
        assert await page.evaluate(f"{CARDS}.map((card) => card.dataset.id)") == ["situation-2", "situation-1"]
        assert not await page.locator("#tabs .open").count()


async def test_what_is_far_ahead_stands_after_what_happens_now(browser: "Browser", face: Served) -> None:
    calm: dict[str, Any] = {"advice": None, "severity": Severity.CAUTION}
    later = shown(1, 0, 1, left_s=480.0, cost_s=300.0, preventable_s=480.0, situation_kind="queue", **calm)
    now = shown(2, 4, 5, left_s=0.0, cost_s=5.0, preventable_s=None, **calm)
    soon = shown(3, 7, 8, left_s=30.0, cost_s=300.0, preventable_s=30.0, situation_kind="queue", **calm)
    await face.publish(later, now, soon)
    async with opened(browser, face) as page:
        order = await page.evaluate(f"{CARDS}.map((card) => card.dataset.id)")
        assert order == ["situation-3", "situation-2", "situation-1"]


async def test_what_it_costs_says_how_much_was_warned_of_and_heeded(browser: "Browser", face: Served) -> None:
    script = """async (total) => {
        const { Costs } = await import("/page/dialogs/costs.js");
        const nothing = { places: [], suggestions: [], none_because: "nothing is known", hours: 0 };
        new Costs((floor) => floor, () => {}).show({ total, rows: [], currency: "EUR" }, [], [], [], 0, nothing);
        return document.querySelector("#costs-body p").textContent;
    }"""
    total = {"lost_s": 90, "losses": 9, "warned_s": 60, "advised_s": 30, "heeded_s": 20, "cost": None}
    sentence = (
        "Of 90 s lost, 60 s were warned of before; "
        "for 30 s of them one of the two robots was advised, and for 20 s it did as advised."
    )
    async with opened(browser, face) as page:
        assert sentence in await page.evaluate(script, total)
        unadvised = total | {"advised_s": 0, "heeded_s": 0}
        assert "60 s were warned of before. Sums" in await page.evaluate(script, unadvised)
        assert "warned" not in await page.evaluate(script, total | {"losses": 0, "lost_s": 0})


async def test_a_suggestion_says_of_what_time_its_figures_are(browser: "Browser", face: Served) -> None:
    script = """async ([from_s, until_s]) => {
        const { Costs } = await import("/page/dialogs/costs.js");
        const place = { text: "Lane: robots lose 40 s an hour.", evidence: { from_s, until_s }, since_s: until_s };
        const total = { lost_s: 90, losses: 0, cost: null }, found = { places: [place], suggestions: [] };
        new Costs((floor) => floor, () => {}).show({ total, rows: [], currency: "" }, [], [], [], 0, found);
        return document.querySelector("#costs-body ol").textContent;
    }"""
    span = [datetime(2026, 3, 2, hour).astimezone().timestamp() for hour in (6, 14)]
    async with opened(browser, face) as page:
        sentences = await page.evaluate(script, span)
    assert sentences.endswith("an hour. These figures are of 06:00 to 14:00; it stands since 14:00.")


async def test_what_it_costs_has_no_rows_of_refused_advice_that_cost_no_time_else(
    browser: "Browser", face: Served
) -> None:
    script = """async () => {
        const { Costs } = await import("/page/dialogs/costs.js");
        const sums = { lost_s: 0, losses: 0, warned_s: 0, advised_s: 0, heeded_s: 0, refused_s: 9, cost: null };
        const row = { ...sums, vendor: "Acme", by: "Bolt", floor: "", place: "Aisle", cell: [1, 1], hour: 0 };
        const nothing = { places: [], suggestions: [], none_because: "", hours: 0 };
        const found = { ...nothing, total: sums, rows: [row], currency: "" };
        window.fetch = async () => new Response(JSON.stringify(found));
        await new Costs((floor) => floor, () => {}, () => 36000).read();
        return document.querySelector("#costs-body").textContent;
    }"""
    async with opened(browser, face) as page:
        found = await page.evaluate(script)
        assert re.match(r"Today, until \d\d:\d\d, robots and people lost", found)
        assert "Acme" not in found
        assert "NaN" not in found


async def test_summaries_are_of_the_services_time_whatever_the_clock_of_the_page_says(
    browser: "Browser", face: Served
) -> None:
    page, asked = await browser.new_page(), []
    page.on("request", lambda request: asked.append(request.url))
    await page.add_init_script("const { now } = Date; Date.now = () => now() + 3 * 3600e3;")
    await page.goto(face.http)
    await page.wait_for_selector('[data-state="live"]')
    for summary, heading in ("shift", "What was going on"), ("costs", "Today by hour"):
        await page.click(f"#{summary}-open")
        await until(page, f"document.getElementById('{summary}-body').textContent.includes('{heading}')")
        await page.click(f"#{summary}-close")
    await page.close()
    (shift_s,) = [float(at_s) for url in asked for at_s in re.findall(r"shift\?since_s=([\d.]+)", url)]
    costs_s = max(float(at_s) for url in asked for at_s in re.findall(r"until_s=([\d.]+)", url))
    assert [shift_s + 8 * 3600, costs_s] == pytest.approx([time.time()] * 2, abs=PATIENCE_S)


async def test_a_line_of_what_has_ended_says_how(browser: "Browser", face: Served) -> None:
    calm = shown(1, 0, 1, advice=None, severity=Severity.CAUTION)
    async with opened(browser, face) as page:
        await face.publish(calm)
        await page.wait_for_selector("#situations .calm")
        await face.publish(cleared(calm, "they have passed each other"))
        await page.wait_for_selector("#situations .ended")
        assert (await text(page, "#situations .what")).endswith(": they have passed each other")


async def test_changed_advice_says_why(browser: "Browser", face: Served) -> None:
    await face.publish(shown(1, 0, 1))
    async with opened(browser, face) as page:
        assert not await page.is_visible("#situations .changed")
        await face.publish(shown(1, 0, 1, revision=2, advice=advice(1, because=f"{name(0)} has had its time")))
        await until(page, f"{CARDS}[0].textContent.includes('{name(1)} should wait')")
        assert (await text(page, "#situations .changed")).endswith(f": {name(0)} has had its time")


async def test_the_focus_stays_on_a_card_while_cards_change_places(browser: "Browser", face: Served) -> None:
    await face.publish(shown(1, 0, 1, 2, left_s=60), shown(2, 4, 5, left_s=40))
    async with opened(browser, face) as page:
        held = "document.activeElement.dataset.robot + document.activeElement.closest('li.card').dataset.id"
        await page.focus('[data-id="situation-1"] .chip >> nth=1')
        before = await page.evaluate(held)
        await face.publish(shown(1, 0, 1, 2, 3, revision=2, severity="critical"))
        await until(page, f"{CARDS}[0].dataset.id === 'situation-1'")
        assert await page.evaluate(held) == before


async def test_keys_alone_reach_everything_on_a_card(browser: "Browser", face: Served) -> None:
    await face.publish(shown(1, 0, 1, advisories=("advisory-1",)), warning(1), warning(2))
    async with opened(browser, face) as page:
        await page.focus("#situations")
        reached = []
        for _ in range(6):
            await page.keyboard.press("Tab")
            reached.append(await page.evaluate("document.activeElement.className || document.activeElement.id"))
        assert reached == ["chip advised", "chip", "show", "take", "count", "machines-count"]


async def test_cards_keep_their_order_while_somebody_points_at_them(browser: "Browser", face: Served) -> None:
    await face.publish(shown(1, 0, 1, left_s=60), shown(2, 4, 5, left_s=40))
    order = f"{CARDS}.map((card) => card.dataset.id).join()"
    async with opened(browser, face) as page:
        await page.hover('[data-id="situation-1"]')
        await face.publish(shown(1, 0, 1, revision=2, severity="critical"))
        await page.wait_for_selector('[data-id="situation-1"].critical')
        assert await page.evaluate(order) == "situation-2,situation-1"
        await page.mouse.move(10, 10)
        await until(page, f"{order} === 'situation-1,situation-2'")


async def test_one_press_acknowledges_a_situation_and_a_second_says_who_and_what(
    browser: "Browser", face: Served
) -> None:
    await face.publish(shown(1, 0, 1))
    async with opened(browser, face) as page:
        await page.click("#situations .take")
        await page.wait_for_selector(".answered")
        assert "Somebody at the operator's page: Seen" in await text(page, "#situations .answer")
        await page.click("#situations .take")
        await page.fill("#who", "Kim <b>Lee</b>")
        await page.fill("#why", "both called back")
        await page.keyboard.press("Enter")
        await page.wait_for_selector("#acknowledge", state="hidden")
        await until(page, f"{CARDS}[0].textContent.includes('Kim <b>Lee</b>: both called back')")
        answer = face.store.get("situation-1")[-1].acknowledgement
        assert answer
        assert answer.name == "Kim <b>Lee</b>"


async def test_one_key_acknowledges_what_has_the_focus(browser: "Browser", face: Served) -> None:
    await face.publish(shown(1, 0, 1, left_s=40), shown(2, 4, 5, left_s=60))
    async with opened(browser, face) as page:
        await page.focus('[data-id="situation-2"] .chip >> nth=0')
        await page.keyboard.press("a")
        await page.wait_for_selector('[data-id="situation-2"].answered')
        await page.keyboard.press("a")
        await page.fill("#who", "Kim")
        await page.fill("#why", "called back")
        await page.keyboard.press("Enter")
        await page.wait_for_selector("#acknowledge", state="hidden")
        await page.focus("#map")
        await page.keyboard.press("a")
        await page.wait_for_selector('[data-id="situation-1"].answered')
        answers = [face.store.get(f"situation-{number}")[-1].acknowledgement for number in (1, 2)]
        assert [(answer.name, answer.reason) for answer in answers if answer] == [
            ("Kim", "Seen"),
            ("Kim", "called back"),
        ]


async def test_the_shift_summary_counts_by_the_worst_severity_and_lists_who_acknowledged(
    browser: "Browser", face: Served
) -> None:
    worst = shown(1, 0, 1, revision=2, severity="critical")
    await face.publish(
        shown(1, 0, 1), worst, cleared(worst, "they have passed", severity=Severity.CAUTION), shown(2, 4, 5)
    )
    async with opened(browser, face) as page:
        await page.evaluate("localStorage.setItem('name', 'Kim')")
        await page.focus("#map")
        await page.keyboard.press("a")
        await page.wait_for_selector('[data-id="situation-2"].answered')
        await page.click("#shift-open")
        await until(page, "document.getElementById('shift-body').textContent.includes(': 2 situations, ')")
        body = await text(page, "#shift-body")
        assert "/" not in body.split(" to ")[0], "7/8 is in July here and in August there"
        assert "1 of them critical at worst; 1 still open, 1 acknowledged" in body
        assert f"Heard now: {ROBOTS} robots." in body
        assert "They have passed" in body
        answered = await text(page, "#shift-body section:last-child tbody tr")
        assert "Kim" in answered
        assert "A-4 and others meet in 5 s at Column 2" in answered
        PICTURES.mkdir(parents=True, exist_ok=True)
        await page.screenshot(path=PICTURES / "shift.png")


async def test_the_shift_summary_counts_what_ended_in_the_same_way_together(browser: "Browser", face: Served) -> None:
    for number in (1, 2):
        left = {"cleared_code": ClearedCode.LEFT}
        await face.publish(
            shown(number, 0, 1), cleared(shown(number, 0, 1), f"Alder A-{number} left the floor", **left)
        )
    async with opened(browser, face) as page:
        await page.click("#shift-open")
        await until(page, "document.getElementById('shift-body').textContent.includes('A robot left the floor2')")


async def test_the_shift_summary_names_the_place_that_holds_a_situation(browser: "Browser", face: Served) -> None:
    script = """async () => {
        const { Shift } = await import("/page/dialogs/shift.js");
        const square = (x) => [[x, 0], [x + 4, 0], [x + 4, 4], [x, 4]];
        const places = [{ name: "Column 1", x: 1, y: 1 }, { name: "Lane", x: 2, y: 2, polygon: square(0) }];
        const areas = [{ name: "Room", polygon: square(0) }, { name: "Yard", polygon: square(6) }];
        const shift = new Shift(() => "Hall", () => places, () => areas);
        return [1, 7, 20].map((x) => shift.place({ location: { datum: "hall", x, y: 1 } }));
    }"""
    async with opened(browser, face) as page:
        assert await page.evaluate(script) == ["Lane, Hall", "Yard, Hall", "Nearest to Lane, Hall"]


async def test_a_long_summary_prints_from_its_heading_on(browser: "Browser", face: Served) -> None:
    async with opened(browser, face, 700, 300) as page:
        await page.click("#shift-open")
        await until(page, "document.getElementById('shift-body').textContent.includes(': 0 situations, ')")
        await page.emulate_media(media="print")
        await until(page, "document.getElementById('shift').clientHeight > innerHeight")
        heading = await page.locator("#shift-title").bounding_box()
        assert heading
        assert heading["y"] >= 0


async def test_critical_situations_are_announced_at_once_and_others_politely(browser: "Browser", face: Served) -> None:
    async with opened(browser, face) as page:
        await face.publish(shown(1, 0, 1))
        await until(page, "document.getElementById('say-politely').textContent.includes('Column 1')")
        assert not await text(page, "#say")
        await face.publish(shown(1, 0, 1, revision=2, severity="critical"))
        await until(page, "document.getElementById('say').textContent.includes('Column 1')")
        assert await page.get_attribute("#say", "aria-live") == "assertive"
        await face.publish(shown(2, 4, 5))
        seen = Acknowledgement(name="Kim", reason="seen", at=moment(time.time()))
        await face.publisher.acknowledge("situation-2", seen)
        await face.publish(shown(2, 4, 5, revision=2, severity="critical"))
        await until(page, "document.getElementById('say').textContent.includes('Column 2')")


@pytest.mark.parametrize("waits_for", ["robots", "other_advice"])
async def test_a_card_says_for_what_people_wait_and_the_alarm_comes_when_they_are_asked(
    browser: "Browser", face: Served, waits_for: str
) -> None:
    async with opened(browser, face) as page:
        await page.evaluate(NOTE_ALARMS)
        await page.click("#alerts summary")
        await page.check("#sound")
        await until(page, "tones === 3")
        waiting = shown(1, 0, 1, severity=Severity.CRITICAL, advice=None, people_wait_for=waits_for)
        await face.publish(waiting)
        await page.wait_for_selector('[data-id="situation-1"]')
        card = await text(page, '[data-id="situation-1"]')
        assert "Critical" in card
        assert {"robots": "its robots are asked first", "other_advice": "something else"}[waits_for] in card
        assert "Nothing to do now" not in card
        assert await page.evaluate("tones") == 3
        now = moment(time.time())  # the page announces only what is new
        await face.publish(waiting.next_revision(advice=advice(0), people_wait_for=None, updated_at=now))
        await until(page, "tones === 6")
        first = "document.querySelector('[data-id=situation-1] .first').textContent"
        await until(page, f"{first}.startsWith({advice(0).text!r})")


async def test_only_the_most_urgent_are_shown_until_the_others_are_asked_for(browser: "Browser", face: Served) -> None:
    await face.publish(*(shown(i, i, i + 1, left_s=10 + i) for i in range(8)))
    async with opened(browser, face) as page:
        assert await page.evaluate(f"{CARDS}.map((card) => card.dataset.id)") == [f"situation-{i}" for i in range(5)]
        assert await text(page, "#more") == "Show 3 more, less urgent"
        await page.click("#more")
        await until(page, f"{CARDS}.length === 8")


async def test_a_card_of_many_robots_fits_a_phone(browser: "Browser", face: Served) -> None:
    await face.publish(shown(1, *range(12), severity="critical", situation_kind="knot"), shown(2, 3, 4))
    async with opened(browser, face, 360, 740) as page:
        assert await page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        PICTURES.mkdir(parents=True, exist_ok=True)
        await page.screenshot(path=PICTURES / "phone-situations.png", full_page=True)


CUT = """() => [...document.querySelectorAll("table tbody :is(td, th)")]
    .filter((cell) => cell.getClientRects().length && (cell.getBoundingClientRect().right > innerWidth
        || cell.scrollWidth > cell.clientWidth + 1)).map((cell) => cell.textContent)"""
"""The cells of tables that are not wholly on the screen."""
VENDORS_SHOWN = """async (vendor) => {
    const { Vendors } = await import("/page/list/vendors.js"), body = (id) => document.querySelector(`#${id} tbody`);
    new Vendors().tables(body("vendors"), body("figures"), { at_s: 1, vendors: { [vendor.name]: vendor } }, () => []);
}"""


async def test_tables_are_read_on_a_phone_without_scrolling_sideways(browser: "Browser", face: Served) -> None:
    worst = shown(1, 0, 1, revision=2, severity="critical")
    await face.publish(shown(1, 0, 1), worst, cleared(worst, "they have passed", severity=Severity.CAUTION))
    async with opened(browser, face, 360, 740) as page:
        await page.click("#figures summary")
        health = VendorHealth(name="Alder Robotics of the north", robots=ROBOTS, messages=54000, deviations=3)
        await page.evaluate(VENDORS_SHOWN, health.model_dump(mode="json"))
        await page.click("#robots summary")
        await until(page, "document.querySelectorAll('#robots tbody tr').length === 12")
        assert await page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        assert await page.evaluate(CUT) == []
        assert await page.get_attribute("#robots tbody td", "data-head") == "State"
        PICTURES.mkdir(parents=True, exist_ok=True)
        await page.screenshot(path=PICTURES / "phone-tables.png", full_page=True)
        await page.click("#shift-open")
        await until(page, "document.getElementById('shift-body').textContent.includes(': 1 situation, ')")
        assert await page.evaluate(CUT) == []
        assert await page.evaluate("document.getElementById('shift').scrollWidth <= innerWidth")
        await page.screenshot(path=PICTURES / "phone-shift.png")


@pytest.mark.parametrize("width", [360, 480, 560, 800])
async def test_the_menu_and_each_dialog_are_wholly_on_a_narrow_screen(
    browser: "Browser", face: Served, width: int
) -> None:
    await face.publish(shown(1, 0, 1))
    inside = """(element) => {
        const { left, right } = element.getBoundingClientRect();
        return left >= 0 && right <= innerWidth && element.scrollWidth <= element.clientWidth;
    }"""
    async with opened(browser, face, width, 740) as page:
        await page.click("#alerts summary")
        for site in "Works", "The second hall of the works":
            await page.evaluate(f"document.getElementById('site').textContent = '{site}'")
            assert await page.locator("#alerts > div").evaluate(inside), site
        await page.click("#alerts summary")
        for name, last in ("shift", "Who acknowledged what"), ("costs", "Today by hour"):
            await page.click(f"#{name}-open")
            await until(page, f"document.getElementById('{name}-body').textContent.includes('{last}')")
            assert await page.locator(f"#{name}").evaluate(inside), name
            await page.click(f"#{name}-close")
        await page.click("#situations .take")
        await page.wait_for_selector(".answered")
        await page.click("#situations .take")
        assert await page.locator("#acknowledge").evaluate(inside)


async def test_sound_and_notifications_are_off_until_chosen_and_then_come_with_what_is_critical(
    browser: "Browser", face: Served
) -> None:
    async with opened(browser, face) as page:
        await page.context.grant_permissions(["notifications"], origin=face.http)
        await page.evaluate(NOTE_ALARMS)
        await face.publish(shown(1, 0, 1, severity=Severity.CRITICAL))
        await page.wait_for_selector('[data-id="situation-1"]')
        assert await page.evaluate("[tones, notices.length]") == [0, 0]
        await page.click("#alerts summary")
        await page.check("#sound")
        await page.check("#notify")
        await until(page, "tones === 3")
        assert await text(page, "#alarm-problem") == ""
        await face.publish(shown(2, 4, 5, severity=Severity.CRITICAL), shown(3, 8, 9, severity=Severity.WARNING))
        await page.wait_for_selector('[data-id="situation-3"]')
        await until(page, "tones === 6")
        assert await page.evaluate("notices.length") == 1


async def test_what_is_between_a_person_and_a_vehicle_comes_first_of_its_severity_and_people_are_counted_apart(
    browser: "Browser", face: Served
) -> None:
    script = """async () => {
        const { counted, mostUrgentFirst, title } = await import("/page/texts.js");
        const { Vendors } = await import("/page/list/vendors.js");
        const listed = await (await fetch("/situations")).json(), vendors = new Vendors();
        const kinds = ["robot", "robot", "person", "driven", "person"];
        const robots = kinds.map((participant) => ({ vendor: "Alder", participant }));
        vendors.note([...robots, { vendor: "Basalt", participant: "robot" }]);
        const signs = vendors.names.flatMap((name) => vendors.signs(name)).map(({ text, kind }) => `${text}: ${kind}`);
        const order = mostUrgentFirst(listed.situations.toReversed());
        return [listed.situations, order, order.map(title), counted(robots), counted([]), signs];
    }"""
    mixed = {"participants": ("driven", "person"), "situation_kind": "meeting"}
    listing: list[dict[str, Any]] = [{}, {"participants": ("person", "person")}, mixed, {"severity": Severity.CRITICAL}]
    for number, fields in enumerate(listing):
        whole = {"severity": Severity.WARNING, **fields}
        await face.publish(shown(number + 1, 2 * number, 2 * number + 1, **whole))
    async with opened(browser, face) as page:
        listed, order, titles, counted, nobody, signs = await page.evaluate(script)
        await until(page, f"document.getElementById('counted').textContent === '{ROBOTS} robots'")
    assert [each["id"][-1] for each in listed] == ["4", "3", "1", "2"]
    assert order == listed
    assert titles[1] == "A vehicle meets a person"
    assert (counted, nobody) == ("2 robots, 2 people, 1 driven vehicle", "0 robots")
    assert signs == ["Alder, robots: robot", "Alder, people: person", "Alder, driven vehicles: driven", "Basalt: robot"]


async def test_titles_name_people_and_vehicles_whatever_the_kind(browser: "Browser", face: Served) -> None:
    script = """async () => {
        const { KINDS, title } = await import("/page/texts.js");
        const titles = (...participants) => Object.keys(KINDS).map((kind) =>
            title({ situation_kind: kind, participants, robots: ["a", "b", "c"], culprit: "a" }));
        const mixes = [["robot", "person"], ["driven", "person"], ["person", "robot"], ["person", "person"]];
        const ring = { situation_kind: "deadlock", subject_is_ring: true, subject_robots: ["a", "b"],
            robots: ["a", "b", "c"] };
        return [titles(), titles("driven", "robot"), titles("robot", "driven", "person"),
            mixes.map((mix) => titles(...mix).filter((text) => !/person|people/i.test(text))),
            title({ ...ring, participants: ["robot", "robot", "person"] })];
    }"""
    async with opened(browser, face) as page:
        robots, vehicles, everybody, unnamed, ring = await page.evaluate(script)
    assert unnamed == [[], [], [], []]
    assert ring == "Waiting for each other", "a person who meets one of its robots is not in it"
    assert robots == [
        "Two robots meet",
        "Head-on",
        "Knot of robots",
        "Queue",
        "Many robots at one point",
        "Way blocked",
        "Robot in the way",
        "Silent robot",
        "Waiting for each other",
        "Who is this robot?",
    ]
    assert vehicles[:2] == ["A robot meets a vehicle", "Head-on with a vehicle"]
    assert vehicles[5:8] == ["Way blocked by a vehicle", "Vehicle in the way", "Silent vehicle"]
    assert everybody[1:3] == ["Head-on with a person", "Knot of robots, vehicles and people"]
    assert everybody[5:9] == [
        "Way blocked for people",
        "Robot in the way of people",
        "Silent robot in the way of people",
        "Robots, vehicles and people wait for each other",
    ]


async def test_the_shift_summary_counts_situations_with_people(browser: "Browser", face: Served) -> None:
    mixed: dict[str, Any] = {"participants": ("robot", "person"), "severity": Severity.CRITICAL}
    await face.publish(shown(1, 0, 1, **mixed), shown(2, 2, 3, participants=("robot", "robot")))
    await face.publish(shown(3, 4, 5, participants=("driven", "person")))
    async with opened(browser, face) as page:
        await page.click("#shift-open")
        line = (
            "With people: 1 situation of robots and people, 1 of them critical at worst; "
            "1 situation of driven vehicles and people, 0 of them critical at worst."
        )
        await until(page, f"document.getElementById('shift-body').textContent.includes({line!r})")


async def test_durations_have_one_rule(browser: "Browser", face: Served) -> None:
    script = """async (seconds) => {
        const { span } = await import("/page/texts.js");
        return seconds.map(span);
    }"""
    spans = {0: "0 s", 93: "93 s", 99.4: "99 s", 99.6: "1.7 min", 120: "2.0 min", 596: "9.9 min", 597: "10 min"}
    spans |= {3540: "59 min", 7199: "120 min", 7200: "2 h"}
    async with opened(browser, face) as page:
        assert await page.evaluate(script, list(spans)) == list(spans.values())


async def test_what_was_acknowledged_is_said_without_its_time(browser: "Browser", face: Served) -> None:
    sentences: dict[str, Any] = {
        "summary": "A-0 and A-1 cross in 9 s, in Aisle 3",
        "headline": "A-0 and A-1 cross, in Aisle 3",
    }
    await face.publish(shown(1, 0, 1, **sentences))
    async with opened(browser, face) as page:
        await page.click("#situations .take")
        await page.wait_for_selector(".answered")
        await page.click("#situations .take")
        assert await text(page, "#acknowledge-what") == sentences["headline"]
        await page.keyboard.press("Escape")
        await page.click("#shift-open")
        await until(page, "document.getElementById('shift-body').textContent.includes('acknowledged what')")
        answered = await text(page, "#shift-body section:last-child tbody tr")
        assert sentences["headline"] in answered


async def test_a_card_that_is_one_line_names_its_robots(browser: "Browser", face: Served) -> None:
    calm: dict[str, Any] = {"advice": None, "severity": Severity.CAUTION, "situation_kind": "knot"}
    headline = "9 robots get in each other's way"
    await face.publish(shown(1, *range(7), more_robots=2, headline=headline, **calm))
    await face.publish(shown(2, 8, 9, headline=f"{name(8)} and {name(9)} cross", **calm))
    async with opened(browser, face) as page:
        named = page.locator("[data-id=situation-1] .named")
        assert await named.inner_text() == "A-0, A-1, A-2, A-3 and 5 more"
        assert not await page.locator("[data-id=situation-2] .named").is_visible(), "its sentence names both"
        PICTURES.mkdir(parents=True, exist_ok=True)
        await page.screenshot(path=PICTURES / "calm-cards.png")
        await page.click("[data-id=situation-1] .what")
        await page.locator("[data-id=situation-1] .robots").wait_for(state="visible")
        assert not await named.is_visible(), "its robots are buttons now"


@pytest.mark.parametrize(("width", "shown_text"), [(1400, "1 needs you"), (360, "1")])
async def test_the_tab_of_a_floor_says_that_it_counts_what_needs_somebody(
    browser: "Browser", face: Served, width: int, shown_text: str
) -> None:
    calm: dict[str, Any] = {"advice": None, "severity": Severity.CAUTION}
    waiting: dict[str, Any] = {"severity": Severity.CRITICAL, "advice": None, "people_wait_for": "robots"}
    await face.publish(shown(1, 0, 1), shown(2, 4, 5, **calm), shown(3, 8, 9, **calm), shown(4, 2, 3, **waiting))
    async with opened(browser, face, width) as page:
        await until(page, "document.getElementById('count').textContent === '(4)'")
        count = page.locator("#tabs .open")
        assert await count.text_content() == "1 needs you", "screen readers hear the words"
        seen = await page.evaluate("document.querySelector('#tabs .words').getBoundingClientRect().width > 1")
        assert ("needs you" in shown_text) == seen
        title = await page.get_attribute("#tabs [role=tab]", "title") or ""
        assert title.startswith("1 situation of this floor needs somebody; the list has those of all floors")
        PICTURES.mkdir(parents=True, exist_ok=True)
        await page.screenshot(path=PICTURES / f"tab-{width}.png")
