"""Outages of another party: which are logged, as one that comes and goes fills no log, and how long to wait then."""

from collections.abc import Callable
from math import inf
from random import Random

QUIET_S = 600.0
"""After an outage was logged, others are only counted for so long."""
STEADY_S = 30.0
"""A connection that lasted this long resets the back-off, and its loss is logged."""


class OutageLog:
    """The outages of one party, of which some are logged."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._is_out = self._is_logged = False
        self._logged_s, self._unlogged = -inf, 0
        """When an outage was logged last, and how many were not logged since."""

    def failed(self, *, was_steady: bool = False) -> str | None:
        """It failed, perhaps again. If this is to be logged: how many outages were not; else None.

        An outage is always logged if it worked for long before: `was_steady`.
        """
        if was_steady:
            self._logged_s = -inf
        if not self._is_out:
            self._is_out, self._is_logged = True, False
            self._unlogged += 1
        if self._is_logged or self._clock() - self._logged_s < QUIET_S:
            return None
        others, self._unlogged = self._unlogged - 1, 0
        self._is_logged, self._logged_s = True, self._clock()
        return f", after {others} more outages since it was last logged" if others else ""

    def worked(self) -> bool:
        """It works. Whether this ends an outage that was logged."""
        ended = self._is_out and self._is_logged
        self._is_out = False
        return ended


def backoff_s(bounds_s: tuple[float, float], failures: int, random: Random) -> float:
    """How long to wait before the next attempt, after so many in a row that failed or did not last.

    It doubles with each failure, within bounds. A random part is taken off, so that not all try at once.
    """
    least_s, most_s = bounds_s
    return min(least_s * 2.0 ** min(max(failures - 1, 0), 30), most_s) * random.uniform(0.5, 1.0)
