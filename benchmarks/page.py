"""How fast the operator's page draws in headless Chromium: `python -m benchmarks.page [ROBOTS ...]`.

The operator's HTTP server, stream and page are real. The robots are synthetic, on one floor, each with a path; a
hundred of them report at each tick of 0.1 s. Results are the frames per second that the page drew, and the longest time
between two frames. The service shares the machine.
"""

import asyncio
import shutil
import sys
import tempfile
import time
from pathlib import Path

from playwright.async_api import Page, async_playwright

from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import Site
from ingest.fleet.fleet import Fleet
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from tests.deconflict.operator.http.served_face import Served, served
from tests.helpers.saying import points, status

TICK_S, REPORTS_PER_TICK, SECONDS = 0.1, 100, 12
WATCH = """seconds => new Promise((done) => {
    const root = document.documentElement, times = [], began = performance.now();
    new MutationObserver(() => times.push(performance.now())).observe(root, { attributeFilter: ["data-frames"] });
    setTimeout(() => {
        const gaps = times.map((at, i) => at - (times[i - 1] ?? began));
        done([(1000 * times.length) / (performance.now() - began), Math.max(...gaps) / 1000]);
    }, seconds * 1000);
})"""


def feed_status(fleet: Fleet, row: int, robots: int, now_s: float) -> None:
    """Feed one robot's status, with a path of ten seconds. The floor is a square with 16 m² for each robot."""
    wide = round(robots**0.5)
    x, y = 4.0 * (row % wide), 4.0 * (row // wide)
    path = points(*((now_s + t, x + 0.3 * t, y + 0.1 * t, 0.3) for t in (2, 4, 6, 8, 10)))
    fleet.receive(status(f"R-{row}", now_s, x, y, 0.3, path=path), now_s, Connection(1))


async def tick(face: Served, fleet: Fleet, robots: int, start_s: float) -> None:
    step = 0
    while True:
        now_s = time.time()
        for row in range(step % max(1, robots // REPORTS_PER_TICK), robots, max(1, robots // REPORTS_PER_TICK)):
            feed_status(fleet, row, robots, now_s)
        face.sources.recent.add(now_s, fleet.next_batch(now_s).to_bytes())
        step += 1
        await asyncio.sleep(max(0.0, start_s + step * TICK_S - time.time()))


async def measured(page: Page, robots: int) -> tuple[float, float]:
    with tempfile.TemporaryDirectory() as folder:
        async with served(Path(folder)) as face:
            fleet, start_s = fleet_of(Site(), Measures()), time.time()
            for row in range(robots):
                feed_status(fleet, row, robots, start_s)
            face.sources.whole = fleet.snapshot(start_s)
            ticking = asyncio.create_task(tick(face, fleet, robots, start_s))
            await page.goto(face.http)
            await page.wait_for_function(f"() => document.getElementById('status').textContent.includes('{robots} ')")
            rate, gap_s = await page.evaluate(WATCH, SECONDS)
            ticking.cancel()
            await page.goto("about:blank")
            return rate, gap_s


async def main(sizes: list[int]) -> None:
    async with async_playwright() as playwright:
        chromium = await playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        page = await chromium.new_page(viewport={"width": 1400, "height": 850}, bypass_csp=True)
        print(f"{'robots':>8} {'frames/s':>9} {'longest gap, s':>15}")
        for robots in sizes:
            rate, gap_s = await measured(page, robots)
            print(f"{robots:>8} {rate:>9.1f} {gap_s:>15.2f}")
        await chromium.close()


if __name__ == "__main__":
    asyncio.run(main([int(robots) for robots in sys.argv[1:]] or [100, 1000, 10_000]))
