"""Whether each file of the data directory can be used. A thread looks, and health says what it has found.

A database that was removed is put back.
"""

import asyncio
import os
import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from deconflict.cluster.members_health import health_part
from deconflict.operator.blackbox.archive import FOLDER, REGISTER
from deconflict.operator.blackbox.keeper import PENDING
from deconflict.operator.ledger import loss_ledger
from deconflict.operator.store import learned_file, sqlite_connections
from deconflict.operator.store.recovery import reserved_numbers
from deconflict.roles.health.refusal_health import SHOWN_S
from deconflict.runtime.data_lock import LOCKS
from deconflict.settings.site import Site
from ingest.fleet.owners import owner_file
from ingest.fleet.recovery import kept_rows
from ingest.recording import clock_notes
from ingest.recording.file_faults import FileKind, file_fault
from ingest.recording.log_segments import PACKED
from ingest.recording.replaced_file import ASIDE, new_name


class LostDatabases:
    """Knows a database by its inode, and holds it without reading it: so no other file gets that inode meanwhile."""

    def __init__(self) -> None:
        self._present: dict[Path, int] = {}
        """By path, a descriptor of the file that is there."""
        self._lost: dict[Path, int] = {}
        """By path, a descriptor of the file that was there until the path was first lost."""

    def lost(self, path: Path) -> None:
        """The file was removed or replaced. The first one counts until it is back, or nobody can put it back."""
        if (descriptor := self._present.pop(path, None)) is not None:
            if path in self._lost:
                os.close(descriptor)
            else:
                self._lost[path] = descriptor

    def found_again(self) -> set[Path]:
        """Paths where the lost file is again. Each is returned once. May wait for the disk."""
        found = {path for path, descriptor in self._lost.items() if _is_at(descriptor, path)}
        for path in found:
            os.close(self._lost.pop(path))
        return found

    def hold(self, paths: Iterable[Path]) -> None:
        """Hold what is there now. Lets go of what nobody can put back. May wait for the disk."""
        for path in [path for path, descriptor in self._lost.items() if not _has_name(descriptor)]:
            os.close(self._lost.pop(path))
        for path in paths:
            held = self._present.get(path)
            if held is None or not _is_at(held, path):
                if held is not None:
                    os.close(self._present.pop(path))
                with suppress(OSError):
                    self._present[path] = os.open(path, os.O_PATH)


def _is_at(descriptor: int, path: Path) -> bool:
    with suppress(OSError):
        return os.path.samestat(os.fstat(descriptor), path.stat())
    return False


def _has_name(descriptor: int) -> bool:
    with suppress(OSError):
        return os.fstat(descriptor).st_nlink > 0
    return False


LOOK_EVERY_S = 2.0
SILENT_S = 8.0
"""A disk that answers no look for so long is reported."""
REMOVED_SHOWN_S = SHOWN_S
"""That a file was removed is reported while it is missing, and for so long after it was written anew; of a database,
until it is put back."""

SMALL = owner_file.FILE_NAME, learned_file.FILE_NAME, reserved_numbers.FILE_NAME, clock_notes.FILE_NAME
FROM_MEMORY = (kept_rows.FILE_NAME, *SMALL)
"""Files that are made anew with all that they had."""
LOST = "; what it had is missing, unless you restore a backup"
NEW_EPOCH = "; the numbers of advisories are a new epoch, so subscribers read again what is open"
MADE_AT_NEED = (FOLDER,)
"""These are missing until there is something to write: that is no fault for ever."""


def data_files(site: Site, data: Path) -> list[tuple[Path, FileKind]]:
    """What the service keeps there by the settings of its site, the most important first."""
    databases = sqlite_connections.FILE_NAME, loss_ledger.FILE_NAME, kept_rows.FILE_NAME
    folders = {"log": site.recorder.enabled, FOLDER: site.keeps_boxes}
    rare: list[Path] = []
    with suppress(OSError):  # the directory may not be entered
        rare += sorted(data.glob(LOCKS))
    if folders[FOLDER]:
        rare += [data / FOLDER / REGISTER, data / FOLDER / PENDING]
    return [
        *((data / name, FileKind.DATABASE) for name in databases),
        *((data / name, FileKind.FILE) for name in SMALL),
        *((data / name, FileKind.FOLDER) for name, is_kept in folders.items() if is_kept),
        *((path, FileKind.RARE_FILE) for path in rare),
    ]


