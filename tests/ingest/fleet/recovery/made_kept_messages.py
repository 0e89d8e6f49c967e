"""Identity reports that are kept over a restart, and how to read them."""

import sqlite3
from contextlib import closing
from pathlib import Path

from ingest.fleet.fleet import Fleet
from ingest.fleet.recovery.kept_messages import KeptMessages
from ingest.fleet.recovery.kept_rows import FILE_NAME
from ingest.port.connection import Connection
from ingest.settings import Vendor

ALDER = Vendor(name="Alder", names_as_uuid=True)
BASALT = Vendor(name="Basalt")
FROM_ALDER, FROM_BASALT = Connection(1, vendor="Alder"), Connection(2, vendor="Basalt")
LARGE = {"x": 2.0, "y": 1.0, "z": 0.4}


def kept_of(of: Fleet, directory: Path) -> KeptMessages:
    return KeptMessages(directory, of, of.measures)


def identified(of: Fleet) -> dict[str, tuple[str, str, str, tuple[float, float, float]]]:
    """By UUID: vendor, name, language and size."""
    return {
        uuid: (each.vendor, each.name, each.language, each.identity.envelope_m)
        for uuid, each in of.robots.items()
        if each.identity
    }


def rows(directory: Path) -> dict[str, bytes]:
    """By UUID, the identity reports in the file."""
    with closing(sqlite3.connect(directory / FILE_NAME)) as db:
        return dict(db.execute("SELECT uuid, raw FROM messages WHERE kind = 'identity'").fetchall())
