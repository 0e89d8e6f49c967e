"""The append-only log: every message as received, and the ticks in order among them, as JSON lines.

    {"received": "...Z", "connection": 3, "peer": "...", "vendor": "Alder", "proven": true, "message": {...}}
    {"received": "...Z", "connection": 3, "peer": "...", "waits": true, "message": {...}}
    {"received": "...Z", "connection": 4, "peer": "...", "language": "vda5050", "topic": "...", "message": {...}}
    {"received": "...Z", "connection": 3, "peer": "...", "rejected": "not-json", "raw": "..."}
    {"received": "...Z", "connection": 3, "peer": "...", "rejected": "not-utf8", "base64": "..."}
    {"received": "...Z", "connection": 3, "peer": "...", "overtaken": true, "base64": "..."}
    {"closed": "...Z", "connection": 3}
    {"given": "...Z", "uuid": "...", "vendor": "Alder"}
    {"off_floor": "...Z", "uuid": "...", "is_off": true, "by": "Petra", "datum": "...", "x_m": 4.5, "y_m": 1.0}
    {"tick": "...Z"}
    {"tick": "...Z", "effort": 1, "pending": 2, "followed": [["...", "..."]]}
    {"engine": "started", "at": "...Z"}

An accepted message stands byte for byte as the last key of its line. A rejected message, or one of several lines or
with what JSON does not have, as `nan`, is quoted as `raw`, or as `base64` if it is not UTF-8. Of one that its sender's
share of the log does not admit whole (`RejectedShares`) that is the beginning, and the line has `size_bytes` and
`sha256` of the whole. A message `overtaken` by a newer status of its robot was never read, so its content may be
anything; a replay leaves it out as well. `vendor` is absent if the connection has none, `language` and `topic` if the
message came over a WebSocket. `proven` is true if the vendor is not only claimed (`ingest/port/connection.py`). A
message `waits` if its robot is not examined yet (`ingest/fleet/owners/admission.py`). A robot is `given` to a vendor by
a person, who may also say that it is `off_floor` (`ingest/fleet/owners/departures.py`). A tick has an `effort` if the
engine had no time for everything (`deconflict/engine/load_shedding.py`), a number `pending` of answers if advice was
still being computed (`deconflict/advice/deferred_answers.py`), and `followed` if robots did what they were asked: each
robot with that for which it was asked (`deconflict/adviser/`).

Times are RFC 3339 in UTC to the microsecond. The service's own times are whole microseconds, so that a replay has
exactly the numbers of the live run. At each tick, or sooner if there are many, lines go to a thread, which passes them
to the system in their order. So a stalled disk stops nothing else. After `sync`, lines survive the death of the
process, also while older files are packed (`log_packing.py`). A power failure loses what the system has not yet written
to disk: by default half a minute on Linux. It is less if much is recorded, since the system is asked to write every few
megabytes.
"""

import base64
import binascii
import json
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from hashlib import sha256
from pathlib import Path
from typing import Any

import msgspec

from deconflict_client.verbs import Followed
from ingest.languages import timestamps
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.recording.clock_notes import KnownTime
from ingest.recording.log_reader import Received
from ingest.recording.log_rotation import RotatingLog
from ingest.recording.log_writer import LogWriter
from ingest.recording.operator_events import OffFloorMark
from ingest.settings import RecorderSettings

HEAD_BYTES = 200
"""What is recorded of the beginning of a message."""
LINE_BYTES = 300
"""The other keys of its line, about."""
BURST_S = 32.0
SENDER_BYTES_PER_S, ALL_BYTES_PER_S = 8192.0, 65536.0
"""Of lines with whole messages, and as much again of lines with beginnings."""
MOST_SENDERS = 1000


class RecordedPart(Enum):
    """How much of a rejected message is recorded."""

    WHOLE = "whole"
    HEAD = "head"
    NOTHING = "nothing"


@dataclass(slots=True, eq=False)
class _Allowance:
    """Bytes that may still be recorded: of whole messages and of beginnings."""

    rate: float
    at_s: float
    whole: float
    heads: float

    def refill(self, now_s: float) -> None:
        added, most = max(now_s - self.at_s, 0.0) * self.rate, self.rate * BURST_S
        self.whole, self.heads, self.at_s = min(self.whole + added, most), min(self.heads + added, most), now_s


