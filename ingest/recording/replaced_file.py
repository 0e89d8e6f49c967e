"""A file that a write replaces as a whole, so that it is never half written."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from ingest.plain_files import check_file

ASIDE = ".unreadable"


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
