"""A number beyond every number of a revision, in a file beside the database: it survives damage to the database.

Its sign says whether numbers may have been given that the database does not hold: minus if so. A write of one byte
changes it, which needs no room on the disk.
"""

import logging
import os
import time
from contextlib import suppress
from pathlib import Path

from deconflict.operator.store.pending_writes import MOST_PENDING
from ingest.plain_files import UnfitFileError, opened, read_file
from ingest.recording.replaced_file import replace_file, set_file_aside

log = logging.getLogger(__name__)

FILE_NAME = "advisories.reserved"
HIGHEST = 1 << 60
"""SQLite counts no further than a few times this."""
BLOCK = 100_000
"""The file is written once for so many numbers. More than may wait for the disk."""
EPOCH_NUMBERS = 100_000
"""An epoch begins at the Unix time times this. No service gives so many a second, so a later epoch begins beyond it."""


def epoch(now_s: float) -> int:
    """A number beyond every number given before, if the clock was not set back. It has no more than 15 digits."""
    return int(now_s * EPOCH_NUMBERS)


class ReservedNumbers:
    """Numbers up to `last` may be in use. A database that begins anew continues beyond it."""

    def __init__(self, directory: Path) -> None:
        self._path = directory / FILE_NAME
        self.has_unstored = False
        """What the file says: numbers were given that the database may not hold."""
        known = self._read()
        self._reserved = known or 0
        """What the file says, as far as it was read or written."""
        self.lost_some = self.has_unstored
        """Whether an earlier service ended before the database had every number that it gave."""
        self.last = max(epoch(time.time()), known or 0) if known is None or self.lost_some else known

    def reserve(self, seq: int) -> None:
        """Reserve well beyond a number that is about to be stored. Raises `OSError` if a later start would read a
        lower number."""
        if seq + MOST_PENDING <= self._reserved:
            return
        last = seq + BLOCK
        try:
            replace_file(self._path, _text(last, has_unstored=self.has_unstored))
        except OSError:
            known = self._read()
            if known is not None and known < seq:
                raise
        else:
            self._reserved = self.last = last

    def note_unstored(self, *, has_unstored: bool) -> None:
        """Have a later start know whether numbers were given that the database may not hold. Raises `OSError`."""
        if has_unstored == self.has_unstored:
            return
        if self._is_signed():
            with opened(self._path, os.O_RDWR) as file:
                file.write(_sign(has_unstored=has_unstored))
                os.fsync(file.fileno())
        else:
            replace_file(self._path, _text(self._reserved, has_unstored=has_unstored))
        self.has_unstored = has_unstored

    def renew_if_removed(self) -> None:
        """Write the file again if somebody has removed it. Raises `OSError`."""
        if self._reserved and not self._path.exists():
            replace_file(self._path, _text(self._reserved, has_unstored=self.has_unstored))

    def _is_signed(self) -> bool:
        """Not if there is no file, or an older release wrote it."""
        with suppress(FileNotFoundError), opened(self._path) as file:
            return file.read(1) in (b"+", b"-")
        return False

    def _read(self) -> int | None:
        """0 if there is no file; None for one that can't be read, since any number may be reserved."""
        try:
            text = read_file(self._path).decode()
            last = abs(int(text))
            if not (0 <= last <= HIGHEST and text.endswith("\n")):
                raise ValueError(f"{last} is no number of a revision, or is cut off")
        except FileNotFoundError:
            return 0
        except ValueError as error:
            log.warning("%s can't be read: %s; it is kept as %s and written anew", self._path, error, self._set_aside())
            return None
        except UnfitFileError as error:
            log.warning("%s", error)
            return None
        except OSError as error:
            log.warning("%s can't be read and is written anew: %s", self._path, error)
            return None
        self.has_unstored = text.startswith("-")
        return last

    def _set_aside(self) -> str:
        """The name under which a file is kept that can't be read."""
        with suppress(OSError):
            return set_file_aside(self._path).name
        return self._path.name


def _text(last: int, *, has_unstored: bool) -> bytes:
    return _sign(has_unstored=has_unstored) + f"{last}\n".encode()


def _sign(*, has_unstored: bool) -> bytes:
    return b"-" if has_unstored else b"+"