class RejectedShares:
    """The allowances of all senders, and of all together: a sender may have many addresses."""

    def __init__(self) -> None:
        self._senders: OrderedDict[str, _Allowance] = OrderedDict()
        self._all = _full(ALL_BYTES_PER_S, 0.0)

    def admit(self, sender: str, message_bytes: int, now_s: float, topic_bytes: int = 0) -> RecordedPart:
        """How much to record of a rejected message of a sender: a vendor, or an address."""
        allowances = (self._of(sender, now_s), self._all)
        for allowance in allowances:
            allowance.refill(now_s)
        line_bytes = LINE_BYTES + topic_bytes
        whole_bytes, head_bytes = message_bytes + line_bytes, min(message_bytes, HEAD_BYTES) + line_bytes
        if all(allowance.whole >= whole_bytes for allowance in allowances):
            for allowance in allowances:
                allowance.whole -= whole_bytes
            return RecordedPart.WHOLE
        if all(allowance.heads >= head_bytes for allowance in allowances):
            for allowance in allowances:
                allowance.heads -= head_bytes
            return RecordedPart.HEAD
        return RecordedPart.NOTHING

    def _of(self, sender: str, now_s: float) -> _Allowance:
        known = self._senders.get(sender)
        if known is None:
            known = self._senders[sender] = _full(SENDER_BYTES_PER_S, now_s)
            if len(self._senders) > MOST_SENDERS:
                self._senders.popitem(last=False)
        else:
            self._senders.move_to_end(sender)
        return known


def _full(rate: float, now_s: float) -> _Allowance:
    return _Allowance(rate, now_s, rate * BURST_S, rate * BURST_S)


FLUSH_BYTES = 1 << 18
"""Lines that wait for a tick are passed on when they exceed this, so that little is left to write at the tick."""
MOST_WAITING_BYTES = 64 << 20
"""Lines that may wait for a slow disk. Further ones are dropped and counted."""
_WAITS = b',"waits":true'
_JSON = msgspec.json.Decoder(msgspec.Raw)
CLOSE_S = 5.0
"""How long `close` waits for the disk."""


def quantise(t_s: float) -> float:
    """The nearest whole microsecond, the resolution of the log."""
    return round(t_s * 1e6) / 1e6


class Recorder:
    """Writes the log. Lines that can't be written are counted, and the service continues."""

    def __init__(
        self,
        settings: RecorderSettings,
        directory: Path,
        measures: Measures,
        clock: Callable[[], float],
        known_time: Callable[[], KnownTime] = lambda: KnownTime(0.0, 0.0),
    ) -> None:
        """Nothing is removed for its age without a `known_time`, which may wait for the disk."""
        self._enabled, self._measures = settings.enabled, measures
        self.files = RotatingLog(settings, directory, clock, known_time)
        """The segments. What was received before their `leaving_before_s` will soon be in neither of the newest two."""
        self.writer = LogWriter(self.files.write, MOST_WAITING_BYTES)
        """Passes the lines to the files on a thread of its own, as soon as the disk takes them."""
        self._rejected_shares = RejectedShares()
        self._lines: list[bytes] = []
        self._bytes = 0
        """The size of `_lines`."""
        self._connection_keys: dict[int, bytes] = {}
        """By number of an open connection, the part of its lines that describes it."""

    def reconfigure(self, settings: RecorderSettings) -> None:
        """Use other limits from now on. Whether anything is recorded does not change."""
        self.files.settings = settings

    @property
    def failing(self) -> str | None:
        """Why lines can't be recorded; None if they can."""
        return self.writer.failing or self.files.failing

    def received(
        self,
        raw: bytes,
        arrival_s: float,
        connection: Connection,
        rejected: str | None,
        *,
        waits: bool = False,
        deviates: bool = True,
    ) -> None:
        """Record a message, the rule that rejected it if one did, and whether its robot waits to be examined.

        One that does not deviate from any rule is JSON by the letter, so that this need not be tried.
        """
        if rejected:
            self._add_rejected(raw, arrival_s, connection, rejected)
            return
        time, keys = self._line_begin(arrival_s, connection)
        self._add(_message_line(raw, time, keys + _WAITS if waits else keys, deviates=deviates))

    def overtaken(self, raw: bytes, arrival_s: float, connection: Connection) -> None:
        """Record a message that was not read, because a newer one came first."""
        begin, quoted = self._line_begin(arrival_s, connection), binascii.b2a_base64(raw, newline=False)
        self._add(b'{"received":"%b",%b,"overtaken":true,"base64":"%b"}\n' % (*begin, quoted))

    def closed(self, connection: Connection, now_s: float) -> None:
        self._connection_keys.pop(connection.id, None)
        self._add(f'{{"closed":"{timestamps.write(now_s)}","connection":{connection.id}}}\n'.encode())

    def given(self, uuid: str, vendor: str, now_s: float) -> None:
        line = {"given": timestamps.write(now_s), "uuid": uuid, "vendor": vendor}
        self._add(json.dumps(line, separators=(",", ":")).encode() + b"\n")

    def off_floor(self, mark: OffFloorMark) -> None:
        self._add(mark_line(mark))

    def engine_started(self, now_s: float) -> None:
        self._add(f'{{"engine":"started","at":"{timestamps.write(now_s)}"}}\n'.encode())

    def tick(self, now_s: float, effort: int = 0, pending: int = 0, followed: Sequence[Followed] = ()) -> None:
        values = {"effort": effort, "pending": pending, "followed": followed}
        line = {"tick": timestamps.write(now_s)} | {name: value for name, value in values.items() if value}
        self._add(json.dumps(line, separators=(",", ":")).encode() + b"\n")
        self.flush()

    def flush(self) -> None:
        """Pass the lines since the last flush to the writer."""
        data = b"".join(self._lines)
        self._lines, self._bytes = [], 0
        if data:
            self.writer.add(data)
        self._count()

    def sync(self, timeout_s: float = CLOSE_S) -> bool:
        """Wait until the system has all flushed lines. Returns whether it has them. May be called from any thread."""
        return self.writer.sync(timeout_s)

    def close(self) -> None:
        """Write all lines and pack what is due, but wait no longer than `CLOSE_S` for either. Lines not written by
        then are counted as lost."""
        self.flush()
        if self.writer.close(CLOSE_S):
            self.files.close()
            self.files.packer.close(CLOSE_S)
        self._count()

    def _add_rejected(self, raw: bytes, arrival_s: float, connection: Connection, rule: str) -> None:
        recorded = self._rejected_shares.admit(connection.holder, len(raw), arrival_s, len(connection.topic))
        if recorded is not RecordedPart.WHOLE:
            self._measures.count("deconflict_rejected_cut_total", recorded.value)
        if recorded is RecordedPart.NOTHING:
            return
        content = _quoted(raw)
        if recorded is RecordedPart.HEAD:
            content = f'{_quoted(raw[:HEAD_BYTES])},"size_bytes":{len(raw)},"sha256":"{sha256(raw).hexdigest()}"'
        keys = f'"rejected":{json.dumps(rule)},{content}'.encode()
        self._add(b'{"received":"%b",%b,%b}\n' % (*self._line_begin(arrival_s, connection), keys))

    def _line_begin(self, arrival_s: float, connection: Connection) -> tuple[bytes, bytes]:
        """The parts with which the line of a message begins: its arrival and its connection."""
        keys = self._connection_keys.get(connection.id)
        if keys is None:
            keys = self._connection_keys[connection.id] = _connection_keys(connection)
        return timestamps.write(arrival_s).encode(), keys

    def _count(self) -> None:
        written, dropped = self.writer.take_counts()
        self._measures.count("deconflict_recorded_bytes_total", by=written)
        if dropped:
            self._measures.count("deconflict_recorded_lines_dropped_total", by=dropped)

    def _add(self, line: bytes) -> None:
        if not self._enabled:
            return
        self._lines.append(line)
        self._bytes += len(line)
        if self._bytes > FLUSH_BYTES:
            self.flush()


