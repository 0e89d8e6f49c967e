"""The data directory: who may read it, and a lock, since two services would write into each other's recordings."""

import fcntl
import logging
import os
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

OTHERS = 0o027
"""Rights that nobody gets: writing for the group, and all for others."""

log = logging.getLogger(__name__)


class DataTakenError(OSError):
    """Another running service uses the data directory."""

    def __init__(self, directory: Path) -> None:
        super().__init__(f"{directory} is in use by another service; set another store.directory, or --data")


def create_data_directory(directory: Path) -> None:
    """Create it if needed. What this process and its children write from now on is for its user and group only."""
    os.umask(os.umask(OTHERS) | OTHERS)
    directory.mkdir(parents=True, exist_ok=True)


@contextmanager
def locked(directory: Path, parts: Iterable[str]) -> Iterator[None]:
    """Lock a directory for these parts of a service. The kernel frees the locks if this process dies.

    Raises `DataTakenError`.
    """
    with ExitStack() as locks:
        for part in parts:
            lock = locks.enter_context((directory / f".{part}.lock").open("w"))
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise DataTakenError(directory) from error
            except OSError as error:
                log.warning("%s can't be locked against other services: %s", directory, error)
        yield
