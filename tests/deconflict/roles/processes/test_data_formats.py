"""What the service does with each file of its data directory that is damaged, or of an older or a newer release."""

import asyncio
import json
import shutil
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

from benchmarks.faulty_files.faults import held_alone
from deconflict.operator.blackbox.archive import FOLDER, REGISTER, Archive
from deconflict.operator.blackbox.keeper import PENDING
from deconflict.operator.store.recovery.reserved_numbers import FILE_NAME as RESERVED
from deconflict.roles.processes.backup_command import backed_up
from deconflict.roles.processes.data_formats import FILES, refuse_newer
from deconflict.runtime.data_lock import DataDirectoryError
from deconflict.runtime.learned_state import HEAD
from ingest.recording.replaced_file import ASIDE
from tests.deconflict.operator.blackbox.made_floor import put
from tests.deconflict.roles.made_service import CROSSING, drive, free_ports, running
from tests.helpers.patience import PATIENCE_S

DATABASES = ("advisories.db", "losses.db", "robots.db")
WRITTEN = (*FILES, RESERVED, f"{FOLDER}/{REGISTER}", f"{FOLDER}/{PENDING}")
"""The files that are not of lines that are left out one by one."""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The data of a service that has run, with every file that one writes."""
    data = tmp_path_factory.mktemp("made")

    async def run() -> None:
        async with running(data) as service:
            await drive(service.robots_url, CROSSING, 6)
            await service.until("/advisories?state=all", lambda answer: bool(answer["advisories"]))

    asyncio.run(run())
    (data / FOLDER).mkdir(exist_ok=True)
    put(Archive(data / FOLDER), 1)
    (data / FOLDER / PENDING).write_text(json.dumps([["a", "b", 1_790_000_000.0, ["Alder", "Corvid"]]]))
    assert all((data / name).is_file() for name in WRITTEN)
    return data


@pytest.fixture
def data(made: Path, tmp_path: Path) -> Path:
    """A copy of it."""
    return Path(shutil.copytree(made, tmp_path / "data"))


def make_newer(path: Path) -> None:
    """State a format that no release has yet."""
    if path.suffix == ".db":
        with closing(sqlite3.connect(path)) as db:
            db.execute("PRAGMA user_version = 99")
    elif path.suffix == ".json":
        path.write_text(json.dumps(json.loads(path.read_text()) | {"format": 99}))
    else:
        with np.load(path) as file:
            arrays = {name: file[name] for name in file.files}
        head = json.loads(arrays[HEAD].tobytes()) | {"format": 99}
        arrays[HEAD] = np.frombuffer(json.dumps(head).encode(), np.uint8)
        out = BytesIO()
        np.savez(out, **arrays)
        path.write_bytes(out.getvalue())


@pytest.mark.parametrize("name", FILES)
def test_a_service_with_a_file_of_a_newer_release_ends_with_a_sentence_and_leaves_it_alone(
    data: Path, name: str
) -> None:
    make_newer(data / name)
    before = {path: path.read_bytes() for path in data.rglob("*") if path.is_file()}
    robots_port, operator_port = free_ports(2)
    ports = ["--robots-port", str(robots_port), "--operator-port", str(operator_port)]
    command = [sys.executable, "-m", "deconflict", "serve", "--data", str(data), *ports]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert ended.returncode == 2
    (sentence,) = [line for line in ended.stderr.splitlines() if line.startswith("deconflict:")]
    assert f"{data / name} has format 99 and this release reads up to {FILES[name][1]}" in sentence
    assert {path: path.read_bytes() for path in before} == before


async def test_an_older_release_goes_back_to_the_copy_from_before_an_upgrade(data: Path, tmp_path: Path) -> None:
    """Here this release is the older one: the newer one has written each file in a form that it can't read."""
    before = tmp_path / "before"
    backed_up(data, before)
    async with running(data) as service:
        then = await service.until("/advisories?state=all", lambda answer: bool(answer["advisories"]))
    for name in FILES:
        make_newer(data / name)
        assert (before / name).is_file()
    with pytest.raises(DataDirectoryError, match="or start with the backup from before the upgrade"):
        refuse_newer(data)
    refuse_newer(before)
    async with running(before) as service:
        now = await service.until("/advisories?state=all", lambda answer: bool(answer["advisories"]))
    assert {each["id"] for each in now["advisories"]} == {each["id"] for each in then["advisories"]}


def test_a_newer_format_that_is_still_in_the_journal_is_seen(data: Path) -> None:
    for name in DATABASES[:2]:
        with closing(sqlite3.connect(data / name)) as db:
            db.execute("PRAGMA user_version = 99")
            with pytest.raises(DataDirectoryError, match="has format 99"):
                refuse_newer(data)
            db.execute("PRAGMA user_version = 1")


