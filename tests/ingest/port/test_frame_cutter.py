"""The bytes of one connection, in pieces of every kind, against the messages that websockets reads from them."""

import asyncio
import random
from collections.abc import Iterable

import pytest
from websockets.frames import Frame, Opcode
from websockets.http11 import Request
from websockets.protocol import CLIENT, OPEN, SERVER, Protocol, Side
from websockets.server import ServerProtocol

from ingest.port.frame_cutter import FrameCuttingConnection, stands_between_frames

MOST = 2000


class Transport(asyncio.Transport):
    """Takes what is written; tells whether it is read from."""

    def __init__(self) -> None:
        super().__init__()
        self.written, self.reading = bytearray(), True

    def set_write_buffer_limits(self, high: int | None = None, low: int | None = None) -> None: ...

    def write(self, data: bytes | bytearray | memoryview) -> None:
        self.written += data

    def can_write_eof(self) -> bool:
        return False

    def close(self) -> None: ...

    def pause_reading(self) -> None:
        self.reading = False

    def resume_reading(self) -> None:
        self.reading = True


def opened(side: Side = SERVER) -> tuple[FrameCuttingConnection, Transport]:
    connection, transport = FrameCuttingConnection(Protocol(side, state=OPEN, max_size=MOST)), Transport()
    connection.connection_made(transport)
    return connection, transport


def frames(rng: random.Random, *, mask: bool) -> tuple[bytes, list[bytes]]:
    """The bytes of many frames of every kind that is allowed, and their messages."""
    stream, messages = bytearray(), []
    for _ in range(40):
        size = rng.choice((0, 1, 125, 126, 127, 300, MOST))
        body, opcode = rng.randbytes(size), rng.choice((Opcode.TEXT, Opcode.BINARY))
        messages.append(body)
        if rng.random() < 0.2:
            stream += Frame(Opcode.PING, b"there?").serialize(mask=mask)
        cut = rng.randrange(size + 1) if rng.random() < 0.3 else None
        if cut is None:
            stream += Frame(opcode, body).serialize(mask=mask)
        else:
            stream += Frame(opcode, body[:cut], fin=False).serialize(mask=mask)
            stream += Frame(Opcode.PONG, b"here").serialize(mask=mask)
            stream += Frame(Opcode.CONT, body[cut:]).serialize(mask=mask)
    return bytes(stream), messages


def pieces(data: bytes, rng: random.Random, most: int) -> Iterable[bytes]:
    while data:
        size = rng.randint(1, most)
        yield data[:size]
        data = data[size:]


@pytest.mark.parametrize("side", [SERVER, CLIENT])
@pytest.mark.parametrize("most", [1, 7, 500, 20_000])
async def test_every_message_comes_whole_and_in_order_however_its_bytes_come(side: Side, most: int) -> None:
    for seed in range(10):
        rng = random.Random(seed)
        connection, _ = opened(side)
        data, messages = frames(rng, mask=side is SERVER)
        heard: list[bytes] = []
        connection.listen(heard.append)
        for piece in pieces(data, rng, most):
            connection.data_received(piece)
        assert heard == messages


async def test_plain_frames_do_not_pass_through_websockets(monkeypatch: pytest.MonkeyPatch) -> None:
    connection, _ = opened()
    heard: list[bytes] = []
    connection.listen(heard.append)
    connection.data_received(Frame(Opcode.PING, b"").serialize(mask=True))
    monkeypatch.setattr(Protocol, "receive_data", None)
    data = b"".join(Frame(Opcode.TEXT, b"%d" % n * 200).serialize(mask=True) for n in range(20))
    for piece in pieces(data, random.Random(1), 333):
        connection.data_received(piece)
    assert heard == [b"%d" % n * 200 for n in range(20)]


async def test_messages_before_there_is_a_listener_are_kept_up_to_a_limit() -> None:
    connection, transport = opened()
    heard: list[bytes] = []
    for n in range(16):
        assert transport.reading
        connection.data_received(Frame(Opcode.TEXT, b"%d" % n).serialize(mask=True))
    assert not transport.reading
    connection.listen(heard.append)
    connection.data_received(Frame(Opcode.TEXT, b"16").serialize(mask=True))
    assert transport.reading
    assert heard == [b"%d" % n for n in range(17)]


@pytest.mark.parametrize(
    "wrong",
    [
        Frame(Opcode.TEXT, bytes(MOST + 1)).serialize(mask=True),
        Frame(Opcode.TEXT, bytes(70_000)).serialize(mask=True),
        Frame(Opcode.TEXT, b"not masked").serialize(mask=False),
        b"\xc1" + Frame(Opcode.TEXT, b"reserved").serialize(mask=True)[1:],
        Frame(Opcode.TEXT, b"", fin=False).serialize(mask=True) + Frame(Opcode.TEXT, b"within").serialize(mask=True),
    ],
    ids=["too large", "much too large", "not masked", "compressed", "a message within one"],
)
async def test_a_protocol_error_is_left_to_websockets_and_ends_the_connection(wrong: bytes) -> None:
    connection, _ = opened()
    heard: list[bytes] = []
    connection.listen(heard.append)
    good = Frame(Opcode.TEXT, b"good").serialize(mask=True)
    connection.data_received(good)
    connection.data_received(good + wrong + good)
    connection.data_received(good)
    assert heard == [b"good"] * 2
    assert connection.protocol.close_sent


async def test_a_connection_is_read_in_small_pieces_while_websockets_has_to_parse_it_and_of_small_messages() -> None:
    connection, _ = opened()
    connection.listen(lambda _: None)
    pings, small, plain = (
        Frame(opcode, body).serialize(mask=True)
        for opcode, body in ((Opcode.PING, b""), (Opcode.TEXT, b""), (Opcode.TEXT, bytes(1000)))
    )
    sizes = []
    for data in (pings, plain, plain + pings, plain, 3 * small + plain, 9 * small + plain, plain):
        sizes.append(len(connection.get_buffer(0)))
        connection.data_received(data)
    assert [size <= 1024 for size in sizes] == [True, True, False, True, False, False, True]


async def test_the_pongs_of_one_read_are_one_write(monkeypatch: pytest.MonkeyPatch) -> None:
    connection, transport = opened()
    connection.listen(lambda _: None)
    writes: list[bytes] = []
    monkeypatch.setattr(transport, "write", writes.append)
    close = Frame(Opcode.CLOSE, b"\x03\xe8").serialize(mask=True)
    connection.data_received(Frame(Opcode.PING, b"there?").serialize(mask=True) * 100 + close)
    assert [len(data) for data in writes] == [8 * 100 + 4]
    assert connection.protocol.close_sent


def test_websockets_parser_waits_for_a_frame_at_one_place_only() -> None:
    protocol = ServerProtocol(max_size=MOST)
    request = (
        b"GET / HTTP/1.1\r\nHost: floor\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
    )
    protocol.receive_data(request[:40])
    assert not stands_between_frames(protocol)
    protocol.receive_data(request[40:])
    (found,) = protocol.events_received()
    assert isinstance(found, Request)
    protocol.send_response(protocol.accept(found))
    first, rest = Frame(Opcode.TEXT, b"a", fin=False), Frame(Opcode.CONT, b"b")
    stood = []
    for byte in first.serialize(mask=True) + rest.serialize(mask=True):
        protocol.receive_data(bytes([byte]))
        stood.append(stands_between_frames(protocol))
    assert stood == [False] * 13 + [True]
