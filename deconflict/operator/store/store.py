"""The advisories and situations on disk: every published revision, numbered once, in one SQLite file.

A revision is stored before anybody receives it, and its number is never used again, neither after a crash nor after old
advisories are removed. If the disk fails or stalls, revisions are still published, and stored once the disk works.

SQLite synchronises its write-ahead log at each commit (`synchronous=FULL`). What `append` has returned survives the
death of the process, and a loss of power if the drive flushes as it reports. A drive that does not may lose the last
commits, but not the file.
"""

import sqlite3
from collections import Counter, deque
from collections.abc import Container, Iterator, Sequence, Set
from contextlib import contextmanager
from datetime import datetime
from functools import partial
from itertools import chain, islice
from operator import attrgetter
from pathlib import Path
from threading import RLock

from deconflict.operator.store import pruning, tables
from deconflict.operator.store.listings import ListingFilter, Page, ShiftRow, StateFilter, first_page, situations_since
from deconflict.operator.store.pending_writes import (
    MOST_PENDING,
    PendingWrites,
    by_revision,
    decided_between,
    newest_by_id,
    open_at_time,
    with_encounters,
)
from deconflict.operator.store.sqlite_connections import SqliteConnections
from deconflict.operator.store.tables import StoreError as StoreError  # noqa: PLC0414 - callers import it from here
from deconflict.operator.store.unstored_answers import UnstoredAnswers
from deconflict_client.advisory import ADVISORY_KINDS, Acknowledgement, AdvisoryState, Location
from deconflict_client.situations import AnyRevision, Listing
from ingest.batch import Pair

MOST_PAST = 2_000
"""Most advisories of a time in the past."""


