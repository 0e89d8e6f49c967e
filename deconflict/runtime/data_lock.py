"""File locks on a data directory: two services there would write into each other's recordings and advisories."""

import fcntl
import logging
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

log = logging.getLogger(__name__)


class DataTakenError(OSError):
    """Another running service uses the data directory."""

    def __init__(self, directory: Path) -> None:
        super().__init__(f"{directory} is in use by another service; set another store.directory, or --data")


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
