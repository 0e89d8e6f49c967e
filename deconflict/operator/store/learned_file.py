"""The file of the engine's learned state, beside the advisories. A write replaces it as a whole."""

import logging
import os
from pathlib import Path

from ingest.measures.measures import Measures

log = logging.getLogger(__name__)

FILE_NAME = "learned.npz"
ASIDE = ".unreadable"
FAILURES = "deconflict_learning_failures_total"


class LearnedFile:
    """Reads and writes bytes. A failure is logged and counted, and never stops the service."""

    def __init__(self, directory: Path, measures: Measures) -> None:
        self.path, self._measures = directory / FILE_NAME, measures
        for operation in ("read", "write"):
            measures.count(FAILURES, operation, by=0)

    def read(self) -> bytes:
        """The bytes written last; empty if there is no file, or it can't be read."""
        try:
            return self.path.read_bytes() if self.path.exists() else b""
        except OSError as error:
            self.set_aside(str(error))
            return b""

    def write(self, data: bytes) -> None:
        """Replace the file. The new one is synchronised to disk before it gets the name."""
        new = self.path.with_suffix(".new")
        try:
            with new.open("wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            new.replace(self.path)
        except OSError as error:
            self._failed("write", f"can't keep the learned state: {error}; free some space, or check the owner")

    def set_aside(self, reason: str) -> None:
        """Rename an unreadable file, so that a person can look at it. Replaces one that was set aside before."""
        aside = self.path.with_name(FILE_NAME + ASIDE)
        self._failed("read", f"{self.path}: {reason}; it is set aside as {aside.name}, and learning begins anew")
        try:
            self.path.replace(aside)
        except OSError as error:
            log.warning("%s can't be set aside: %s; the next write replaces it", self.path, error)

    def _failed(self, operation: str, message: str) -> None:
        self._measures.count(FAILURES, operation)
        log.warning(message)
