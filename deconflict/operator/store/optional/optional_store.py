"""The store of a service: what it publishes does not wait for the file, neither at the start nor while it runs."""

import logging
from collections.abc import Container, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from sys import maxsize
from threading import RLock

from deconflict.operator.store import pruning
from deconflict.operator.store.optional.newest_known import NewestKnown
from deconflict.operator.store.optional.optional_connections import (
    OPEN_STUCK_S,
    OptionalConnections,
    StuckDiskError,
    within,
)
from deconflict.operator.store.sqlite_connections import DamagedStoreError, StoreConnections
from deconflict.operator.store.store import Store, StoreError
from deconflict_client.situations import AnyRevision

log = logging.getLogger(__name__)


class OptionalStore(Store):
    """As `Store`, but memory takes the place of a file that can't be used, until `attach` can use it."""

    connects = OptionalConnections
    connections: OptionalConnections

    def __init__(self, directory: Path, *, follows_stream: bool = False) -> None:
        super().__init__(directory, follows_stream=follows_stream)
        self._is_closed, self._removed = False, 0
        self._known = self._first_known()

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
        why = self.connections.fault()
        if self._is_closed:  # meanwhile: a thread may ask longer than the store is open
            return False
        if why and not self.outage:
            lock = self._number_lock
            with lock:
                is_left = self.connections.leave_file(why, self._pending, self._answers.unstored)
                with self.connections.changing:
                    if is_left and lock is self._number_lock:
                        self._pending = []
        file = self.connections.opened_again()
        if file:
            self._use_again(file)
            self.note_unstored()
        return bool(why or file)

    def _use_again(self, file: StoreConnections) -> None:
        lock = self._number_lock
        with lock:
            with ExitStack() as at_error:
                at_error.callback(file.close)
                with self.connections.without_limit():
                    self.flush()
                at_error.pop_all()
            if not self.connections.use_again(file):
                return
            with suppress(StoreError):  # it is read in vain if the file fails at once, and is tried again with it
                known = self._read_known()
                with self.connections.changing:
                    if lock is self._number_lock:
                        self._known = known

    def _note_stored(self, pending: Sequence[AnyRevision], unwritable: Container[int]) -> None:
        self._known.note(revision for revision in pending if revision.seq not in unwritable)

    def set_position(self, outlet: str, seq: int) -> None:
        super().set_position(outlet, seq)
        self._known.note_position(outlet, seq)

    def leave_stuck(self) -> bool:
        """Use memory from now on, with what is open. Whoever waits for the disk may change nothing here later."""
        with self.connections.changing:
            if self.outage:
                return self._leave_waiting()
            log.error("the disk of %s does not answer", self.path)
            pending, unstored, waiting = self._pending, self._answers.unstored, self.outlets.unstored
            self._number_lock, self.outlets = RLock(), pruning.OutletPositions()
            self.outlets.unstored = dict(waiting)
            self.connections.leave_stuck(self._known.state(), pending, unstored)
            self._pending = []
        return True

    def _leave_waiting(self) -> bool:
        """Wait no more for who hands over to the file again, if its disk does not answer."""
        if self._number_lock.acquire(blocking=False):
            self._number_lock.release()
            return False
        log.error("the disk of %s does not answer once more", self.path)
        self._number_lock = RLock()
        self.connections.leave_waiting()
        return True

    def _first_known(self) -> NewestKnown:
        """Of the file, of the one that takes its place if it is damaged, or of memory if neither can be read."""
        for is_last in (False, True):
            try:
                return within(OPEN_STUCK_S, self._read_known)
            except StuckDiskError:
                with self.connections.changing:
                    self.connections.leave_stuck(None)
            except StoreError as error:
                if is_last or not isinstance(error, DamagedStoreError):
                    self.connections.leave_file(str(error), (), ())
        return self._read_known()

    def _read_known(self) -> NewestKnown:
        with self.connections.long_reading() as db:
            return NewestKnown.read(db)

    def close(self) -> None:
        """Hand over what memory has, if the file takes it now. It waits for the disk no longer than a start does."""
        try:
            within(OPEN_STUCK_S, self._close)
        except StoreError as error:
            log.error("what was published and is not in %s may be lost: %s", self.path, error)

    def _close(self) -> None:
        if self.outage:
            with suppress(StoreError):
                self.attach()
        self._is_closed = True
        if self.outage:
            log.error("what was published since %s could not be used is lost: %s", self.path, self.outage)
        super().close()

    def flush(self) -> None:
        """As before. Memory stays within its size whatever the disk does: others who remove may wait for that."""
        super().flush()
        if self.connections.is_in_memory:
            removed = super().prune_to(maxsize)
            with self._number_lock:
                self._removed += removed

    def prune_to(self, most_bytes: float) -> int:
        """As before, with those that `flush` has removed since."""
        removed = super().prune_to(most_bytes)
        with self._number_lock:
            removed, self._removed = removed + self._removed, 0
        return removed
