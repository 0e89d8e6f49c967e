"""Writes blocks of lines in its own thread, in order, so that the caller never waits for the disk."""

import logging
import threading
from collections import deque
from collections.abc import Callable

log = logging.getLogger(__name__)

Write = Callable[[bytes], int]
"""Writes a block. Returns how many of its bytes were written; the others are lost."""


class LogWriter:
    """Blocks wait in memory up to `most_bytes`. A block that would exceed them is dropped and its lines are counted."""

    def __init__(self, write: Write, most_bytes: int) -> None:
        self._write, self._most = write, most_bytes
        self._blocks: deque[bytes] = deque()
        self._bytes = 0
        """Bytes that wait, including the block that is being written."""
        self._written = self._dropped = 0
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None
        self._closed = False
        self.failing: str | None = None
        """Why blocks are being dropped; None if they are not."""

    @property
    def waiting(self) -> bool:
        """Whether blocks wait or are being written."""
        return self._bytes > 0

    def add(self, block: bytes) -> None:
        """Add a block of whole lines."""
        with self._changed:
            if self._bytes + len(block) > self._most:
                self._note_slow_disk()
                self._dropped += block.count(b"\n")
                return
            self._blocks.append(block)
            self._bytes += len(block)
            self._changed.notify_all()
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="recording", daemon=True)
            self._thread.start()

    def sync(self, timeout_s: float) -> bool:
        """Wait until everything is written. Returns whether that happened in time."""
        with self._changed:
            return self._changed.wait_for(lambda: not self._bytes, timeout_s)

    def take_counts(self) -> tuple[int, int]:
        """Bytes written and lines dropped since the last call."""
        with self._changed:
            counts = self._written, self._dropped
            self._written = self._dropped = 0
            return counts

    def close(self, timeout_s: float) -> bool:
        """Write what waits, drop what is not written in time, and end. Returns whether all was written in time."""
        done = self.sync(timeout_s)
        with self._changed:
            self._closed = True
            self._dropped += sum(block.count(b"\n") for block in self._blocks)
            self._blocks.clear()
            self._changed.notify_all()
        if done and self._thread:
            self._thread.join()
        return done

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._blocks or self._closed)
                if self._closed:
                    return
                block = self._blocks[0]
            try:
                done = self._write(block)
            except Exception:
                log.exception("%d lines of the recording are lost", block.count(b"\n"))
                done = 0
            with self._changed:
                if self._closed:
                    return
                self._end(self._blocks.popleft(), done)

    def _end(self, block: bytes, done: int) -> None:
        self._bytes -= len(block)
        self._written += done
        self._dropped += block[done:].count(b"\n")
        if self.failing and not self._bytes:
            self.failing = None
            log.warning("the disk keeps up with the recording again")
        self._changed.notify_all()

    def _note_slow_disk(self) -> None:
        if not self.failing:
            self.failing = f"the disk is too slow: {self._bytes} bytes wait to be written"
            log.error("lines are not recorded: %s; recording resumes once they are written", self.failing)
