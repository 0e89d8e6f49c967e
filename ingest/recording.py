"""The append-only log: every message as received, and the ticks in order among them, as JSON lines.

    {"received": "...Z", "connection": 3, "vendor": "Alder", "message": {...}}    the message's own bytes, verbatim
    {"received": "...Z", "connection": 3, "rejected": "not-json", "raw": "..."}   where they are no one-line JSON object
    {"received": "...Z", "connection": 3, "rejected": "not-utf8", "base64": "..."}
    {"closed": "...Z", "connection": 3}
    {"tick": "...Z"}
    {"engine": "started", "at": "...Z"}

Times are RFC 3339 in UTC to the microsecond, and the service's times are whole microseconds, so that a replay has the
very numbers of the live run. Lines written since the last tick are flushed at the next; the death of the process loses
at most those, the loss of power what the system has not yet written out. Each start and each `segment_bytes` begins
a new file, so nothing is ever appended to a torn line.
"""

import base64
import json
import logging
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from ingest import stamps
from ingest.connection import Connection
from ingest.measures import Measures
from ingest.settings import Recorder as Settings

log = logging.getLogger(__name__)

RETRY_S = 5.0
"""How long after a failed write the next is tried."""
PATTERN = "log-*.jsonl"


def quantise(t_s: float) -> float:
    """The nearest whole microsecond, which is what a log can hold."""
    return round(t_s * 1e6) / 1e6


class Recorder:
    """Writes the log. What cannot be written is counted, and the service goes on."""

    def __init__(self, settings: Settings, directory: Path, measures: Measures, clock: Callable[[], float]) -> None:
        self._settings, self._directory, self._measures, self._clock = settings, directory, measures, clock
        self._file: BinaryIO | None = None
        self._written = 0
        self._retry_s = float("-inf")
        self._lines: list[bytes] = []
        self.failing: str | None = None
        """Why nothing can be recorded just now."""

    def received(self, raw: bytes, arrival_s: float, connection: Connection, rejected: str | None) -> None:
        """A message, and the rule that rejected it if one did."""
        vendor = f',"vendor":{json.dumps(connection.vendor)}' if connection.vendor else ""
        head = f'{{"received":"{stamps.write(arrival_s)}","connection":{connection.id}{vendor}'
        if rejected is None and b"\n" not in raw and b"\r" not in raw:
            self._lines.append(head.encode() + b',"message":' + raw.strip() + b"}\n")
            return
        reason = f',"rejected":{json.dumps(rejected)}' if rejected else ""
        self._lines.append(f"{head}{reason},{_quoted(raw)}}}\n".encode())

    def closed(self, connection: Connection, now_s: float) -> None:
        self._lines.append(f'{{"closed":"{stamps.write(now_s)}","connection":{connection.id}}}\n'.encode())

    def engine_started(self, now_s: float) -> None:
        self._lines.append(f'{{"engine":"started","at":"{stamps.write(now_s)}"}}\n'.encode())

    def tick(self, now_s: float) -> None:
        self._lines.append(f'{{"tick":"{stamps.write(now_s)}"}}\n'.encode())
        self.flush()

    def flush(self) -> None:
        """Write out what has come since the last flush."""
        lines, self._lines = self._lines, []
        if not lines or not self._settings.enabled:
            return
        if self.failing and self._clock() < self._retry_s:
            self._measures.count("deconflict_recorded_lines_dropped_total", by=len(lines))
            return
        try:
            self._write(b"".join(lines))
        except OSError as error:
            self._fail(error, len(lines))
            return
        if self.failing:
            log.info("recording again")
            self.failing = None

    def close(self) -> None:
        self.flush()
        self._end_segment()

    def _write(self, data: bytes) -> None:
        if self._file is None or self._written >= self._settings.segment_bytes:
            self._new_segment()
        assert self._file is not None  # noqa: S101
        self._file.write(data)
        self._written += len(data)
        self._measures.count("deconflict_recorded_bytes_total", by=len(data))

    def _new_segment(self) -> None:
        self._end_segment()
        self._directory.mkdir(parents=True, exist_ok=True)
        self._remove_oldest()
        name = f"log-{round(self._clock() * 1e6):017d}.jsonl"
        self._file = (self._directory / name).open("xb", buffering=0)
        self._written = 0

    def _end_segment(self) -> None:
        if self._file:
            self._file.close()
        self._file = None

    def _remove_oldest(self) -> None:
        """Keep the segments within `total_bytes`, with room for one more."""
        segments = sorted(self._directory.glob(PATTERN))
        sizes = {segment: segment.stat().st_size for segment in segments}
        excess = sum(sizes.values()) + self._settings.segment_bytes - self._settings.total_bytes
        for segment in segments:
            if excess <= 0:
                return
            segment.unlink()
            excess -= sizes[segment]
            log.info("removed %s: recordings had reached total_bytes", segment.name)

    def _fail(self, error: OSError, lines: int) -> None:
        if not self.failing:
            log.error("nothing can be recorded: %s; free or mend the disk, recording resumes by itself", error)
        self.failing = str(error)
        self._retry_s = self._clock() + RETRY_S
        self._measures.count("deconflict_recorded_lines_dropped_total", by=lines)
        self._end_segment()


def _quoted(raw: bytes) -> str:
    try:
        return f'"raw":{json.dumps(raw.decode(), ensure_ascii=False)}'
    except UnicodeDecodeError:
        return f'"base64":"{base64.b64encode(raw).decode()}"'
