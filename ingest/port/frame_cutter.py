"""Splits the bytes of a WebSocket into messages, without a task for each connection.

websockets parses every frame in Python, queues it and wakes the task that waits for it: half of the cost of a message.
Nearly all messages are one plain frame, and those are cut from the bytes here. Everything else (handshakes, fragments,
pings, closes, errors) is left to websockets. Bytes are cut only while websockets is between two frames.

All sockets are read into one buffer. By default asyncio allocates a new one of 256 KiB for each read, which costs more
than the read. What is left to websockets is read in smaller pieces, and so are small messages, because thousands of
pings, fragments or empty messages fit into the whole buffer.
"""

import asyncio
from collections.abc import Callable
from typing import Any

from websockets.asyncio.client import ClientConnection
from websockets.asyncio.connection import Connection
from websockets.asyncio.server import ServerConnection
from websockets.frames import DATA_OPCODES, Frame
from websockets.protocol import SEND_EOF, SERVER, Event, Protocol, State
from websockets.utils import apply_mask as slow_mask

try:
    from websockets.speedups import apply_mask
except ImportError:
    apply_mask = slow_mask

PLAIN = (0x81, 0x82)
"""First byte of a frame that is a whole message, text or binary."""
MASKED, SHORT, LONG = 0x80, 126, 127
"""In the second byte: the bit for a mask, and the lengths that mean that 2 or 8 bytes of length follow."""
LONGEST = 0xFFFF
"""The greatest length in two bytes."""
ZEROS = bytes(4)
MOST_EARLY = 16
"""Messages that are kept before there is a listener. After that, reading pauses."""
_BUFFER = memoryview(bytearray(1 << 14))
"""Holds the bytes of one read. They are cut before the next read, since a process has one event loop."""
_SMALL_BUFFER = _BUFFER[: 1 << 10]
"""For a connection of whose last bytes some were left to websockets, or held small messages. Each takes up to 50 us."""
SMALL_BYTES = 200
"""Mean length of the messages of a read that are small. No status is as short."""


class FrameCuttingConnection(Connection, asyncio.BufferedProtocol):
    """A connection that passes each message, text or binary, to its listener, in order and at once."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._listener: Callable[[bytes], None] | None = None
        self._early: list[bytes] = []
        self._between_frames = False
        """Whether websockets is between two frames and holds no bytes."""
        self._incomplete = b""
        """The beginning of a plain frame whose end has not arrived."""
        self._fragments = bytearray()
        """The fragments of a message so far."""
        self.is_unread = False
        """Whether the peer was cut off because it did not read."""
        self._buffer = _SMALL_BUFFER
        self._read: Callable[[bytes], None] = self.data_received

    def listen(self, listener: Callable[[bytes], None], read: Callable[[bytes], None] | None = None) -> None:
        """Pass on the messages so far, and those that arrive from now on.

        `read` gets the bytes of each read, and has to pass them to `data_received`.
        """
        early, self._early = self._early, []
        self._listener, self._read = listener, read or self.data_received
        for message in early:
            listener(message)
        if len(early) >= MOST_EARLY:
            self.transport.resume_reading()

    def get_buffer(self, sizehint: int) -> memoryview:  # noqa: ARG002 - the most that asyncio would ask for
        return self._buffer

    def buffer_updated(self, nbytes: int) -> None:
        self._read(bytes(_BUFFER[:nbytes]))

    def pause_writing(self) -> None:
        """Cut off a peer that leaves thousands of pongs unread: it would wait for them even when it is closed."""
        super().pause_writing()
        self.is_unread = True
        self.loop.call_soon(self.transport.abort)  # after the pongs of this read, which asyncio would log one by one

    def send_data(self) -> None:
        """Send the pongs of one read at once: asyncio logs each write to a connection that is lost."""
        writes = self.protocol.writes
        if len(writes) > 2:
            ends = writes[-1] == SEND_EOF
            self.protocol.writes = [b"".join(writes), *([SEND_EOF] if ends else [])]
        super().send_data()

    def data_received(self, data: bytes) -> None:
        if self._incomplete:
            data, self._incomplete = self._incomplete + data, b""
        are_small = False
        if self._between_frames and self._listener and self.protocol.state is State.OPEN:
            data, are_small = self._cut(data, self._listener)
        self._buffer = _SMALL_BUFFER if data or are_small else _BUFFER
        if data:
            super().data_received(data)
            self._between_frames = stands_between_frames(self.protocol)

    def process_event(self, event: Event) -> None:
        """A frame that websockets has parsed."""
        if not isinstance(event, Frame) or event.opcode not in DATA_OPCODES:
            super().process_event(event)
        elif event.fin and not self._fragments:
            self._pass_on(bytes(event.data))
        else:
            self._fragments += event.data
            if event.fin:
                whole, self._fragments = bytes(self._fragments), bytearray()
                self._pass_on(whole)

    def _pass_on(self, message: bytes) -> None:
        if self._listener:
            self._listener(message)
            return
        self._early.append(message)
        if len(self._early) == MOST_EARLY:
            self.transport.pause_reading()

    def _cut(self, data: bytes, listener: Callable[[bytes], None]) -> tuple[bytes, bool]:
        """Pass on the plain frames at the beginning of `data`.

        Returns the bytes that are left for websockets, and whether the messages are small.
        """
        at, end, number = 0, len(data), 0
        mask = MASKED if self.protocol.side is SERVER else 0
        max_length = self.protocol.max_message_size or LONGEST
        while end - at >= 2:
            length = data[at + 1] - mask
            if data[at] not in PLAIN or not 0 <= length < LONG:
                return data[at:], True
            body = at + 2
            if length == SHORT:
                body, length = at + 4, data[at + 2] << 8 | data[at + 3] if end - at >= 4 else SHORT
            if length > max_length:
                return data[at:], True
            body += len(ZEROS) if mask else 0
            if body + length > end:
                break
            message = data[body : body + length]
            if mask and (key := data[body - 4 : body]) != ZEROS:
                message = apply_mask(message, key)
            at, number = body + length, number + 1
            listener(message)
        self._incomplete = data[at:]
        return b"", number * SMALL_BYTES > at


class FrameCuttingServer(FrameCuttingConnection, ServerConnection):
    """A connection that was accepted."""


class FrameCuttingClient(FrameCuttingConnection, ClientConnection):
    """A connection that was dialled."""


def stands_between_frames(protocol: Protocol) -> bool:
    """Whether the next byte begins a frame that begins a message.

    After the handshake, websockets' parser waits in `StreamReader.at_eof` there and nowhere else. If a release of
    websockets changes that, nothing is cut, and websockets parses everything.
    """
    inner: Any = protocol.parser
    while (within := getattr(inner, "gi_yieldfrom", None)) is not None:
        inner = within
    waits = getattr(inner, "__name__", "") == "at_eof"
    return waits and protocol.current_size is None and not protocol.extensions