class FileHealth:
    """All times are monotonic."""

    def __init__(self, files: Sequence[tuple[Path, FileKind]], *, gives_numbers: bool = True) -> None:
        """`gives_numbers`: advisories are numbered by their database, and not by the stream of a cluster."""
        self._files, self._gives_numbers = files, gives_numbers
        self._faults: dict[str, str] = {}
        """By name of a file."""
        self._contents: dict[Path, frozenset[str]] = {}
        """As of `_content`, of the files that were there at the last look."""
        self._removed_s: dict[str, float] = {}
        """By name, when a file was seen to be removed, and was last missing."""
        self._asides: dict[Path, int | None] = {}
        """By file, the inode of what the service set aside of it, as the last look began; None if there is nothing."""
        self._set_aside: set[str] = set()
        """Names of files that the service itself has taken away."""
        self._databases = LostDatabases()
        self._looked_s = time.monotonic()

    async def run(self) -> None:
        """Look again and again, until cancelled."""
        while True:
            await asyncio.to_thread(self.look, time.monotonic())
            await asyncio.sleep(LOOK_EVERY_S)

    def look(self, now_s: float) -> None:
        """Look at each file. May wait for the disk."""
        asides, self._asides = self._asides, {path: _inode(_aside(path)) for path, _ in self._files}
        self._faults = {path.name: fault for path, kind in self._files if (fault := file_fault(path, kind))}
        found = {path: content for path, kind in self._files if (content := self._present(path, kind)) is not None}
        missing = {path.name for path, _ in self._files if path not in found and path.name not in MADE_AT_NEED}
        removed_s = {name: now_s if name in missing else at_s for name, at_s in self._removed_s.items()}
        for path, before in self._contents.items():
            if path not in found or (before and not before & found[path]):
                removed_s[path.name] = now_s
                self._databases.lost(path)
                self._note_removed(path.name, asides[path], _inode(_aside(path)))
        found_again = {path.name for path in self._databases.found_again()}
        self._removed_s = {name: at_s for name, at_s in removed_s.items() if name not in found_again}
        self._databases.hold(path for path, kind in self._files if kind is FileKind.DATABASE and path in found)
        self._contents, self._looked_s = found, time.monotonic()

    def _present(self, path: Path, kind: FileKind) -> frozenset[str] | None:
        """As of `_content`; as at the last look while it can't be known, as of a directory that may not be entered."""
        try:
            return _content(path, kind)
        except (FileNotFoundError, NotADirectoryError):
            return None
        except OSError:
            return self._contents.get(path)

    def document(self, now_s: float, outages: Mapping[str, str | None] | None = None) -> dict[str, Any]:
        """The part `files` of the health. `outages` has by name why a file is not in use, as who uses it knows."""
        faults = {
            name: f"{self._lost_by(name)}, and is {self._since(name, removed_s, now_s)}"
            for name, removed_s in self._removed_s.items()
            if now_s - removed_s < REMOVED_SHOWN_S
        }
        faults |= {name: outage for name, outage in (outages or {}).items() if outage} | self._faults
        if now_s - self._looked_s > SILENT_S:
            faults = {"the data directory": f"its disk has not answered for {now_s - self._looked_s:.0f} s; check it"}
        reasons = [f"{name}: {fault}" for name, fault in faults.items()]
        return health_part(reasons, **({"faults": faults} if faults else {}))

    def _note_removed(self, name: str, aside_before: int | None, aside: int | None) -> None:
        self._set_aside.discard(name)
        if aside is not None and aside != aside_before:
            self._set_aside.add(name)

    def _lost_by(self, name: str) -> str:
        if name in self._set_aside:
            return f"the service could not use it and set it aside as {name}{ASIDE}"
        return "it was removed or replaced"

    def _since(self, name: str, removed_s: float, now_s: float) -> str:
        """What has become of a removed file."""
        if name in {path.name for path in self._contents}:
            now = f"written anew since {max(now_s - removed_s, 0.0):.0f} s"
        else:
            now = "not there yet"
        epoch = NEW_EPOCH if name == sqlite_connections.FILE_NAME and self._gives_numbers else ""
        return now + ("" if name in FROM_MEMORY else LOST) + epoch


def _aside(path: Path) -> Path:
    return path.with_name(path.name + ASIDE)


def _inode(path: Path) -> int | None:
    with suppress(OSError):
        return path.stat().st_ino
    return None


def _content(path: Path, kind: FileKind) -> frozenset[str] | None:
    """The inode of a database, the names in a folder of what the service does not remove or rename within seconds, and
    nothing of a file that is replaced at each write. None if there is none, for what is there only at times, and for
    what is no database. Raises `OSError`."""
    if kind is FileKind.RARE_FILE or (kind is FileKind.DATABASE and not path.is_file()):
        return None
    inode = path.stat().st_ino
    if kind is FileKind.FOLDER:
        lasting = (entry.name for entry in path.iterdir() if entry.name != PENDING and entry != new_name(entry))
        return frozenset(name.removesuffix(PACKED) for name in lasting)
    return frozenset([str(inode)] if kind is FileKind.DATABASE else [])
