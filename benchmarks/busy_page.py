"""What the operator's page takes in of a busy floor: `python -m benchmarks.busy_page [ROBOTS ...]`.

Service, robots and page are real and share the machine; the page is in headless Chromium without a graphics card. The
floor has docks and crossings, and one robot in five is in an open conflict. Results are the messages of the live floor
and the revisions that the page took each second, how many of the revisions that were sent this is, the thread time of
the page's scripts and drawing, and what the page says of itself at the end.
"""

import shutil
import sys
import time
from collections import Counter

from playwright.sync_api import CDPSession, Page, sync_playwright

from benchmarks.endtoend import Load, service

SETTLE_S, SECONDS = 20.0, 12.0


def counted(session: CDPSession) -> Counter[str]:
    """The messages that come to the page from now on, by the path of their socket."""
    paths: dict[str, str] = {}
    counts: Counter[str] = Counter()

    def opened(event: dict[str, str]) -> None:
        paths[event["requestId"]] = event["url"].partition("?")[0].rpartition("/")[2]

    session.on("Network.webSocketCreated", opened)
    session.on("Network.webSocketFrameReceived", lambda event: counts.update([paths.get(event["requestId"], "")]))
    session.send("Network.enable")
    return counts


def thread_s(session: CDPSession) -> float:
    """What the page's thread has worked so far."""
    metrics = session.send("Performance.getMetrics")["metrics"]
    return float(next(metric["value"] for metric in metrics if metric["name"] == "TaskDuration"))


def last_seq(page: Page, url: str) -> int:
    """The number of the last revision that was published."""
    return int(page.request.get(f"{url}advisories?limit=1").json()["seq"])


def measured(page: Page, url: str) -> str:
    """A line of the table: messages of the floor and revisions a second, their share, thread time, status."""
    session = page.context.new_cdp_session(page)
    session.send("Performance.enable", {"timeDomain": "threadTicks"})
    counts = counted(session)
    page.goto(url)
    page.wait_for_timeout(1000 * SETTLE_S)
    counts.clear()
    seq, worked_s, began_s = last_seq(page, url), thread_s(session), time.monotonic()
    page.wait_for_timeout(1000 * SECONDS)
    took_s, sent, taken = time.monotonic() - began_s, last_seq(page, url) - seq, counts["stream"]
    worked, status = (thread_s(session) - worked_s) / took_s, page.text_content("#status")
    share = taken / sent if sent else 1.0
    return f"{counts['live'] / took_s:>8.1f} {taken / took_s:>12.1f} {share:>7.0%} {worked:>7.2f}  {status}"


def main(sizes: list[int]) -> None:
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        print(f"{'robots':>8} {'floor/s':>8} {'revisions/s':>12} {'of all':>7} {'thread':>7}  status")
        for robots in sizes:
            with service(robots) as running, chromium.new_page(viewport={"width": 1400, "height": 850}) as page:
                load = Load(running.url, robots, 2 * SETTLE_S + SECONDS + 10, docks=True)
                time.sleep(SETTLE_S)
                print(f"{robots:>8} {measured(page, f'http://{running.face}/')}")
                load.result()
        chromium.close()


if __name__ == "__main__":
    main([int(robots) for robots in sys.argv[1:]] or [300, 1000])