@pytest.mark.parametrize("name", DATABASES)
def test_a_newer_format_is_seen_while_another_program_keeps_the_database_for_itself(data: Path, name: str) -> None:
    with closing(sqlite3.connect(data / name)) as db:
        db.execute("PRAGMA journal_mode = WAL")
        db.execute("PRAGMA user_version = 99")
    with held_alone(data / name), pytest.raises(DataDirectoryError, match=f"{name} has format 99"):
        refuse_newer(data)


def truncated(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2 - 3])


def nearly_whole(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-1])


def garbage(path: Path) -> None:
    path.write_bytes(np.random.default_rng(3).bytes(5000))


def of_another_program(path: Path) -> None:
    """A file of its kind in which another program keeps something else."""
    if path.suffix == ".db":
        path.unlink()
        with closing(sqlite3.connect(path)) as db:
            db.execute("CREATE TABLE revisions (colour TEXT)")
            db.execute("CREATE TABLE messages (colour TEXT)")
            db.execute("CREATE TABLE losses (colour TEXT)")
            db.execute(f"PRAGMA user_version = {FILES[path.name][1]}")
    elif path.suffix == ".npz":
        with path.open("wb") as file:
            np.savez(file, colours=np.zeros(3))
    else:
        path.write_text('{"colour": [1, 2, 3], "format": 1}\n')


def with_wild_values(path: Path) -> None:
    """Of the right form, with values of other types or beyond all sense."""
    if path.name == "robots.db":
        with closing(sqlite3.connect(path)) as db:
            db.execute("UPDATE messages SET raw = 7, arrival_s = 'soon', uuid = NULL")
            db.commit()
    elif path.suffix == ".db":
        with closing(sqlite3.connect(path)) as db:
            db.execute("PRAGMA user_version = 0")
    elif path.name == RESERVED:
        path.write_text(f"{10**30}\n")
    elif path.name == PENDING:
        path.write_text('[["a", "b", 1e300], ["a", "b", 3.0, "Alder"]]')
    elif path.name == REGISTER:
        path.write_bytes(b'{"file": "a", "bytes": 1, "sha256": "b"}\n\xff\xfe\n[[[\n' + path.read_bytes())
    elif path.name == "owners.json":
        path.write_text('{"format": 1, "configured": 3, "owners": [["a", {}, 2]]}')


@pytest.mark.parametrize(
    "damage",
    [truncated, nearly_whole, garbage, of_another_program, with_wild_values],
    ids=lambda damage: damage.__name__,
)
async def test_whatever_the_files_are_like_the_service_starts_warns_and_keeps_what_it_cannot_read(
    data: Path, damage: Callable[[Path], None], caplog: pytest.LogCaptureFixture
) -> None:
    for name in WRITTEN:
        damage(data / name)
    damaged = {name: (data / name).read_bytes() for name in WRITTEN}
    refuse_newer(data)
    async with running(data) as service:
        driving = asyncio.create_task(drive(service.robots_url, CROSSING, 8))
        await service.until("/advisories", lambda answer: bool(answer["advisories"]))
        await service.until("/losses", lambda answer: "total" in answer)  # the ledger is opened beside all else
        await driving
    for name, content in damaged.items():
        _assert_is_said(data / name, content, damage, caplog.text)


def _assert_is_said(path: Path, content: bytes, damage: Callable[[Path], None], log: str) -> None:
    """The file was damaged so that it is set aside whole: it is beside the new one, and the log names it."""
    if damage is nearly_whole and path.name in (RESERVED, REGISTER, *DATABASES):
        return  # lines less their last end; and a database may lack the end of a page that nothing uses
    if damage is with_wild_values and path.name in (*FILES,):
        return  # read as far as it goes
    assert path.name in log, path.name
    if path.name == REGISTER:
        return  # it is kept before it is written
    beside = [other for other in path.parent.iterdir() if other.name != path.name and path.stem in other.name]
    asides = {other.name: other.read_bytes() for other in beside}
    own = content[4096:] if path.suffix == ".db" else content  # salvage gives a database another first page
    assert any(own in kept for kept in asides.values()), (path.name, {name: len(kept) for name, kept in asides.items()})


async def test_register_lines_that_cannot_be_read_are_kept_and_the_others_stay(data: Path) -> None:
    register = data / FOLDER / REGISTER
    with_wild_values(register)
    content = register.read_bytes()
    archive = Archive(data / FOLDER)
    assert len(archive.boxes()) == 1
    put(archive, 2)
    assert len(archive.boxes()) == 2
    assert register.with_name(REGISTER + ASIDE).read_bytes() == content
    assert len(register.read_bytes().splitlines()) == 2


def test_a_wild_format_is_damage_and_no_newer_release(tmp_path: Path) -> None:
    for name in DATABASES:
        (tmp_path / name).write_bytes(b"SQLite format 3\0" + b"i_]S" * 2000)
    refuse_newer(tmp_path)
