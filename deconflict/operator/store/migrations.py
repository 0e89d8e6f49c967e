"""The SQL statements that create the advisory database, and that upgrade it from each format to the next."""

UPGRADES: tuple[tuple[str, ...], ...] = (
    (
        """CREATE TABLE revisions (
            seq INTEGER PRIMARY KEY AUTOINCREMENT,
            id TEXT NOT NULL,
            revision INTEGER NOT NULL,
            document TEXT NOT NULL,
            UNIQUE (id, revision))""",
        """CREATE TABLE advisories (
            id TEXT PRIMARY KEY,
            revision INTEGER NOT NULL,
            seq INTEGER NOT NULL,
            open INTEGER NOT NULL,
            updated_s REAL NOT NULL,
            kind TEXT NOT NULL,
            robot_a TEXT NOT NULL,
            robot_b TEXT NOT NULL,
            vendor_a TEXT NOT NULL,
            vendor_b TEXT NOT NULL) WITHOUT ROWID""",
        "CREATE INDEX advisories_by_seq ON advisories (open, seq)",
        "CREATE INDEX advisories_by_age ON advisories (open, updated_s)",
        """CREATE TABLE encounters (
            robot_a TEXT NOT NULL,
            robot_b TEXT NOT NULL,
            ordinal INTEGER NOT NULL,
            PRIMARY KEY (robot_a, robot_b)) WITHOUT ROWID""",
    ),
    (
        """CREATE TABLE parties (
            id TEXT NOT NULL,
            robot TEXT NOT NULL,
            vendor TEXT NOT NULL,
            PRIMARY KEY (id, robot)) WITHOUT ROWID""",
        """INSERT OR IGNORE INTO parties
            SELECT id, robot_a, vendor_a FROM advisories UNION ALL SELECT id, robot_b, vendor_b FROM advisories""",
        "ALTER TABLE advisories DROP COLUMN robot_a",
        "ALTER TABLE advisories DROP COLUMN robot_b",
        "ALTER TABLE advisories DROP COLUMN vendor_a",
        "ALTER TABLE advisories DROP COLUMN vendor_b",
    ),
    (
        """CREATE TABLE renewed (
            seq INTEGER PRIMARY KEY AUTOINCREMENT,
            id TEXT NOT NULL,
            revision INTEGER NOT NULL,
            answers INTEGER NOT NULL,
            updated_s REAL NOT NULL,
            document TEXT NOT NULL,
            UNIQUE (id, revision, answers))""",
        """INSERT INTO renewed SELECT seq, id, revision, 0,
            (julianday(json_extract(document, '$.updated_at')) - 2440587.5) * 86400.0, document FROM revisions""",
        "DELETE FROM sqlite_sequence WHERE name = 'renewed'",
        "UPDATE sqlite_sequence SET name = 'renewed' WHERE name = 'revisions'",
        "DROP TABLE revisions",
        "ALTER TABLE renewed RENAME TO revisions",
        "CREATE INDEX revisions_by_age ON revisions (updated_s)",
        "ALTER TABLE advisories ADD COLUMN acknowledgement TEXT",
        "ALTER TABLE advisories ADD COLUMN answers INTEGER NOT NULL DEFAULT 0",
    ),
    ("CREATE TABLE positions (outlet TEXT PRIMARY KEY, seq INTEGER NOT NULL) WITHOUT ROWID",),
    ("CREATE TABLE burdens (vendor TEXT PRIMARY KEY, yielded_s REAL NOT NULL) WITHOUT ROWID",),
    ("CREATE INDEX situations_by_seq ON advisories (seq) WHERE kind = 'situation'",),
    (
        "ALTER TABLE advisories ADD COLUMN vendors TEXT NOT NULL DEFAULT ''",
        "CREATE INDEX advisories_by_vendors ON advisories (open, vendors, updated_s, revision)",
    ),
    (
        "DROP INDEX advisories_by_age",
        "DROP INDEX advisories_by_vendors",
        "DROP INDEX situations_by_seq",
        "CREATE INDEX situations_by_seq ON advisories (open, seq) WHERE kind = 'situation'",
        "CREATE INDEX cleared_by_age ON advisories (updated_s) WHERE open = 0",
        "CREATE INDEX cleared_by_vendors ON advisories (vendors, updated_s, revision) WHERE open = 0",
    ),
    ("CREATE TABLE removed (kind TEXT PRIMARY KEY, seq INTEGER NOT NULL) WITHOUT ROWID",),
)
"""Item v holds the statements that take a file from version v (`PRAGMA user_version`) to version v + 1."""

TABLES = {"revisions", "advisories", "encounters", "parties", "positions", "burdens", "removed"}
"""Of a file of the newest version."""
