"""Faults of files, real ones: each holds until the end of its block. Disks are mounted, which needs root."""

import os
import shutil
import socket
import sqlite3
import subprocess
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, closing, contextmanager, suppress
from pathlib import Path

Fault = Callable[[Path], AbstractContextManager[None]]
SIDE_FILES = ("-wal", "-shm", "-journal")
HUGE_BYTES = 100 << 30


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Another program writes to a database, without end."""
    with closing(sqlite3.connect(path, timeout=10.0, isolation_level=None)) as db:
        db.execute("BEGIN EXCLUSIVE")
        yield
        db.execute("ROLLBACK")


@contextmanager
def held_alone(path: Path) -> Iterator[None]:
    """Another program keeps a database for itself: nobody else can even read it. Only before the service has it."""
    with closing(sqlite3.connect(path, timeout=10.0, isolation_level=None)) as db:
        db.execute("PRAGMA locking_mode = EXCLUSIVE")
        db.execute("BEGIN EXCLUSIVE")
        db.execute("CREATE TABLE IF NOT EXISTS held (number INTEGER)")
        yield
        db.execute("ROLLBACK")


@contextmanager
def missing(path: Path) -> Iterator[None]:
    """Somebody has removed it. What comes in its place stays."""
    remove(path)
    yield


@contextmanager
def blocked(path: Path) -> Iterator[None]:
    """A directory has the place of a file, or a file that of a directory."""
    with _replaced(path, Path.touch if path.is_dir() else Path.mkdir):
        yield


@contextmanager
def pipe(path: Path) -> Iterator[None]:
    with _replaced(path, os.mkfifo):
        yield


@contextmanager
def device(path: Path) -> Iterator[None]:
    """A link to a device that has no end."""
    with _replaced(path, lambda place: place.symlink_to("/dev/zero")):
        yield


@contextmanager
def socket_file(path: Path) -> Iterator[None]:
    """A socket that a program has left behind."""

    def make(place: Path) -> None:
        folder = os.open(place.parent, os.O_RDONLY | os.O_DIRECTORY)
        try:  # the address of a socket is at most 107 bytes long
            with socket.socket(socket.AF_UNIX) as left:
                left.bind(f"/proc/self/fd/{folder}/{place.name}")
        finally:
            os.close(folder)

    with _replaced(path, make):
        yield


@contextmanager
def huge(path: Path) -> Iterator[None]:
    """A file that is larger than any memory, and takes no room on the disk."""

    def make(place: Path) -> None:
        place.touch()
        os.truncate(place, HUGE_BYTES)

    with _replaced(path, make):
        yield


@contextmanager
def _replaced(path: Path, make: Callable[[Path], object]) -> Iterator[None]:
    """What was there before comes back, unless the service has made another."""
    aside = path.with_name(f"{path.name}.aside")
    with suppress(FileNotFoundError):
        path.rename(aside)
    make(path)
    made = path.lstat().st_ino
    yield
    if os.path.lexists(path) and path.lstat().st_ino == made:
        path.rmdir() if path.is_dir() else path.unlink()
    if aside.exists() and not path.exists():
        aside.rename(path)


@contextmanager
def read_only(path: Path) -> Iterator[None]:
    _mount("--bind", path, path)
    try:
        subprocess.run(["mount", "-o", "remount,ro,bind", str(path)], check=True)
        yield
    finally:
        subprocess.run(["umount", "-l", str(path)], check=True)


@contextmanager
def read_only_disk(disk: Path) -> Iterator[None]:
    """Of a disk that `disk_at` has mounted. Fails while files are open for writing, as the system does."""
    subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True)
    try:
        yield
    finally:
        subprocess.run(["mount", "-o", "remount,rw", str(disk)], check=True)


@contextmanager
def full_disk(disk: Path) -> Iterator[None]:
    ballast = disk / "ballast"
    with ballast.open("wb", buffering=0) as file, suppress(OSError):
        while file.write(b"x" * 4096):
            pass
    yield
    ballast.unlink()


@contextmanager
def missing_disk(directory: Path) -> Iterator[None]:
    """The whole directory is gone, as when its disk was not mounted, or is unplugged."""
    aside = directory.with_name(f"{directory.name}.aside")
    directory.rename(aside)
    yield
    remove(directory)
    aside.rename(directory)


def without_its_disk(path: Path) -> AbstractContextManager[None]:
    """The directory that a file is in is gone."""
    return missing_disk(path.parent)


@contextmanager
def disk_at(path: Path, megabytes: int) -> Iterator[Path]:
    """A disk of memory. Raises `PermissionError` if it may not be mounted."""
    path.mkdir(parents=True, exist_ok=True)
    _mount("-t", "tmpfs", "-o", f"size={megabytes}m", "tmpfs", path)
    try:
        yield path
    finally:
        subprocess.run(["umount", "-l", str(path)], check=True)


def remove(path: Path) -> None:
    """Remove a file with what SQLite has beside it, or a directory."""
    if path.is_dir():
        shutil.rmtree(path)
    for part in (path, *(path.with_name(path.name + suffix) for suffix in SIDE_FILES)):
        part.unlink(missing_ok=True)


def _mount(*arguments: str | Path) -> None:
    done = subprocess.run(["mount", *map(str, arguments)], check=False, capture_output=True, text=True)
    if done.returncode:
        raise PermissionError(f"may not mount: {done.stderr.strip()}")
