"""Reads logs: the service's own, or any with lines `{"received": ..., "message": {...}}`.

A capture of a broker has lines `{"time": ..., "topic": ..., "payload": ...}`. The payload is an object, or the text of
the message. The topic says in which language it is. A log is a plain, gzip or zstd file, or a directory of such files.
"""

import base64
import json
import logging
import re
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from io import BufferedReader
from math import inf
from operator import attrgetter
from pathlib import Path
from typing import IO, Any

import msgspec

from deconflict_client.verbs import Followed
from ingest.languages import timestamps
from ingest.languages.front_ends import FRONT_ENDS, MASSROBOTICS, language_of_topic
from ingest.port.connection import Connection
from ingest.recording.compression import DAMAGED, unpacked
from ingest.recording.log_segments import last_lines, opened_log, segments
from ingest.recording.operator_events import Given, OffFloorMark, operator_event

LONGEST_LINE = 1 << 24
"""Bytes. Anything longer is no line of a log, and is not read into memory as one."""
LOGGED_LINES = 10
"""Unreadable lines for which a warning is logged."""

log = logging.getLogger(__name__)

_MESSAGE, _PAYLOAD = re.compile(r'"message"\s*:\s*'), re.compile(r'"payload"\s*:\s*')
_DECODER = json.JSONDecoder()
UNREADABLE = (ValueError, KeyError, TypeError, RecursionError, OverflowError)
"""The errors that `parsed` raises."""
_BROKEN = (OSError, *DAMAGED)


class Received(msgspec.Struct, frozen=True, gc=False):
    """A message as it arrived."""

    raw: bytes
    arrival_s: float
    connection: Connection
    refused: str | None = None
    """The rule that rejected it; None if it was accepted."""
    waits: bool = False
    """Whether its robot was not examined (`ingest/fleet/owners/admission.py`)."""


class Overtaken(msgspec.Struct, frozen=True, gc=False):
    """A status that was not read, because a newer one of its robot came first."""

    raw: bytes
    arrival_s: float
    connection: Connection


@dataclass(frozen=True, slots=True)
class Closed:
    """A connection was closed."""

    connection: Connection


@dataclass(frozen=True, slots=True)
class Tick:
    """The engine made a pass."""

    now_s: float
    """Time of the pass, seconds since the epoch."""
    effort: int = 0
    """0 if the pass did everything. A higher number left out more, for lack of time."""
    pending: int = 0
    """How many of the newest questions for advice had no answer at the pass."""
    followed: tuple[Followed, ...] = ()
    """What robots did as asked when the adviser last looked, if it looked since the pass before."""


@dataclass(frozen=True, slots=True)
class EngineStarted:
    """The engine started, or started again."""

    now_s: float


@dataclass(frozen=True, slots=True)
class BlackBoxNote:
    """A line that only a black box has: what it is, what was decided, or where it ends."""

    document: dict[str, Any]


Event = Received | Overtaken | Closed | Given | OffFloorMark | Tick | EngineStarted | BlackBoxNote
NOTES = ("blackbox", "decided", "end")


