"""The directory of black boxes and its register: the contents of each box, and the hash of its last line."""

import json
import logging
import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import msgspec

from deconflict.operator.blackbox.hash_chain import FIRST_HASH
from ingest.plain_files import read_file
from ingest.recording.clock_notes import old_ones
from ingest.recording.replaced_file import replace_file, set_file_aside

log = logging.getLogger(__name__)

FOLDER = "blackbox"
"""Beside the log and the advisory database."""
REGISTER = "register.jsonl"
NAME = re.compile(r"blackbox-\d{8}T\d{9}Z\.jsonl\.zst")

LOGGED_LINES = 3
"""Of one reading."""


class _NearMiss(msgspec.Struct):
    vendors: list[str] = []


class _Line(msgspec.Struct):
    """What is needed of a line of the register."""

    file: str
    bytes: int
    sha256: str
    until: str
    near_misses: list[_NearMiss]


_LINE = msgspec.json.Decoder(_Line)

VendorPair = tuple[str, ...]
"""The vendors of two robots, sorted."""
Box = dict[str, Any]
"""One line of the register: `file`, `bytes`, `sha256` of the last line, `from`, `until`, `near_misses`."""


class Archive:
    """One directory. Only one process may add to it."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory

    def boxes(self) -> list[Box]:
        """The boxes whose file exists, newest last."""
        return [box for box in self._registered() if (self.directory / box["file"]).exists()]

    def head(self) -> str:
        """The hash for the first line of the next box."""
        registered = self._registered()
        return str(registered[-1]["sha256"]) if registered else FIRST_HASH

    def link(self, file: str) -> tuple[str | None, str | None]:
        """The hash in a box's first line, and the hash of its last line; None for each that is not registered."""
        before = None
        for box in self._registered():
            if box["file"] == file:
                return before, str(box["sha256"])
            before = str(box["sha256"])
        return None, None

    def path(self, file: str) -> Path | None:
        """The path of a box; None if there is no such box."""
        path = self.directory / file
        return path if NAME.fullmatch(file) and path.is_file() else None

    def add(self, box: Box) -> None:
        self._write([*self._registered(), box])

    def prune(self, *, files: int, total_bytes: int, before: str, latest: str) -> list[str]:
        """Remove boxes that are old (`old_ones`), and those beyond the limits of count and size. Returns their names.

        Beyond a limit, the oldest box of the pair of vendors with the most boxes goes first, so that no pair of vendors
        can push out the boxes of others.
        """
        boxes = self.boxes()
        kept = boxes[old_ones([box["until"] for box in boxes], before, latest) :]
        while len(kept) > files:
            kept.remove(_oldest_of_largest_pair(kept, lambda _: 1))
        while sum(map(_bytes, kept)) > total_bytes:
            kept.remove(_oldest_of_largest_pair(kept, _bytes))
        gone = [str(box["file"]) for box in boxes if box not in kept]
        for file in gone:
            (self.directory / file).unlink(missing_ok=True)
        if gone:
            self._write(self._linked({str(box["file"]) for box in kept}))
        return gone

    def _linked(self, files: set[str]) -> list[Box]:
        """The register's lines to keep: those of these files and, for the chain, the one before each and the newest."""
        registered = self._registered()
        next_files = [*(box["file"] for box in registered[1:]), None]
        return [
            box
            for box, next_file in zip(registered, next_files, strict=True)
            if {box["file"], next_file} & files or next_file is None
        ]

    def _registered(self) -> list[Box]:
        return self._read()[0]

    def _read(self) -> tuple[list[Box], list[str]]:
        """The boxes of the register, and why other lines of it are left out."""
        path = self.directory / REGISTER
        boxes: list[Box] = []
        problems: list[str] = []
        for line in read_file(path).splitlines() if path.exists() else ():
            try:
                _LINE.decode(line)
                boxes.append(json.loads(line))
            except (msgspec.MsgspecError, ValueError, RecursionError) as error:
                problems.append(str(error).replace("\n", " ")[:200])
        for problem in problems[:LOGGED_LINES]:
            log.warning("a line of %s is left out: %s", path, problem)
        return boxes, problems

    def _write(self, boxes: Iterable[Box]) -> None:
        """Replaces the register in one step, so that a crash leaves the old one or the new one.

        One with lines that can't be read is kept beside it.
        """
        if self._read()[1]:
            set_file_aside(self.directory / REGISTER)
        replace_file(self.directory / REGISTER, "".join(json.dumps(box) + "\n" for box in boxes).encode())


def _bytes(box: Box) -> int:
    return int(box["bytes"])


def _oldest_of_largest_pair(boxes: Sequence[Box], size: Callable[[Box], int]) -> Box:
    """The oldest box of the pair of vendors with the largest total size.

    A box with near misses of several pairs counts for the pair with the smallest total.
    """
    totals, owned = Counter[VendorPair](), Counter[VendorPair]()
    for box in boxes:
        for pair in _vendor_pairs(box):
            totals[pair] += size(box)
    owners = [min(_vendor_pairs(box), key=lambda pair: (totals[pair], pair)) for box in boxes]
    for box, owner in zip(boxes, owners, strict=True):
        owned[owner] += size(box)
    most = max(owned.values())
    return next(box for box, owner in zip(boxes, owners, strict=True) if owned[owner] == most)


def _vendor_pairs(box: Box) -> set[VendorPair]:
    return {tuple(sorted(map(str, near_miss.get("vendors", ())))) for near_miss in box["near_misses"]} or {()}
