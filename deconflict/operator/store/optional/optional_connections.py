"""Connections to a file that may fail: while it can't be used, a database in memory takes its place.

One connection to that database stands for all four.
"""

import logging
import sqlite3
import time
from collections.abc import Callable, Container, Iterator, Sequence
from concurrent.futures import Future
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext, suppress
from functools import partial
from pathlib import Path
from threading import Lock, Thread
from typing import TypeVar

from deconflict.operator.store.migrations import UPGRADES
from deconflict.operator.store.optional.stand_in import MOST_BYTES, STEP, StandIn, State, readable_state, state_of
from deconflict.operator.store.recovery.reserved_numbers import epoch
from deconflict.operator.store.sqlite_connections import (
    SqliteConnections,
    StoreConnections,
    StoreLocks,
    begun,
    new_locks,
)
from deconflict.operator.store.tables import STUCK, StoreError, last_seq
from deconflict_client.situations import AnyRevision

log = logging.getLogger(__name__)

OPEN_TIMEOUT_S = 1.0
"""How long a file is waited for that another program keeps locked."""
OPEN_STUCK_S = 5.0
"""A disk that answers nothing at the start for so long is not waited for."""

Answer = TypeVar("Answer")


class StuckDiskError(StoreError):
    """The disk does not answer. Who asked it may hold what others wait for."""


def within(limit_s: float, ask: Callable[[], Answer], drop: Callable[[Answer], object] = lambda _: None) -> Answer:
    """The answer of the disk. Raises `StoreError` if it takes longer; `drop` gets an answer that comes later."""
    asking = Future[Answer]()

    def run() -> None:
        try:
            asking.set_result(ask())
        except BaseException as error:  # noqa: BLE001 - who asked gets it
            asking.set_exception(error)

    Thread(target=run, name="disk", daemon=True).start()
    try:
        return asking.result(limit_s)
    except TimeoutError:
        asking.add_done_callback(lambda late: None if late.exception() else drop(late.result()))
        raise StuckDiskError(STUCK) from None


def _identity_of_log(path: Path) -> tuple[int, int] | None:
    """Device and inode of the write-ahead log of a database; None if there is none."""
    try:
        status = path.with_name(f"{path.name}-wal").stat()
    except FileNotFoundError:
        return None
    return status.st_dev, status.st_ino