def mark_line(mark: OffFloorMark) -> bytes:
    """The line of what was said of a robot."""
    line = {"off_floor": timestamps.write(mark.at_s)} | msgspec.structs.asdict(mark)
    del line["at_s"]
    return json.dumps(line, separators=(",", ":")).encode() + b"\n"


def line_of(message: Received) -> bytes:
    """The line of an accepted message in the log."""
    time = timestamps.write(message.arrival_s).encode()
    return _message_line(message.raw, time, _connection_keys(message.connection) + (_WAITS if message.waits else b""))


def _message_line(raw: bytes, time: bytes, connection_keys: bytes, *, deviates: bool = True) -> bytes:
    is_line = raw[:1] == b"{" and raw[-1:] == b"}" and b"\n" not in raw and b"\r" not in raw
    if is_line and not (deviates and _is_no_json(raw)):
        return b'{"received":"%b",%b,"message":%b}\n' % (time, connection_keys, raw)
    return b'{"received":"%b",%b,%b}\n' % (time, connection_keys, _quoted(raw).encode())


def _is_no_json(raw: bytes) -> bool:
    """Whether a line with it could not be read."""
    try:
        _JSON.decode(raw)
    except (msgspec.DecodeError, RecursionError):
        return True
    return False


def _connection_keys(connection: Connection) -> bytes:
    keys: dict[str, Any] = {"connection": connection.id, "peer": connection.peer}
    if connection.vendor:
        keys["vendor"] = connection.vendor
    if connection.topic:
        keys |= {"language": connection.language, "topic": connection.topic}
    if connection.proven:
        keys["proven"] = True
    return json.dumps(keys, separators=(",", ":"))[1:-1].encode()


def _quoted(raw: bytes) -> str:
    try:
        return f'"raw":{json.dumps(raw.decode(), ensure_ascii=False)}'
    except UnicodeDecodeError:
        return f'"base64":"{base64.b64encode(raw).decode()}"'
