"""A number beyond every number of a revision, in a file beside the database: it survives damage to the database."""

import logging
from contextlib import suppress
from pathlib import Path

from deconflict.operator.store.pending_writes import MOST_PENDING
from ingest.recording.replaced_file import replace_file, set_file_aside

log = logging.getLogger(__name__)

FILE_NAME = "advisories.reserved"
HIGHEST = 1 << 60
"""SQLite counts no further than a few times this."""
BLOCK = 100_000
"""The file is written once for so many numbers. More than may wait for the disk."""


class ReservedNumbers:
    """Numbers up to `last` may be in use. A database that begins anew continues beyond it."""

    def __init__(self, directory: Path) -> None:
        self._path = directory / FILE_NAME
        self.last = self._read()

    def reserve(self, seq: int) -> None:
        """Reserve well beyond a number that is about to be stored. Raises `OSError`."""
        if seq + MOST_PENDING <= self.last:
            return
        last = seq + BLOCK
        replace_file(self._path, f"{last}\n".encode())
        self.last = last

    def _read(self) -> int:
        try:
            last = int(self._path.read_text())
            if not 0 <= last <= HIGHEST:
                raise ValueError(f"{last} is no number of a revision")
        except FileNotFoundError:
            return 0
        except ValueError as error:
            log.warning("%s can't be read: %s; it is kept as %s and written anew", self._path, error, self._set_aside())
            return 0
        except OSError as error:
            log.warning("%s can't be read and is written anew: %s", self._path, error)
            return 0
        return last

    def _set_aside(self) -> str:
        """The name under which a file is kept that can't be read."""
        with suppress(OSError):
            return set_file_aside(self._path).name
        return self._path.name
