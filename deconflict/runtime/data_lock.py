"""A data directory is one service's: two would write into each other's recordings and advisories."""

import fcntl
import logging
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

log = logging.getLogger(__name__)


class DataTakenError(OSError):
    """Another service keeps its data there."""

    def __init__(self, directory: Path) -> None:
        super().__init__(f"{directory} is another service's, which runs; set another store.directory, or --data")


@contextmanager
def held(directory: Path, parts: Iterable[str]) -> Iterator[None]:
    """Keep a directory for these parts of a service, until the end or this process's death. Raises `DataTakenError`."""
    with ExitStack() as locks:
        for part in parts:
            lock = locks.enter_context((directory / f".{part}.lock").open("w"))
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise DataTakenError(directory) from error
            except OSError as error:
                log.warning("%s can't be kept from other services: %s", directory, error)
        yield
