"""The file of the engine's learned state, beside the advisories. A write replaces it as a whole."""

import logging
from collections.abc import Mapping
from pathlib import Path

from ingest.measures.measures import Measures
from ingest.plain_files import UnfitFileError, check_folder, read_file, unfit, with_advice
from ingest.recording.replaced_file import ASIDE, replace_file, set_file_aside

log = logging.getLogger(__name__)

FILE_NAME = "learned.npz"
FAILURES = "deconflict_learning_failures_total"
PARTS = "deconflict_learned_parts_set_aside_total"
WHOLE = "all"
"""The label of a file of which no part is used."""


class LearnedFile:
    """Reads and writes bytes. A failure is logged and counted, and never stops the service."""

    def __init__(self, directory: Path, measures: Measures) -> None:
        self.path, self._measures = directory / FILE_NAME, measures
        self._unread = ""
        """Why it could not be read for now. What is there later may be sound."""
        for operation in ("read", "write"):
            measures.count(FAILURES, operation, by=0)
        measures.count(PARTS, WHOLE, by=0)

    def read(self) -> bytes:
        """The bytes written last; empty if there is no file, or it can't be read."""
        self._unread = ""
        try:
            check_folder(self.path)
            return read_file(self.path) if self.path.exists() else b""
        except UnfitFileError as error:
            self._unread = str(error)
            self._failed("read", f"{error}; learning begins anew")
            return b""
        except OSError as error:
            self.set_aside(str(error))
            return b""

    def write(self, data: bytes) -> None:
        """Replace the file. The new one is synchronised to disk before it gets the name."""
        try:
            if self._unread and self.path.exists() and not unfit(self.path):
                self.set_aside(f"it was put there after the engine had started without it ({self._unread})")
            replace_file(self.path, data)
        except OSError as error:
            advised = with_advice(error, "free some space, or check the owner")
            self._failed("write", f"can't keep the learned state: {advised}")
        else:
            self._unread = ""

    def set_parts_aside(self, reasons: Mapping[str, str]) -> None:
        """Keep a copy of a file of which these parts can't be used; the engine goes on with the others."""
        for part, reason in sorted(reasons.items()):
            self._measures.count(PARTS, part)
            log.warning("%s: the part %r is set aside: %s; it is learned anew", self.path, part, reason)
        self._failed("read", f"{self.path} is kept as {FILE_NAME}{ASIDE}, and the engine goes on with its other parts")
        try:
            replace_file(self.path.with_name(FILE_NAME + ASIDE), read_file(self.path))
        except OSError as error:
            log.warning("%s can't be kept: %s", self.path, error)

    def set_aside(self, reason: str) -> None:
        """Rename an unreadable file, so that a person can look at it. Replaces one that was set aside before."""
        self._measures.count(PARTS, WHOLE)
        self._failed("read", f"{self.path}: {reason}; it is set aside as {FILE_NAME}{ASIDE}, and learning begins anew")
        try:
            set_file_aside(self.path)
        except OSError as error:
            log.warning("%s can't be set aside: %s; the next write replaces it", self.path, error)

    def _failed(self, operation: str, message: str) -> None:
        self._measures.count(FAILURES, operation)
        log.warning(message)
