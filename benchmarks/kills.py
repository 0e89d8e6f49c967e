"""Kill a random role at random moments under load: `python -m benchmarks.kills [--kills 100] [--robots 200]`.

A subscriber follows the stream all the while and resumes with `after`. At the end: was any number lost, doubled or
out of order, is every advisory's life whole, was any cleared because its robots "left" though they never did, and can
the whole log be read.
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
from deconflict.roles.supervisor import RoleProcess
from ingest.recording.log_reader import LogReader, segments


@dataclass
class Follower:
    """One subscriber, and every revision that it was told, in order."""

    url: str
    told: list[dict[str, Any]] = field(default_factory=list)
    resumed: int = 0

    async def follow(self, stop: asyncio.Event) -> None:
        """Follow until `stop`, again and again from the last number."""
        stopping = asyncio.create_task(stop.wait())
        while not stop.is_set():
            following = asyncio.create_task(self._listen())
            await asyncio.wait({following, stopping}, return_when=asyncio.FIRST_COMPLETED)
            following.cancel()
            await asyncio.gather(following, return_exceptions=True)
            self.resumed += 1
            await asyncio.sleep(0.05)

    async def _listen(self) -> None:
        seen = self.told[-1]["seq"] if self.told else 0
        try:
            async with connect(f"{self.url}?after={seen}") as stream:
                async for message in stream:
                    self.told.append(json.loads(message))
        except (OSError, WebSocketException):
            return


def faults(told: Iterable[dict[str, Any]]) -> list[str]:
    """What is wrong with a stream as a subscriber saw it, a sentence each."""
    found, seq, revisions = [], 0, dict[str, int]()
    for one in told:
        if one["seq"] != seq + 1:
            found.append(f"number {one['seq']} follows {seq}")
        seq = one["seq"]
        expected = revisions.get(one["id"], 0) + 1
        if one["revision"] != expected:
            found.append(f"revision {one['revision']} of {one['id']} came where {expected} was due")
        revisions[one["id"]] = one["revision"]
        if "left the floor" in (one["cleared_because"] or ""):
            found.append(f"{one['id']} was cleared because {one['cleared_because']}, and nobody left")
    return found


def kill_at_random(one: Running, face: str, kills: int, rng: random.Random) -> list[float]:
    """Kill `kills` times; how long each time until the service was whole again, seconds."""
    took_s = []
    for _ in range(kills):
        time.sleep(rng.uniform(0.3, 2.0))
        victim: RoleProcess = rng.choice(one.roles)
        if victim.process is None:
            continue
        restarts = victim.restarts
        os.kill(victim.process.pid, signal.SIGKILL)
        took_s.append(_until_whole(face, victim.role, restarts + 1))
    return took_s


def _until_whole(face: str, role: str, restarts: int) -> float:
    """Seconds until the role was started anew and the service says that it is whole."""
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
    """The whole run, and what was found."""
    with service() as one:
        follower, stop = Follower(f"ws://{one.face}/advisories/stream"), asyncio.Event()
        loop = asyncio.new_event_loop()
        threading.Thread(target=loop.run_forever, daemon=True).start()
        following: Future[None] = asyncio.run_coroutine_threadsafe(follower.follow(stop), loop)
        offering = Load(one.url, robots, kills * 60.0)
        time.sleep(10)
        took_s = sorted(kill_at_random(one, f"http://{one.face}", kills, random.Random(seed)))
        time.sleep(5)
        loop.call_soon_threadsafe(stop.set)
        following.result()
        offered = offering.stop()
        reader = LogReader()
        lines = sum(1 for _ in reader.read(segments(one.data / "log")))
    return {
        "kills": len(took_s),
        "revisions": len(follower.told),
        "resumed": follower.resumed,
        "whole_again_s": {"median": took_s[len(took_s) // 2], "most": took_s[-1]},
        "load": offered,
        "log_events": lines,
        "log_unreadable": reader.unreadable,
        "faults": faults(follower.told),
    }


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--kills", type=int, default=100)
    arguments.add_argument("--robots", type=int, default=200)
    arguments.add_argument("--seed", type=int, default=1)
    arguments.add_argument("--json", type=Path)
    args = arguments.parse_args()
    told = run(args.kills, args.robots, args.seed)
    print(json.dumps(told, indent=2))
    if args.json:
        args.json.write_text(json.dumps(told, indent=2) + "\n")


if __name__ == "__main__":
    main()