class Store:
    """The advisories of one directory. Every method may be called from any thread, and may block on the disk."""

    outage: str | None = None
    """Why the file is not in use; None if it is."""
    connects: type[SqliteConnections] = SqliteConnections

    def __init__(self, directory: Path, *, follows_stream: bool = False) -> None:
        """Open or create the file in `directory`. Raises `StoreError`. `follows_stream`: as of `SqliteConnections`."""
        self.connections = self.connects(directory, follows_stream=follows_stream)
        """Those to the file, or to memory in its place."""
        self.path = self.connections.path
        self._number_lock, self._answers = RLock(), UnstoredAnswers()
        self._pending: list[AnyRevision] = []
        """Numbered, and not in the file yet, ascending by number."""
        self.outlets = pruning.OutletPositions()
        self.unwritable: deque[tuple[AnyRevision, Exception]] = deque()
        """What could not be written though others could, each once. The publisher takes it from here."""

    def close(self) -> None:
        self.note_unstored()
        self.connections.close()

    @property
    def unstored(self) -> int:
        """Number of revisions that wait for the disk."""
        return len(self._pending)

    @property
    def has_pending(self) -> bool:
        """Whether `flush` has something to store."""
        return bool(self._pending or self.outlets.unstored)

    def accept(self, advisories: Sequence[AnyRevision]) -> list[AnyRevision]:
        """Number revisions and keep them for `flush`. Every other method sees them from now on.

        A revision that has a number keeps it: it comes from a stream that this store follows. A known revision is
        returned as it was. One that can't be written is left out, and is in `unwritable`. Raises `StoreError`, also if
        too many wait for the disk already: so any number is accepted once the disk works.
        """
        lock = self._number_lock
        with lock:
            self._refuse_too_many()
            pending, accepted, known_pending = list(self._pending), [], by_revision(self._pending)
            unwritable: list[tuple[AnyRevision, Exception]] = []
            with self.connections.numbering() as db:
                seq = _last(db, pending)
                for advisory in advisories:
                    try:
                        known = known_pending.get((advisory.id, advisory.revision))
                        known = known or tables.stored_revision(db, advisory.id, advisory.revision)
                        known = known or self._answers.numbered(db, advisory, seq + 1)
                    except tables.UNWRITABLE as error:
                        unwritable.append((advisory, error))
                        continue
                    if known.seq > seq:
                        seq = known.seq
                        pending.append(known)
                        known_pending[known.id, known.revision] = known
                    accepted.append(known)
            with self.connections.changing:
                self._refuse_if_left(lock)
                self._pending = pending
            self.unwritable += unwritable
        return accepted

    def leave_stuck(self) -> bool:
        """Go on without a file whose disk answers nothing, if that is possible. Waits for no disk."""
        return False

    def _refuse_if_left(self, lock: object) -> None:
        if lock is not self._number_lock:
            raise StoreError(f"{self.path}: its disk did not answer, and memory has taken its place")

    def _refuse_too_many(self) -> None:
        if len(self._pending) >= MOST_PENDING:
            raise StoreError(f"{self.path}: {len(self._pending)} revisions wait for the disk; free or mend it")

    def flush(self) -> None:
        """Store pending revisions and positions in one transaction. After a `StoreError` they are still pending.

        A revision that can't be written though the file can is left out, and is in `unwritable`.
        """
        with self._number_lock:
            pending, positions = self._pending, dict(self.outlets.unstored)
        if not pending and not positions:
            return
        with self.connections.writing() as db:
            last, answered = tables.last_seq(db), self._answers.unstored
            new = (revision for revision in pending if revision.seq > last)
            unwritable = [(each, error) for each in new if (error := tables.write_one(db, each, answered))]
            tables.put_positions(db, positions)
        with self._number_lock, self.connections.changing:
            self._note_stored(pending, {revision.seq for revision, _ in unwritable})
            self.unwritable += unwritable
            self._pending = [revision for revision in self._pending if not pending or revision.seq > pending[-1].seq]
            self._answers.stored_to(pending[-1].seq if pending else 0)
            self.outlets.stored(positions)
        self.note_unstored()

    def _note_stored(self, pending: Sequence[AnyRevision], unwritable: Container[int]) -> None:
        """The database has what was pending, but for these numbers."""

    def note_unstored(self) -> None:
        """Have a start after a crash begin a new epoch if revisions wait for the disk now."""
        self.connections.note_unstored(lambda: bool(self._pending))

    def append(self, advisories: Sequence[AnyRevision]) -> list[AnyRevision]:
        """Store revisions in one transaction and return them as stored, each with its sequence number.

        A revision that has a number keeps it: it comes from a stream that this store follows. One that is stored
        already (same advisory id and revision) is returned as it was first stored. So a sender may send again.
        """
        stored = []
        with self._number_lock:
            self.flush()
            with self.connections.writing() as db:
                seq = tables.last_seq(db)
                for advisory in advisories:
                    known = tables.stored_revision(db, advisory.id, advisory.revision)
                    if known is None:
                        known = self._answers.numbered(db, advisory, seq + 1)
                        seq = known.seq
                        tables.write_revision(db, known)
                    stored.append(known)
        return stored

    def acknowledge(self, advisory_id: str, answer: Acknowledgement, seq: int | None = None) -> AnyRevision | None:
        """`accept_answer`, and store it and what waits."""
        self.flush()
        answered = self.accept_answer(advisory_id, answer, seq)
        self.flush()
        return answered

    def accept_answer(self, advisory_id: str, answer: Acknowledgement, seq: int | None = None) -> AnyRevision | None:
        """Number the newest revision once more, with the answer, and keep it for `flush`; None for an unknown advisory.

        `seq` is the number if the stream that this store follows gave one; an answer with a number that is stored
        already is not stored twice. Every later revision has the answer too. Raises `StoreError`, as `accept` does.
        """
        lock = self._number_lock
        with lock, self.connections.numbering() as db:
            self._refuse_too_many()
            last = _last(db, self._pending)
            newest = newest_by_id(self._pending).get(advisory_id) or tables.newest(db, advisory_id)
            if newest is None or (seq is not None and seq <= last):
                return newest
            answered = newest.model_copy(update={"seq": seq or last + 1, "acknowledgement": answer})
            with self.connections.changing:
                self._refuse_if_left(lock)
                self._answers.unstored[answered.seq] = answered
                self._pending = [*self._pending, answered]
        return answered

    def after(self, seq: int, limit: int = 100) -> list[AnyRevision]:
        """Up to `limit` revisions with a number above `seq`, ascending; all of them if `limit` is negative."""
        with self._file_and_pending() as (db, pending):
            rows = db.execute(
                "SELECT document FROM revisions WHERE seq > ? ORDER BY seq LIMIT ?", (seq, limit)
            ).fetchall()
        found = [*tables.readable(rows), *(revision for revision in pending if revision.seq > seq)]
        return found if limit < 0 else found[:limit]

    def page_after(self, seq: int, kinds: Set[str], limit: int) -> Page:
        """Up to `limit` revisions of these kinds with a number above `seq`. Returns fewer if others lie between."""
        with self._file_and_pending() as (db, pending):
            unstored = ((each.seq, each if each.kind in kinds else None) for each in pending if each.seq > seq)
            stored, removed = tables.after(db, seq, kinds), tables.last_removed(db, kinds)
            return first_page(chain(stored, unstored), seq, limit, removed)

    def latest(
        self, state: StateFilter = "open", *, limit: int | None = None, **fields: str | None
    ) -> Listing[AnyRevision]:
        """The newest revision of each that matches, newest first, at most `limit`. `fields` are of `ListingFilter`."""
        wanted = ListingFilter(state, **fields)
        with self._file_and_pending() as (db, pending):
            seq, changed = _last(db, pending), newest_by_id(pending)
            found = tables.latest(db, wanted, -1 if limit is None else limit + 1 + len(changed))
        stored = [advisory for advisory in found if advisory.id not in changed]
        unstored = [revision for revision in changed.values() if wanted.matches(revision)]
        found = sorted([*stored, *unstored], key=lambda advisory: -advisory.seq)
        return Listing(seq=seq, advisories=found[:limit], more=limit is not None and len(found) > limit)

    def open_after(self, seq: int, limit: int) -> list[tables.StoredDocument]:
        """Up to `limit` that are open and whose newest revisions have a number above `seq`, ascending."""
        with self._file_and_pending() as (db, pending):
            changed = newest_by_id(pending)
            stored = (document for document in tables.open_after(db, seq) if document.id not in changed)
            unstored = (
                tables.StoredDocument(revision.seq, revision.id, revision.kind, revision.model_dump_json())
                for revision in sorted(changed.values(), key=attrgetter("seq"))
                if revision.seq > seq and revision.state is not AdvisoryState.CLEARED
            )
            return list(islice(chain(stored, unstored), limit))

    def held_at(self, seq: int, kinds: Set[str]) -> list[tuple[str, str]]:
        """Kind and id of what a receiver that knows these kinds up to a number holds open, and perhaps of some more."""
        with self._file_and_pending(long=True) as (db, pending):
            stored = tables.held_at(db, seq, kinds)
        unstored = ((each.kind, each.id) for each in pending if each.seq <= seq and each.kind in kinds)
        return list(dict.fromkeys([*stored, *unstored]))

    def open_at(self, now_s: float, limit: int = MOST_PAST) -> list[AnyRevision]:
        """The newest `limit` open at a time: the newest revision by then of each that changed in the hour before."""
        with self._file_and_pending(long=True) as (db, pending):
            stored = tables.open_at(db, now_s, limit)
        return open_at_time(stored, pending, now_s)[-limit:]

    def pending_until(self, until_s: float) -> list[AnyRevision]:
        """The revisions that were decided by then and wait for the disk, ascending."""
        return [revision for revision in self._pending if revision.updated_at.timestamp() <= until_s]

    def raised_between(self, since_s: float, until_s: float) -> Counter[Location]:
        """How many advisories were raised at each place between two times."""
        with self._file_and_pending(long=True) as (db, pending):
            places = Counter(tables.raised_between(db, since_s, until_s))
        unstored = (revision for revision in decided_between(pending, since_s, until_s) if revision.revision == 1)
        return places + Counter(each.location for each in unstored if each.location and each.kind in ADVISORY_KINDS)

    def situations_since(self, since_s: float, limit: int) -> list[ShiftRow]:
        """As `listings.situations_since`, of what is on disk."""
        with self._file_and_pending(long=True) as (db, _):
            return situations_since(db, since_s, limit)

    def get(self, advisory_id: str) -> list[AnyRevision]:
        """Every revision of one advisory, ascending; empty if there is no such advisory."""
        with self._file_and_pending() as (db, pending):
            rows = db.execute(
                "SELECT document FROM revisions WHERE id = ? ORDER BY revision, answers", (advisory_id,)
            ).fetchall()
        unstored = (revision for revision in pending if revision.id == advisory_id)
        return [*tables.readable(rows), *unstored]

    def last_seq(self) -> int:
        """The highest number given so far; 0 before the first."""
        with self._file_and_pending() as (db, pending):
            return _last(db, pending)

    def position(self, outlet: str) -> int | None:
        """The number of the last revision that an outlet has delivered; None for a new outlet."""
        with self._number_lock, self.connections.numbering() as db:
            return self.outlets.unstored.get(outlet, tables.position(db, outlet))

    def set_position(self, outlet: str, seq: int) -> None:
        """Set what an outlet has delivered, without waiting. `flush` stores it, with or after that revision."""
        self.outlets.move(outlet, seq)

    def keep_canary(self, document: str) -> None:
        """Replace the stored canary, an advisory that nobody reads. Raises `StoreError`."""
        with self.connections.writing() as db:
            tables.put_canary(db, document)

    def burdens_s(self) -> dict[str, float]:
        """How long the robots of each vendor were advised to yield, seconds, also of what was removed."""
        with self._file_and_pending() as (db, pending):
            burdens_s: dict[str, float] = dict(db.execute("SELECT vendor, yielded_s FROM burdens").fetchall())
        for vendor, more_s in (item for revision in pending for item in revision.advised_wait_s.items()):
            burdens_s[vendor] = burdens_s.get(vendor, 0.0) + more_s
        return burdens_s

    def encounters_after(self, pair: Pair, limit: int) -> list[tuple[Pair, int]]:
        """The last numbers of encounters of up to `limit` pairs that follow `pair`, ascending, perhaps `FORGOTTEN`."""
        with self._file_and_pending() as (db, pending):
            numbers = dict(tables.encounters_after(db, pair, limit))
        last = max(numbers) if len(numbers) == limit else None
        return sorted(with_encounters(numbers, pending, pair, last).items())

    def prune(self, before: datetime, latest_s: float = float("inf")) -> int:
        """Remove old cleared advisories (`pruning.last_old`), and surplus pairs; returns how many advisories."""
        pruning.forget_surplus_pairs(self.connections)
        with self.connections.long_reading() as db:
            last = pruning.last_old(db, before.timestamp(), latest_s)
        remove = partial(pruning.remove_old, before_s=before.timestamp(), latest_s=latest_s, last=last)
        return pruning.remove_in_steps(self.outlets, self.connections, remove)

    def prune_to(self, most_bytes: float) -> int:
        """If the file uses more, remove cleared advisories until it uses less by `pruning.ROOM`; returns how many."""
        with self.connections.reading() as db:
            if pruning.used_bytes(db) <= self.connections.most_bytes(db, most_bytes):
                return 0
        with self.connections.long_reading() as db:
            revisions = pruning.revisions_by_vendors(db)

        def remove(db: sqlite3.Connection) -> int:
            least_bytes = self.connections.most_bytes(db, most_bytes) * (1 - pruning.ROOM)
            return pruning.remove_of_most(db, least_bytes, revisions, self.outlets.reaches(db))

        return pruning.remove_in_steps(self.outlets, self.connections, remove)

    def used_bytes(self) -> int:
        """Size of the file without its free pages."""
        with self.connections.reading() as db:
            return pruning.used_bytes(db)

    @contextmanager
    def _file_and_pending(self, *, long: bool = False) -> Iterator[tuple[sqlite3.Connection, PendingWrites]]:
        """The file, and the revisions that are not in it yet. `long` is for a read that takes long."""
        pending = self._pending
        with self.connections.long_reading() if long else self.connections.reading() as db:
            last = tables.last_seq(db)
            yield db, [revision for revision in pending if revision.seq > last]


def _last(db: sqlite3.Connection, pending: PendingWrites) -> int:
    return max(tables.last_seq(db), pending[-1].seq if pending else 0)
