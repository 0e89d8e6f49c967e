"""The SQL statements that create the ledger, and that upgrade it from each format to the next."""

import sqlite3

UPGRADES: tuple[tuple[str, ...], ...] = (
    (
        """CREATE TABLE IF NOT EXISTS losses (
            hour_s INTEGER, vendor TEXT, model TEXT, by_vendor TEXT, root_vendor TEXT, kind TEXT, floor TEXT,
            place TEXT, cell_x INTEGER, cell_y INTEGER, lost_s REAL, sure_s REAL, losses INTEGER,
            PRIMARY KEY (hour_s, vendor, model, by_vendor, root_vendor, kind, floor, place, cell_x, cell_y)
        ) WITHOUT ROWID""",
        "CREATE TABLE IF NOT EXISTS parcels (sender TEXT PRIMARY KEY, number INTEGER) WITHOUT ROWID",
    ),
    (
        "ALTER TABLE losses ADD COLUMN warned_s REAL NOT NULL DEFAULT 0.0",
        "ALTER TABLE losses ADD COLUMN advised_s REAL NOT NULL DEFAULT 0.0",
        "ALTER TABLE losses ADD COLUMN heeded_s REAL NOT NULL DEFAULT 0.0",
    ),
    (
        "ALTER TABLE losses ADD COLUMN over_usual_s REAL NOT NULL DEFAULT 0.0",
        "UPDATE losses SET over_usual_s = lost_s",
    ),
    (
        "CREATE TABLE begun (at_s REAL)",
        "INSERT INTO begun SELECT hour_s FROM losses ORDER BY hour_s LIMIT 1",
    ),
    (
        "ALTER TABLE losses ADD COLUMN refusals INTEGER NOT NULL DEFAULT 0",
        "ALTER TABLE losses ADD COLUMN refused_s REAL NOT NULL DEFAULT 0.0",
        "ALTER TABLE losses ADD COLUMN unable INTEGER NOT NULL DEFAULT 0",
        "ALTER TABLE losses ADD COLUMN unable_s REAL NOT NULL DEFAULT 0.0",
    ),
)
"""Item v holds the statements that take a file from version v (`PRAGMA user_version`) to version v + 1. The first
ledgers have version 0."""


TABLES = ("losses", "parcels", "begun")
"""Of a file of the newest version."""


def upgrade(db: sqlite3.Connection) -> None:
    """Create the tables, or bring them to the newest format. Raises `sqlite3.OperationalError` if a newer release wrote
    the file, and `sqlite3.DatabaseError` if the tables are not those of the format that it states."""
    try:
        _upgrade(db)
        for table in TABLES:
            db.execute(f"SELECT * FROM {table} LIMIT 1").fetchone()  # noqa: S608 - constants
    except sqlite3.OperationalError as error:
        if getattr(error, "sqlite_errorname", "") == "SQLITE_ERROR":
            raise sqlite3.DatabaseError(f"its tables are not those of its format: {error}") from error
        raise


def _upgrade(db: sqlite3.Connection) -> None:
    with db:
        db.execute("BEGIN IMMEDIATE")
        (version,) = db.execute("PRAGMA user_version").fetchone()
        if version > len(UPGRADES):
            raise sqlite3.OperationalError(
                f"it has format {version} and this release reads up to {len(UPGRADES)}: "
                "run the newer release that wrote it, or choose another directory"
            )
        for statement in (statement for step in UPGRADES[version:] for statement in step):
            db.execute(statement)
        db.execute(f"PRAGMA user_version = {len(UPGRADES)}")
