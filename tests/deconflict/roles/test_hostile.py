"""Broken and hostile senders, all at once, beside two honest robots that are about to meet."""

import asyncio
import json
import time
import zlib
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed
from websockets.frames import CloseCode, Frame, Opcode
from websockets.protocol import State

from deconflict.advisory import ADVISORY, AdvisoryState
from deconflict.roles.service import in_one_process
from deconflict.settings.site import Conflict, Operator, Site
from ingest.frames.floor_index import MOST_UNKNOWN
from ingest.settings import Datum, Reading, Receiver, Vendor
from metrics.monitoring.exposition import render
from tests.deconflict.roles.test_service import CROSSING, Running, drive
from tests.helpers.patience import PATIENCE_S
from tests.helpers.saying import HALL, identity, points, robot, status

SITE = Site(
    datums=(Datum(id=HALL, name="Hall"),),
    vendors=(Vendor(name="Alder"), Vendor(name="Mallory")),
    receiver=Receiver(port=0, open_timeout_s=1.0, idle_timeout_s=4.0, max_messages_per_s=200, max_connections=200),
    reading=Reading(max_robots_per_vendor=50),
    operator=Operator(port=0),
    conflict=Conflict(clear_after_s=1.0),
)
RSV1 = 0x40
"""Of a frame's first byte: its message is compressed (RFC 7692)."""
MALLORY = {"manufacturerName": "Mallory"}
OWN = tuple(f"M-{i}" for i in range(1, 10))
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


async def come_in(service: Running) -> None:
    """Be known with the robots that the abuse is about, before made up ones fill what the vendor may have."""
    async with mallory(service.robots_url) as socket, asyncio.timeout(PATIENCE_S):
        while sum(one["vendor"] == "Mallory" for one in (await service.get("/robots")).json()["robots"]) < len(OWN):
            for name in OWN:
                await socket.send(status(name, time.time(), 500.0, 150.0))
            await asyncio.sleep(0.1)


async def say_what_is_broken(url: str) -> None:
    async with mallory(url) as socket:
        for broken in BROKEN.values():
            await socket.send(broken(time.time()))


async def make_up_uuids(url: str) -> None:
    async with mallory(url) as socket:
        for i in range(10, 310):
            await socket.send(status(f"M-{i}", time.time(), 500.0, 500.0 + i))


async def claim_anothers_robot(url: str) -> None:
    async with mallory(url) as socket:
        await socket.send(identity("A-1", time.time(), **MALLORY))
        for _ in range(20):
            await socket.send(status("A-1", time.time(), 900.0, 900.0))


async def change_who_it_is(url: str) -> None:
    async with mallory(url) as socket:
        for i in range(60):
            await socket.send(identity("M-1", time.time(), **MALLORY, robotModel=f"model {i}"))
            await asyncio.sleep(0.1)  # sent at once, all but the newest would be shed


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


async def send_compressed(url: str) -> None:
    """A bomb that would be a gigabyte; no compression was agreed upon, so that nobody unpacks it."""
    bomb = zlib.compressobj(9, wbits=-15)
    packed = bomb.compress(bytes(1 << 24)) + bomb.flush(zlib.Z_SYNC_FLUSH)
    async with mallory(url) as socket:
        frame = bytearray(Frame(Opcode.TEXT, packed[:60_000]).serialize(mask=True))
        frame[0] |= RSV1
        socket.transport.write(bytes(frame))
        await socket.wait_closed()
        assert socket.close_code == CloseCode.PROTOCOL_ERROR


async def send_text_that_is_none(url: str) -> None:
    async with mallory(url) as socket:
        socket.transport.write(Frame(Opcode.TEXT, b'{"uuid":"\xc3\x28"}').serialize(mask=True))
        await socket.send(status("M-6", time.time(), 500.0, 150.0))
        await asyncio.sleep(0)


async def drip(url: str) -> None:
    """A message that never ends, a byte at a time."""
    whole = Frame(Opcode.TEXT, b"[" + b" " * 1000).serialize(mask=True)
    async with mallory(url) as socket:
        for i in range(len(whole)):
            if socket.state is not State.OPEN:
                return
            socket.transport.write(whole[i : i + 1])
            await asyncio.sleep(0.1)
    raise AssertionError("nobody ended it")


async def say_absurd_points(url: str) -> None:
    async with mallory(url) as socket:
        now_s = time.time()
        far, late, fine = points((now_s + 1, 1e308, 0.0, 0.0), (253_402_300_799.0, 1.0, 0.0, 0.0), (now_s + 2, 1, 1, 0))
        await socket.send(status("M-7", now_s, 500.0, 160.0, path=[far, late, fine], batteryPercentage=1e308))


