"""Reads and writes of the tables in the advisory database."""

import json
import logging
import sqlite3
from collections.abc import Container, Iterable, Iterator, Mapping, Set
from contextlib import AbstractContextManager, closing
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

from deconflict.operator.store.listings import OPEN_VALUES, ListingFilter
from deconflict.operator.store.pending_writes import LOOK_BACK_S
from deconflict_client.advisory import (
    EVERY_KIND,
    SITUATION,
    Acknowledgement,
    AdvisoryState,
    ConflictAdvisory,
    Location,
)
from deconflict_client.situations import REVISION, AnyRevision
from ingest.batch import Pair

log = logging.getLogger(__name__)


class StoreError(Exception):
    """The advisories can't be read or written; the message says what to do."""


STUCK = "its disk does not answer; check it"


class UnreadableAdvisoryError(StoreError):
    """One stored advisory can't be read."""


UNWRITABLE = (
    sqlite3.IntegrityError,
    sqlite3.DataError,
    sqlite3.InterfaceError,
    sqlite3.NotSupportedError,
    ArithmeticError,
    TypeError,
    ValueError,
    UnreadableAdvisoryError,
)
"""Errors of writing one revision that others don't have. Any other error is one of the file or its disk."""


OF_KIND = {
    None: "a.open = {open} AND a.kind NOT IN ('situation', 'advice')",
    SITUATION: "a.open = {open} AND a.kind = 'situation'",
}
"""Conditions of a listing by kind. That for situations names the kind, so that SQLite takes the index of situations."""

FIRST_SEQ = "(SELECT min(r.seq) FROM revisions AS r WHERE r.id = a.id)"
"""The number of the first revision of the advisory `a`."""


def last_seq(db: sqlite3.Connection) -> int:
    row = db.execute("SELECT seq FROM sqlite_sequence WHERE name = 'revisions'").fetchone()
    return int(row[0]) if row else 0


def stored_revision(db: sqlite3.Connection, advisory_id: str, revision: int) -> AnyRevision | None:
    row = db.execute(
        "SELECT document FROM revisions WHERE id = ? AND revision = ? ORDER BY seq LIMIT 1", (advisory_id, revision)
    ).fetchone()
    return revision_of(row[0]) if row else None


def open_at(db: sqlite3.Connection, now_s: float, limit: int = -1) -> list[AnyRevision]:
    """The newest revision by then of each advisory that was open and had changed in the `LOOK_BACK_S` before.

    The newest `limit` of them, ascending; all if it is negative.
    """
    rows = db.execute(
        "SELECT document FROM revisions WHERE json_extract(document, '$.state') <> ? AND seq IN "
        "(SELECT max(seq) FROM revisions WHERE updated_s BETWEEN ? AND ? GROUP BY id) ORDER BY seq DESC LIMIT ?",
        (AdvisoryState.CLEARED, now_s - LOOK_BACK_S, now_s, limit),
    )
    return readable(rows)[::-1]


def latest(db: sqlite3.Connection, wanted: ListingFilter, limit: int) -> list[AnyRevision]:
    """The newest revisions of what matches, newest first, at most `limit`; all if it is negative.

    What is open and what is cleared are two sorted selections, which SQLite merges: it sorts nothing, and reads what is
    newer than the last one that it returns.
    """
    of_kind = OF_KIND.get(wanted.kind, "a.open = {open} AND a.kind = :kind")
    selection = f"""SELECT document, a.seq AS seq FROM advisories AS a JOIN revisions AS r ON r.seq = a.seq
        WHERE {of_kind}
        AND (:situation_kind IS NULL OR document ->> '$.situation_kind' = :situation_kind)
        AND (:severity IS NULL OR document ->> '$.severity' = :severity)
        AND (:vendor IS NULL OR :vendor IN (SELECT vendor FROM parties AS p WHERE p.id = a.id))
        AND (:robot IS NULL OR :robot IN (SELECT robot FROM parties AS p WHERE p.id = a.id))"""  # noqa: S608 - constants
    selections = " UNION ALL ".join(selection.format(open=is_open) for is_open in OPEN_VALUES[wanted.state])
    rows = db.execute(f"{selections} ORDER BY seq DESC LIMIT :limit", {**asdict(wanted), "limit": limit}).fetchall()
    return readable((document,) for document, _ in rows)


