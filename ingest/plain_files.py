"""What is opened in a data directory, or is named to a command: regular files, read whole only up to a size.

A pipe would make a role wait without end, a device or a huge file would fill its memory. Links are followed.
"""

import codecs
import io
import os
import sqlite3
import stat
from pathlib import Path
from typing import IO

MOST_BYTES = 256 << 20
"""A file that is read whole is not larger."""
MOST_GIVEN_BYTES = 16 << 20
"""A site file, a plan or a result that a person names is not larger."""
SIDE_FILES = ("-wal", "-shm", "-journal")
"""What SQLite has beside a database."""
MARKED = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
"""Byte order marks, the longer of two with one beginning first."""
SAVE_AS = "save it as UTF-8"
OTHER_KINDS = {
    stat.S_IFDIR: "a directory",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


class UnfitFileError(OSError):
    """Something has the place of a file that can't be one. The message says what, and what to do."""


class UnfitDatabaseError(sqlite3.OperationalError):
    """As `UnfitFileError`, where errors of SQLite are expected."""


def unfit(path: Path, most_bytes: int | None = MOST_BYTES) -> str | None:
    """Why a file is not to be opened, and what to do; None if it may be, or is not there. Raises `OSError`."""
    try:
        return _unfit(path, path.stat(), most_bytes)
    except (FileNotFoundError, NotADirectoryError):
        return None


def unfit_database(path: Path) -> str | None:
    """As `unfit`, of a database and the files beside it."""
    parts = path, *(path.with_name(path.name + suffix) for suffix in SIDE_FILES)
    return next((reason for part in parts if (reason := unfit(part, None))), None)


def opened(path: Path, flags: int = os.O_RDONLY, most_bytes: int | None = MOST_BYTES) -> IO[bytes]:
    """Open a regular file with these flags of `os.open`. Never waits for another program.

    Raises `UnfitFileError` and other `OSError`.
    """
    if reason := unfit(path, most_bytes):
        raise UnfitFileError(reason)
    descriptor = os.open(path, flags | os.O_NONBLOCK | os.O_CLOEXEC, 0o666)
    if reason := _unfit(path, os.fstat(descriptor), most_bytes):
        os.close(descriptor)
        raise UnfitFileError(reason)
    return os.fdopen(descriptor, "rb" if flags == os.O_RDONLY else "r+b", buffering=0)


def read_file(path: Path, most_bytes: int = MOST_BYTES) -> bytes:
    """The content of a file. Raises `UnfitFileError` and other `OSError`."""
    with opened(path, most_bytes=most_bytes) as file:
        return file.read(most_bytes + 1) or b""


def decoded(raw: bytes) -> str:
    """Text in UTF-8, or as its byte order mark says, as editors of Windows write it. Raises `UnicodeDecodeError`, which
    says what to do."""
    encoding = next((name for mark, name in MARKED if raw.startswith(mark)), "utf-8")
    if encoding == "utf-8" and b"\0" in raw:
        raise UnicodeDecodeError(encoding, raw, raw.index(b"\0"), raw.index(b"\0") + 1, f"a zero; {SAVE_AS}")
    try:
        return raw.decode(encoding)
    except UnicodeDecodeError as error:
        error.reason += f"; {SAVE_AS}"
        raise


def opened_stream(path: Path) -> io.FileIO:
    """A file, or a pipe with a writer, to be read once in pieces. A pipe without a writer is empty, and not waited for.

    Raises `UnfitFileError` and other `OSError`.
    """
    if (reason := unfit(path, None)) and not path.is_fifo():
        raise UnfitFileError(reason)
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    os.set_blocking(descriptor, True)
    return io.FileIO(descriptor)


def check_file(path: Path) -> None:
    """Raises `UnfitFileError` if something else has the place of a file."""
    if reason := unfit(path):
        raise UnfitFileError(reason)


def check_database(path: Path) -> None:
    """To be called before SQLite opens it. Raises `UnfitDatabaseError`."""
    try:
        reason = unfit_database(path)
    except OSError as error:
        reason = str(error)
    if reason:
        raise UnfitDatabaseError(reason)


def check_folder(path: Path) -> None:
    """Raises `UnfitFileError` if the directory of a file is not there: the file may be there once its disk is."""
    if not path.parent.is_dir():
        raise UnfitFileError(f"{path.parent} is missing or no directory; mount or make it")


def with_advice(error: Exception, advice: str) -> str:
    """The words of an error with what to do, unless it says so itself."""
    return str(error) if isinstance(error, UnfitFileError | UnfitDatabaseError) else f"{error}; {advice}"


def _unfit(path: Path, status: os.stat_result, most_bytes: int | None) -> str | None:
    if not stat.S_ISREG(status.st_mode):
        found = OTHER_KINDS.get(stat.S_IFMT(status.st_mode), "something else")
        return f"{path} is {found} where a file is expected; move it away"
    if most_bytes is not None and status.st_size > most_bytes:
        return f"{path} has {status.st_size} bytes, and at most {most_bytes} are read; move it away"
    return None
