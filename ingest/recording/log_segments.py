"""The files of a log. Older segments of the service's own are packed: of each segment one file counts."""

import io
import os
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TypeVar

from ingest.plain_files import opened_stream
from ingest.recording.compression import DAMAGED, content_bytes, unpacked

PACKED = ".zst"
"""A packed segment has this after the name that it had when it was plain."""
BUFFER_BYTES = 1 << 18
"""Buffer for reading a log. With the default size every fourth line would wait for the system."""
TAIL_BYTES = 1 << 20
"""The end of a log is read in a piece of this size. It has whole lines if the service wrote the log."""
TAIL_LINES = 1000
"""What is kept of a packed log, which is read from its beginning."""

_Found = TypeVar("_Found")


def packed_name(segment: Path) -> Path:
    return segment.with_name(segment.name + PACKED)


def segments(path: Path) -> list[Path]:
    """The file itself, or the logs of a directory by name. For the service's own logs that is the order of time.

    What is in a directory and no file, such as a pipe, is left out. A packed segment counts once its plain file is
    gone. One that is packed while the directory is read may be missed the first time, but not the second.
    """
    if not path.is_dir():
        return [path]
    names = {file for _ in range(2) for file in path.iterdir() if ".jsonl" in file.suffixes and file.is_file()}
    return sorted(names - {packed_name(file) for file in names})


def under_present_name(log: Path, use: Callable[[Path], _Found]) -> _Found:
    """Use a log that may have been packed since it was listed. Raises what `use` raises."""
    with suppress(FileNotFoundError):
        return use(log)
    return use(packed if (packed := packed_name(log)).exists() else log)


def opened_log(log: Path) -> io.BufferedReader:
    """A log as it is stored. Raises `OSError`."""
    return io.BufferedReader(under_present_name(log, opened_stream), BUFFER_BYTES)


def text_bytes(log: Path) -> int:
    """The length of the lines of a log. Raises `OSError`."""
    with opened_log(log) as stored:
        return content_bytes(stored)


def last_lines(log: Path) -> deque[bytes]:
    """The lines at the end of a log, or of what can be read of it. Raises `OSError`."""
    with opened_log(log) as stored:
        lines = unpacked(stored)
        if lines is stored:
            stored.seek(max(os.fstat(stored.fileno()).st_size - TAIL_BYTES, 0))
            return deque(stored.read().splitlines())
        last = deque[bytes](maxlen=TAIL_LINES)
        with suppress(*DAMAGED):
            last.extend(iter(lambda: lines.readline(TAIL_BYTES), b""))
        return last
