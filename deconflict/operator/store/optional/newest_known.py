"""What memory begins with if the disk of the file answers nothing any more: it is known before that happens."""

import sqlite3
from collections import Counter, deque
from collections.abc import Iterable
from contextlib import closing
from itertools import chain
from operator import attrgetter
from threading import Lock
from typing import Self

from deconflict.advisories.encounter_numbers import FORGOTTEN
from deconflict.operator.store import tables
from deconflict.operator.store.optional.stand_in import MOST_UNSENT, State, empty_database, state_of
from deconflict_client.advisory import AdvisoryState, ConflictAdvisory
from deconflict_client.situations import AnyRevision

UNSENT = """SELECT document FROM revisions WHERE seq > (SELECT min(seq) FROM positions)
ORDER BY seq DESC LIMIT ?"""


class NewestKnown:
    """The state of a database as this process has written it. For any thread."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._last_seq = 0
        """The highest number of what the database has."""
        self._open: dict[str, AnyRevision] = {}
        """The newest revision of what is open, by id."""
        self._unsent = deque[AnyRevision](maxlen=MOST_UNSENT)
        """The newest revisions that an outlet has not sent, ascending by number."""
        self._positions: dict[str, int] = {}
        """By outlet, the number of the last revision that it has sent."""
        self._burdens_s = Counter[str]()
        """How long the robots of each vendor were advised to yield."""
        self._encounter = 0
        """The highest number of an encounter."""

    @classmethod
    def read(cls, db: sqlite3.Connection) -> Self:
        """The state of a database. Raises `sqlite3.Error`."""
        known = cls()
        known._last_seq, known._positions = tables.last_seq(db), tables.positions(db)
        known._open = {each.id: each for each in tables.readable((each.text,) for each in tables.open_after(db, 0))}
        known._unsent.extend(reversed(tables.readable(db.execute(UNSENT, (MOST_UNSENT,)))))
        known._burdens_s.update(dict(db.execute("SELECT vendor, yielded_s FROM burdens")))
        (known._encounter,) = db.execute("SELECT ifnull(max(ordinal), 0) FROM encounters").fetchone()
        return known

    def note(self, stored: Iterable[AnyRevision]) -> None:
        """The database has these revisions."""
        with self._lock:
            for revision in stored:
                if revision.seq > self._last_seq:
                    self._add(revision)

    def _add(self, revision: AnyRevision) -> None:
        self._last_seq = revision.seq
        if revision.state is AdvisoryState.CLEARED:
            self._open.pop(revision.id, None)
        else:
            self._open[revision.id] = revision
        if isinstance(revision, ConflictAdvisory):
            self._encounter = max(self._encounter, revision.encounter)
        self._burdens_s.update(revision.advised_wait_s)
        if self._positions:
            self._unsent.append(revision)

    def note_position(self, outlet: str, seq: int) -> None:
        """An outlet has sent every revision up to a number."""
        with self._lock:
            self._positions[outlet] = max(seq, self._positions.get(outlet, 0))
            sent = min(self._positions.values())
            while self._unsent and self._unsent[0].seq <= sent:
                self._unsent.popleft()

    def state(self) -> State:
        """A pair that meets again goes on above all encounters."""
        with self._lock:
            return self._state()

    def _state(self) -> State:
        known = chain(self._unsent, self._open.values())
        newest = {(each.id, each.revision, each.acknowledgement is None): each for each in known}
        with closing(empty_database()) as db:
            for revision in sorted(newest.values(), key=attrgetter("seq")):
                tables.write_known(db, revision)
            tables.put_positions(db, self._positions)
            tables.note_encounter(db, FORGOTTEN, self._encounter)
            db.executemany("INSERT INTO burdens VALUES (?, ?)", list(self._burdens_s.items()))
            return state_of(db)._replace(last_seq=self._last_seq)
