"""Which refused clients are logged: each once an hour for each reason, so that none of them fills the log."""

import logging
import time
from collections.abc import Callable

MOST_LOGGED = 1000
"""Clients and reasons in an hour. Later ones are only counted, until it is over."""
WITHIN_S = 3600.0

log = logging.getLogger(__name__)


class RefusedClients:
    """The refused clients of one port."""

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s, self._since_s = now_s, now_s()
        self._logged: set[tuple[str, str]] = set()

    def note(self, address: str, reason: str) -> None:
        """A client was refused. Logs it, unless it was for the same reason before. `reason` never has a secret."""
        if self._now_s() - self._since_s > WITHIN_S:
            self._logged.clear()
            self._since_s = self._now_s()
        if (address, reason) in self._logged or len(self._logged) >= MOST_LOGGED:
            return
        self._logged.add((address, reason))
        log.warning("%s is refused, which is logged once an hour: %s", address, reason)
        if len(self._logged) == MOST_LOGGED:
            log.warning("further clients that are refused within this hour are not logged")
