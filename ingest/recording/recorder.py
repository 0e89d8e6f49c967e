"""The append-only log: every message as received, and the ticks in order among them, as JSON lines.

    {"received": "...Z", "connection": 3, "peer": "...", "vendor": "Alder", "message": {...}}
    {"received": "...Z", "connection": 3, "peer": "...", "rejected": "not-json", "raw": "..."}
    {"received": "...Z", "connection": 3, "peer": "...", "rejected": "not-utf8", "base64": "..."}
    {"received": "...Z", "connection": 3, "peer": "...", "overtaken": true, "base64": "..."}
    {"closed": "...Z", "connection": 3}
    {"tick": "...Z"}
    {"tick": "...Z", "effort": 1, "pending": 2}
    {"engine": "started", "at": "...Z"}

A message that was accepted stands there byte for byte, the last key of its line; one that was not, or that is more than
one line, is quoted as `raw`, or as `base64` where it is not UTF-8. One that was `overtaken` by a newer status of its
robot was never read, so that it may be anything, and a replay leaves it out as well. Without a vendor of its own a
connection has no `vendor`. A tick has an `effort` where the engine had no time for everything
(`deconflict/engine/load_shedding.py`), and a number `pending` of answers where advice was still worked out
(`deconflict/advice/async_answers.py`).

Times are RFC 3339 in UTC to the microsecond, and the service's times are whole microseconds, so that a replay has the
very numbers of the live run. Lines go to a thread of their own at each tick, or sooner where there are many, and from
there to the system, in the order they came: a disk that stalls stops nobody. After `sync` the death of the process
loses none of them. Nobody waits for the disk: the loss of power loses what the system has not yet written out, by
default half a minute on Linux, and less where much is recorded, since it is asked for that every few megabytes.
"""

import base64
import binascii
import json
from collections.abc import Callable
from pathlib import Path

from ingest.languages.massrobotics import timestamps
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.recording.log_rotation import RotatingLog
from ingest.recording.log_writer import LogWriter
from ingest.settings import Recorder as Settings

FLUSH_BYTES = 1 << 18
"""Lines that wait for a tick are handed over when they are more than this: little is left to write when it comes."""
MOST_WAITING_BYTES = 64 << 20
"""Lines that may wait for a slow disk; what comes beyond is dropped and counted."""
CLOSE_S = 5.0
"""How long a close waits for the disk."""


def quantise(t_s: float) -> float:
    """The nearest whole microsecond, which is what a log can hold."""
    return round(t_s * 1e6) / 1e6


class Recorder:
    """Writes the log. What cannot be written is counted, and the service goes on."""

    def __init__(self, settings: Settings, directory: Path, measures: Measures, clock: Callable[[], float]) -> None:
        self._enabled, self._measures = settings.enabled, measures
        self._files = RotatingLog(settings, directory, clock)
        self._writer = LogWriter(self._files.write, MOST_WAITING_BYTES)
        self._lines: list[bytes] = []
        self._bytes = 0
        """In `_lines`."""
        self._heads: dict[int, bytes] = {}
        """What every line of an open connection says of it."""

    def renew(self, settings: Settings) -> None:
        """Other limits from now on; whether anything is recorded stays as it was."""
        self._files.settings = settings

    @property
    def failing(self) -> str | None:
        """Why nothing can be recorded just now."""
        return self._writer.failing or self._files.failing

    @property
    def behind(self) -> bool:
        """Whether lines wait for the disk."""
        return self._writer.waiting

    def received(self, raw: bytes, arrival_s: float, connection: Connection, rejected: str | None) -> None:
        """A message, and the rule that rejected it if one did."""
        begun = self._begun(arrival_s, connection)
        if rejected is None and raw[:1] == b"{" and raw[-1:] == b"}" and b"\n" not in raw and b"\r" not in raw:
            self._add(b'{"received":"%b",%b,"message":%b}\n' % (*begun, raw))
        else:
            reason = f',"rejected":{json.dumps(rejected)}' if rejected else ""
            told = f"{reason},{_quoted(raw)}".encode()
            self._add(b'{"received":"%b",%b%b}\n' % (*begun, told))

    def overtaken(self, raw: bytes, arrival_s: float, connection: Connection) -> None:
        """A message that was not read, because a newer one came first."""
        begun, quoted = self._begun(arrival_s, connection), binascii.b2a_base64(raw, newline=False)
        self._add(b'{"received":"%b",%b,"overtaken":true,"base64":"%b"}\n' % (*begun, quoted))

    def closed(self, connection: Connection, now_s: float) -> None:
        self._heads.pop(connection.id, None)
        self._add(f'{{"closed":"{timestamps.write(now_s)}","connection":{connection.id}}}\n'.encode())

    def engine_started(self, now_s: float) -> None:
        self._add(f'{{"engine":"started","at":"{timestamps.write(now_s)}"}}\n'.encode())

    def tick(self, now_s: float, effort: int = 0, pending: int = 0) -> None:
        told = "".join(f',"{name}":{value}' for name, value in (("effort", effort), ("pending", pending)) if value)
        self._add(f'{{"tick":"{timestamps.write(now_s)}"{told}}}\n'.encode())
        self.flush()

    def flush(self) -> None:
        """Hand over what has come since the last flush."""
        data = b"".join(self._lines)
        self._lines, self._bytes = [], 0
        if data:
            self._writer.put(data)
        self._tally()

    def sync(self, timeout_s: float = CLOSE_S) -> bool:
        """Wait until what was handed over is out of the process; whether it is. May be called from any thread."""
        return self._writer.sync(timeout_s)

    def close(self) -> None:
        """Write out what there is, but wait no longer than `CLOSE_S`: what a stalled disk then holds is counted."""
        self.flush()
        if self._writer.close(CLOSE_S):
            self._files.close()
        self._tally()

    def _begun(self, arrival_s: float, connection: Connection) -> tuple[bytes, bytes]:
        """What the line of a message begins with: when it came, and how."""
        head = self._heads.get(connection.id) or self._heads.setdefault(connection.id, _head(connection))
        return timestamps.write(arrival_s).encode(), head

    def _tally(self) -> None:
        written, dropped = self._writer.tally()
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


def _head(connection: Connection) -> bytes:
    vendor = f',"vendor":{json.dumps(connection.vendor)}' if connection.vendor else ""
    return f'"connection":{connection.id},"peer":{json.dumps(connection.peer)}{vendor}'.encode()


def _quoted(raw: bytes) -> str:
    try:
        return f'"raw":{json.dumps(raw.decode(), ensure_ascii=False)}'
    except UnicodeDecodeError:
        return f'"base64":"{base64.b64encode(raw).decode()}"'
