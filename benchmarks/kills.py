"""Kill a random role at random moments under load: `python -m benchmarks.kills [--kills 100] [--robots 200]`.

A subscriber follows the stream of advisories and situations during the run and resumes with `after`. At the end the
benchmark checks: is any number missing, repeated or out of order; is every lifecycle complete; was any advisory cleared
because its robots "left" although they did not; and can the whole log be read.
"""

import argparse
import asyncio
import json
import os
import random
import signal
import threading
import time
from collections.abc import Iterable
from concurrent.futures import Future
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
from websockets.asyncio.client import connect
from websockets.exceptions import WebSocketException

from benchmarks.endtoend import Load, Running, service
from deconflict.roles.processes.role_process import STEADY_S, RoleProcess
from deconflict_client.advisory import ClearedCode
from ingest.recording.log_reader import LogReader
from ingest.recording.log_segments import segments


@dataclass
class Follower:
    """One subscriber, and every revision that it received, in order."""

    url: str
    received: list[dict[str, Any]] = field(default_factory=list)
    resumed: int = 0

    async def follow(self, stop: asyncio.Event) -> None:
        """Follow until `stop`. After every loss it resumes from the last number."""
        stopping = asyncio.create_task(stop.wait())
        while not stop.is_set():
            following = asyncio.create_task(self._listen())
            await asyncio.wait({following, stopping}, return_when=asyncio.FIRST_COMPLETED)
            following.cancel()
            await asyncio.gather(following, return_exceptions=True)
            self.resumed += 1
            await asyncio.sleep(0.05)

    async def _listen(self) -> None:
        seen = self.received[-1]["seq"] if self.received else 0
        try:
            async with connect(f"{self.url}?kinds=situation,advisory&after={seen}") as stream:
                async for message in stream:
                    self.received.append(json.loads(message))
        except (OSError, WebSocketException):
            return


def faults(revisions: Iterable[dict[str, Any]]) -> list[str]:
    """The faults in a stream as a subscriber received it, one sentence each."""
    found, seq, counts = [], 0, dict[str, int]()
    for revision in revisions:
        if seq and revision["seq"] != seq + 1:
            found.append(f"number {revision['seq']} follows {seq}")
        seq = revision["seq"]
        expected = counts.get(revision["id"], 0) + 1
        if revision["revision"] != expected:
            found.append(f"revision {revision['revision']} of {revision['id']} came where {expected} was due")
        counts[revision["id"]] = revision["revision"]
        if revision["cleared_code"] == ClearedCode.LEFT:
            found.append(f"{revision['id']} was cleared because {revision['cleared_because']}, and nobody left")
    return found


def kill_at_random(running: Running, face: str, kills: int, rng: random.Random) -> list[float]:
    """Kill `kills` times. Returns the seconds until the service was complete again, for each time.

    A role that has just been killed is left alone: the supervisor makes one that ends again and again wait on purpose.
    """
    took_s = list[float]()
    while len(took_s) < kills:
        time.sleep(rng.uniform(0.3, 2.0))
        victim: RoleProcess = rng.choice(running.roles)
        if victim.pid is None or time.monotonic() - victim.started_s <= STEADY_S:
            continue
        restarts = victim.restarts
        os.kill(victim.pid, signal.SIGKILL)
        took_s.append(_until_whole(face, victim.role, restarts + 1))
    return took_s


def _until_whole(face: str, role: str, restarts: int) -> float:
    """Seconds until the role was restarted and the service reports that it is complete."""
    began_s = time.monotonic()
    while time.monotonic() < began_s + 60:
        try:
            health = httpx.get(f"{face}/healthz", timeout=2.0, trust_env=False)
            if health.status_code == 200 and health.json()["restarts"].get(role, 0) >= restarts:
                break
        except httpx.HTTPError:
            pass
        time.sleep(0.05)
    return time.monotonic() - began_s


def run(kills: int, robots: int, seed: int) -> dict[str, Any]:
    """Run the benchmark. Returns its figures and the faults."""
    with service() as running:
        follower, stop = Follower(f"ws://{running.face}/advisories/stream"), asyncio.Event()
        loop = asyncio.new_event_loop()
        threading.Thread(target=loop.run_forever, daemon=True).start()
        following: Future[None] = asyncio.run_coroutine_threadsafe(follower.follow(stop), loop)
        load = Load(running.url, robots, kills * 60.0)
        time.sleep(10)
        took_s = sorted(kill_at_random(running, f"http://{running.face}", kills, random.Random(seed)))
        time.sleep(5)
        loop.call_soon_threadsafe(stop.set)
        following.result()
        offered = load.stop()
        reader = LogReader()
        lines = sum(1 for _ in reader.read(segments(running.data / "log")))
    return {
        "kills": len(took_s),
        "revisions": len(follower.received),
        "resumed": follower.resumed,
        "whole_again_s": {"median": took_s[len(took_s) // 2], "most": took_s[-1]},
        "load": offered,
        "log_events": lines,
        "log_unreadable": reader.unreadable,
        "faults": faults(follower.received),
    }


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--kills", type=int, default=100)
    arguments.add_argument("--robots", type=int, default=200)
    arguments.add_argument("--seed", type=int, default=1)
    arguments.add_argument("--json", type=Path)
    args = arguments.parse_args()
    result = run(args.kills, args.robots, args.seed)
    print(json.dumps(result, indent=2))
    if args.json:
        args.json.write_text(json.dumps(result, indent=2) + "\n")


if __name__ == "__main__":
    main()