class LogReader:
    """Reads logs in order, line by line. Lines that can't be read are counted, logged and left out."""

    def __init__(self) -> None:
        self.unreadable = 0
        """Incomplete or foreign lines so far, and compressed files that end too early."""
        self.late, self.late_by_s = 0, 0.0
        """How many messages are behind one that arrived later, and the largest difference."""
        self.own = False
        """Whether a log has lines other than messages. The service wrote such a log, in the order in which it read."""
        self._newest_s = -inf
        self._finished_bytes = 0
        self._file: IO[bytes] | None = None

    @property
    def bytes_read(self) -> int:
        """How much was read, in bytes of the files as they are stored."""
        return self._finished_bytes + (self._file.tell() if self._file and self._file.seekable() else 0)

    def read(self, paths: Iterable[Path]) -> Iterator[Event]:
        """All events of the files, and of the logs in the directories, in the order given.

        Raises `OSError` if a file can't be opened.
        """
        self._newest_s = -inf
        for path in paths:
            for file in segments(path):
                with opened_log(file) as stored:
                    self._file = stored
                    yield from self._events(file, stored)
                    self._finished_bytes, self._file = self.bytes_read, None

    def _events(self, file: Path, stored: BufferedReader) -> Iterator[Event]:
        number = 0
        try:
            lines = unpacked(stored)
            while line := lines.readline(LONGEST_LINE):
                number += 1
                if not line.isspace():
                    try:
                        event = parsed(line)
                    except UNREADABLE as error:
                        self._leave_out(file, number, error)
                    else:
                        self._note(event)
                        yield event
        except _BROKEN as error:
            self._leave_out(file, number + 1, error)

    def _note(self, event: Event) -> None:
        if not isinstance(event, Received):
            self.own |= isinstance(event, Tick | BlackBoxNote | EngineStarted | Given)
        elif event.arrival_s >= self._newest_s:
            self._newest_s = event.arrival_s
        else:
            self.late += 1
            self.late_by_s = max(self.late_by_s, self._newest_s - event.arrival_s)

    def _leave_out(self, file: Path, number: int, error: Exception) -> None:
        self.unreadable += 1
        if self.unreadable <= LOGGED_LINES:
            why = f"{error.msg}: column {error.colno}" if isinstance(error, json.JSONDecodeError) else error
            log.warning("%s, line %d is left out: %s: %.100s", file, number, type(error).__name__, why)


def by_time(paths: Iterable[Path]) -> list[Path]:
    """The files, and the logs of the directories, in the order of their first times.

    A file without a time stays behind the one before it. If one can be read only once, as a pipe, all stay as given.
    """
    files = [file for path in paths for file in segments(path)]
    if len(files) < 2 or not all(file.is_file() for file in files):
        return files
    first_s, last_s = {}, -inf
    for file in files:
        first_s[file] = last_s = _first_time_s(file, last_s)
    return sorted(files, key=first_s.__getitem__)


def _first_time_s(file: Path, otherwise_s: float) -> float:
    with suppress(*_BROKEN):
        for line in lines_of(file):
            with suppress(*UNREADABLE):
                if (t_s := _time_of(parsed(line))) is not None:
                    return t_s
    return otherwise_s


def _time_of(event: Event) -> float | None:
    """The time of a message, a tick or a start of the engine. None for another event."""
    if isinstance(event, Received):
        return event.arrival_s
    return event.now_s if isinstance(event, Tick | EngineStarted) else None


def segments_until(directory: Path, t_s: float) -> list[Path]:
    """The service's own logs in a directory that began before `t_s`, oldest first. Empty if there is no directory."""
    begun = {segment: begun_s(segment) for segment in segments(directory)} if directory.is_dir() else {}
    return sorted((segment for segment, at_s in begun.items() if at_s <= t_s), key=begun.__getitem__)


def ends_s(directory: Path) -> float:
    """The time of the newest event in the service's own logs in a directory. 0 if there is none."""
    for segment in reversed(segments(directory) if directory.is_dir() else []):
        for line in reversed(last_lines(segment)):
            with suppress(*UNREADABLE):
                if (t_s := _time_of(parsed(line))) is not None:
                    return t_s
    return 0.0


def begun_s(segment: Path) -> float:
    """The first time in one of the service's own logs; inf if it has none. Its name may have a later time."""
    return _first_time_s(segment, inf)


def lines_of(file: Path) -> Iterator[bytes]:
    """The lines of one log, not parsed. Raises `OSError`, and `EOFError` or `ZstdError` if the file ends too early."""
    with opened_log(file) as stored:
        lines = unpacked(stored)
        while line := lines.readline(LONGEST_LINE):
            yield line


class _MessageLine(msgspec.Struct, gc=False, forbid_unknown_fields=True):
    """A line with an unquoted message: an accepted one in the service's own log, or any in a foreign log."""

    received: str
    message: msgspec.Raw
    connection: int = 0
    peer: str = ""
    vendor: str | None = None
    language: str = MASSROBOTICS
    topic: str = ""
    proven: bool = False
    waits: bool = False
    before: str = ""
    """In a black box, the hash of the line before."""


_MESSAGE_LINE = msgspec.json.Decoder(_MessageLine)
_sender = attrgetter("connection", "peer", "vendor", "language", "topic", "proven")


