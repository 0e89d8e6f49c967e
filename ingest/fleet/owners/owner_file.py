"""The register of owners on disk, beside the message log, with the robots that are off the floor.

A write replaces it as a whole.
"""

import asyncio
import logging
from contextlib import suppress
from pathlib import Path

import msgspec

from ingest.fleet.owners.robot_owners import RobotOwners
from ingest.measures.measures import Measures
from ingest.plain_files import check_folder, read_file, with_advice
from ingest.recording.operator_events import OffFloorMark
from ingest.recording.replaced_file import ASIDE, replace_file, set_file_aside

FILE_NAME = "owners.json"
WRITE_EVERY_S = 5.0
FAILURES = "deconflict_owners_failures_total"
FORGOTTEN = "deconflict_owners_forgotten_total"

log = logging.getLogger(__name__)


class _Marks(msgspec.Struct):
    """The part of the file that is no owner. Earlier releases wrote none."""

    off_floor: list[OffFloorMark] = []


def kept_marks(log_directory: Path) -> list[OffFloorMark]:
    """The robots that are off the floor by the file beside a log. Empty if it can't be read."""
    with suppress(OSError, ValueError):
        return msgspec.json.decode(read_file(log_directory.parent / FILE_NAME), type=_Marks).off_floor
    return []


class OwnerFile:
    """Reads the register at the start and writes it when it has changed. A failure is logged and counted."""

    def __init__(self, directory: Path, owners: RobotOwners, measures: Measures) -> None:
        self._path, self._owners, self._measures = directory / FILE_NAME, owners, measures
        self._off_floor = owners.off_floor
        self._written = 0
        """The number of changes at the last write."""
        self._is_unread = False
        """Whether the file is there and could not be read. Then it is not replaced, since it may be sound."""
        for operation in ("read", "write"):
            measures.count(FAILURES, operation, by=0)
        self._enter(self._read())

    def _read(self) -> bytes | None:
        """The content of the file; None if there is none, or it can't be read for now."""
        try:
            check_folder(self._path)
            data = read_file(self._path)
        except FileNotFoundError:
            data = None
        except OSError as error:
            if not self._is_unread:
                self._fail("read", with_advice(error, "it is read later; check its owner and its disk"))
            self._is_unread = True
            return None
        self._is_unread = False
        return data

    def _enter(self, data: bytes | None) -> None:
        """Enter what the file has. It was entered first, so it counts more than what was entered since."""
        if data is None:
            return
        try:
            self._owners.register.read(data, self._owners.vendors)
            self._off_floor.read(msgspec.json.decode(data, type=_Marks).off_floor)
        except ValueError as error:
            self._fail("read", f"{error}; it is set aside as {FILE_NAME}{ASIDE}, and owners are entered anew")
            with suppress(OSError):
                set_file_aside(self._path)

    async def keep(self) -> None:
        """Write every change soon, until cancelled."""
        while True:
            await asyncio.sleep(WRITE_EVERY_S)
            self._count_forgotten()
            if self._is_unread:
                self._enter(await asyncio.to_thread(self._read))
            is_removed = self._written and not await asyncio.to_thread(self._path.exists)
            changes = self._changes
            if not self._is_unread and (is_removed or changes != self._written):
                await asyncio.to_thread(self._replace, self._content(), changes)

    def write(self) -> None:
        """Write what has changed."""
        if self._is_unread:
            self._enter(self._read())
        if not self._is_unread and (changes := self._changes) != self._written:
            self._replace(self._content(), changes)

    @property
    def _changes(self) -> int:
        return self._owners.register.changes + self._off_floor.changes

    def _content(self) -> bytes:
        document = self._owners.register.document(self._owners.vendors)
        return msgspec.json.encode(document | {"off_floor": list(self._off_floor.marks.values())})

    def _replace(self, data: bytes, changes: int) -> None:
        try:
            replace_file(self._path, data)
        except OSError as error:
            self._fail("write", with_advice(error, "free some space, or check the owner of the directory"))
        else:
            self._written = changes

    def _count_forgotten(self) -> None:
        forgotten, self._owners.register.forgotten = self._owners.register.forgotten, {}
        for vendor, count in forgotten.items():
            self._measures.count(FORGOTTEN, vendor, by=count)

    def _fail(self, operation: str, message: str) -> None:
        self._measures.count(FAILURES, operation)
        log.warning("the owners of robots can't be kept: %s", message)
