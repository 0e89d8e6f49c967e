"""Packs older segments of the log in a thread of its own, so that recording never waits for it.

A packed segment is first written under another name. Once it is on the disk it gets its name, and then the plain one is
removed. So at each moment, also after a kill, every line is in the plain segment, in the packed one, or in both. Of
both the plain one is read, and packed again at the next rotation.
"""

import logging
import os
import stat
import threading
import time
from collections.abc import Sequence
from math import inf
from pathlib import Path

import zstandard

from ingest.plain_files import opened, with_advice
from ingest.recording.log_segments import PACKED, packed_name
from ingest.recording.replaced_file import replacing

PLAIN_SEGMENTS = 2
"""The newest segments stay plain: lines are added to the last one, and a restart reads both (`log_recovery`)."""
MOST_AT_ONCE = 2
"""Segments that are packed after one rotation: each makes one, and what an older release left is packed in time."""
RETRY_S = 60.0
"""How long after a failure packing is tried again, if no segment is finished before."""
LEVEL, CHUNK_BYTES = 3, 1 << 20
"""Other levels of zstd take several times longer, or more room."""
UNFINISHED = "packing.new"

log = logging.getLogger(__name__)


class LogPacker:
    """`pack` and `retry` are for one thread, others may read `failing`."""

    def __init__(self) -> None:
        self.failing: str | None = None
        """Why segments can't be packed; None if they can. They stay as they are."""
        self._plain: Sequence[Path] = ()
        """Segments that were to be packed after the last rotation."""
        self._is_due, self._tried_s = False, -inf
        """Whether they were not tried yet, and when the last attempt began, monotonic."""
        self._changing = threading.Lock()
        self._thread: threading.Thread | None = None

    def pack(self, finished: Sequence[Path]) -> None:
        """Pack some soon of those that are plain, the oldest first. `finished` are all but the one that is written."""
        self._plain = [segment for segment in finished[: 1 - PLAIN_SEGMENTS] if segment.suffix != PACKED]
        self._start()

    def retry(self) -> None:
        """Try again what failed, once some time has passed."""
        if self.failing and time.monotonic() - self._tried_s >= RETRY_S:
            self._start()

    def close(self, timeout_s: float) -> None:
        """Wait until what is due is packed, but no longer than this."""
        if thread := self._thread:
            thread.join(timeout_s)

    def _start(self) -> None:
        with self._changing:
            self._is_due = True
            if self._thread is None and self._plain:
                self._thread = threading.Thread(target=self._run, name="packing", daemon=True)
                self._thread.start()

    def _run(self) -> None:
        while True:
            with self._changing:
                if not self._is_due:
                    self._thread = None
                    return
                self._is_due, self._tried_s = False, time.monotonic()
            self._note(self._pack_some(self._plain))

    def _pack_some(self, segments: Sequence[Path]) -> str | None:
        """Returns why one could not be packed; None if none failed."""
        packed, fault = 0, None
        for segment in segments:
            try:
                packed += _pack(segment)
            except Exception as error:  # noqa: BLE001 - whatever it is, it is tried again
                fault = f"{segment.name} is not packed: {with_advice(error, 'free space or repair the disk')}"
            if packed >= MOST_AT_ONCE:
                break
        return fault

    def _note(self, fault: str | None) -> None:
        if fault and not self.failing:
            log.error("%s; nothing is lost, and packing resumes by itself", fault)
        elif self.failing and not fault:
            log.warning("segments of the log are packed again")
        self.failing = fault


def _pack(segment: Path) -> bool:
    """Replace a plain segment by a packed one. Returns whether there was one. Raises `OSError` and `ZstdError`."""
    try:
        if not stat.S_ISREG(segment.lstat().st_mode):
            return False
        with (
            opened(segment, most_bytes=None) as plain,
            replacing(packed_name(segment), segment.with_name(UNFINISHED)) as packed,
        ):
            status = os.fstat(plain.fileno())
            compressor = zstandard.ZstdCompressor(LEVEL, write_checksum=True)
            compressor.copy_stream(plain, packed, status.st_size, CHUNK_BYTES, CHUNK_BYTES)
            packed.flush()
            os.utime(packed.fileno(), ns=(status.st_atime_ns, status.st_mtime_ns))
    except FileNotFoundError:
        return False
    if not segment.exists():  # meanwhile it was too old, or the log too large
        packed_name(segment).unlink(missing_ok=True)
        return False
    _sync_folder(segment.parent)
    segment.unlink(missing_ok=True)
    return True


def _sync_folder(folder: Path) -> None:
    """Put the names in a folder on the disk."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
