"""A page that is late says so, and costs what it shows: in a real Chromium."""

import asyncio
from contextlib import AsyncExitStack
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from deconflict.operator.store.store import Store
from deconflict_client.advisory import Severity
from tests.deconflict.operator.http.served_face import Served, served
from tests.deconflict.operator.opened_page import CARDS, cleared, opened, shown, text, ticking, until, warning

if TYPE_CHECKING:
    from playwright.async_api import Browser

pytestmark = pytest.mark.asyncio(loop_scope="module")

LATE = """async () => {
    const { Live } = await import(new URL("page/floor/live.js", location));
    const { liveStatus } = await import(new URL("page/floor/live_status.js", location));
    let fellBehind = 0, number = 0;
    const feed = { loaded: true }, states = [];
    const live = new Live(() => { fellBehind += 1; }, (seq, atS) => { feed.completeS = atS; });
    live.socket.onmessage = live.socket.onclose = null;
    const { now } = Date, beganMs = now(), runMs = performance.now();
    const receive = (lateS, atMs) => {
        Date.now = () => atMs;
        performance.now = () => runMs + atMs - beganMs;
        const sentS = atMs / 1000 - lateS;
        const floor = { now_s: sentS, whole: false, floors: [], robots: [], gone: [] };
        live.receive({ number: number += 1, sent_s: sentS, seq: 0, health: { roles: {}, at_s: sentS }, floor });
        const [state, sentence] = liveStatus(live, feed);
        states.push([state, sentence, fellBehind]);
    };
    try {
        for (let i = 0; i < 60; i += 1) receive(0.05, beganMs + 100 * i);
        for (let i = 60; i < 170; i += 1) receive(8, beganMs + 8_000 + 100 * i);
    } finally { Date.now = now; delete performance.now; }
    return states;
}"""


async def test_a_page_that_is_late_never_calls_its_floor_live(browser: "Browser", face: Served) -> None:
    async with opened(browser, face) as page:
        states = await page.evaluate(LATE)
    assert {state for state, _, _ in states[:60]} == {"live"}
    assert {state for state, _, _ in states[60:]} <= {"stale", "lost"}, "a delay is no less if all messages have it"
    assert states[60][1].startswith("This page is 8 s behind: this is the floor at ")
    fell = [fell for _, _, fell in states[60:]]
    assert fell.count(0) == pytest.approx(20, abs=3), "it begins anew after ten seconds in which it was not in time"


async def test_the_clock_of_the_page_counts_sleep_and_never_runs_back(browser: "Browser", face: Served) -> None:
    """In sleep some browsers' running time stands still, and only the machine's clock goes on."""
    script = """async () => {
        const { pageS } = await import(new URL("page/floor/page_clock.js", location));
        const { now } = Date, beganS = pageS(), passed = [];
        try {
            for (const jumpMs of [60_000, -480_000, 60_000]) {
                Date.now = () => now() + jumpMs;
                passed.push(pageS() - beganS);
            }
        } finally { Date.now = now; }
        return passed;
    }"""
    async with opened(browser, face) as page:
        slept_s, back_s, forth_s = await page.evaluate(script)
    assert slept_s == pytest.approx(60, abs=2)
    assert slept_s <= back_s < slept_s + 2, "a clock that is set back changes nothing"
    assert forth_s == pytest.approx(back_s + 540, abs=2), "one that is set forth may have slept"


async def test_a_page_that_fell_behind_lists_what_is_open_now(browser: "Browser", face: Served) -> None:
    ends, stays, critical = shown(1, 0, 1), shown(2, 4, 5), shown(3, 8, 9, severity=Severity.CRITICAL)
    await face.publish(ends, stays)
    async with opened(browser, face) as page:
        await until(page, f"{CARDS}.length === 2")
        await page.evaluate(
            """async () => {
                const { Feed } = await import(new URL("page/floor/feed.js", location));
                window.news = [];
                window.feed = new Feed(({ id }, before, isNow) => news.push([id, Boolean(before), isNow]));
            }"""
        )
        await until(page, "feed.socket?.readyState === 1")
        assert await page.evaluate("news") == [], "what was open before is no news"
        await page.evaluate("feed.socket.onmessage = () => {}")
        await face.publish(cleared(ends, "they have passed each other"), critical)
        await page.wait_for_selector("#situations .ended")
        assert await page.evaluate("feed.situations.size") == 2
        await page.evaluate("feed.renew()")
        await until(page, f"[...feed.situations.keys()].sort().join() === '{stays.id},{critical.id}'")
        assert await page.evaluate("news.sort()") == [[stays.id, True, True], [critical.id, False, True]]
        await face.publish(cleared(stays, "they have passed each other"), cleared(critical, "they have passed"))
        await until(page, "feed.situations.size === 0")


