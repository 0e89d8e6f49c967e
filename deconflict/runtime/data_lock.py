"""The data directory: who may read it, and a lock, since two services would write into each other's recordings."""

import fcntl
import logging
import os
import stat
import threading
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from ingest.plain_files import opened

OTHERS = 0o027
"""Rights that nobody gets: writing for the group, and all for others."""
ELSEWHERE = "set another store.directory, or --data"
LOCKS = ".*.lock"
"""Matches the names of the files that are locked."""

MADE_HERE = (
    "advisories*",
    "losses*",
    "owners*",
    "learned*",
    "robots*",
    "clock*",
    ".*.lock",
    "log",
    "log/*",
    "blackbox",
    "blackbox/*",
)
"""What a service makes there. Other files, and a directory that others may use, are left alone."""

log = logging.getLogger(__name__)


LATE_S = 10.0


class DataDirectoryError(OSError):
    """A data directory that can't be used. The message says what to change."""


def create_data_directory(directory: Path) -> None:
    """Create it if needed. What this process and its children write from now on is for its user and group only.

    Raises `DataDirectoryError` if a file has its place. A disk that is missing, full or read-only is logged only, also
    one behind a link: the service warns without it, and uses it once it can.
    """
    os.umask(os.umask(OTHERS) | OTHERS)
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        leads_nowhere = directory.is_symlink() and not directory.exists()
        if isinstance(error, FileExistsError | NotADirectoryError) and not leads_nowhere:
            problem = f"{directory} can't be made a data directory: {error.strerror}; {ELSEWHERE}"
            raise DataDirectoryError(problem) from error
        log.error(
            "%s can't be made: %s; nothing is kept until it can; mend its disk, or %s", directory, error, ELSEWHERE
        )
        return
    if not os.access(directory, os.W_OK | os.X_OK):
        log.error("%s can't be written to; nothing is kept until it can; mend its disk, or %s", directory, ELSEWHERE)
    _restrict(directory)


def _restrict(directory: Path) -> None:
    """Take the rights from what an earlier release has written, too. Links are not followed."""
    for path in (found for pattern in MADE_HERE for found in directory.glob(pattern)):
        with suppress(OSError):
            mode = path.lstat().st_mode
            if (stat.S_ISREG(mode) or stat.S_ISDIR(mode)) and mode & OTHERS:
                path.chmod(stat.S_IMODE(mode) & ~OTHERS)


def said_if_late(directory: Path) -> threading.Timer:
    """Say that a start waits for the disk of a directory if it does so for long. To be cancelled once it goes on."""
    text = "the disk of %s has not answered for %g s; the service starts once it does; check it, or %s"
    late = threading.Timer(LATE_S, log.error, (text, directory, LATE_S, ELSEWHERE))
    late.daemon = True
    late.start()
    return late


@contextmanager
def locked(directory: Path, parts: Iterable[str]) -> Iterator[None]:
    """Lock a directory for these parts of a service. The kernel frees the locks if this process dies.

    Raises `DataDirectoryError`.
    """
    with ExitStack() as locks:
        for part in parts:
            try:
                lock = locks.enter_context(opened(directory / f".{part}.lock", os.O_RDWR | os.O_CREAT))
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise DataDirectoryError(f"{directory} is in use by another service; {ELSEWHERE}") from error
            except OSError as error:
                log.warning("%s can't be locked against other services: %s", directory, error)
        yield
