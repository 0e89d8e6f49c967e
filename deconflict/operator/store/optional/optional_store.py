"""The store of a service: what it publishes does not wait for the file, neither at the start nor while it runs."""

import logging
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from sys import maxsize
from threading import RLock

from deconflict.operator.store import pruning, tables
from deconflict.operator.store.optional.optional_connections import OptionalConnections
from deconflict.operator.store.optional.stand_in import MOST_BYTES, state_of_open
from deconflict.operator.store.store import Store, StoreError
from deconflict_client.advisory import Acknowledgement, AdvisoryState
from deconflict_client.situations import AnyRevision

log = logging.getLogger(__name__)


class OptionalStore(Store):
    """As `Store`, but memory takes the place of a file that can't be used, until `attach` can use it."""

    connects = OptionalConnections
    connections: OptionalConnections

    def __init__(self, directory: Path, *, follows_stream: bool = False) -> None:
        super().__init__(directory, follows_stream=follows_stream)
        self._open: dict[str, AnyRevision] = {}
        """The newest revision of what is open, by id, so that memory has it if the disk answers nothing any more."""
        self._last = 0
        """The highest number given."""
        self._is_closed = False
        self._read_open()

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
            with self._number_lock:
                self.connections.leave_file(why, self._pending, self._answers.unstored)
                self._pending = []
        file = self.connections.opened_again()
        if file:
            with self._number_lock:
                self.flush()
                self.connections.use_again(file)
                self._read_open()
            self.note_unstored()
        return bool(why or file)

    def accept(self, advisories: Sequence[AnyRevision]) -> list[AnyRevision]:
        accepted = super().accept(advisories)
        self._note_open(accepted)
        return accepted

    def accept_answer(self, advisory_id: str, answer: Acknowledgement, seq: int | None = None) -> AnyRevision | None:
        answered = super().accept_answer(advisory_id, answer, seq)
        self._note_open([answered] if answered else [])
        return answered

    def leave_stuck(self) -> bool:
        """Use memory from now on, with what is open. Whoever waits for the disk may change nothing here later."""
        if self.outage:
            return False
        log.error("the disk of %s does not answer", self.path)
        pending, unstored, waiting = self._pending, self._answers.unstored, self.outlets.unstored
        numbers = {revision.seq for revision in pending}
        stored = [revision for revision in self._open.values() if revision.seq not in numbers]
        self._number_lock, self.outlets = RLock(), pruning.OutletPositions()
        self.outlets.unstored = dict(waiting)
        state = state_of_open(stored, pending[0].seq - 1 if pending else self._last)
        self.connections.leave_stuck(state, pending, unstored)
        self._pending = []
        return True

    def _read_open(self) -> None:
        documents = self.open_after(0, maxsize)
        self._last = self.last_seq()
        self._open = {each.id: each for each in tables.readable((document.text,) for document in documents)}

    def _note_open(self, accepted: Iterable[AnyRevision]) -> None:
        for revision in accepted:
            self._last = max(self._last, revision.seq)
            if revision.state is AdvisoryState.CLEARED:
                self._open.pop(revision.id, None)
            else:
                self._open[revision.id] = revision

    def close(self) -> None:
        """Hand over what memory has, if the file takes it now."""
        if self.outage:
            with suppress(StoreError):
                self.attach()
        self._is_closed = True
        if self.outage:
            log.error("what was published since %s could not be used is lost: %s", self.path, self.outage)
        super().close()

    def prune_to(self, most_bytes: int) -> int:
        return super().prune_to(min(most_bytes, MOST_BYTES) if self.connections.is_in_memory else most_bytes)
