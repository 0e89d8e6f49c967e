"""Why a file of the data directory can't be used, found by looking: people hear of it before it is needed."""

import os
import sqlite3
from contextlib import closing
from enum import Enum
from pathlib import Path
from stat import S_IFMT

from ingest.plain_files import OTHER_KINDS, unfit, unfit_database
from ingest.recording.replaced_file import names_held, new_name

LEAST_FREE_BYTES = 1 << 16
"""A disk with less is full."""
LINES = ".jsonl"
"""A directory with this suffix has the place of a file; others are nobody's."""
LOCKED_S = 1.0
"""A database that another program keeps locked for longer is reported."""


class FileKind(Enum):
    FILE, DATABASE, FOLDER, RARE_FILE = range(4)
    """A rare file is there only at times: what it is counts, not whether it can be made."""


def file_fault(path: Path, kind: FileKind) -> str | None:
    """Why a file can't be written, and what to do; None if it can, or can be made. May wait for the disk."""
    try:
        fault = _unfit(path, kind) or (None if kind is FileKind.RARE_FILE else _place_fault(path, kind))
        return fault or (_lock_fault(path) if kind is FileKind.DATABASE and path.exists() else None)
    except OSError as error:
        return f"{path}: {error.strerror}; check its owner and its disk"


def _unfit(path: Path, kind: FileKind) -> str | None:
    """What is no file, of a file with what is written beside it, or in a folder. Raises `OSError`."""
    if kind is FileKind.DATABASE:
        return unfit_database(path)
    if kind is not FileKind.FOLDER:
        return unfit(path) or (unfit(beside, None) if (beside := new_name(path)).is_dir() else None)
    entries = path.iterdir() if path.is_dir() else ()
    wanted = (entry for entry in entries if not entry.is_dir() or LINES in entry.suffixes)
    return next((reason for entry in wanted if (reason := unfit(entry, None))), None)


def _place_fault(path: Path, kind: FileKind) -> str | None:
    """Raises `OSError`."""
    if not path.parent.is_dir():
        return f"{path.parent} is missing or no directory; mount or make it"
    if not path.exists():
        if not os.access(path.parent, os.W_OK | os.X_OK):
            return f"{path} can't be made; {_why_not(path.parent)}"
    elif kind is FileKind.FOLDER and not path.is_dir():
        found = OTHER_KINDS.get(S_IFMT(path.stat().st_mode), "a file")
        return f"{path} is {found} where a directory is expected; move it away"
    elif not os.access(path, os.W_OK):
        return f"{path} can't be written; {_why_not(path)}"
    status = os.statvfs(path if path.exists() else path.parent)
    is_full = status.f_bavail * status.f_frsize < LEAST_FREE_BYTES
    return f"the disk of {path} is full; free some space" if is_full else None


def _why_not(path: Path) -> str:
    is_read_only = os.statvfs(path).f_flag & os.ST_RDONLY
    return "its disk is read-only; mend it, or mount it for writing" if is_read_only else "check its owner"


def _lock_fault(path: Path) -> str | None:
    uri = f"{path.absolute().as_uri()}?mode=rw"
    try:
        with names_held(path.parent):
            db = sqlite3.connect(uri, uri=True, timeout=LOCKED_S, isolation_level=None)
            with closing(db):
                db.execute("BEGIN IMMEDIATE")
                db.execute("ROLLBACK")
    except (sqlite3.Error, OSError) as error:
        name = getattr(error, "sqlite_errorname", "")
        if name.startswith(("SQLITE_BUSY", "SQLITE_LOCKED")):
            return f"{path} is locked by another program; stop that program"
        return f"{path}: {error}; check the file and its disk"
    return None
