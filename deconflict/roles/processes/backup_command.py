"""The command `backup`: copies a data directory while its service runs. The copy is the data directory of a start."""

import argparse
import fcntl
import os
import shutil
import sqlite3
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from deconflict.operator.blackbox.archive import FOLDER as BOXES
from deconflict.operator.ledger import loss_ledger
from deconflict.operator.store import learned_file, sqlite_connections
from deconflict.operator.store.recovery import reserved_numbers
from deconflict.operator.store.tables import last_seq, read_only
from deconflict.runtime.command_parsers import Commands, add_command
from deconflict.runtime.data_lock import LOCKS, DataDirectoryError, create_data_directory
from deconflict_client.counted_nouns import count_of
from ingest.fleet.owners import owner_file
from ingest.fleet.recovery import kept_rows
from ingest.languages.visible_text import visible
from ingest.plain_files import SIDE_FILES, check_database, opened, unfit, with_advice
from ingest.recording import clock_notes
from ingest.recording.log_segments import packed_name, segments
from ingest.recording.replaced_file import ASIDE

DATABASES = (sqlite_connections.FILE_NAME, loss_ledger.FILE_NAME, kept_rows.FILE_NAME)
WHOLE = (owner_file.FILE_NAME, learned_file.FILE_NAME, clock_notes.FILE_NAME)
"""Files that the service replaces as a whole."""
LOG = "log"
SET_ASIDE = ("advisories-*.db", "losses-*.db", f"*{ASIDE}")
"""Files that the service renamed, since they were damaged. Nobody writes to them, so they are copied as they are."""
ADVICE = "a start of the service sets a damaged one aside"
LOCK = ".backup.lock"
"""In a copy until it is complete."""
NEVER_COPIED = (LOCKS, "*.new", "*.unfinished")


def add_backup(commands: Commands) -> None:
    """Add the command to the command line."""
    command = add_command(
        commands,
        "backup",
        "copy a data directory while its service runs; a service that starts with the copy goes on from there",
        "deconflict backup /var/lib/deconflict /backup/monday",
        "deconflict serve SITE.toml --data /backup/monday      # to start with the copy",
    )
    command.add_argument("data", type=Path, metavar="DATA", help="the data directory")
    command.add_argument("target", type=Path, metavar="TARGET", help="the copy, a directory that is not there yet")
    command.set_defaults(run=_backup)


def _backup(args: argparse.Namespace) -> int:
    copied = backed_up(args.data, args.target)
    sys.stdout.write(f"{args.target}: {count_of(copied, 'file')}\n")
    sys.stdout.writelines(f"not copied: {visible(name)}\n" for name in left_out(args.data, args.target))
    return 0


def backed_up(data: Path, target: Path) -> int:
    """Copy a data directory. Returns the number of files. Raises `DataDirectoryError`; then there is no `target`."""
    if not any((data / name).exists() for name in (*DATABASES, LOG)):
        raise DataDirectoryError(f"{data} is no data directory of a service that has run; give that of serve --data")
    if os.path.lexists(target):
        raise DataDirectoryError(f"{target} is there already; name a directory that is not")
    if target.resolve().is_relative_to(data.resolve()):
        raise DataDirectoryError(f"{target} is in {data}; name a directory outside it")
    unfinished = target.with_name(target.name + ".unfinished")
    try:
        with _made_alone(unfinished):
            copied = sum(_copies(data, unfinished))
            (unfinished / LOCK).unlink(missing_ok=True)
            unfinished.rename(target)
    except (OSError, sqlite3.Error) as error:
        raise DataDirectoryError(f"{data} can't be copied to {target}: {error}") from error
    return copied


@contextmanager
def _made_alone(unfinished: Path) -> Iterator[None]:
    """A new directory, in the place of one that a kill has left, which no other backup writes to. An error removes it.

    Raises `OSError`.
    """
    if unfinished.is_dir():
        with _alone(unfinished):
            shutil.rmtree(unfinished)
    create_data_directory(unfinished)
    with _alone(unfinished):
        try:
            yield
        except BaseException:
            shutil.rmtree(unfinished, ignore_errors=True)
            raise


@contextmanager
def _alone(unfinished: Path) -> Iterator[None]:
    """Raises `OSError` if another backup writes to the directory."""
    with opened(unfinished / LOCK, os.O_RDWR | os.O_CREAT) as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise DataDirectoryError("another backup is writing it; wait for that one") from error
        yield


def left_out(data: Path, target: Path) -> list[str]:
    """What the directory has that is none of the service's files, or could not be copied as one."""
    kept = (*NEVER_COPIED, *(name + suffix for name in (*DATABASES, *SET_ASIDE) for suffix in SIDE_FILES))
    return sorted(
        path.name
        for path in data.iterdir()
        if not (target / path.name).exists() and not any(path.match(pattern) for pattern in kept)
    )


def _copies(data: Path, target: Path) -> Iterator[bool]:
    """Copies one file after another. The log comes first: the database is not older than what it decided."""
    for folder, files in ((LOG, segments(data / LOG)), (BOXES, sorted(_files(data / BOXES)))):
        (target / folder).mkdir()
        for file in files:
            yield _copy(file, target / folder) or _copy(packed_name(file), target / folder)
    for name in WHOLE:
        yield _copy(data / name, target)
    for file in (found for pattern in SET_ASIDE for found in sorted(data.glob(pattern))):
        yield _copy(file, target)
        for suffix in SIDE_FILES:
            yield _copy(file.with_name(file.name + suffix), target)
    for name in DATABASES:
        yield _copy_database(data / name, target / name)
    _have_start_begin_an_epoch(data, target)


def _files(folder: Path) -> Iterator[Path]:
    return (file for file in folder.iterdir() if file.is_file()) if folder.is_dir() else iter(())


def _copy(file: Path, folder: Path) -> bool:
    """Copy a file, if it is there still and is one."""
    try:
        if unfit(file, None):
            return False
        with opened(file, most_bytes=None) as source, (folder / file.name).open("xb") as copy:
            shutil.copyfileobj(source, copy, 1 << 20)
            copy.flush()
            os.fsync(copy.fileno())
    except FileNotFoundError:
        return False
    return True


def _copy_database(path: Path, copy: Path) -> bool:
    """A copy of one moment, whatever is written meanwhile. Writers do not wait."""
    if not path.exists():
        return False
    try:
        check_database(path)
        with read_only(path) as source, closing(sqlite3.connect(copy)) as target:
            source.backup(target)
    except sqlite3.Error as error:
        raise sqlite3.OperationalError(f"{path}: {with_advice(error, ADVICE)}") from error
    return True


def _have_start_begin_an_epoch(data: Path, target: Path) -> None:
    """The running service gives further numbers, which the copy does not hold: none of them may be given again."""
    database = target / sqlite_connections.FILE_NAME
    last = 0
    if database.exists():
        with read_only(database) as db:
            last = last_seq(db)
    _copy(data / reserved_numbers.FILE_NAME, target)
    numbers = reserved_numbers.ReservedNumbers(target)
    numbers.reserve(last)
    numbers.note_unstored(has_unstored=True)