def parsed(line: bytes) -> Event:
    """The event of one line. Raises one of `UNREADABLE`."""
    if line.startswith(b'{"tick":"') and line.endswith(b'"}\n'):
        return Tick(_time(line[9:-3].decode()))
    try:
        fields = _MESSAGE_LINE.decode(line)
    except (msgspec.DecodeError, UnicodeDecodeError):
        text = line.decode().rstrip("\r\n")
        document: dict[str, Any] = json.loads(text)
        return _captured(text, document) if "payload" in document else _rare_event(text, document)
    sender = _connection(*_sender(fields))
    return Received(bytes(fields.message), _time(fields.received), sender, waits=fields.waits)


def _rare_event(line: str, document: dict[str, Any]) -> Event:
    """The event of a line that is not of the two frequent kinds."""
    if "tick" in document:
        at_s = _time(document["tick"])
        followed = tuple((str(robot), str(other)) for robot, other in document.get("followed", ()))
        return Tick(at_s, document.get("effort", 0), document.get("pending", 0), followed)
    if "engine" in document:
        return EngineStarted(_time(document["at"]))
    if any(note in document for note in NOTES):
        return BlackBoxNote(document)
    if "off_floor" in document or "given" in document:
        return operator_event(document, _time(document.get("off_floor") or document["given"]))
    if "closed" in document:
        return Closed(_connection_of(document))
    arrived = _raw(line, document), _time(document["received"]), _connection_of(document)
    rejected, waits = document.get("rejected"), document.get("waits") is True
    return Overtaken(*arrived) if "overtaken" in document else Received(*arrived, rejected, waits)


def _captured(line: str, document: dict[str, Any]) -> Received:
    """The message of a line of a capture."""
    topic, payload, time = str(document["topic"]), document["payload"], document["time"]
    language = language_of_topic(topic)
    if language is None:
        raise ValueError(f"topic {topic[:100]!r} belongs to no language that is read")
    raw = payload.encode() if isinstance(payload, str) else _raw(line, document, _PAYLOAD, "payload")
    arrival_s = float(time) if isinstance(time, int | float) else _time(time)
    if not timestamps.plausible(arrival_s):
        raise ValueError(f"{time!r} is no time from 1970 to 2099")
    return Received(raw, arrival_s, _connection(0, "capture", None, language, topic, proven=False))


@lru_cache(maxsize=100_000)
def _connection(number: int, peer: str, vendor: str | None, language: str, topic: str, proven: bool) -> Connection:
    """Raises `ValueError` for a language that is not read."""
    if language not in FRONT_ENDS:
        raise ValueError(f"{language[:40]!r} is no language that this release reads")
    return Connection(number, peer, vendor=vendor, language=language, topic=topic, proven=proven)


def _connection_of(document: dict[str, Any]) -> Connection:
    number, vendor = document.get("connection"), document.get("vendor")
    return _connection(
        number if isinstance(number, int) else 0,
        str(document.get("peer", "")),
        vendor if isinstance(vendor, str) else None,
        str(document.get("language", MASSROBOTICS)),
        str(document.get("topic", "")),
        document.get("proven") is True,
    )


def _raw(line: str, document: dict[str, Any], keys: re.Pattern[str] = _MESSAGE, name: str = "message") -> bytes:
    """The message's own bytes. Encoding it again could change its numbers and its repeated keys."""
    if "base64" in document:
        return base64.b64decode(document["base64"], validate=True)
    if "raw" in document:
        return str(document["raw"]).encode()
    for key in keys.finditer(line):
        value, end = _DECODER.raw_decode(line, key.end())
        if value == document[name]:
            return line[key.end() : end].encode()
    return json.dumps(document[name], ensure_ascii=False).encode()


def _time(text: object) -> float:
    stamp = timestamps.parse(text) if isinstance(text, str) else None
    if stamp is None:
        raise ValueError(f'{text!r} is no time, as "2026-11-22T10:00:00Z" is')
    if not timestamps.plausible(stamp.t_s):
        raise ValueError(f"{text!r} is no time from 1970 to 2099")
    return stamp.t_s
