"""The service's clock: that of the host, but when the host's is set it goes on, and only leans towards it.

A service that took a step over would find every robot silent, or every report older than the last.
"""

import logging
from collections.abc import Callable

log = logging.getLogger(__name__)

SLEW = 0.01
"""Seconds a second by which it leans: an hour's step is made good in four days, or at the next start."""
STEP_S = 1.0
"""A difference from the host's clock of more than this is told."""


class SteadyClock:
    """Seconds since the epoch that never go back and never leap."""

    def __init__(self, wall: Callable[[], float], monotonic: Callable[[], float]) -> None:
        """`wall` is the host's clock, seconds since the epoch; nobody sets `monotonic`."""
        self._wall, self._monotonic = wall, monotonic
        self._read_s = monotonic()
        self._offset_s = wall() - self._read_s
        self.off_s = 0.0
        """What the host's clock is ahead of this one."""

    def __call__(self) -> float:
        read_s = self._monotonic()
        most_s, self._read_s = SLEW * (read_s - self._read_s), read_s
        off_s = self._wall() - read_s - self._offset_s
        self._offset_s += min(max(off_s, -most_s), most_s)
        if abs(off_s) > STEP_S >= abs(self.off_s):
            log.warning("the host's clock was set by %+.1f s; the service's goes on until it is restarted", off_s)
        self.off_s = off_s
        return read_s + self._offset_s
