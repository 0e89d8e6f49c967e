"""Which refused clients are logged: each once for each reason, so that none of them fills the log."""

import logging

MOST_LOGGED = 1000
"""Clients and reasons. Later ones are only counted, until the service starts again."""

log = logging.getLogger(__name__)


class RefusedClients:
    """The refused clients of one port."""

    def __init__(self) -> None:
        self._logged: set[tuple[str, str]] = set()

    def note(self, address: str, reason: str) -> None:
        """A client was refused. Logs it, unless it was for the same reason before."""
        if (address, reason) in self._logged or len(self._logged) >= MOST_LOGGED:
            return
        self._logged.add((address, reason))
        log.warning("%s is refused, which is logged once: %s", address, reason)
        if len(self._logged) == MOST_LOGGED:
            log.warning("further clients that are refused are counted and not logged")
