"""Read a log back, ours or any of lines `{"received": ..., "message": {...}}`: plain, gzip or zstd, or a directory."""

import base64
import gzip
import io
import json
import logging
import re
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from math import inf
from pathlib import Path
from typing import IO, Any

import msgspec
import zstandard

from ingest.languages.massrobotics import timestamps
from ingest.port.connection import Connection

LONGEST_LINE = 1 << 24
"""Bytes; what is longer is no line of a log, and is not gathered in memory to find out."""
TAIL_BYTES = 1 << 20
"""The end of a log that has whole lines in any case, as long as our own are."""
BUFFER_BYTES = 1 << 18
"""Of a log that is read through; with the usual ones every fourth line waits for the system."""
TOLD_LINES = 10
"""Unreadable lines that are named in the service's log."""

log = logging.getLogger(__name__)

_MESSAGE = re.compile(r'"message"\s*:\s*')
_DECODER = json.JSONDecoder()
UNREADABLE = (ValueError, KeyError, TypeError, RecursionError)
"""What `parsed` raises."""
_BROKEN = (OSError, EOFError, zstandard.ZstdError)
_GZIP, _ZSTD, _SKIPPED = b"\x1f\x8b", zstandard.FRAME_HEADER, re.compile(rb"[\x50-\x5f]\x2a\x4d\x18")
"""How packed logs begin; zstd's may begin with a frame that is to be skipped."""


class Received(msgspec.Struct, frozen=True, gc=False):
    """A message as it came."""

    raw: bytes
    arrival_s: float
    connection: Connection
    refused: str | None = None
    """The rule that rejected it."""


class Overtaken(msgspec.Struct, frozen=True, gc=False):
    """A status that nobody read, because a newer one of its robot came first."""

    raw: bytes
    arrival_s: float
    connection: Connection


@dataclass(frozen=True, slots=True)
class Closed:
    connection: Connection


@dataclass(frozen=True, slots=True)
class Tick:
    now_s: float
    effort: int = 0
    """Of the engine's pass, 0 where it did everything."""
    pending: int = 0
    """Answers that its pass did without, the newest of those asked for."""


@dataclass(frozen=True, slots=True)
class EngineStarted:
    now_s: float


@dataclass(frozen=True, slots=True)
class BlackBoxNote:
    """A line that only a black box has: what it is, what was decided, or where it ends."""

    document: dict[str, Any]


Event = Received | Overtaken | Closed | Tick | EngineStarted | BlackBoxNote
NOTES = ("blackbox", "decided", "end")


class LogReader:
    """Reads logs in order, a line at a time. Lines that can't be read are counted, named and left out."""

    def __init__(self) -> None:
        self.unreadable = 0
        """Torn or foreign lines met so far, and compressed files that break off."""
        self.late, self.late_by_s = 0, 0.0
        """Messages that stand behind one that came later, and by how much at most."""
        self.own = False
        """Whether anything but messages was in a log: the service wrote it, in the order in which it took them."""
        self._newest_s = -inf
        self._finished_bytes = 0
        self._file: IO[bytes] | None = None

    @property
    def bytes_read(self) -> int:
        """How far it has come, in bytes of the files as they are stored."""
        return self._finished_bytes + (self._file.tell() if self._file else 0)

    def read(self, paths: Iterable[Path]) -> Iterator[Event]:
        """Every event of the files, and of the logs in the directories, in the order given.

        Raises `OSError` where a file can't be opened.
        """
        self._newest_s = -inf
        for path in paths:
            for file in segments(path):
                with io.BufferedReader(io.FileIO(file), BUFFER_BYTES) as stored:
                    self._file = stored
                    yield from self._events(file, unpacked(stored))
                    self._finished_bytes, self._file = self.bytes_read, None

    def _events(self, file: Path, lines: IO[bytes]) -> Iterator[Event]:
        number = 0
        try:
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
            self.own |= isinstance(event, Tick | BlackBoxNote | EngineStarted)
        elif event.arrival_s >= self._newest_s:
            self._newest_s = event.arrival_s
        else:
            self.late += 1
            self.late_by_s = max(self.late_by_s, self._newest_s - event.arrival_s)

    def _leave_out(self, file: Path, number: int, error: Exception) -> None:
        self.unreadable += 1
        if self.unreadable <= TOLD_LINES:
            log.warning("%s, line %d is left out: %s: %.100s", file, number, type(error).__name__, error)


def by_time(paths: Iterable[Path]) -> list[Path]:
    """The files, and the logs of the directories, in the order of the first time that each tells.

    One that tells none stays behind the one before it. Where one can be read only once, as a pipe, all stay as given.
    """
    files = [file for path in paths for file in segments(path)]
    if len(files) < 2 or not all(file.is_file() for file in files):
        return files
    begins_s, last_s = {}, -inf
    for file in files:
        begins_s[file] = last_s = _begins_s(file, last_s)
    return sorted(files, key=begins_s.__getitem__)


def _begins_s(file: Path, otherwise_s: float) -> float:
    with suppress(*_BROKEN):
        for line in lines_of(file):
            with suppress(*UNREADABLE):
                if (t_s := _time_of(parsed(line))) is not None:
                    return t_s
    return otherwise_s


