"""What can't be taken is set aside: counted, logged and left out, so that it holds up nothing else."""

import logging
import time
from typing import Literal

from ingest.measures.measures import Measures

SET_ASIDE = "deconflict_advisories_set_aside_total"
Reason = Literal["invalid", "unwritable"]
REMEDIES: dict[Reason, str] = {
    "invalid": "it is not a valid advisory; start all processes from one release, or report this as a fault",
    "unwritable": "it can't be written though others can; report this as a fault",
}

log = logging.getLogger(__name__)


class SetAsides:
    """The revisions of advisories that one role has set aside. Nobody receives them."""

    def __init__(self, measures: Measures) -> None:
        self._measures = measures
        self.last_s = float("-inf")
        """When the newest was set aside, monotonic time."""
        for reason in REMEDIES:
            measures.count(SET_ASIDE, reason, by=0)

    def add(self, reason: Reason, what: str, error: Exception) -> None:
        """Set aside `what`, a name or the beginning of a document."""
        self.last_s = time.monotonic()
        self._measures.count(SET_ASIDE, reason)
        log.error("a revision is set aside (%s): %s: %s", REMEDIES[reason], what, error)