class OptionalConnections(SqliteConnections):
    """As `SqliteConnections`, but begins without the file if it must, and leaves one that was removed."""

    def __init__(self, directory: Path, *, follows_stream: bool = False) -> None:
        self._stand_in: StandIn | None = None
        self._memory_lock = Lock()
        self._left: list[tuple[StoreConnections, StoreLocks]] = []
        """Files in use that did not answer, and what is locked by those who wait for them."""
        self.outage: str | None = None
        """Why the file is not in use; None if it is."""
        self._log_identity: tuple[int, int] | None = None
        """Of the write-ahead log of the file in use."""
        super().__init__(directory, follows_stream=follows_stream)

    @property
    def is_in_memory(self) -> bool:
        return self._stand_in is not None

    def most_bytes(self, db: sqlite3.Connection, most_bytes: float) -> float:
        """Asked of a database: the file may take the place of memory while its size is measured, or the other way."""
        stand_in = self._stand_in
        return min(most_bytes, MOST_BYTES) if stand_in and stand_in.db is db else most_bytes

    def note_engine(self) -> None:
        """An engine resumes with what is open now."""
        if self._stand_in:
            self._stand_in.has_engine = True

    def fault(self) -> str | None:
        """Why the file in use is of no use any more. It may wait for the disk."""
        if self._stand_in:
            return None
        try:
            status = self.path.stat()
            if (status.st_dev, status.st_ino) != self._identity:
                return f"{self.path} was replaced by something else"
            if self._log_identity != _identity_of_log(self.path):
                return f"{self.path}-wal, which has what that file lacks, was removed or replaced"
            with self.numbering() as db:
                last_seq(db)
            with suppress(OSError):
                self._reserved.renew_if_removed()
        except (FileNotFoundError, NotADirectoryError):
            return f"{self.path} was removed"
        except (StoreError, OSError) as error:
            return str(error)
        return None

    def leave_file(self, why: str, pending: Sequence[AnyRevision], answered: Container[int]) -> bool:
        """Use memory from now on, which has `pending`, too, as of `StandIn`. No revision may be numbered meanwhile.

        Returns whether it was begun: not if memory has taken the place of the file meanwhile.
        """
        file = self._file
        with self._all_locked() as locks:
            state = self._last_state(file)
            with self.changing:
                if self._stand_in or locks is not self._locks:
                    return False
                self._use_memory(state, why, pending, answered)
        file.close()
        return True

    def leave_stuck(
        self, state: State | None, pending: Sequence[AnyRevision] = (), answered: Container[int] = ()
    ) -> None:
        """As `leave_file`, of a file that many may wait for: it is left to them, and closed once it is in use again.

        The caller holds `changing`.
        """
        self._left.append((self._file, self._locks))
        self.leave_waiting()
        self._use_memory(state, STUCK, pending, answered)

    def leave_waiting(self) -> None:
        """Wait for none of those who hold locks now: they wait for the disk. The caller holds `changing`."""
        self._locks = new_locks()

    def _close_left(self) -> None:
        """Close the files that were left, unless somebody still waits for one."""
        for left in list(self._left):
            file, locks = left
            with ExitStack() as held:
                if all(lock.acquire(blocking=False) and held.callback(lock.release) for lock in locks):
                    file.close()
                    self._left.remove(left)

    def opened_again(self) -> StoreConnections | None:
        """Connections to the file if it is not in use and can be used again; they have all but the newest revisions."""
        if self._stand_in is None:
            return None
        with ExitStack() as at_error:
            try:
                file = self._opened_or_renewed()
                at_error.callback(file.close)
                with self._explained_errors():
                    self._stand_in.begin_file(file.writer)
                while len(rows := self._next_rows(self._stand_in)) == STEP:
                    super().note_unstored(lambda: True)  # a kill between the steps leaves numbers that it lacks
                    self._write_rows(self._stand_in, file.writer, rows)
            except (StoreError, sqlite3.Error, OSError) as error:
                self.outage = str(error)
                return None
            at_error.pop_all()
        return file

    @contextmanager
    def without_limit(self) -> Iterator[None]:
        """Memory takes what waits, also if it is full."""
        with self._stand_in.without_limit() if self._stand_in else nullcontext():
            yield

    def use_again(self, file: StoreConnections) -> bool:
        """Write the rest of what memory has to the file, and use it. Raises `StoreError`; then memory stays in use.

        Returns whether the file is in use: not if its disk did not answer for so long that it was left once more.
        """
        if (stand_in := self._stand_in) is None:
            return False
        with ExitStack() as at_error, self._said_errors(), self._all_locked() as locks:
            at_error.callback(file.close)
            self._write_rows(stand_in, file.writer, self._next_rows(stand_in))
            while rows := self._next_rows(stand_in):  # what came since the last step may be many
                self._write_rows(stand_in, file.writer, rows)
            with self._explained_errors(), begun(file.writer, "BEGIN IMMEDIATE"):
                stand_in.finish(file.writer, time.time())
            with self._explained_errors():
                self._known_seq = last_seq(file.writer)
                is_used = self._use(file, locks)
            at_error.pop_all()
            if is_used:
                stand_in.db.close()
        if is_used:
            self._close_left()
            log.warning("%s is in use again", self.path)
        return is_used

    @contextmanager
    def _said_errors(self) -> Iterator[None]:
        try:
            yield
        except StoreError as error:
            self.outage = str(error)
            raise

    def _begin_use(self, file: StoreConnections) -> None:
        super()._begin_use(file)
        self._stand_in = self.outage = None
        self._is_damaged = False

    def note_unstored(self, has_unstored: Callable[[], bool]) -> None:
        """The numbers of an epoch in memory need no note: none of them is given again. So nobody waits for the disk."""
        if not self.is_in_memory:
            super().note_unstored(has_unstored)

    def _begin(self) -> None:
        if not self._follows_stream and not self._known_seq:
            self._known_seq = epoch(time.time())  # perhaps the disk with the numbers given before is not there
        try:
            opened = within(OPEN_STUCK_S, self._opened_or_renewed, StoreConnections.close)
            self._use(opened, self._locks)
        except (StoreError, OSError) as error:
            state = None
            with suppress(StoreError):
                state = within(OPEN_STUCK_S, partial(readable_state, self.path))
            self._use_memory(state, str(error))

    def _opened(self) -> StoreConnections:
        """As before, and what SQLite can open for reading only is no file to use: it would stay so after a repair."""
        file = super()._opened()
        with ExitStack() as at_error, self._explained_errors():
            at_error.callback(file.close)
            with begun(file.writer, "BEGIN IMMEDIATE") as db:
                db.execute(f"PRAGMA user_version = {len(UPGRADES)}")
            self._log_identity = _identity_of_log(self.path)
            at_error.pop_all()
        return file

    def _open_timeout_s(self) -> float:
        return min(super()._open_timeout_s(), OPEN_TIMEOUT_S)

    def _connection_lock(self) -> AbstractContextManager[object]:
        return self._memory_lock if self._stand_in else nullcontext()

    def _renew_if_damaged(self) -> None:
        if not self._stand_in:
            super()._renew_if_damaged()

    def _note_last(self, seq: int) -> None:
        if not self._stand_in:
            super()._note_last(seq)

    def _last_state(self, file: StoreConnections) -> State | None:
        """What can be read of a file in use. One that was removed exists until it is closed."""
        try:
            return state_of(file.writer)
        except sqlite3.Error:
            return readable_state(self.path)

    def _use_memory(
        self, state: State | None, why: str, pending: Sequence[AnyRevision] = (), answered: Container[int] = ()
    ) -> None:
        if self._follows_stream:
            self._stand_in = StandIn(None, None)  # its follower reads the stream again
        else:
            self._stand_in = StandIn(state, max(self._reserved.last, self._known_seq), pending, answered)
        self.outage, self._is_damaged = why, False
        self._file = StoreConnections(*4 * [self._stand_in.db])
        known = "what is open in it is known" if state else "nothing of it is known"
        log.error("advisories are kept in memory, and the file is tried again each second: %s; %s", why, known)

    def _next_rows(self, stand_in: StandIn) -> list[tuple[int, str, int]]:
        with self._memory_lock:
            return stand_in.next_rows()

    def _write_rows(self, stand_in: StandIn, db: sqlite3.Connection, rows: list[tuple[int, str, int]]) -> None:
        with self._explained_errors(), begun(db, "BEGIN IMMEDIATE"):
            step = stand_in.hand_over(db, rows)
        stand_in.handed_over(step)
