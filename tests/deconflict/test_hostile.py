"""Broken and hostile senders, all at once, beside two honest robots that are about to meet."""

import asyncio
import json
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed
from websockets.frames import Frame, Opcode

from deconflict.advisory import ADVISORY, AdvisoryState
from deconflict.service import in_one_process
from deconflict.site import Conflict, Operator, Site
from ingest.settings import Datum, Reading, Receiver, Vendor
from metrics.exposition import render
from tests.deconflict.test_service import CROSSING, Running, drive
from tests.saying import HALL, identity, points, robot, status

SITE = Site(
    datums=(Datum(id=HALL, name="Hall"),),
    vendors=(Vendor(name="Alder"), Vendor(name="Mallory")),
    receiver=Receiver(port=0, open_timeout_s=1.0, max_messages_per_s=200, max_connections=200),
    reading=Reading(max_robots_per_vendor=50),
    operator=Operator(port=0),
    conflict=Conflict(clear_after_s=1.0),
)
MALLORY = {"manufacturerName": "Mallory"}
BROKEN: dict[str, Callable[[float], bytes]] = {
    "not-utf8": lambda _: b'{"uuid":"\xff\xfe"}',
    "not-json": lambda _: b'{"uuid":',
    "too-deep": lambda _: b"[" * 5000 + b"]" * 5000,
    "not-object": lambda _: b'["status"]',
    "number-not-finite": lambda now_s: status("M-1", now_s).replace(b'"x": 0.0', b'"x": NaN', 1),
    "report-unknown": lambda _: json.dumps({"uuid": robot("M-1")}).encode(),
    "position-absurd": lambda now_s: status("M-1", now_s, 1e308, 0.0),
    "stamp-absurd": lambda _: status("M-1", 253_402_300_799.0),
    "envelope-absurd": lambda now_s: identity("M-1", now_s, **MALLORY, baseRobotEnvelope={"x": 1e308, "y": 1, "z": 1}),
    "uuid-unreadable": lambda now_s: status("M-1", now_s, uuid="x" * 10_000),
}


@asynccontextmanager
async def mallory(url: str) -> AsyncIterator[ClientConnection]:
    """A connection of the hostile vendor; that the service ends it is no failure of a test."""
    with suppress(ConnectionClosed):
        async with connect(f"{url}/Mallory", max_size=None) as socket:
            yield socket


async def say_what_is_broken(url: str) -> None:
    async with mallory(url) as socket:
        for broken in BROKEN.values():
            await socket.send(broken(time.time()))


async def make_up_uuids(url: str) -> None:
    async with mallory(url) as socket:
        for i in range(300):
            await socket.send(status(f"M-{i}", time.time(), 500.0, 500.0 + i))


async def claim_anothers_robot(url: str) -> None:
    async with mallory(url) as socket:
        await socket.send(identity("A-1", time.time(), **MALLORY))
        for _ in range(20):
            await socket.send(status("A-1", time.time(), 900.0, 900.0))


async def change_who_it_is(url: str) -> None:
    async with mallory(url) as socket:
        for i in range(100):
            await socket.send(identity("M-1", time.time(), **MALLORY, robotModel=f"model {i}"))


async def jump_by_hours(url: str) -> None:
    async with mallory(url) as socket:
        for hours in (5, -5, 48, -48, 0):
            await socket.send(status("M-2", time.time() + hours * 3600, 500.0, 400.0))


async def repeat_one_instant(url: str) -> None:
    async with mallory(url) as socket:
        now_s = time.time()
        path = points(*((now_s, 500.0 + i, 300.0, 0.0) for i in range(1000)))
        await socket.send(status("M-3", now_s, 500.0, 300.0, path=path[:200]))


async def send_too_much(url: str) -> None:
    async with mallory(url) as socket:
        await socket.send(b"[" + b"0," * 200_000 + b"0]")
        await socket.wait_closed()


async def send_in_crumbs(url: str) -> None:
    async with mallory(url) as socket:
        await socket.send(b"{" for _ in range(20_000))


async def flood(url: str) -> None:
    async with mallory(url) as socket:
        for _ in range(20_000):
            await socket.send(status("M-4", time.time(), 500.0, 200.0))


async def stay_half_open(url: str) -> None:
    """Each is ended by the service, or this never returns."""
    host, port = url.removeprefix("ws://").split(":")
    torn = Frame(Opcode.TEXT, b"no handshake").serialize(mask=True)
    for half in (b"", b"GET / HTTP/1.1\r\nHost: floor\r\n", b"\x16\x03\x01 no TLS here", b"G" * 100_000, torn):
        reader, writer = await asyncio.open_connection(host, int(port))
        with suppress(ConnectionError):
            writer.write(half)
            await reader.read()
        writer.close()
        with suppress(ConnectionError):
            await writer.wait_closed()


ABUSES = (
    say_what_is_broken,
    make_up_uuids,
    claim_anothers_robot,
    change_who_it_is,
    jump_by_hours,
    repeat_one_instant,
    send_too_much,
    send_in_crumbs,
    flood,
    stay_half_open,
)


def rejections(text: str) -> dict[str, float]:
    """Of Mallory, by rule, from the metrics as Prometheus reads them."""
    rows = (line for line in text.splitlines() if line.startswith("deconflict_rejections_total{"))
    return {line.split('rule="')[1].split('"')[0]: float(line.split()[-1]) for line in rows if '"Mallory"' in line}


async def test_hostile_senders_are_counted_and_honest_robots_are_still_warned(tmp_path: Path) -> None:
    async with in_one_process(SITE, tmp_path, render) as roles:
        service = Running(*roles)
        abusing = [asyncio.create_task(abuse(service.robots_url)) for abuse in ABUSES]
        driving = asyncio.create_task(drive(f"{service.robots_url}/Alder", CROSSING, 30))
        told = await first_advisory(service, "conflict")
        assert (told.state, set(told.robots)) == (AdvisoryState.RAISED, {robot("A-1"), robot("B-1")})
        await asyncio.gather(*abusing)
        claimed = await first_advisory(service, "foreign_claim")
        assert (claimed.owner, claimed.claimant, claimed.robots) == ("Alder", "Mallory", (robot("A-1"),))
        wanted = {*BROKEN, "robots-too-many", "uuid-of-another-vendor", "message-too-large"}
        async with asyncio.timeout(30):
            while not wanted <= set(rejections((await service.get("/metrics")).text)):
                await asyncio.sleep(0.1)
        driving.cancel()
        robots = {one["uuid"]: one for one in (await service.get("/robots")).json()["robots"]}
        assert robots[robot("A-1")]["vendor"] == "Alder"
        assert abs(robots[robot("A-1")]["location"]["x"]) < 50
        assert sum(one["vendor"] == "Mallory" for one in robots.values()) == 50
        text = (await service.get("/metrics")).text
        assert 'deconflict_messages_shed_total{vendor="Mallory"}' in text
        assert 'result="rejected",vendor="Alder"' not in text
        assert (await service.get("/healthz")).status_code == 200


async def first_advisory(service: Running, kind: str) -> Any:
    async with connect(f"ws://{service.face}/advisories/stream?after=0") as stream, asyncio.timeout(20):
        while True:
            told = ADVISORY.validate_json(await stream.recv())
            if told.kind == kind:
                return told