def after(db: sqlite3.Connection, seq: int, kinds: Set[str]) -> Iterator[tuple[int, AnyRevision | None]]:
    """The numbers above `seq`, ascending, each with its revision; None in place of one of another kind."""
    rows = db.execute(
        "SELECT r.seq, CASE WHEN a.kind IN (SELECT value FROM json_each(?)) THEN document END "
        "FROM revisions AS r CROSS JOIN advisories AS a WHERE r.seq > ? AND a.id = r.id ORDER BY r.seq",
        (json.dumps(sorted(kinds)), seq),
    )
    return ((number, next(iter(readable([(document,)])), None) if document else None) for number, document in rows)


class StoredDocument(NamedTuple):
    """The newest revision of an advisory or a situation, as it is stored."""

    seq: int
    id: str
    kind: str
    text: str


def open_after(db: sqlite3.Connection, seq: int) -> Iterator[StoredDocument]:
    """What is open and whose newest revision has a number above `seq`, ascending."""
    rows = db.execute(
        "SELECT a.seq, a.id, a.kind, document FROM advisories AS a JOIN revisions AS r ON r.seq = a.seq "
        "WHERE a.open = 1 AND a.seq > ? ORDER BY a.seq",
        (seq,),
    )
    return (StoredDocument(*row) for row in rows)


def held_at(db: sqlite3.Connection, seq: int, kinds: Set[str]) -> list[tuple[str, str]]:
    """Kind and id of what a receiver that knows these kinds up to a number holds open."""
    return db.execute(
        f"""SELECT kind, id FROM advisories AS a WHERE (open = 1 OR (open = 0 AND seq > :seq))
        AND kind IN (SELECT value FROM json_each(:kinds)) AND {FIRST_SEQ} <= :seq""",  # noqa: S608 - a constant
        {"seq": seq, "kinds": json.dumps(sorted(kinds))},
    ).fetchall()


def encounters_after(db: sqlite3.Connection, pair: Pair, limit: int) -> list[tuple[Pair, int]]:
    """The highest encounter number of up to `limit` pairs that follow `pair`."""
    rows = db.execute(
        "SELECT robot_a, robot_b, ordinal FROM encounters WHERE (robot_a, robot_b) > (?, ?) "
        "ORDER BY robot_a, robot_b LIMIT ?",
        (*pair, limit),
    )
    return [((a, b), int(ordinal)) for a, b, ordinal in rows]


def raised_between(db: sqlite3.Connection, since_s: float, until_s: float) -> Iterator[Location]:
    """Where each advisory was that was raised between two times, if that is known."""
    rows = db.execute(
        "SELECT document ->> '$.location.datum', document ->> '$.location.x', document ->> '$.location.y' "
        "FROM revisions WHERE revision = 1 AND answers = 0 AND updated_s BETWEEN ? AND ? "
        "AND document ->> '$.kind' NOT IN ('situation', 'advice')",
        (since_s, until_s),
    )
    return (Location(datum=datum, x=x, y=y) for datum, x, y in rows if datum is not None)


def between(db: sqlite3.Connection, since_s: float, until_s: float) -> list[AnyRevision]:
    """Every revision decided after `since_s` and by `until_s`, ascending, without those that only add an answer."""
    rows = db.execute(
        "SELECT document FROM revisions WHERE answers = 0 AND updated_s > ? AND updated_s <= ? ORDER BY seq",
        (since_s, until_s),
    )
    return readable(rows)


def read_only(path: Path) -> AbstractContextManager[sqlite3.Connection]:
    """A connection that can't write. Raises `sqlite3.Error`."""
    return closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True))


