"""The append-only log: every message as received, and the ticks in order among them, as JSON lines.

    {"received": "...Z", "connection": 3, "peer": "...", "vendor": "Alder", "message": {...}}
    {"received": "...Z", "connection": 3, "peer": "...", "rejected": "not-json", "raw": "..."}
    {"received": "...Z", "connection": 3, "peer": "...", "rejected": "not-utf8", "base64": "..."}
    {"closed": "...Z", "connection": 3}
    {"tick": "...Z"}
    {"engine": "started", "at": "...Z"}

A message that was accepted stands there byte for byte, the last key of its line; one that was not, or that is more than
one line, is quoted as `raw`, or as `base64` where it is not UTF-8. Without a vendor of its own a connection has no
`vendor`.

Times are RFC 3339 in UTC to the microsecond, and the service's times are whole microseconds, so that a replay has the
very numbers of the live run. Lines go to the system at each tick, or sooner where there are many; the death of the
process loses at most those since. Nothing is forced to the disk: the loss of power loses what the system has not yet
written out, by default half a minute on Linux. Each start and each `segment_bytes` begins a new file, and so does
recording after a failure, so nothing is ever appended to a torn line.
"""

import base64
import json
import logging
from collections.abc import Callable
from io import FileIO
from pathlib import Path

from ingest import stamps
from ingest.connection import Connection
from ingest.measures import Measures
from ingest.settings import Recorder as Settings

log = logging.getLogger(__name__)

RETRY_S = 5.0
"""How long after a failed write the next is tried."""
FLUSH_BYTES = 1 << 20
"""Lines that wait for a tick are written out when they are more than this."""
PATTERN = "log-[0-9]*.jsonl"


def quantise(t_s: float) -> float:
    """The nearest whole microsecond, which is what a log can hold."""
    return round(t_s * 1e6) / 1e6


class Recorder:
    """Writes the log. What cannot be written is counted, and the service goes on."""

    def __init__(self, settings: Settings, directory: Path, measures: Measures, clock: Callable[[], float]) -> None:
        self._settings, self._directory, self._measures, self._clock = settings, directory, measures, clock
        self._file: FileIO | None = None
        self._written = 0
        self._failed_s = 0.0
        self._lines: list[bytes] = []
        self._waiting = 0
        """Bytes in `_lines`."""
        self._heads: dict[int, str] = {}
        """What every line of an open connection says of it."""
        self.failing: str | None = None
        """Why nothing can be recorded just now."""

    def received(self, raw: bytes, arrival_s: float, connection: Connection, rejected: str | None) -> None:
        """A message, and the rule that rejected it if one did."""
        head = self._heads.get(connection.id) or self._heads.setdefault(connection.id, _head(connection))
        head = f'{{"received":"{stamps.write(arrival_s)}",{head}'
        if rejected is None and raw[:1] == b"{" and raw[-1:] == b"}" and b"\n" not in raw and b"\r" not in raw:
            self._add(b'%b,"message":%b}\n' % (head.encode(), raw))
        else:
            reason = f',"rejected":{json.dumps(rejected)}' if rejected else ""
            self._add(f"{head}{reason},{_quoted(raw)}}}\n".encode())

    def closed(self, connection: Connection, now_s: float) -> None:
        self._heads.pop(connection.id, None)
        self._add(f'{{"closed":"{stamps.write(now_s)}","connection":{connection.id}}}\n'.encode())

    def engine_started(self, now_s: float) -> None:
        self._add(f'{{"engine":"started","at":"{stamps.write(now_s)}"}}\n'.encode())

    def tick(self, now_s: float) -> None:
        self._add(f'{{"tick":"{stamps.write(now_s)}"}}\n'.encode())
        self.flush()

    def flush(self) -> None:
        """Write out what has come since the last flush, or count it as dropped."""
        data, done = b"".join(self._lines), 0
        self._lines, self._waiting = [], 0
        # a clock that was set back makes the next attempt come sooner, never much later
        if not data or (self.failing and abs(self._clock() - self._failed_s) < RETRY_S):
            self._drop(data)
            return
        try:
            file = self._segment()
            while done < len(data):
                done += file.write(data[done:])
        except OSError as error:
            self._fail(error)
            self._drop(data[done:])
        else:
            self._recovered()
        self._written += done
        self._measures.count("deconflict_recorded_bytes_total", by=done)

    def close(self) -> None:
        self.flush()
        self._end_segment()

    def _add(self, line: bytes) -> None:
        if not self._settings.enabled:
            return
        self._lines.append(line)
        self._waiting += len(line)
        if self._waiting > FLUSH_BYTES:
            self.flush()

    def _segment(self) -> FileIO:
        """The file to write to: a new one at first and where the last is long enough."""
        if self._file is None or self._written >= self._settings.segment_bytes:
            self._end_segment()
            self._directory.mkdir(parents=True, exist_ok=True)
            existing = sorted(self._directory.glob(PATTERN))
            self._remove_oldest(existing)
            self._file = (self._directory / self._name(existing)).open("xb", buffering=0)
            self._written = 0
        return self._file

    def _name(self, existing: list[Path]) -> str:
        """Later than the others by name, though the clock may have been set back."""
        newest_us = int("".join(filter(str.isdigit, existing[-1].stem))) if existing else 0
        return f"log-{max(round(self._clock() * 1e6), newest_us + 1):017d}.jsonl"

    def _end_segment(self) -> None:
        if self._file:
            self._file.close()
        self._file = None

    def _remove_oldest(self, segments: list[Path]) -> None:
        """Keep the segments within `total_bytes`, with room for one more."""
        sizes = [segment.stat().st_size for segment in segments]
        excess = sum(sizes) + self._settings.segment_bytes - self._settings.total_bytes
        for segment, size in zip(segments, sizes, strict=True):
            if excess <= 0:
                return
            segment.unlink()
            excess -= size
            log.info("removed %s: recordings had reached total_bytes", segment.name)

    def _fail(self, error: OSError) -> None:
        if not self.failing:
            log.error("nothing can be recorded: %s; free or mend the disk, recording resumes by itself", error)
        self.failing = str(error)
        self._failed_s = self._clock()
        self._end_segment()

    def _recovered(self) -> None:
        if self.failing:
            log.warning("recording again")
        self.failing = None

    def _drop(self, data: bytes) -> None:
        """Count the lines that are not, or not wholly, written."""
        if data:
            self._measures.count("deconflict_recorded_lines_dropped_total", by=data.count(b"\n"))


def _head(connection: Connection) -> str:
    vendor = f',"vendor":{json.dumps(connection.vendor)}' if connection.vendor else ""
    return f'"connection":{connection.id},"peer":{json.dumps(connection.peer)}{vendor}'


def _quoted(raw: bytes) -> str:
    try:
        return f'"raw":{json.dumps(raw.decode(), ensure_ascii=False)}'
    except UnicodeDecodeError:
        return f'"base64":"{base64.b64encode(raw).decode()}"'
