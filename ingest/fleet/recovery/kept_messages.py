"""What a restart needs of robots, but may not find in the newest segments of the message log: `robots.db` beside it.

The file has the identity report of each robot that is known and examined (`ingest/fleet/owners/admission.py`): one
that comes back from it is examined at once. It is written soon after one says something new, and a robot that is
forgotten is removed, also at a start: the file has when each robot was last heard. It also has the last status of
robots that report rarely: once half of a segment of the log is written, of the robots that have not reported in it.
So one of the two newest segments or the file has the last status of each robot that is not silent.
"""

import asyncio
import logging
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from math import inf
from pathlib import Path

from deconflict_client.counted_nouns import count_of
from ingest.fleet.fleet import Fleet
from ingest.fleet.recovery.kept_rows import (
    BUSY_TIMEOUT_S,
    FILE_NAME,
    FORMAT,
    IDENTITY,
    SECOND_FORMAT,
    STATUS,
    TABLE,
    Changes,
    Row,
    file_version,
    is_damage,
    read_rows,
    replace_rows,
)
from ingest.fleet.robot import Robot
from ingest.fleet.shared_identities import INTRODUCER, SharedIdentity
from ingest.measures.measures import Measures
from ingest.plain_files import check_database, check_folder, with_advice
from ingest.port.connection import KEPT, Connection
from ingest.recording.log_reader import Received
from ingest.recording.replaced_file import ASIDE, set_database_aside

WRITE_EVERY_S, RETRY_S = 1.0, 10.0
HEARD_EVERY_S = 3600.0
"""How often the file is told when each robot was last heard. After a kill it may lack so much."""
READ_TIMEOUT_S = 1.0
"""How long a start waits for a file that another program keeps locked. It is read later then."""
READ_AT_ONCE = 200
"""Messages that are read late between two turns of the event loop."""
FAILURES = "deconflict_kept_messages_failures_total"

log = logging.getLogger(__name__)


