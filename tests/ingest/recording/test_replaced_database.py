"""A damaged database is renamed while another part of the service looks at it."""

import sqlite3
import threading
from contextlib import closing
from pathlib import Path

import pytest

from ingest.recording import replaced_file
from ingest.recording.file_faults import FileKind, file_fault
from ingest.recording.replaced_file import names_held, set_database_aside


def written(path: Path) -> sqlite3.Connection:
    db = sqlite3.connect(path, isolation_level=None)
    db.execute("PRAGMA journal_mode = WAL")
    db.execute("CREATE TABLE IF NOT EXISTS losses (lost_s REAL)")
    db.execute("INSERT INTO losses VALUES (1.0)")
    return db


def test_a_database_is_renamed_with_what_is_beside_it_once_nobody_looks_at_it(tmp_path: Path) -> None:
    path, aside = tmp_path / "losses.db", tmp_path / "aside.db"
    with closing(written(path)):
        renaming = threading.Thread(target=set_database_aside, args=(path, aside))
        with names_held(tmp_path) as is_held:
            renaming.start()
            renaming.join(0.1)
            assert (is_held, renaming.is_alive(), path.exists()) == (True, True, True)
        renaming.join()
        assert {each.name for each in tmp_path.iterdir()} == {"aside.db", "aside.db-wal", "aside.db-shm"}


def test_a_look_waits_while_a_database_is_renamed_and_goes_on_after_a_while(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "losses.db"
    written(path).close()
    monkeypatch.setattr(replaced_file, "HELD_S", 0.1)
    with names_held(tmp_path), names_held(tmp_path) as is_held_twice:
        assert (is_held_twice, file_fault(path, FileKind.DATABASE)) == (False, None)
    looking = threading.Thread(target=file_fault, args=(path, FileKind.DATABASE))
    monkeypatch.setattr(replaced_file, "HELD_S", 60.0)
    with names_held(tmp_path):
        looking.start()
        looking.join(0.1)
        assert looking.is_alive()
    looking.join()
