"""Messages out of the bytes that a socket brings, without a task for each connection.

websockets parses every frame in Python, queues it and wakes whoever waits for it: half of what a message cost. Nearly
all messages are one plain frame, and those are cut from the bytes here. Everything else (handshakes, fragments, pings,
closes, whatever is wrong) is left to websockets, which stands between two frames whenever bytes are cut before it.

All sockets are read into one buffer: a new one of 256 KiB for each read, as asyncio has it otherwise, costs more than
the reading.
"""

import asyncio
from collections.abc import Callable
from typing import Any

from websockets.asyncio.client import ClientConnection
from websockets.asyncio.connection import Connection
from websockets.asyncio.server import ServerConnection
from websockets.frames import DATA_OPCODES, Frame
from websockets.protocol import SERVER, Event, Protocol, State
from websockets.utils import apply_mask as slow_mask

try:
    from websockets.speedups import apply_mask
except ImportError:
    apply_mask = slow_mask

PLAIN = (0x81, 0x82)
"""First byte of a frame that is a whole message, text or binary."""
MASKED, SHORT, LONG = 0x80, 126, 127
"""Of the second byte: the mask's bit, and the lengths that say that 2 or 8 bytes of length follow."""
LONGEST = 0xFFFF
"""What two bytes of length can say."""
ZEROS = bytes(4)
MOST_EARLY = 16
"""Messages that are kept before somebody listens; then the other end has to wait."""
_BUFFER = memoryview(bytearray(1 << 16))
"""Holds what a socket brings until it is cut, which is before the next one is read: a process has one event loop."""


class FrameCuttingConnection(Connection, asyncio.BufferedProtocol):
    """A connection that hands each message, text or binary, to whoever listens, in order and as it comes."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._listener: Callable[[bytes], None] | None = None
        self._early: list[bytes] = []
        self._between = False
        """Whether websockets stands between two frames and holds no bytes."""
        self._torn = b""
        """The beginning of a plain frame whose end is yet to come."""
        self._parts = bytearray()
        """Of a message in fragments."""

    def listen(self, listener: Callable[[bytes], None]) -> None:
        """Hand over what has come so far, and what comes from now on."""
        early, self._early = self._early, []
        self._listener = listener
        for message in early:
            listener(message)
        if len(early) >= MOST_EARLY:
            self.transport.resume_reading()

    def get_buffer(self, sizehint: int) -> memoryview:  # noqa: ARG002 - the most that asyncio would ask for
        return _BUFFER

    def buffer_updated(self, nbytes: int) -> None:
        self.data_received(bytes(_BUFFER[:nbytes]))

    def data_received(self, data: bytes) -> None:
        if self._torn:
            data, self._torn = self._torn + data, b""
        if self._between and self._listener and self.protocol.state is State.OPEN:
            data = self._cut(data, self._listener)
        if data:
            super().data_received(data)
            self._between = stands_between_frames(self.protocol)

    def process_event(self, event: Event) -> None:
        """A frame that websockets has parsed."""
        if not isinstance(event, Frame) or event.opcode not in DATA_OPCODES:
            super().process_event(event)
        elif event.fin and not self._parts:
            self._hand_over(bytes(event.data))
        else:
            self._parts += event.data
            if event.fin:
                whole, self._parts = bytes(self._parts), bytearray()
                self._hand_over(whole)

    def _hand_over(self, message: bytes) -> None:
        if self._listener:
            self._listener(message)
            return
        self._early.append(message)
        if len(self._early) == MOST_EARLY:
            self.transport.pause_reading()

    def _cut(self, data: bytes, listener: Callable[[bytes], None]) -> bytes:
        """Hand over the plain frames that `data` begins with; what is left for websockets."""
        at, end = 0, len(data)
        mask = MASKED if self.protocol.side is SERVER else 0
        most = self.protocol.max_message_size or LONGEST
        while end - at >= 2:
            length = data[at + 1] - mask
            if data[at] not in PLAIN or not 0 <= length < LONG:
                return data[at:]
            body = at + 2
            if length == SHORT:
                body, length = at + 4, data[at + 2] << 8 | data[at + 3] if end - at >= 4 else SHORT
            if length > most:
                return data[at:]
            body += len(ZEROS) if mask else 0
            if body + length > end:
                break
            message = data[body : body + length]
            if mask and (key := data[body - 4 : body]) != ZEROS:
                message = apply_mask(message, key)
            at = body + length
            listener(message)
        self._torn = data[at:]
        return b""


class FrameCuttingServer(FrameCuttingConnection, ServerConnection):
    """Of one who has connected to us."""


class FrameCuttingClient(FrameCuttingConnection, ClientConnection):
    """Of one whom we have dialled."""


def stands_between_frames(protocol: Protocol) -> bool:
    """Whether the next byte is the first of a frame, and not of one that goes on with a message.

    websockets' parser is a generator that waits in `StreamReader.at_eof` there and nowhere else once hands are shaken.
    Were that to change, nothing would be cut, and all be parsed by websockets.
    """
    inner: Any = protocol.parser
    while (within := getattr(inner, "gi_yieldfrom", None)) is not None:
        inner = within
    waits = getattr(inner, "__name__", "") == "at_eof"
    return waits and protocol.current_size is None and not protocol.extensions
