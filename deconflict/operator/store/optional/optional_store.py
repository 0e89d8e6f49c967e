"""The store of a service: what it publishes does not wait for the file, neither at the start nor while it runs."""

import logging
from contextlib import suppress

from deconflict.operator.store.optional.optional_connections import OptionalConnections
from deconflict.operator.store.optional.stand_in import MOST_BYTES
from deconflict.operator.store.store import Store, StoreError

log = logging.getLogger(__name__)


class OptionalStore(Store):
    """As `Store`, but memory takes the place of a file that can't be used, until `attach` can use it."""

    connects = OptionalConnections
    connections: OptionalConnections

    @property
    def outage(self) -> str | None:  # type: ignore[override]
        return self.connections.outage

    def note_engine(self) -> None:
        """An engine resumes with what is open now."""
        self.connections.note_engine()

    def attach(self) -> bool:
        """Use the file if it can be used again, and memory if it was removed. Returns whether either was begun.

        For one thread at a time. It may wait for the disk; nothing else waits for that.
        """
        if why := self.connections.fault():
            with self._number_lock:
                self.connections.leave_file(why, self._pending, self._answers.unstored)
                self._pending = []
        file = self.connections.opened_again()
        if file:
            with self._number_lock:
                self.flush()
                self.connections.use_again(file)
            self.note_unstored()
        return bool(why or file)

    def close(self) -> None:
        """Hand over what memory has, if the file takes it now."""
        if self.outage:
            with suppress(StoreError):
                self.attach()
        if self.outage:
            log.error("what was published since %s could not be used is lost: %s", self.path, self.outage)
        super().close()

    def prune_to(self, most_bytes: int) -> int:
        return super().prune_to(min(most_bytes, MOST_BYTES) if self.connections.is_in_memory else most_bytes)