def answers_of(db: sqlite3.Connection, advisory_id: str) -> tuple[int, Acknowledgement | None]:
    """How often an advisory was acknowledged, and the newest acknowledgement."""
    row = db.execute("SELECT answers, acknowledgement FROM advisories WHERE id = ?", (advisory_id,)).fetchone()
    count, newest = row or (0, None)
    return count, Acknowledgement.model_validate_json(newest) if newest else None


def numbered(db: sqlite3.Connection, advisory: AnyRevision, seq: int) -> AnyRevision:
    """A revision that is not stored yet with its own number, or else `seq`, and the newest answer to its advisory."""
    return advisory.model_copy(update={"seq": advisory.seq or seq, "acknowledgement": answers_of(db, advisory.id)[1]})


def write_revision(db: sqlite3.Connection, revision: AnyRevision) -> None:
    """Write a numbered revision, and what it adds to the burdens of vendors."""
    insert(db, revision, answers_of(db, revision.id)[0], revision.updated_at)
    db.executemany(
        """INSERT INTO burdens VALUES (?, ?)
        ON CONFLICT (vendor) DO UPDATE SET yielded_s = yielded_s + excluded.yielded_s""",
        list(revision.advised_wait_s.items()),
    )


def newest(db: sqlite3.Connection, advisory_id: str) -> AnyRevision | None:
    """The newest revision of an advisory."""
    row = db.execute(
        "SELECT document FROM advisories AS a JOIN revisions AS r ON r.seq = a.seq WHERE a.id = ?", (advisory_id,)
    ).fetchone()
    return revision_of(row[0]) if row else None


def write_answer(db: sqlite3.Connection, answered: AnyRevision) -> None:
    """Write a numbered revision that repeats the newest one, if the database has that, with an answer."""
    answer = answered.acknowledgement
    if answer is None:
        raise ValueError(f"{answered.id} has no answer")
    newest = answer.model_dump_json(), answered.id
    if db.execute("UPDATE advisories SET answers = answers + 1, acknowledgement = ? WHERE id = ?", newest).rowcount:
        insert(db, answered, answers_of(db, answered.id)[0], answer.at)
    else:
        write_known(db, answered)


def write_known(db: sqlite3.Connection, revision: AnyRevision) -> None:
    """Write a revision that another database has, with its answer, and without what came before it."""
    answer = revision.acknowledgement
    insert(db, revision, int(answer is not None), revision.updated_at)
    if answer:
        newest = answer.model_dump_json()
        db.execute("UPDATE advisories SET answers = 1, acknowledgement = ? WHERE id = ?", (newest, revision.id))


def write_one(db: sqlite3.Connection, revision: AnyRevision, answered: Container[int]) -> Exception | None:
    """Write a numbered revision, or an answer. If it can't be written, returns why, and only its number is used up."""
    failed: Exception | None = None
    db.execute("SAVEPOINT revision")
    try:
        (write_answer if revision.seq in answered else write_revision)(db, revision)
    except UNWRITABLE as error:
        failed = error
        db.execute("ROLLBACK TO revision")
        use_up_number(db, revision.seq)
    db.execute("RELEASE revision")
    return failed


def insert(db: sqlite3.Connection, advisory: AnyRevision, answers: int, at: datetime) -> None:
    db.execute(
        "INSERT INTO revisions (seq, id, revision, answers, updated_s, document) VALUES (?, ?, ?, ?, ?, ?)",
        (advisory.seq, advisory.id, advisory.revision, answers, at.timestamp(), advisory.model_dump_json()),
    )
    db.execute(
        """INSERT INTO advisories (id, revision, seq, open, updated_s, kind, vendors) VALUES (?, ?, ?, ?, ?, ?, ?)
        ON CONFLICT (id) DO UPDATE SET revision = excluded.revision, seq = excluded.seq, open = excluded.open,
            updated_s = excluded.updated_s, vendors = excluded.vendors
        WHERE excluded.revision >= revision""",
        (
            advisory.id,
            advisory.revision,
            advisory.seq,
            advisory.state is not AdvisoryState.CLEARED,
            advisory.updated_at.timestamp(),
            advisory.kind,
            "\n".join(sorted(set(advisory.vendors))),
        ),
    )
    parties = zip(advisory.robots, advisory.vendors, strict=True)
    db.executemany("INSERT OR IGNORE INTO parties VALUES (?, ?, ?)", [(advisory.id, *party) for party in parties])
    if isinstance(advisory, ConflictAdvisory):
        note_encounter(db, advisory.robots, advisory.encounter)


