"""What can't be taken is set aside: counted, logged and left out, so that it holds up nothing else."""

import logging
import time
from typing import Any, Literal

from deconflict_client.situations import REVISION, AnyRevision
from ingest.measures.measures import Measures

SET_ASIDE = "deconflict_advisories_set_aside_total"
SHOWN_LETTERS = 200
"""Characters of an invalid revision that the log shows."""
Reason = Literal["invalid", "unwritable"]
REMEDIES: dict[Reason, str] = {
    "invalid": "it is not a valid advisory; start all processes from one release, or report this as a fault",
    "unwritable": "it can't be written though others can; report this as a fault",
}

log = logging.getLogger(__name__)


class SetAsides:
    """Reads revisions of advisories, and sets aside those that one role can't take. Nobody receives them."""

    def __init__(self, measures: Measures) -> None:
        self._measures = measures
        self.last_s = float("-inf")
        """When the newest was set aside, monotonic time."""
        for reason in REMEDIES:
            measures.count(SET_ASIDE, reason, by=0)

    def revision_of(self, document: bytes | dict[str, Any]) -> AnyRevision | None:
        """The revision of a document, or of a line of JSON. None if it is not valid; then it is set aside."""
        try:
            if isinstance(document, bytes):
                return REVISION.validate_json(document)
            return REVISION.validate_python(document)
        except ValueError as error:
            text = document.decode(errors="replace") if isinstance(document, bytes) else str(document)
            self.add("invalid", text[:SHOWN_LETTERS], error)
            return None

    def add(self, reason: Reason, what: str, error: Exception) -> None:
        """Set aside `what`, a name or the beginning of a document."""
        self.last_s = time.monotonic()
        self._measures.count(SET_ASIDE, reason)
        log.error("a revision is set aside (%s): %s: %s", REMEDIES[reason], what, error)
