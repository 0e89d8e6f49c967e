"""The file of what a site has taught the engine, beside the advisories: replaced as a whole, never half written."""

import logging
import os
from pathlib import Path

from ingest.measures.measures import Measures

log = logging.getLogger(__name__)

FILE_NAME = "learned.npz"
ASIDE = ".unreadable"
FAILURES = "deconflict_learning_failures_total"


class LearnedFile:
    """Reads and writes bytes; a file or disk that fails is told and counted, and never stops the service."""

    def __init__(self, directory: Path, measures: Measures) -> None:
        self.path, self._measures = directory / FILE_NAME, measures
        for what in ("read", "write"):
            measures.count(FAILURES, what, by=0)

    def read(self) -> bytes:
        """What was written last; nothing where there is none, or none that can be read."""
        try:
            return self.path.read_bytes() if self.path.exists() else b""
        except OSError as error:
            self.set_aside(str(error))
            return b""

    def write(self, data: bytes) -> None:
        """Put `data` in the place of what was written before; on the disk before its name."""
        new = self.path.with_suffix(".new")
        try:
            with new.open("wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            new.replace(self.path)
        except OSError as error:
            self._failed("write", f"what was learned can't be kept: {error}; free some space, or check who owns it")

    def set_aside(self, why: str) -> None:
        """Keep an unreadable file for a person to look at, out of the way; one set aside before is replaced."""
        aside = self.path.with_name(FILE_NAME + ASIDE)
        self._failed("read", f"{self.path}: {why}; it is set aside as {aside.name}, and learning begins anew")
        try:
            self.path.replace(aside)
        except OSError as error:
            log.warning("%s can't be set aside: %s; the next that is kept replaces it", self.path, error)

    def _failed(self, what: str, told: str) -> None:
        self._measures.count(FAILURES, what)
        log.warning(told)
