import asyncio
import logging
import os
import socket
import subprocess
import sys
import threading
import time
from contextlib import ExitStack, suppress
from functools import partial

import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.frames import Frame, Opcode
from websockets.typing import Origin

from ingest.port.connection import Connection
from ingest.port.rate_limits import READING_SHARE
from ingest.settings import Vendor
from tests.helpers.patience import PATIENCE_S
from tests.helpers.plain_http import http_client
from tests.helpers.saying import status
from tests.ingest.port.made_receiver import REFUSED, floor, until

HANDSHAKE = (
    b"GET / HTTP/1.1\r\nHost: floor\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)


async def raw_client(port: int) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    """A client that has shaken hands and from here on does only what a test makes it do: no pong, no close."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    writer.write(HANDSHAKE)
    answer = await reader.readuntil(b"\r\n\r\n")
    assert b" 101 " in answer
    return reader, writer


def text_frame(data: bytes) -> bytes:
    return Frame(Opcode.TEXT, data).serialize(mask=True)


async def test_text_and_binary_frames_are_delivered_in_order_with_their_arrival() -> None:
    async with floor() as served_floor, connect(served_floor.url) as robot:
        await robot.send("text ü")
        await robot.send(b"\xff\x00 bytes")
        await robot.send(["in ", "parts"])
        await until(lambda: len(served_floor.delivered) == 3)
        assert served_floor.raws() == ["text ü".encode(), b"\xff\x00 bytes", b"in parts"]
        arrivals = [arrival_s for _, arrival_s, _ in served_floor.delivered]
        assert arrivals == sorted(arrivals)
        assert {connection.id for _, _, connection in served_floor.delivered} == {1}
        assert served_floor.delivered[0][2].peer == "127.0.0.1"


async def test_what_was_sent_before_an_abrupt_end_is_delivered_and_nothing_is_logged(
    caplog: pytest.LogCaptureFixture,
) -> None:
    async with floor() as served_floor:
        _, writer = await raw_client(served_floor.receiver.port)
        writer.write(b"".join(text_frame(b"%d" % i) for i in range(50)) + text_frame(b"torn")[:-2])
        await writer.drain()
        await until(lambda: len(served_floor.delivered) == 50)
        writer.transport.abort()
        await until(lambda: served_floor.closed)
        assert served_floor.raws() == [b"%d" % i for i in range(50)]
        assert served_floor.connections == 0
    assert [record.message for record in caplog.records if record.levelno >= logging.WARNING] == []


async def test_text_that_is_not_utf8_is_delivered_for_the_reader_to_refuse() -> None:
    async with floor() as served_floor:
        _, writer = await raw_client(served_floor.receiver.port)
        writer.write(text_frame(b'{"a":"\xff"}') + text_frame(b"next"))
        await until(lambda: len(served_floor.delivered) == 2)
        assert served_floor.raws() == [b'{"a":"\xff"}', b"next"]
        writer.close()


@pytest.mark.parametrize("parts", [("x" * 1001,), ("x" * 600, "x" * 600)], ids=["whole", "in fragments"])
async def test_a_message_too_large_is_refused_with_what_to_change(parts: tuple[str, ...]) -> None:
    async with floor(max_message_bytes=1000) as served_floor, connect(served_floor.url) as robot:
        await robot.send("x" * 1000)
        await robot.send(parts)
        with pytest.raises(ConnectionClosed) as ended:
            await robot.recv()
        assert ended.value.rcvd is not None
        assert ended.value.rcvd.code == 1009
        await until(lambda: served_floor.closed)
        (refused,) = served_floor.refused
        assert refused[0] == "message-too-large"
        assert "1000 bytes" in refused[1]
        assert len(served_floor.delivered) == 1


async def test_a_peer_that_closes_with_that_code_itself_sent_no_such_message() -> None:
    async with floor() as served_floor:
        async with connect(served_floor.url) as robot:
            await robot.close(1009, "yours was too large")
        await until(lambda: served_floor.closed)
        assert served_floor.refused == []
        assert served_floor.measures.values[REFUSED] == {}


async def test_what_is_no_websocket_frame_ends_the_connection_and_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ingest.port.receiver.CLOSE_TIMEOUT_S", 0.1)
    monkeypatch.setattr("ingest.port.receiver.IDLE_CHECK_S", 0.05)
    async with floor() as served_floor:
        _, writer = await raw_client(served_floor.receiver.port)
        writer.write(b"\xf3\x01 reserved bits")
        await until(lambda: served_floor.closed)
        assert served_floor.count("protocol-error") == 1
        writer.close()


@pytest.mark.parametrize(
    ("path", "vendor"),
    [("/", None), ("/Alder", "Alder"), ("/alder/?token=1", "Alder"), ("/Blue%20Line", "Blue Line"), ("/else", None)],
)
async def test_the_path_tells_the_vendor(path: str, vendor: str | None) -> None:
    async with (
        floor(vendors=(Vendor(name="Alder"), Vendor(name="Blue Line"))) as served_floor,
        connect(served_floor.url + path) as robot,
    ):
        await robot.send("hello")
        await until(lambda: served_floor.delivered)
        connection = served_floor.delivered[0][2]
        assert (connection.vendor, connection.path) == (vendor, path)
        assert (connection.proven, connection.source) == (False, "127.0.0.1"), "a path proves nothing"


async def test_health_is_answered_over_plain_http() -> None:
    async with floor() as served_floor, http_client() as client:
        answer = await client.get(served_floor.url.replace("ws", "http") + "/healthz")
        assert (answer.status_code, answer.text) == (200, "ok\n")
        assert served_floor.connections == 0


async def test_a_silent_connection_is_closed_with_the_reason_and_one_that_talks_is_not() -> None:
    async with floor(idle_timeout_s=0.4) as served_floor, connect(served_floor.url) as silent:
        _, talker = await raw_client(served_floor.receiver.port)

        async def talk() -> None:
            while True:
                talker.write(text_frame(b"here"))
                await asyncio.sleep(0.05)

        talking = asyncio.create_task(talk())
        with pytest.raises(ConnectionClosed) as ended:
            await silent.recv()
        assert ended.value.rcvd is not None
        assert ended.value.rcvd.reason == "nothing heard for 0.4 s"
        await until(lambda: served_floor.connections == 1)
        assert served_floor.count("idle") == 1
        talking.cancel()
        talker.close()


async def test_a_silent_peer_that_does_not_even_close_is_let_go(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ingest.port.receiver.CLOSE_TIMEOUT_S", 0.1)
    async with floor(idle_timeout_s=0.2) as served_floor:
        _, writer = await raw_client(served_floor.receiver.port)
        await until(lambda: served_floor.closed)
        assert (served_floor.count("idle"), served_floor.connections) == (1, 0)
        writer.close()


@pytest.mark.parametrize("cap", [1, 2])
async def test_of_too_many_from_one_peer_the_newest_win(cap: int) -> None:
    async with floor(max_connections_per_peer=cap) as served_floor:
        robots = [await connect(served_floor.url) for _ in range(cap + 2)]
        for replaced in robots[:2]:
            with pytest.raises(ConnectionClosed) as ended:
                await replaced.recv()
            assert ended.value.rcvd is not None
            assert "close those no longer used" in ended.value.rcvd.reason
        await until(lambda: served_floor.connections == cap)
        assert [connection.id for connection in served_floor.closed] == [1, 2]
        assert served_floor.count("replaced") == 2
        for robot in robots[2:]:
            await robot.send("still here")
        await until(lambda: len(served_floor.delivered) == cap)


async def test_beyond_the_limit_a_connection_is_refused_until_another_ends() -> None:
    async with floor(max_connections=1) as served_floor:
        async with connect(served_floor.url):
            with pytest.raises(InvalidStatus) as refused:
                await connect(served_floor.url)
            assert refused.value.response.status_code == 503
            assert served_floor.count("full") == 1
        await until(lambda: served_floor.closed)
        async with connect(served_floor.url) as robot:
            await robot.send("now")
            await until(lambda: served_floor.delivered)


async def test_a_vendor_with_most_places_makes_room_for_another_and_not_for_itself() -> None:
    async with floor((Vendor(name="Alder"), Vendor(name="Mallory")), max_connections=4) as served_floor:
        greedy = [await connect(f"{served_floor.url}/Mallory") for _ in range(4)]
        with pytest.raises(InvalidStatus):
            await connect(f"{served_floor.url}/Mallory")
        async with connect(f"{served_floor.url}/Alder") as robot:
            await robot.send("there is room")
            await until(served_floor.raws)
        with pytest.raises(ConnectionClosed) as ended:
            await greedy[0].recv()
        assert ended.value.rcvd is not None
        assert "all places are taken" in ended.value.rcvd.reason
        assert (served_floor.count("full"), served_floor.count("replaced")) == (1, 1)
        for connection in greedy:
            await connection.close()


async def test_guessing_tokens_is_slowed_down_and_a_right_token_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ALDER", "alder-0123456789abcdef")
    monkeypatch.setattr("ingest.security.failed_sign_ins.STEP_S", 0.1)
    async with floor((Vendor(name="Alder", token="env:ALDER"),)) as served_floor:
        began_s = time.monotonic()
        for _ in range(6):
            with pytest.raises(InvalidStatus):
                await connect(served_floor.url, additional_headers={"Authorization": "Bearer guessed-0123456789"})
        assert time.monotonic() - began_s > 0.1 + 0.2 + 0.25
        right = {"Authorization": "Bearer alder-0123456789abcdef"}
        async with connect(served_floor.url, additional_headers=right) as robot:
            await robot.send("hello")
            await until(served_floor.raws)


async def test_handshakes_of_an_address_that_never_end_make_room_for_those_of_another(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("ingest.port.receiver.HANDSHAKE_FILES", 3)
    async with floor(max_connections=3, open_timeout_s=600.0) as served_floor:
        port = served_floor.receiver.port
        silent = [await asyncio.open_connection("127.0.0.1", port, local_addr=("127.0.0.2", 0)) for _ in range(9)]
        await until(lambda: served_floor.count("full") == 3)
        honest = [await connect(served_floor.url) for _ in range(3)]
        assert served_floor.count("full") == 6
        for robot in honest:
            await robot.send("there is room")
        await until(lambda: len(served_floor.raws()) == 3)
        with suppress(ConnectionResetError):
            assert [await reader.read() for reader, _ in silent[:6]] == 6 * [b""]
        for robot in honest:
            await robot.close()
        for _, writer in silent:
            writer.close()


async def test_a_peer_that_never_shakes_hands_is_let_go() -> None:
    async with floor(open_timeout_s=0.1) as served_floor:
        reader, writer = await asyncio.open_connection("127.0.0.1", served_floor.receiver.port)
        async with asyncio.timeout(PATIENCE_S):
            assert await reader.read() == b""
        assert served_floor.connections == 0
        writer.close()


async def test_closing_tells_the_robots_and_leaves_nothing_open() -> None:
    async with floor() as served_floor:
        robot = await connect(served_floor.url)
        await until(lambda: served_floor.connections == 1)
        await served_floor.receiver.close()
        with pytest.raises(ConnectionClosed):
            await robot.recv()
        assert len(served_floor.closed) == 1
        assert served_floor.connections == 0


async def test_a_peer_that_answers_nothing_can_not_hold_up_the_closing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ingest.port.receiver.CLOSE_TIMEOUT_S", 0.1)
    async with floor() as served_floor:
        talkers = [await raw_client(served_floor.receiver.port) for _ in range(2)]
        talkers[0][1].write(b"\xf3\x01 no frame")
        async with asyncio.timeout(PATIENCE_S):
            assert await talkers[0][0].read(1)
            await served_floor.receiver.close()
        assert served_floor.connections == 0
        for _, writer in talkers:
            writer.close()


FLOODED = """
import asyncio, logging, resource, sys
logging.basicConfig(level=logging.WARNING)
resource.setrlimit(resource.RLIMIT_NOFILE, (320, 320))
from ingest.security.vendor_credentials import VendorCredentials
from ingest.measures.measures import Measures
from ingest.port.receiver import Receiver
from ingest.settings import ReceiverSettings

async def main():
    measures, nothing = Measures(), lambda *_: None
    receiver = Receiver(ReceiverSettings(port=0, open_timeout_s=60), VendorCredentials(()), nothing, nothing, nothing,
                        overtaken=nothing, measures=measures, clock=lambda: 0.0)
    await receiver.start()
    print(receiver.port, flush=True)
    await asyncio.get_running_loop().run_in_executor(None, sys.stdin.readline)
    print(measures.values["deconflict_connections_refused_total"].get(("full",), 0), flush=True)
    await receiver.close()

asyncio.run(main())
"""


def test_more_connections_than_files_are_turned_away_and_do_not_fill_the_log() -> None:
    with ExitStack() as opened:
        service = opened.enter_context(
            subprocess.Popen(
                [sys.executable, "-c", FLOODED],
                env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
            )
        )
        assert service.stdout
        address = ("127.0.0.1", int(service.stdout.readline()))
        robots = []
        for i in range(200):
            robots.append(opened.enter_context(socket.create_connection(address, timeout=PATIENCE_S)))
            if i < 120:
                robots[i].sendall(HANDSHAKE)
                assert b" 101 " in robots[i].recv(4096)
        for i in range(300):
            robots.append(opened.enter_context(socket.create_connection(address, timeout=PATIENCE_S)))
            with suppress(ConnectionResetError):
                assert robots[120 + i].recv(1) == b""
        for robot in robots:
            robot.close()
        out, err = service.communicate("done\n", timeout=PATIENCE_S)
    assert int(out) == 300
    (text,) = err.splitlines()
    assert "at most 120 connections, because 320 files may be open" in text


async def test_a_vendors_token_lets_it_in_and_nobody_else(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ALDER", "alder-0123456789abcdef")
    async with floor((Vendor(name="Alder", token="env:ALDER"), Vendor(name="Basalt"))) as served_floor:
        right = {"Authorization": "Bearer alder-0123456789abcdef"}
        async with connect(served_floor.url, additional_headers=right) as robot:
            await robot.send("hello")
            await until(lambda: served_floor.delivered)
        connection = served_floor.delivered[0][2]
        assert (connection.vendor, connection.source) == ("Alder", "vendor Alder")
        for path, headers, status in (
            ("/", {}, 401),
            ("/Alder", {"Authorization": "Bearer alder-guessed-0123"}, 401),
            ("/Basalt", right, 403),
        ):
            with pytest.raises(InvalidStatus) as refused:
                await connect(served_floor.url + path, additional_headers=headers)
            assert refused.value.response.status_code == status
        assert (served_floor.count("unauthorised"), served_floor.count("another-vendor")) == (2, 1)


async def test_a_page_of_another_site_may_not_speak_for_robots(monkeypatch: pytest.MonkeyPatch) -> None:
    """A browser lets any page open a WebSocket, and always says whose page it is."""
    async with floor() as served_floor:
        for origin in ("https://elsewhere.example", "null"):
            with pytest.raises(InvalidStatus) as refused:
                await connect(served_floor.url, origin=Origin(origin))
            assert refused.value.response.status_code == 403
        with pytest.raises(InvalidStatus) as refused:
            await connect(served_floor.url, additional_headers={"Sec-Fetch-Site": "cross-site"})
        assert refused.value.response.status_code == 403
        assert served_floor.count("another-site") == 3
        async with connect(served_floor.url, origin=Origin("http://localhost:5173")) as local:
            await local.send("heard")
            await until(lambda: served_floor.raws() == [b"heard"])
    monkeypatch.setenv("ALDER", "alder-0123456789abcdef")
    headers = {"Authorization": "Bearer alder-0123456789abcdef"}
    async with (
        floor((Vendor(name="Alder", token="env:ALDER"),)) as served_floor,
        connect(served_floor.url, additional_headers=headers, origin=Origin(served_floor.url)) as client_connection,
    ):
        await client_connection.send("a library that names the port itself")
        await until(served_floor.raws)
        with pytest.raises(InvalidStatus) as refused:
            await connect(served_floor.url, additional_headers=headers, origin=Origin("https://elsewhere.example"))
        assert refused.value.response.status_code == 403


async def test_a_flood_delays_only_its_own_vendor_and_what_is_shed_is_counted() -> None:
    vendors = (Vendor(name="Alder"), Vendor(name="Basalt"))
    async with (
        floor(vendors, max_messages_per_s=20) as served_floor,
        connect(served_floor.url + "/Alder") as flooding,
        connect(served_floor.url + "/Basalt") as calm,
    ):
        for i in range(2000):
            await flooding.send(status(f"A-{i % 5}", i))
        await calm.send(b"calm")
        await until(lambda: b"calm" in served_floor.raws())
        newest = {status(f"A-{i % 5}", i) for i in range(1995, 2000)}
        await until(lambda: newest <= set(served_floor.raws()))
        shed = served_floor.measures.values["deconflict_messages_shed_total"]
        assert list(shed) == [("Alder",)]
        await until(lambda: shed["Alder",] + len(served_floor.delivered) == 2001)
        assert len(served_floor.delivered) < 200


async def test_a_sender_has_a_share_of_the_time_that_other_processes_leave() -> None:
    async with floor() as served_floor:
        delivery, connection = served_floor.receiver._delivery, Connection(1, vendor="Alder")
        now_s = asyncio.get_running_loop().time()
        pauses_s = [delivery.timed(connection, partial(time.sleep, 0.1), now_s) for _ in range(4)]
        assert pauses_s[-1] > 0.5


PONG, EMPTY = Frame(Opcode.PONG, b""), Frame(Opcode.TEXT, b"")
BEGUN, MORE = Frame(Opcode.TEXT, b"", fin=False), Frame(Opcode.CONT, b"", fin=False)


@pytest.mark.parametrize(
    ("first", "flood"),
    [(EMPTY, PONG), (EMPTY, EMPTY), (BEGUN, MORE)],
    ids=["pongs", "empty messages", "empty fragments"],
)
async def test_the_sockets_of_a_sender_take_a_bounded_part_of_a_core_and_of_memory(first: Frame, flood: Frame) -> None:
    async with floor((Vendor(name="Alder"),), max_messages_per_s=20) as served_floor:
        _, writer = await raw_client(served_floor.receiver.port)
        raw = writer.get_extra_info("socket").dup()
        writer.write(first.serialize(mask=True))
        data, stop = flood.serialize(mask=True) * 5000, threading.Event()
        flooding = threading.Thread(target=_send_until, args=(stop, raw, data))
        flooding.start()
        try:
            await asyncio.sleep(1.0)  # the burst
            used_s = time.thread_time()
            await asyncio.sleep(2.0)
            used_s = time.thread_time() - used_s
        finally:
            stop.set()
            flooding.join()
            raw.close()
            writer.close()
        assert used_s < 2.0 * 3 * READING_SHARE
        assert served_floor.count("protocol-error") == 0


async def test_a_peer_that_reads_no_pong_is_cut_off_counted_and_fills_no_log(caplog: pytest.LogCaptureFixture) -> None:
    async with floor() as served_floor:
        reader, writer = await raw_client(served_floor.receiver.port)
        reader._transport.pause_reading()  # type: ignore[attr-defined]
        raw, pings = writer.get_extra_info("socket").dup(), Frame(Opcode.PING, bytes(125)).serialize(mask=True) * 500
        raw.setblocking(False)
        with suppress(ConnectionError):
            async with asyncio.timeout(PATIENCE_S):
                while True:
                    await asyncio.get_running_loop().sock_sendall(raw, pings)
        await until(lambda: served_floor.count("unread") == 1)
        assert "socket.send() raised exception" not in caplog.text
        assert served_floor.connections == 0
        raw.close()
        writer.close()


def _send_until(stop: threading.Event, raw: socket.socket, data: bytes) -> None:
    raw.settimeout(0.1)
    at = 0
    while not stop.is_set():
        with suppress(TimeoutError):
            at = (at + raw.send(data[at:])) % len(data)
