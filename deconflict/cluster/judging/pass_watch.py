"""Notices that a pass hangs in its thread, while the event loop of its engine goes on to send heartbeats."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager

from deconflict.cluster.nats.nats_tasks import BEAT_EVERY_S
from deconflict.runtime.heartbeat import SILENCE_LIMIT_S

log = logging.getLogger(__name__)


class HangingPassError(Exception):
    """A pass does not end."""

    def __init__(self, whose: str) -> None:
        super().__init__(f"a pass of {whose} has not ended within {SILENCE_LIMIT_S} s; the engine restarts")


class PassWatch:
    """Counts the heartbeats during a pass. While the whole process stands still, none is sent."""

    def __init__(self, whose: str) -> None:
        self._whose, self._is_passing, self._beats = whose, False, 0

    @contextmanager
    def passing(self) -> Iterator[None]:
        """A pass is made."""
        self._is_passing, self._beats = True, 0
        try:
            yield
        finally:
            self._is_passing = False

    def beat(self) -> None:
        """A heartbeat is due. Raises `HangingPassError`."""
        self._beats += 1
        if self._is_passing and self._beats * BEAT_EVERY_S > SILENCE_LIMIT_S:
            error = HangingPassError(self._whose)
            log.error("%s", error)  # the process can't end before the pass does, and is killed
            raise error
