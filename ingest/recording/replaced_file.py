"""A small file that a write replaces as a whole, so that it is never half written."""

import os
from pathlib import Path

ASIDE = ".unreadable"


def replace_file(path: Path, data: bytes) -> None:
    """Replace the file. The new one is synchronised to disk before it gets the name. Raises `OSError`."""
    new = path.with_suffix(".new")
    with new.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    new.replace(path)


def set_file_aside(path: Path) -> Path:
    """Rename an unreadable file, so that a person can look at it; returns its new path. Raises `OSError`."""
    return path.replace(path.with_name(path.name + ASIDE))
