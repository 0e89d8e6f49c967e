"""The directory of black boxes, and its register: what is in each, and the hash that its last line must have."""

import json
import logging
import os
import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from deconflict.operator.blackbox.hash_chain import NOTHING

log = logging.getLogger(__name__)

FOLDER = "blackbox"
"""Beside the log and the advisories."""
REGISTER = "register.jsonl"
NAME = re.compile(r"blackbox-\d{8}T\d{9}Z\.jsonl\.zst")

Pair = tuple[str, ...]
"""The vendors of two robots, sorted."""
Box = dict[str, Any]
"""One line of the register: `file`, `bytes`, `sha256` of the last line, `from`, `until`, `near_misses`."""


class Shelf:
    """One directory; whoever adds to it is alone."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory

    def boxes(self) -> list[Box]:
        """Those there are, the newest last."""
        return [one for one in self._registered() if (self.directory / one["file"]).exists()]

    def head(self) -> str:
        """What the next box's first line must carry."""
        registered = self._registered()
        return str(registered[-1]["sha256"]) if registered else NOTHING

    def link(self, file: str) -> tuple[str | None, str | None]:
        """The hashes that a box's first line must carry and its last must have, each None where nobody knows."""
        before = None
        for one in self._registered():
            if one["file"] == file:
                return before, str(one["sha256"])
            before = str(one["sha256"])
        return None, None

    def path(self, file: str) -> Path | None:
        """Where a box is; None where there is no such."""
        path = self.directory / file
        return path if NAME.fullmatch(file) and path.is_file() else None

    def add(self, box: Box) -> None:
        self._write([*self._registered(), box])

    def prune(self, *, files: int, total_bytes: int, before: str) -> list[str]:
        """Remove those that end before a time, and what is beyond so many or so much; their names.

        Of those beyond, the oldest goes of the pair of vendors that holds the most, so that none pushes out others'.
        """
        boxes = self.boxes()
        kept = [box for box in boxes if box["until"] >= before]
        while len(kept) > files:
            kept.remove(_least_missed(kept, lambda _: 1))
        while sum(map(_bytes, kept)) > total_bytes:
            kept.remove(_least_missed(kept, _bytes))
        gone = [str(box["file"]) for box in boxes if box not in kept]
        for file in gone:
            (self.directory / file).unlink(missing_ok=True)
        if gone:
            self._write(self._linked({str(box["file"]) for box in kept}))
        return gone

    def _linked(self, files: set[str]) -> list[Box]:
        """What the register tells of files, and of what the chain needs: whatever is before each, and the newest."""
        registered = self._registered()
        after = [*(one["file"] for one in registered[1:]), None]
        return [one for one, then in zip(registered, after, strict=True) if {one["file"], then} & files or then is None]

    def _registered(self) -> list[Box]:
        path = self.directory / REGISTER
        if not path.exists():
            return []
        found = []
        for line in path.read_text(encoding="utf-8").splitlines():
            try:
                box = json.loads(line)
                found.append({"file": str(box["file"]), "bytes": int(box["bytes"]), "sha256": str(box["sha256"])} | box)
            except (ValueError, KeyError, TypeError) as error:
                log.warning("a line of %s is left out: %s", path, error)
        return found

    def _write(self, boxes: Iterable[Box]) -> None:
        """In one step, so that a crash leaves the old register or the new one."""
        new = self.directory / (REGISTER + ".new")
        with new.open("w", encoding="utf-8") as file:
            file.writelines(json.dumps(box) + "\n" for box in boxes)
            file.flush()
            os.fsync(file.fileno())
        new.replace(self.directory / REGISTER)


def _bytes(box: Box) -> int:
    return int(box["bytes"])


def _least_missed(boxes: Sequence[Box], size: Callable[[Box], int]) -> Box:
    """The oldest of the pair of vendors that holds the most; a box of several is of the one that holds the least."""
    held, owned = Counter[Pair](), Counter[Pair]()
    for box in boxes:
        for pair in _pairs(box):
            held[pair] += size(box)
    owners = [min(_pairs(box), key=lambda pair: (held[pair], pair)) for box in boxes]
    for box, owner in zip(boxes, owners, strict=True):
        owned[owner] += size(box)
    most = max(owned.values())
    return next(box for box, owner in zip(boxes, owners, strict=True) if owned[owner] == most)


def _pairs(box: Box) -> set[Pair]:
    return {tuple(sorted(map(str, one["vendors"]))) for one in box["near_misses"]} or {()}
