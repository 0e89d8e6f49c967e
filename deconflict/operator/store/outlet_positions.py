"""How far each outlet has read and delivered, so that removal spares what an outlet has sent, or may send, open."""

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from sys import maxsize
from threading import Lock
from typing import NamedTuple

from deconflict.advisory import EVERY_KIND
from deconflict.operator.store import tables
from deconflict.operator.store.sqlite_connections import SqliteConnections


class OutletReach(NamedTuple):
    """How far one outlet is, in numbers of revisions."""

    delivered: int
    """It has sent every revision up to this number."""
    read_to: int
    """It may have sent, or may yet send, any stored revision up to this number. It has read none above it."""


class OutletPositions:
    """Positions that are not in the file yet, and the pages that outlets read. `begin_page` and `end_page` never wait
    for the disk."""

    def __init__(self) -> None:
        self.unstored: dict[str, int] = {}
        """Positions of outlets that are not in the file yet."""
        self._lock = Lock()
        self._is_removing = False
        """From the choice of what is removed until that is committed."""
        self._reading: set[str] = set()
        self._late: set[str] = set()
        """Outlets that began a page during the present removal, which does not spare what they read."""
        self._read_to: dict[str, int] = {}
        self._removed_to = 0

    def begin_page(self, outlet: str) -> int | None:
        """The outlet reads its next page: until `end_page`, no removal that begins takes what it may still send.

        Returns the highest number that was removed since the start. Returns None while an earlier removal is being
        committed: then the outlet may not read yet, and asks again.
        """
        with self._lock:
            if self._is_removing and outlet not in self._reading:
                self._late.add(outlet)
            self._reading.add(outlet)
            return None if outlet in self._late else self._removed_to

    def end_page(self, outlet: str, last: int) -> None:
        """The outlet has read its page, which ends with the number `last`, or reads none."""
        with self._lock:
            self._read_to[outlet] = max(last, self._read_to.get(outlet, 0))
            self._reading.discard(outlet)
            self._late.discard(outlet)

    def reaches(self, db: sqlite3.Connection) -> list[OutletReach]:
        """How far each outlet is that has a position."""
        positions = tables.positions(db) | self.unstored
        return [OutletReach(position, self._most_read(outlet, position)) for outlet, position in positions.items()]

    def _most_read(self, outlet: str, position: int) -> int:
        with self._lock:
            return maxsize if outlet in self._reading else max(position, self._read_to.get(outlet, 0))

    @contextmanager
    def removing(self, connections: SqliteConnections) -> Iterator[sqlite3.Connection]:
        """A transaction that removes advisories."""
        try:
            with connections.writing() as db:
                with self._lock:
                    self._is_removing = True
                yield db
                self._removed_to = tables.last_removed(db, EVERY_KIND)
        finally:
            with self._lock:
                self._is_removing = False
                self._late.clear()