def note_encounter(db: sqlite3.Connection, pair: Pair, number: int) -> None:
    """A pair has had an encounter with this number."""
    db.execute(
        """INSERT INTO encounters VALUES (?, ?, ?)
        ON CONFLICT (robot_a, robot_b) DO UPDATE SET ordinal = excluded.ordinal WHERE excluded.ordinal > ordinal""",
        (*pair, number),
    )


def note_removed(db: sqlite3.Connection, numbers: Iterable[tuple[str, int]]) -> None:
    """Note that revisions up to a number may be gone, each with its kind."""
    db.executemany(
        "INSERT INTO removed VALUES (?, ?) ON CONFLICT (kind) DO UPDATE SET seq = max(seq, excluded.seq)", numbers
    )


def last_removed(db: sqlite3.Connection, kinds: Set[str]) -> int:
    """The highest number of a revision of these kinds that may be gone; 0 if none is."""
    (seq,) = db.execute(
        "SELECT max(seq) FROM removed WHERE kind IN (SELECT value FROM json_each(?))", (json.dumps(sorted(kinds)),)
    ).fetchone()
    return int(seq or 0)


def begin_after(db: sqlite3.Connection, seq: int) -> None:
    """Continue the numbers of another file after `seq`. Some of its revisions may be gone."""
    if seq > last_seq(db):
        use_up_number(db, seq)
    note_removed(db, ((kind, seq) for kind in EVERY_KIND))


def use_up_number(db: sqlite3.Connection, seq: int) -> None:
    """Have no later revision get a number."""
    db.execute("INSERT INTO revisions VALUES (?, '', 0, 0, 0, '')", (seq,))
    db.execute("DELETE FROM revisions WHERE seq = ?", (seq,))


def put_canary(db: sqlite3.Connection, document: str) -> None:
    """Replace the stored canary. Its table is no part of the format: any release may do without."""
    db.execute("CREATE TABLE IF NOT EXISTS canary (number INTEGER PRIMARY KEY, document TEXT NOT NULL)")
    db.execute("INSERT OR REPLACE INTO canary VALUES (1, ?)", (document,))


def position(db: sqlite3.Connection, outlet: str) -> int | None:
    row = db.execute("SELECT seq FROM positions WHERE outlet = ?", (outlet,)).fetchone()
    return int(row[0]) if row else None


def positions(db: sqlite3.Connection) -> dict[str, int]:
    """The stored position of each outlet."""
    return dict(db.execute("SELECT outlet, seq FROM positions").fetchall())


def put_positions(db: sqlite3.Connection, positions: Mapping[str, int]) -> None:
    """Store positions of outlets. A position never goes back."""
    db.executemany(
        "INSERT INTO positions VALUES (?, ?) ON CONFLICT (outlet) DO UPDATE SET seq = max(seq, excluded.seq)",
        list(positions.items()),
    )


def readable(rows: Iterable[tuple[str]]) -> list[AnyRevision]:
    """The revisions of documents, without those that can't be read, which are logged: they hold up no other."""
    revisions = []
    for (document,) in rows:
        try:
            revisions.append(revision_of(document))
        except UnreadableAdvisoryError as error:
            log.error("a stored revision is left out: %s; it begins with %.80s", error, document)
    return revisions


def revision_of(document: str) -> AnyRevision:
    try:
        return REVISION.validate_json(document)
    except ValueError as error:
        raise UnreadableAdvisoryError(
            f"this release can't read a stored advisory ({error}): run the release that wrote it, "
            "or move the file aside to start a new one"
        ) from error
