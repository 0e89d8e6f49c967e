"""Which databases were removed, and are put back."""

import os
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path


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
