"""The directory of black boxes, and its register: what is in each, and the hash that its last line must have."""

import json
import logging
import os
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from deconflict.blackbox.chain import NOTHING

log = logging.getLogger(__name__)

FOLDER = "blackbox"
"""Beside the log and the advisories."""
REGISTER = "register.jsonl"
NAME = re.compile(r"blackbox-\d{8}T\d{9}Z\.jsonl\.zst")

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
        """Remove the oldest beyond so many or so much, and those that end before a time; their names."""
        size, gone = 0, []
        for number, box in enumerate(reversed(self.boxes()), 1):
            size += int(box["bytes"])
            if number > files or size > total_bytes or box["until"] < before:
                (self.directory / box["file"]).unlink(missing_ok=True)
                gone.append(str(box["file"]))
        if gone:
            self._write([one for one in self._registered() if one["file"] not in gone][-files:] or self._last())
        return gone

    def _last(self) -> list[Box]:
        """The newest entry is kept without its file: the chain goes on from it."""
        return self._registered()[-1:]

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
