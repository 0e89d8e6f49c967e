"""The store of a service: what it publishes does not wait for the file, neither at the start nor while it runs."""

from pathlib import Path

from deconflict.operator.store.recovery.optional_connections import OptionalConnections
from deconflict.operator.store.recovery.stand_in import MOST_BYTES
from deconflict.operator.store.store import Store


class OptionalStore(Store):
    """As `Store`, but memory takes the place of a file that can't be used, until `attach` can use it."""

    connects = OptionalConnections
    _connections: OptionalConnections

    def __init__(self, directory: Path, *, follows_stream: bool = False) -> None:
        super().__init__(directory, follows_stream=follows_stream)

    @property
    def outage(self) -> str | None:  # type: ignore[override]
        return self._connections.outage

    def note_engine(self) -> None:
        """An engine resumes with what is open now."""
        self._connections.note_engine()

    def attach(self) -> bool:
        """Use the file if it can be used again, and memory if it was removed. Returns whether either was begun.

        For one thread at a time. It may wait for the disk; nothing else waits for that.
        """
        if why := self._connections.fault():
            with self._number_lock:
                self._connections.leave_file(why, self._pending, self._answers.unstored)
                self._pending = []
        file = self._connections.opened_again()
        if file:
            with self._number_lock:
                self.flush()
                self._connections.use_again(file)
        return bool(why or file)

    def prune_to(self, most_bytes: int) -> int:
        return super().prune_to(min(most_bytes, MOST_BYTES) if self._connections.is_in_memory else most_bytes)
