"""The files of the log: lines are appended to the newest, older ones are packed, and the oldest are removed.

A new file begins at each start, after `segment_bytes`, after a day, and after a failed write. So nothing is ever
appended to an incomplete line.
"""

import logging
import os
from collections.abc import Callable
from contextlib import suppress
from io import FileIO
from math import inf
from pathlib import Path
from stat import S_ISDIR, S_ISREG

from ingest.recording.clock_notes import DAY_S, KnownTime, old_ones
from ingest.recording.log_packing import LogPacker
from ingest.recording.log_segments import PACKED
from ingest.settings import RecorderSettings

log = logging.getLogger(__name__)

KEPT_BYTES = 4 << 20
"""Written bytes that stay in the page cache at least."""
RETRY_S = 5.0
"""How long after a failed write the next one is tried."""
PATTERN = "log-[0-9]*.jsonl"


class RotatingLog:
    """The files of one writer in a directory. For one thread only, but other threads may set `settings`."""

    def __init__(
        self,
        settings: RecorderSettings,
        directory: Path,
        clock: Callable[[], float],
        known_time: Callable[[], KnownTime],
    ) -> None:
        self.settings, self._directory, self._clock, self._known_time = settings, directory, clock, known_time
        self.packer = LogPacker()
        self._file: FileIO | None = None
        self._path = directory
        """Of the file."""
        self._written, self._released_bytes, self._begun_s = 0, 0, 0.0
        """Bytes in the file, how many there were when the page cache was last released, and when the file began."""
        self._failed_s = 0.0
        self.failing: str | None = None
        """Why nothing can be written; None if writing works."""
        self._not_removable: set[Path] = set()
        """Segments that could not be removed, which was logged."""

    @property
    def leaving_before_s(self) -> float:
        """When the newest file began, once it is half full; -inf until then. May be read from any thread.

        Lines from before are in none of the two newest files as soon as the next one begins.
        """
        return self._begun_s if 2 * self._written >= self.settings.segment_bytes else -inf

    def write(self, data: bytes) -> int:
        """Append whole lines. Returns how many bytes were written: fewer than all if the disk fails."""
        done = 0
        self.packer.retry()
        # abs: if the clock was set back, the next attempt comes sooner, never much later
        if self.failing and abs(self._clock() - self._failed_s) < RETRY_S:
            return 0
        try:
            file = self._segment()
            while done < len(data):
                done += file.write(data[done:])
        except OSError as error:
            self._fail(error)
        else:
            self._recovered()
        self._written += done
        if self._file:
            self._release_cache(self._file)
        return done

    def close(self) -> None:
        if self._file:
            self._file.close()
        self._file = None

    def _release_cache(self, file: FileIO) -> None:
        """Ask the system to write the file to disk and to release its pages from the page cache.

        Otherwise a long recording fills the memory with pages that nobody reads, and allocating each new page costs
        more than writing it.
        """
        if self._written - self._released_bytes < KEPT_BYTES or not hasattr(os, "posix_fadvise"):
            return
        self._released_bytes = self._written
        with suppress(OSError):  # a file system may not know of it
            os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)

    def _segment(self) -> FileIO:
        """The file to write to: a new one at first, and when the last one is long or old enough."""
        is_old = abs(self._clock() - self._begun_s) >= DAY_S
        if self._file is None or self._written >= self.settings.segment_bytes or is_old or self._is_removed(self._file):
            self.close()
            self._directory.mkdir(parents=True, exist_ok=True)
            existing = sorted(file for name in (PATTERN, PATTERN + PACKED) for file in self._directory.glob(name))
            try:
                self._path = self._directory / self._name(existing)
                self._file = self._path.open("xb", buffering=0)
                self._written, self._released_bytes, self._begun_s = 0, 0, self._clock()
            finally:  # a full disk may need the room
                self._remove_oldest(self._remove_old(existing))
            self.packer.pack(existing)
        return self._file

    def _is_removed(self, file: FileIO) -> bool:
        """Whether somebody has removed the file, or moved it away, as with the whole directory for a backup that is put
        in its place: then nobody finds what is written to it."""
        if _is_at(file, self._path):
            return False
        log.error("the newest file of the log was removed or moved, with %d bytes; a new one begins", self._written)
        return True

    def _name(self, existing: list[Path]) -> str:
        """A name that sorts after all others, even if the clock was set back. So its time may be later than now."""
        newest_us = int("".join(filter(str.isdigit, existing[-1].stem))) if existing else 0
        return f"log-{max(round(self._clock() * 1e6), newest_us + 1):017d}.jsonl"

    def _remove_old(self, segments: list[Path]) -> dict[Path, int]:
        """Remove segments to which nothing was added for `keep_days`. Returns the others with their sizes in bytes."""
        found: dict[Path, os.stat_result] = {}
        for segment in segments:
            try:
                status = segment.stat()
            except FileNotFoundError:  # somebody else has removed it
                continue
            except OSError as error:
                self._log_once(segment, error)
                continue
            if S_ISREG(status.st_mode) or S_ISDIR(status.st_mode):  # a pipe or a device is for a person to move away
                found[segment] = status
        time, written_s = self._known_time(), [status.st_mtime for status in found.values()]
        old = old_ones(written_s, time.before_s(self.settings.keep_days), time.latest_s)
        for segment in list(found)[:old]:
            if self._remove(segment, "it is older than keep_days"):
                del found[segment]
        return {segment: status.st_size for segment, status in found.items()}

    def _remove_oldest(self, sizes: dict[Path, int]) -> None:
        """Remove the oldest of the segments, which have these sizes in bytes as they are stored, until there is room
        for one more within `total_bytes`."""
        excess = sum(sizes.values()) + self.settings.segment_bytes - self.settings.total_bytes
        for segment, size in sizes.items():
            if excess <= 0:
                return
            if self._remove(segment, "recordings had reached total_bytes"):
                excess -= size

    def _remove(self, segment: Path, reason: str) -> bool:
        """Remove a segment. Returns whether it is gone."""
        try:
            segment.unlink(missing_ok=True)
        except OSError as error:
            self._log_once(segment, error)
            return False
        log.info("removed %s: %s", segment.name, reason)
        return True

    def _log_once(self, segment: Path, error: OSError) -> None:
        """Log that an old segment can't be removed, the first time."""
        if segment not in self._not_removable:
            log.error("the old segment %s can't be removed: %s; remove it by hand", segment, error)
        self._not_removable.add(segment)

    def _fail(self, error: OSError) -> None:
        if not self.failing:
            log.error("nothing can be recorded: %s; free space or repair the disk, recording resumes by itself", error)
        self.failing = str(error)
        self._failed_s = self._clock()
        self._remove_empty()
        self.close()

    def _remove_empty(self) -> None:
        """Remove a new file of which the disk took nothing: each further attempt makes another one."""
        with suppress(OSError):
            if self._file and os.fstat(self._file.fileno()).st_size == 0 and _is_at(self._file, self._path):
                self._path.unlink()

    def _recovered(self) -> None:
        if self.failing:
            log.warning("recording again")
        self.failing = None


def _is_at(file: FileIO, path: Path) -> bool:
    """Whether the open file is the one that has this path."""
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except (FileNotFoundError, NotADirectoryError):
        return False
