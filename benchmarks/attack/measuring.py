"""What honest robots get while an attack runs: which meetings were told of, latency, memory, disk and health."""

import asyncio
import json
import threading
import time
from collections import defaultdict
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
from websockets.asyncio.client import connect
from websockets.exceptions import WebSocketException

from benchmarks.attack.courses import HONEST_VENDORS, meetings_s
from benchmarks.endtoend import LATENCY, Running
from ingest.measures.measures import Histogram
from tests.helpers.saying import robot

AHEAD_S = 2.0
"""A meeting is told of if its advisory was received this long before, and is open."""
SAMPLE_S = 0.5


class Subscriber:
    """Follows the stream, and notes when each advisory of an honest pair was received first and last."""

    def __init__(self, url: str, pairs: int) -> None:
        self._url = url
        self._pair_of = {
            tuple(sorted((robot(f"honest {pair}.0"), robot(f"honest {pair}.1")))): pair for pair in range(pairs)
        }
        self.open_s: dict[int, list[tuple[float, float]]] = defaultdict(list)
        """By pair, from when to when each of its advisories was open, as received."""
        self._raised_s: dict[str, float] = {}
        self.revisions, self.largest_bytes, self._seen = 0, 0, 0
        self._stopping = False
        self._thread = threading.Thread(target=lambda: asyncio.run(self._follow()))
        self._thread.start()

    def stop(self) -> None:
        self._stopping = True
        self._thread.join()

    async def _follow(self) -> None:
        while not self._stopping:
            with suppress(OSError, WebSocketException):
                async with connect(f"{self._url}?after={self._seen}", proxy=None, max_size=None) as stream:
                    while not self._stopping:
                        with suppress(TimeoutError):
                            self._take(await asyncio.wait_for(stream.recv(), SAMPLE_S))
            await asyncio.sleep(0.1)

    def _take(self, message: str | bytes) -> None:
        revision, now_s = json.loads(message), time.time()
        self._seen = revision["seq"]
        self.revisions, self.largest_bytes = self.revisions + 1, max(self.largest_bytes, len(message))
        pair = self._pair_of.get(tuple(revision["robots"]))
        if revision["kind"] != "conflict" or pair is None:
            return
        raised_s = self._raised_s.setdefault(revision["id"], now_s)
        spans = [span for span in self.open_s[pair] if span[0] != raised_s]
        ended_s = now_s if revision["state"] == "cleared" else float("inf")
        self.open_s[pair] = [*spans, (raised_s, ended_s)]

    def told(self, start_s: float, pairs: int, since_s: float, until_s: float) -> tuple[int, int]:
        """How many of the meetings between two times were told of, and how many there were."""
        number = meetings = 0
        for pair in range(pairs):
            for t_s in meetings_s(pair, since_s - start_s, until_s - start_s):
                at_s, meetings = start_s + t_s, meetings + 1
                number += any(begin <= at_s - AHEAD_S and end >= at_s - AHEAD_S for begin, end in self.open_s[pair])
        return number, meetings


@dataclass
class Samples:
    """The service, looked at twice a second."""

    running: Running
    memory_mb: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    """By role, in the order of the looks."""
    health: list[tuple[float, str]] = field(default_factory=list)
    disk_mb: float = 0.0
    _stopping: threading.Event = field(default_factory=threading.Event)

    def __post_init__(self) -> None:
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def stop(self) -> None:
        self._stopping.set()
        self._thread.join()

    def memory(self) -> dict[str, dict[str, float]]:
        """By role, the memory before the attack, and the most."""
        return {role: {"usual": used[len(used) // 4], "most": max(used)} for role, used in self.memory_mb.items()}

    def _run(self) -> None:
        while not self._stopping.wait(SAMPLE_S):
            with suppress(OSError):  # a role may end while it is looked at
                for role, usage in self.running.usage().items():
                    self.memory_mb[role].append(round(usage.memory_mb, 1))
            self.health.append((time.time(), health(self.running.face)))
            self.disk_mb = max(self.disk_mb, disk_mb(self.running.data))


def health(face: str) -> str:
    """What the service says of itself; "-" if it does not answer."""
    try:
        answer: dict[str, Any] = httpx.get(f"http://{face}/healthz", timeout=2.0, trust_env=False).json()
    except (httpx.HTTPError, ValueError):
        return "-"
    return str(answer["status"])


def disk_mb(data: Path) -> float:
    with suppress(OSError):
        return round(sum(path.stat().st_size for path in data.rglob("*") if path.is_file()) / 1e6, 1)
    return 0.0


def honest_latency(running: Running) -> Histogram:
    """Latency of the messages of honest vendors so far, from message to advisory."""
    rows = [
        row
        for document in running.documents()
        for row in document["histograms"].get(LATENCY, [])
        if set(row[0]) & set(HONEST_VENDORS)
    ]
    return Histogram.joined(rows) if rows else Histogram()
