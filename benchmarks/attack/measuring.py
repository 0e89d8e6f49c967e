"""What honest robots get while an attack runs: which meetings were told of, latency, memory, disk and health."""

import asyncio
import json
import threading
import time
from collections import defaultdict
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import datetime
from math import nan
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
"""A meeting is told of if the newest revision of its pair that was received this long before predicts it."""
NEAR_S = 4.0
"""A revision predicts a meeting at most so far from when it is. A pair meets every twelve seconds."""
SAMPLE_S = 0.5


class Subscriber:
    """Follows the stream, and notes what each revision about an honest pair predicts, and when it was received."""

    def __init__(self, url: str, pairs: int) -> None:
        self._url = url
        self._pair_of = {
            tuple(sorted((robot(f"honest {pair}.0"), robot(f"honest {pair}.1")))): pair for pair in range(pairs)
        }
        self._predictions: dict[int, list[tuple[float, float]]] = defaultdict(list)
        """By pair: when each revision was received, and when it predicts the pair to meet; NaN if it is cleared."""
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
        predicted_s = datetime.fromisoformat(revision["predicted_at"]).timestamp()
        self._predictions[pair].append((now_s, nan if revision["state"] == "cleared" else predicted_s))

    def told(self, start_s: float, pairs: int, since_s: float, until_s: float) -> tuple[int, int]:
        """How many of the meetings between two times were told of, and how many there were."""
        number = meetings = 0
        for pair in range(pairs):
            for t_s in meetings_s(pair, since_s - start_s, until_s - start_s):
                at_s, meetings = start_s + t_s, meetings + 1
                number += abs(self._predicted_s(pair, at_s - AHEAD_S) - at_s) <= NEAR_S
        return number, meetings

    def _predicted_s(self, pair: int, by_s: float) -> float:
        """When the newest revision that was received by then predicts a pair to meet. NaN if there is none."""
        received = [predicted_s for received_s, predicted_s in self._predictions[pair] if received_s <= by_s]
        return received[-1] if received else nan


@dataclass
class Samples:
    """The service, looked at twice a second."""

    running: Running
    memory_mb: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    """By role, in the order of the looks."""
    health: list[tuple[float, str]] = field(default_factory=list)
    canary_s: list[tuple[float, float]] = field(default_factory=list)
    """What the service says of how long its canary takes."""
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
            document = health_document(self.running.face)
            self.health.append((time.time(), document["status"]))
            self.canary_s.append((time.time(), document.get("canary", {}).get("latency_s", 0.0)))
            self.disk_mb = max(self.disk_mb, disk_mb(self.running.data))


def health(face: str) -> str:
    """What the service says of itself; "-" if it does not answer."""
    return str(health_document(face)["status"])


def health_document(face: str) -> dict[str, Any]:
    """The same with its parts."""
    try:
        answer: dict[str, Any] = httpx.get(f"http://{face}/healthz", timeout=2.0, trust_env=False).json()
    except (httpx.HTTPError, ValueError):
        return {"status": "-"}
    return answer


def is_well(face: str) -> bool:
    """Whether nothing is wrong now."""
    document = health_document(face)
    return is_up(document) and all(part["status"] == "ok" for part in parts_now(document).values())


def is_up(document: dict[str, Any]) -> bool:
    """Whether health knows of the roles, and none of them is down."""
    return "down" not in document.get("roles", {"": "down"}).values()


def parts_now(document: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """The parts of health, without what was refused or lost before, which is said for ten minutes more."""
    parts = {name: part for name, part in document.items() if isinstance(part, dict) and "status" in part}
    return {name: part for name, part in parts.items() if name != "refused_or_lost"}


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
