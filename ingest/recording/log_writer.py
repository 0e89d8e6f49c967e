"""Writes blocks of lines in a thread of its own, in order, so that whoever has them to write never waits."""

import logging
import threading
from collections import deque
from collections.abc import Callable

log = logging.getLogger(__name__)

Write = Callable[[bytes], int]
"""Writes a block; how many of its bytes are written. What is not is lost."""


class LogWriter:
    """Blocks wait in memory up to `most_bytes`; one that would exceed them is dropped and its lines counted."""

    def __init__(self, write: Write, most_bytes: int) -> None:
        self._write, self._most = write, most_bytes
        self._blocks: deque[bytes] = deque()
        self._bytes = 0
        """Waiting, the block that is being written included."""
        self._written = self._dropped = 0
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None
        self._closed = False
        self.failing: str | None = None
        """Why blocks are dropped just now."""

    @property
    def waiting(self) -> bool:
        return self._bytes > 0

    def put(self, block: bytes) -> None:
        """Hand over whole lines."""
        with self._changed:
            if self._bytes + len(block) > self._most:
                self._too_slow()
                self._dropped += block.count(b"\n")
                return
            self._blocks.append(block)
            self._bytes += len(block)
            self._changed.notify_all()
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="recording", daemon=True)
            self._thread.start()

    def sync(self, timeout_s: float) -> bool:
        """Wait until nothing waits any more; whether that came about in time."""
        with self._changed:
            return self._changed.wait_for(lambda: not self._bytes, timeout_s)

    def tally(self) -> tuple[int, int]:
        """Bytes written and lines dropped since the last tally."""
        with self._changed:
            told = self._written, self._dropped
            self._written = self._dropped = 0
            return told

    def close(self, timeout_s: float) -> bool:
        """Write what waits, for as long as that, drop the rest, and end; whether all was written or given up."""
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

    def _too_slow(self) -> None:
        if not self.failing:
            self.failing = f"the disk is too slow: {self._bytes} bytes wait to be written"
            log.error("not everything is recorded: %s; it is, once they are", self.failing)