def _time_of(event: Event) -> float | None:
    """When a message came, or a tick or a start of the engine was."""
    if isinstance(event, Received):
        return event.arrival_s
    return event.now_s if isinstance(event, Tick | EngineStarted) else None


def segments_until(directory: Path, t_s: float) -> list[Path]:
    """Our own logs in a directory that were begun by a time, oldest first; none where there is no directory."""
    return [one for one in segments(directory) if begun_s(one) <= t_s] if directory.is_dir() else []


def ends_s(directory: Path) -> float:
    """When the newest thing was that our own logs in a directory tell of; 0 where there is none."""
    for segment in reversed(segments(directory) if directory.is_dir() else []):
        with segment.open("rb") as file:
            file.seek(max(segment.stat().st_size - TAIL_BYTES, 0))
            lines = file.read().splitlines()
        for line in reversed(lines):
            with suppress(*UNREADABLE):
                if (t_s := _time_of(parsed(line))) is not None:
                    return t_s
    return 0.0


def begun_s(segment: Path) -> float:
    """When a log of ours was begun, by its name; 0 where the name does not say."""
    digits = "".join(filter(str.isdigit, segment.name.split(".")[0]))
    return int(digits) / 1e6 if digits else 0.0


def segments(path: Path) -> list[Path]:
    """The file itself, or the logs of a directory by name, which is by time for our own."""
    if not path.is_dir():
        return [path]
    return sorted(one for one in path.iterdir() if ".jsonl" in one.suffixes and not one.is_dir())


def lines_of(file: Path) -> Iterator[bytes]:
    """The lines of one log as they stand. Raises `OSError`, and `EOFError` or `ZstdError` where it breaks off."""
    with file.open("rb") as stored:
        lines = unpacked(stored)
        while line := lines.readline(LONGEST_LINE):
            yield line


def unpacked(stored: "io.BufferedReader[Any]") -> IO[bytes]:
    """The bytes of a log that is stored plain or packed, by how it begins and whatever it is called."""
    first = stored.peek(4)
    if first.startswith(_GZIP):
        return io.BufferedReader(gzip.open(stored))
    if first.startswith(_ZSTD) or _SKIPPED.match(first):
        return io.BufferedReader(zstandard.open(stored, "rb"))
    return stored


class _Plain(msgspec.Struct, gc=False, forbid_unknown_fields=True):
    """A line with a message as it stands: ours of one that was accepted, or another's."""

    received: str
    message: msgspec.Raw
    connection: int = 0
    peer: str = ""
    vendor: str | None = None
    before: str = ""
    """In a black box, the hash of the line before."""


_PLAIN = msgspec.json.Decoder(_Plain)


def parsed(line: bytes) -> Event:
    """What one line says. Raises one of `UNREADABLE`."""
    if line.startswith(b'{"tick":"') and line.endswith(b'"}\n'):
        return Tick(_time(line[9:-3].decode()))
    try:
        plain = _PLAIN.decode(line)
    except (msgspec.DecodeError, UnicodeDecodeError):
        return _told(line.decode())
    return Received(
        bytes(plain.message), _time(plain.received), _connection(plain.connection, plain.peer, plain.vendor)
    )


def _told(line: str) -> Event:
    """What a line says that is not of the two kinds of which there are many."""
    told: dict[str, Any] = json.loads(line)
    if "tick" in told:
        return Tick(_time(told["tick"]), told.get("effort", 0), told.get("pending", 0))
    if "engine" in told:
        return EngineStarted(_time(told["at"]))
    if any(note in told for note in NOTES):
        return BlackBoxNote(told)
    if "closed" in told:
        return Closed(_connection_of(told))
    if "overtaken" in told:
        return Overtaken(_raw(line, told), _time(told["received"]), _connection_of(told))
    return Received(_raw(line, told), _time(told["received"]), _connection_of(told), told.get("rejected"))


@lru_cache(maxsize=20_000)
def _connection(number: int, peer: str, vendor: str | None) -> Connection:
    return Connection(number, peer, vendor=vendor)


def _connection_of(told: dict[str, Any]) -> Connection:
    number, vendor = told.get("connection"), told.get("vendor")
    return _connection(
        number if isinstance(number, int) else 0,
        str(told.get("peer", "")),
        vendor if isinstance(vendor, str) else None,
    )


def _raw(line: str, told: dict[str, Any]) -> bytes:
    """The message's own bytes. Written anew it could differ: in its numbers, in keys that it repeats."""
    if "base64" in told:
        return base64.b64decode(told["base64"], validate=True)
    if "raw" in told:
        return str(told["raw"]).encode()
    for key in _MESSAGE.finditer(line):
        value, end = _DECODER.raw_decode(line, key.end())
        if value == told["message"]:
            return line[key.end() : end].encode()
    return json.dumps(told["message"], ensure_ascii=False).encode()


def _time(text: str) -> float:
    stamp = timestamps.parse(text)
    if stamp is None:
        raise ValueError(f"{text!r} is no time")
    return stamp.t_s
