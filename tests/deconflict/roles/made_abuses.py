"""Broken and hostile senders."""

import asyncio
import json
import time
import zlib
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed
from websockets.frames import CloseCode, Frame, Opcode
from websockets.protocol import State

from ingest.frames.floor_index import MOST_UNKNOWN
from tests.helpers.saying import identity, points, robot, status

RSV1 = 0x40
"""Of a frame's first byte: its message is compressed (RFC 7692)."""

BETWEEN_STATUSES_S = 0.05
"""Of a robot only the newest status is read of those that wait."""

MALLORY = {"manufacturerName": "Mallory"}


BROKEN: dict[str, Callable[[float], bytes]] = {
    "not-utf8": lambda _: b"\xff\xfe",
    "not-json": lambda _: b'{"uuid":',
    "too-deep": lambda _: b"[" * 5000 + b"]" * 5000,
    "not-object": lambda _: b'["status"]',
    "number-not-finite": lambda now_s: status("M-1", now_s).replace(b'"x": 0.0', b'"x": NaN', 1),
    "report-unknown": lambda _: json.dumps({"uuid": robot("M-1")}).encode(),
    "position-absurd": lambda now_s: status("M-1", now_s, 1e308, 0.0),
    "key-missing": lambda now_s: status("M-1", now_s, location={"x": 1.0}),
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
            await asyncio.sleep(BETWEEN_STATUSES_S)


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
        for _ in range(2 * MOST_UNKNOWN):
            here = {"x": 1.0, "y": 1.0, "planarDatum": robot(f"floor {time.time()}")}
            await socket.send(status("M-9", time.time(), location=here))
            await asyncio.sleep(BETWEEN_STATUSES_S)


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
    send_text_that_is_none,
    drip,
    say_absurd_points,
    name_made_up_floors,
    flood,
    stay_half_open,
)