async def name_made_up_floors(url: str) -> None:
    async with mallory(url) as socket:
        path = points(*((time.time() + i / 10, 1.0, 1.0, 0.0) for i in range(2 * MOST_UNKNOWN)))
        for i, point in enumerate(path):
            point["planarDatumUUID"] = robot(f"floor {i}")
        here = {"x": 1.0, "y": 1.0, "planarDatum": robot("floor here")}
        await socket.send(status("M-8", time.time(), path=path))
        await socket.send(status("M-9", time.time(), location=here))


async def be_in_two_places(url: str, told: Callable[[], Awaitable[Any]]) -> Any:
    """One robot over two connections, until somebody is told; what was told."""
    telling = asyncio.ensure_future(told())
    async with connect(f"{url}/Mallory") as here, connect(f"{url}/Mallory") as there:
        while not telling.done():
            await here.send(status("M-3", time.time(), 500.0, 300.0))
            await asyncio.sleep(0.1)
            await there.send(status("M-3", time.time(), 900.0, 300.0))
            await asyncio.sleep(0.1)
    return telling.result()


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
    send_compressed,
    send_text_that_is_none,
    drip,
    say_absurd_points,
    name_made_up_floors,
    flood,
    stay_half_open,
)
SHED = (
    say_what_is_broken,
    make_up_uuids,
    claim_anothers_robot,
    change_who_it_is,
    jump_by_hours,
    repeat_one_instant,
    say_absurd_points,
    name_made_up_floors,
)
"""Of which a flood beside them may leave nothing to count: said again where that is so."""


def counted(text: str, name: str, label: str = "rule") -> set[str]:
    """The values of a label, of Mallory where it is of a vendor, in the metrics as Prometheus reads them."""
    rows = (line for line in text.splitlines() if line.startswith(f"deconflict_{name}{{"))
    return {row.split(f'{label}="')[1].split('"')[0] for row in rows if "vendor=" not in row or '"Mallory"' in row}


async def test_hostile_senders_are_counted_and_honest_robots_are_still_warned(tmp_path: Path) -> None:
    async with in_one_process(SITE, tmp_path, render) as roles:
        service = Running(*roles)
        await come_in(service)
        abusing = [asyncio.create_task(abuse(service.robots_url)) for abuse in ABUSES]
        driving = asyncio.create_task(drive(f"{service.robots_url}/Alder", CROSSING, 40, time.time() + 8))
        told = await first_advisory(service, "conflict")
        assert (told.state, set(told.robots)) == (AdvisoryState.RAISED, {robot("A-1"), robot("B-1")})
        await asyncio.gather(*abusing)
        claimed = await first_advisory(service, "foreign_claim")
        assert (claimed.owner, claimed.claimant, claimed.robots) == ("Alder", "Mallory", (robot("A-1"),))
        until_s = time.monotonic() + PATIENCE_S
        while (missing := uncounted((await service.get("/metrics")).text)) and time.monotonic() < until_s:
            await asyncio.gather(*(abuse(service.robots_url) for abuse in SHED))
            await asyncio.sleep(1.0)
        assert not missing
        doubled = await be_in_two_places(service.robots_url, lambda: first_advisory(service, "two_places", "Mallory"))
        assert robot("M-3") in doubled.robots
        driving.cancel()
        robots = {one["uuid"]: one for one in (await service.get("/robots")).json()["robots"]}
        assert robots[robot("A-1")]["vendor"] == "Alder"
        assert abs(robots[robot("A-1")]["location"]["x"]) < 50
        assert sum(one["vendor"] == "Mallory" for one in robots.values()) == 50
        text = (await service.get("/metrics")).text
        assert 'deconflict_messages_shed_total{vendor="Mallory"}' in text
        assert 'result="rejected",vendor="Alder"' not in text
        assert (await service.get("/healthz")).status_code == 200


def uncounted(text: str) -> set[str]:
    """What was done to it and is not counted."""
    rejected = {*BROKEN, "robots-too-many", "uuid-of-another-vendor", "message-too-large"}
    deviating = {"identity-changed", "path-times-equal", "point-absurd", "battery-out-of-range", "clock-off"}
    return (
        rejected - counted(text, "rejections_total")
        | {*deviating, "datum-too-many"} - counted(text, "deviations_total")
        | {"protocol-error", "idle"} - counted(text, "connections_refused_total", "reason")
    )


async def first_advisory(service: Running, kind: str, vendor: str = "Alder") -> Any:
    async with connect(f"ws://{service.face}/advisories/stream?after=0") as stream, asyncio.timeout(PATIENCE_S):
        while True:
            told = ADVISORY.validate_json(await stream.recv())
            if told.kind == kind and vendor in told.vendors:
                return told