async def test_what_ended_and_was_removed_while_the_page_was_away_is_shown_no_more(
    browser: "Browser", tmp_path: Path
) -> None:
    first = shown(1, 0, 1)
    async with AsyncExitStack() as pages:
        async with served(tmp_path) as face, ticking(face):
            await face.publish(first, warning(1))
            page = await pages.enter_async_context(opened(browser, face))
            assert await page.evaluate(f"{CARDS}.length") == 1
        store = Store(tmp_path)
        store.append([cleared(first, "avoided")])
        assert store.prune(datetime.now(UTC) + timedelta(days=1)) == 1
        store.close()
        async with served(tmp_path, at=face.address) as again, ticking(again):
            await until(page, f"{CARDS}.length === 0")
            assert (await text(page, "#machines-count")).startswith("1 warning for machines")


async def test_what_ended_unseen_does_not_push_the_others_away(browser: "Browser", face: Served) -> None:
    unseen = [shown(i, i, i + 1, left_s=10 + i) for i in range(5, 9)]
    await face.publish(*(shown(i, i, i + 1, left_s=10 + i) for i in range(5)), *unseen)
    async with opened(browser, face) as page:
        await until(page, f"{CARDS}.length === 5")
        await face.publish(*(cleared(each, "they have passed each other") for each in unseen))
        await until(page, "document.getElementById('count').textContent === '(5, 4 over)'")
        assert await page.evaluate(f"{CARDS}.length") == 5


async def test_a_chosen_card_that_is_not_among_the_most_urgent_says_how_it_ended(
    browser: "Browser", face: Served
) -> None:
    situations = [shown(i, i, i + 1, left_s=10 + i) for i in range(8)]
    await face.publish(*situations)
    async with opened(browser, face) as page:
        await page.click("#more")
        await page.click('[data-id="situation-7"] .show')
        await page.click("#more")
        await until(page, f"{CARDS}.length === 6")
        await face.publish(cleared(situations[7], "they have passed each other"))
        await page.wait_for_selector('[data-id="situation-7"].ended:not([hidden])')


async def test_what_becomes_critical_while_the_service_restarts_is_announced(
    browser: "Browser", tmp_path: Path
) -> None:
    async with AsyncExitStack() as pages:
        async with served(tmp_path) as face, ticking(face):
            page = await pages.enter_async_context(opened(browser, face))
        async with served(tmp_path, at=face.address) as again, ticking(again):
            await again.publish(shown(1, 0, 1, severity=Severity.CRITICAL))
            await until(page, "document.getElementById('say').textContent.includes('Column 1')")


async def test_only_cards_that_are_shown_are_filled(browser: "Browser", face: Served) -> None:
    await face.publish(*(shown(i, i, i + 1, left_s=10 + i) for i in range(8)))
    async with opened(browser, face) as page:
        await until(page, f"{CARDS}.length === 5")
        filled = "[...document.querySelectorAll('#situations .what')].filter((each) => each.textContent).length"
        assert await page.evaluate(filled) == 5


async def test_a_sentence_names_no_part_of_the_robots_beside_it(browser: "Browser", face: Served) -> None:
    listed = "Alder A-9, Alder A-0 and 1 more"
    headline = "4 robots get in each other's way at 2 places, the worst 3 m from Door 1 on Hall"
    sentence = f"4 robots get in each other's way at 2 places now: {listed}, the worst 3 m from Door 1 on Hall"
    await face.publish(shown(1, 0, 1, situation_kind="knot", headline=headline, summary=sentence))
    async with opened(browser, face) as page:
        what = await text(page, "#situations .what")
    assert what == headline


async def test_labels_of_what_needs_nobody_give_way(browser: "Browser", face: Served) -> None:
    """Twelve calm situations lie at one place, where there is room beside it for fewer labels."""
    calm = [shown(i, 3, 4, severity=Severity.CAUTION, advice=None) for i in range(1, 13)]
    await face.publish(shown(0, 3, 4, severity=Severity.CRITICAL), *calm)
    count_labels = """async () => {
        const { SituationLayer } = await import(new URL("page/map/situation_layer.js", location));
        const { placeLabels } = SituationLayer.prototype;
        return new Promise((done) => {
            SituationLayer.prototype.placeLabels = function (scene) {
                placeLabels.call(this, scene);
                const hasCritical = this.labels.some(({ severity }) => severity === "critical");
                if (scene.situations.length === 13) done([hasCritical, this.labels.length]);
            };
        });
    }"""
    async with opened(browser, face) as page, asyncio.timeout(20):
        has_critical, labels = await page.evaluate(count_labels)
    assert has_critical
    assert 1 < labels <= 9
