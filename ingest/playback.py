"""Read a log back, ours or any of lines `{"received": ..., "message": {...}}`: plain, gzip or zstd, or a directory."""

import base64
import gzip
import io
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, cast

import zstandard

from ingest import stamps
from ingest.connection import Connection
from ingest.recording import PATTERN

_MESSAGE = b'"message":'


@dataclass(frozen=True, slots=True)
class Received:
    """A message as it came."""

    raw: bytes
    arrival_s: float
    connection: Connection
    refused: str | None = None
    """The rule by which the receiver refused it before it was read."""


@dataclass(frozen=True, slots=True)
class Closed:
    connection: Connection


@dataclass(frozen=True, slots=True)
class Tick:
    now_s: float


@dataclass(frozen=True, slots=True)
class EngineStarted:
    now_s: float


Event = Received | Closed | Tick | EngineStarted


class Reader:
    """Reads logs in order, a line at a time. Lines that can't be read are counted and left out."""

    def __init__(self) -> None:
        self.unreadable = 0
        """Torn or foreign lines met so far."""

    def read(self, paths: Iterable[Path]) -> Iterator[Event]:
        """Every event of the files, and of the logs in the directories, in the order given."""
        for path in paths:
            for file in segments(path):
                with _opened(file) as lines:
                    for line in lines:
                        if line.strip():
                            yield from self._event(line)

    def _event(self, line: bytes) -> Iterator[Event]:
        try:
            yield _parsed(line)
        except (ValueError, KeyError, TypeError):
            self.unreadable += 1


def segments(path: Path) -> list[Path]:
    """The file itself, or the logs of a directory by name, which is by time for our own."""
    if not path.is_dir():
        return [path]
    own = sorted(path.glob(PATTERN))
    return own or sorted(one for one in path.iterdir() if ".jsonl" in one.suffixes)


def _opened(path: Path) -> BinaryIO:
    if path.suffix == ".gz":
        return cast(BinaryIO, gzip.open(path))
    if path.suffix == ".zst":
        return cast(BinaryIO, io.BufferedReader(zstandard.open(path, "rb")))
    return path.open("rb")


def _parsed(line: bytes) -> Event:
    if line.startswith(b'{"tick":"') and line.endswith(b'"}\n'):
        return Tick(_time(line[9:-3].decode()))
    if not line.endswith(b"\n"):
        json.loads(line)  # a last line without its end may be torn, and a torn one is no JSON
    at = line.find(_MESSAGE)
    if line.startswith(b'{"received":"') and at > 0 and line.rstrip().endswith(b"}"):
        head = json.loads(line[:at].rstrip().rstrip(b",") + b"}")
        return _received(head, line[at + len(_MESSAGE) :].strip()[:-1])
    told = json.loads(line)
    if "tick" in told:
        return Tick(_time(told["tick"]))
    if "engine" in told:
        return EngineStarted(_time(told["at"]))
    if "closed" in told:
        return Closed(Connection(told["connection"]))
    return _received(told, _bytes_of(told))


def _received(head: dict[str, object], raw: bytes) -> Received:
    connection = Connection(
        cast(int, head.get("connection", 0)),
        str(head.get("peer", "")),
        vendor=cast(str | None, head.get("vendor")),
    )
    return Received(raw, _time(str(head["received"])), connection, cast(str | None, head.get("rejected")))


def _bytes_of(told: dict[str, object]) -> bytes:
    if "base64" in told:
        return base64.b64decode(str(told["base64"]))
    if "raw" in told:
        return str(told["raw"]).encode()
    return json.dumps(told["message"], ensure_ascii=False).encode()


def _time(text: str) -> float:
    stamp = stamps.parse(text)
    if stamp is None:
        raise ValueError(text)
    return stamp.t_s
