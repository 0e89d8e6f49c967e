"""A file that a write replaces as a whole, so that it is never half written, and one that is renamed as damaged."""

import fcntl
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from ingest.plain_files import SIDE_FILES, check_file

ASIDE = ".unreadable"
HELD_S, AGAIN_S = 2.0, 0.01
"""How long a name is waited for at most, and how often it is tried."""


def new_name(path: Path) -> Path:
    """Where a file is until it is whole."""
    return path.with_suffix(".new")


def replace_file(path: Path, data: bytes) -> None:
    """Replace the file. Raises `OSError`."""
    with replacing(path) as file:
        file.write(data)


@contextmanager
def replacing(path: Path, new: Path | None = None) -> Iterator[IO[bytes]]:
    """A new file, which is synchronised to disk before it gets the name; until then it is `new`. Raises `OSError`.

    Something else in the place of the file stays there (`UnfitFileError`). What was written before an error is removed.
    """
    check_file(path)
    new = new or new_name(path)
    with suppress(IsADirectoryError):
        new.unlink(missing_ok=True)  # left by a kill; a pipe or a link would take what is written
    check_file(new)
    try:
        with new.open("xb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        new.replace(path)
    except BaseException:
        with suppress(OSError):
            new.unlink()
        raise


def set_file_aside(path: Path) -> Path:
    """Rename an unreadable file, so that a person can look at it; returns its new path. Raises `OSError`."""
    return path.replace(path.with_name(path.name + ASIDE))


def set_database_aside(path: Path, aside: Path) -> None:
    """Rename a database and what SQLite has beside it, which a new one would take for its own. Raises `OSError`."""
    with names_held(path.parent):
        for suffix in (*SIDE_FILES, ""):
            if (part := path.with_name(path.name + suffix)).exists():
                part.replace(aside.with_name(aside.name + suffix))


@contextmanager
def names_held(directory: Path) -> Iterator[bool]:
    """Whether no other process or thread that holds its names renames a database there, or looks at one.

    Who opens a database while some of its files are renamed would begin new ones beside it, and SQLite removes such
    files by name. After `HELD_S` it goes on without. Raises `OSError` if there is no such directory.
    """
    descriptor = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        yield _is_locked(descriptor)
    finally:
        os.close(descriptor)


def _is_locked(descriptor: int) -> bool:
    ends_s = time.monotonic() + HELD_S
    while True:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() >= ends_s:
                return False
            time.sleep(AGAIN_S)
        except OSError:  # a file system without locks
            return False
        else:
            return True