class KeptMessages:
    """Keeps the file as the fleet is. A failure is logged and counted, and what it concerns is written later."""

    def __init__(self, directory: Path, fleet: Fleet, measures: Measures) -> None:
        self._path, self._fleet, self._measures = directory / FILE_NAME, fleet, measures
        self._lacks_none = False
        """Whether the file has all identities but those that have changed since. False until that is known."""
        self._changed: set[str] = set()
        """UUIDs of robots whose identity in the file may be another. Always the same set: the fleet adds to it."""
        fleet.note_identity = self._changed.add
        self._since_s = -inf
        """A robot that was heard later has reported since the start, or a short time before."""
        self._heard_s: dict[str, float] = {}
        """By UUID, when robots were last heard, as the file said at the start."""
        self._heard_noted_s = -inf
        """When the file was last told when robots were heard."""
        self._is_failing = False
        """Whether the last write failed."""
        self._is_unread = False
        """Whether the file could not be read at the start, and may have what the fleet lacks."""
        self._statuses_before_s = -inf
        """The `before_s` of the statuses in the file."""
        for operation in ("read", "write"):
            measures.count(FAILURES, operation, by=0)

    def read(self, now_s: float) -> list[Received]:
        """All kept messages, the oldest first, but of robots that would be forgotten. Empty if they can't be read.

        They are of the vendors that the site file names now. A topic says itself of which vendor it is. An identity
        from a time to come counts as new: the clock may be behind.
        """
        self._since_s = now_s - self._fleet.reading.silent_after_s
        heard_since_s = now_s - self._fleet.reading.forget_after_s - HEARD_EVERY_S
        try:
            check_folder(self._path)
            rows, unreadable = read_rows(self._path, READ_TIMEOUT_S)
            rows = [row for row in rows if row.heard_s >= heard_since_s]
            if unreadable:
                are = count_of(unreadable, "row is", "rows are")
                self._fail("read", f"{FILE_NAME}: {are} not as this service writes them; left out")
            self._heard_s = {row.uuid: row.heard_s for row in rows if row.kind == IDENTITY}
            return [self._settled(row, now_s) for row in rows]
        except (sqlite3.DatabaseError, OSError) as error:
            if isinstance(error, sqlite3.DatabaseError) and is_damage(error):
                self._set_aside("read", error)
            else:
                self._lacks_none = self._is_unread = True
                self._fail(
                    "read",
                    with_advice(error, f"it is read later; check {FILE_NAME}: its owner, and what keeps it locked"),
                )
        return []

    async def _read_late(self, now_s: float) -> None:
        """Give robots the identities of the file that was not read at the start, except those that have one."""
        try:
            check_folder(self._path)
            rows, _ = await asyncio.to_thread(read_rows, self._path, READ_TIMEOUT_S)
        except (sqlite3.DatabaseError, OSError) as error:
            if isinstance(error, sqlite3.DatabaseError) and is_damage(error):
                self._set_aside("read", error)
                self._lacks_none = self._is_unread = False
            return
        self._is_unread = False
        heard_since_s = now_s - self._fleet.reading.forget_after_s - HEARD_EVERY_S
        wanted = [row for row in rows if row.kind == IDENTITY and row.heard_s >= heard_since_s and self._is_lacked(row)]
        for at in range(0, len(wanted), READ_AT_ONCE):
            measures, self._fleet.measures = self._fleet.measures, Measures()
            for message in (self._settled(row, now_s) for row in wanted[at : at + READ_AT_ONCE]):
                self._fleet.receive(message.raw, now_s, message.connection)
            self._fleet.measures = measures
            await asyncio.sleep(0)
        log.warning("%s is read now: %d robots have their identity again", FILE_NAME, len(wanted))

    def _is_lacked(self, row: Row) -> bool:
        robot = self._fleet.robots.get(row.uuid)
        return robot is None or robot.shared_identity is None

    def _settled(self, row: Row, now_s: float) -> Received:
        vendor = None if row.topic else row.vendor
        settled = vendor and self._fleet.owners.vendors.settled_name(vendor, was_configured=True)
        arrival_s = min(row.arrival_s, now_s) if row.kind == IDENTITY else row.arrival_s
        return _received(row._replace(arrival_s=arrival_s, vendor=settled))

    async def keep(self, leaving_before_s: Callable[[], float], now_s: Callable[[], float]) -> None:
        """Write every change soon, until cancelled. `leaving_before_s` is that of the files of the recorder."""
        wait_s = WRITE_EVERY_S
        while True:
            await asyncio.sleep(wait_s)
            if self._is_unread:
                await self._read_late(now_s())
            elif self._lacks_none and not await asyncio.to_thread(self._path.exists):
                self._lacks_none = False  # somebody has removed it
            if changes := self._changes(leaving_before_s(), now_s()):
                writing = asyncio.create_task(self._write_in_thread(changes))
                try:
                    await asyncio.shield(writing)
                except asyncio.CancelledError:
                    await writing  # the last write must not meet this one
                    raise
                wait_s = RETRY_S if self._is_failing else WRITE_EVERY_S

    async def _write_in_thread(self, changes: Changes) -> None:
        self._note_written(changes, await asyncio.to_thread(self._write, changes))

    def write(self, leaving_before_s: float, now_s: float) -> None:
        """Write what has changed, and when each robot was last heard."""
        self._heard_noted_s = -inf
        if changes := self._changes(leaving_before_s, now_s):
            self._note_written(changes, self._write(changes))

    def _changes(self, leaving_before_s: float, now_s: float) -> Changes | None:
        """What is to be written now. None if nothing is."""
        is_due = leaving_before_s > self._statuses_before_s
        statuses = list(self._rare_statuses(leaving_before_s, now_s)) if is_due else None
        changed = self._changed.copy()
        self._changed.clear()
        is_whole = not self._lacks_none
        identities = {uuid: self._row(uuid) for uuid in (changed.union(self._fleet.robots) if is_whole else changed)}
        heard_s = self._newly_heard() if abs(now_s - self._heard_noted_s) >= HEARD_EVERY_S else None
        gone = [uuid for uuid in changed if uuid not in self._fleet.robots]
        changes = Changes(identities, gone, is_whole, statuses, leaving_before_s, heard_s, now_s)
        return changes if identities or is_due or heard_s else None

    def _row(self, uuid: str) -> Row | None:
        """The identity of a robot. None if it has none, or is not known."""
        robot = self._fleet.robots.get(uuid)
        if robot is None or robot.shared_identity is None or not robot.examined:
            return None
        before_s = self._heard_s.get(uuid, robot.shared_identity.arrival_s)
        heard_s = max(before_s, robot.arrival_s) if robot.arrival_s > self._since_s else before_s
        return _identity_row(robot.shared_identity, heard_s)

    def _newly_heard(self) -> dict[str, float]:
        """By UUID, when the robots with an identity were last heard that were heard since the start."""
        return {
            uuid: max(robot.arrival_s, self._heard_s.get(uuid, -inf))
            for uuid, robot in self._fleet.robots.items()
            if robot.shared_identity and robot.arrival_s > self._since_s
        }

    def _rare_statuses(self, before_s: float, now_s: float) -> Iterator[Row]:
        """The last statuses of the robots that have not reported since `before_s` and are not silent."""
        since_s = now_s - self._fleet.reading.silent_after_s
        for robot in self._fleet.robots.values():
            if robot.arrival_s >= before_s:
                return
            if robot.arrival_s >= since_s and robot.status_from and robot.examined:
                yield _status_row(robot, robot.status_from)

    def _write(self, changes: Changes) -> bool | None:
        """Write the changes. Returns whether the file is new; None if it can't be written. For any thread."""
        try:
            check_database(self._path)
            with closing(sqlite3.connect(self._path, timeout=BUSY_TIMEOUT_S)) as db, db:
                version = file_version(db)
                if version < FORMAT:
                    for statement in SECOND_FORMAT if version else (TABLE,):
                        db.execute(statement)
                    db.execute(f"PRAGMA user_version = {FORMAT}")
                replace_rows(db, changes)
                return not version
        except sqlite3.DatabaseError as error:
            if is_damage(error):
                self._set_aside("write", error)
            else:
                self._fail("write", with_advice(error, "free some space, or check the owner of the directory"))
        return None

    def _note_written(self, changes: Changes, is_new: bool | None) -> None:
        self._is_failing = is_new is None
        if is_new is None:
            self._changed.update(changes.identities)
            return
        if changes.heard_s is not None:
            self._heard_noted_s = changes.now_s
        self._lacks_none = changes.is_whole or not is_new
        if changes.statuses is not None:
            self._statuses_before_s = changes.before_s

    def _set_aside(self, operation: str, error: sqlite3.Error) -> None:
        """Begin the file anew with the next write."""
        with suppress(OSError):
            set_database_aside(self._path, self._path.with_name(f"{FILE_NAME}{ASIDE}"))
        self._fail(operation, f"{error}; the file is set aside as {FILE_NAME}{ASIDE} and begun anew")

    def _fail(self, operation: str, message: str) -> None:
        """Count a failure, and log the first of those that follow one another."""
        self._measures.count(FAILURES, operation)
        if not self._is_failing:
            log.warning("identity reports can't be kept for a restart: %s", message)


def kept_identities(log_directory: Path) -> list[Received]:
    """The identity reports that are kept beside a log, the oldest first. Empty if they can't be read."""
    try:
        return [_received(row) for row in read_rows(log_directory.parent / FILE_NAME)[0] if row.kind == IDENTITY]
    except sqlite3.Error as error:
        log.warning("the identity reports of %s can't be read: %s", FILE_NAME, error)
        return []


def _received(row: Row) -> Received:
    connection = Connection(KEPT, row.peer, vendor=row.vendor, language=row.language, topic=row.topic)
    return Received(row.raw, row.arrival_s, connection)


def _identity_row(identity: SharedIdentity, heard_s: float) -> Row:
    peer = INTRODUCER if identity.elsewhere else ""
    sender = peer, identity.vendor, identity.language, identity.topic
    return Row(IDENTITY, identity.uuid, identity.arrival_s, identity.raw, *sender, heard_s)


def _status_row(robot: Robot, connection: Connection) -> Row:
    peer = connection.peer if connection.topic else connection.source
    sender = peer, connection.vendor, connection.language, connection.topic
    return Row(STATUS, robot.uuid, robot.arrival_s, robot.status_raw, *sender, robot.arrival_s)
