"""Something else has the place of a file of the data directory: no role waits, fails or replaces it."""

import asyncio
import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

import pytest

from benchmarks.faulty_files.faults import Fault, blocked, device, huge, pipe, socket_file
from deconflict.operator.blackbox.archive import FOLDER, REGISTER, Archive
from deconflict.operator.blackbox.keeper import PENDING, Keeper
from deconflict.operator.ledger.optional_ledger import OptionalLedger
from deconflict.operator.store.learned_file import FILE_NAME as LEARNED
from deconflict.operator.store.learned_file import LearnedFile
from deconflict.operator.store.optional.optional_store import OptionalStore
from deconflict.operator.store.recovery.reserved_numbers import FILE_NAME as RESERVED
from deconflict.operator.store.recovery.reserved_numbers import ReservedNumbers
from deconflict.roles import operator_sources
from deconflict.roles.health import file_health, refusal_health
from deconflict.roles.processes.data_formats import refuse_newer
from deconflict.runtime.data_lock import locked
from deconflict.settings.site import LossSettings, Site
from ingest.fleet.owners.owner_file import OwnerFile
from ingest.fleet.recovery.kept_messages import KeptMessages
from ingest.measures.measures import Measures
from ingest.plain_files import UnfitFileError
from ingest.recording.clock_notes import KnownTime
from ingest.recording.log_reader import LogReader
from ingest.recording.log_rotation import RotatingLog
from ingest.settings import RecorderSettings
from tests.deconflict.roles.made_service import CROSSING, Running, drive, running
from tests.helpers.patience import PATIENCE_S
from tests.ingest.fleet.made_fleet import fleet

pytestmark = pytest.mark.usefixtures("ends_in_time")

WORDS: dict[Fault, str] = {
    pipe: "is a pipe where",
    device: "is a device where",
    blocked: "is a directory where",
    socket_file: "is a socket where",
    huge: "are read; move",
}
SEGMENT, LOCK = "log/log-1.jsonl", ".face.lock"
READ_IN_PARTS = ("advisories.db", "losses.db", "robots.db", SEGMENT)
"""These may be large."""


def use_store(data: Path) -> str:
    with closing(OptionalStore(data)) as store:
        store.attach()
        return str(store.outage)


def use_ledger(data: Path) -> str:
    ledger = OptionalLedger(data, LossSettings(), Measures())
    ledger.store()
    return str(ledger.outage)


def use_robots(data: Path) -> None:
    of = fleet()
    kept = KeptMessages(data, of, of.measures)
    assert kept.read(0.0) == []
    kept.write(0.0, 0.0)


def use_owners(data: Path) -> None:
    of = fleet()
    owners = OwnerFile(data, of.owners, of.measures)
    of.owners.register.changes += 1
    owners.write()


def use_learned(data: Path) -> None:
    file = LearnedFile(data, Measures())
    assert file.read() == b""
    file.write(b"new")


def use_reserved(data: Path) -> None:
    numbers = ReservedNumbers(data)
    numbers.reserve(numbers.last + 1)
    for has_unstored in (True, False):
        numbers.has_unstored = not has_unstored
        with suppress(OSError):
            numbers.note_unstored(has_unstored=has_unstored)
    numbers.renew_if_removed()


def use_pending(data: Path) -> None:
    with closing(OptionalStore(data)) as store:
        keeper = Keeper(Site(), data, store, Measures())
        keeper._read_pending()
        keeper.write_pending()


def use_register(data: Path) -> str:
    with pytest.raises(UnfitFileError) as raised:
        Archive(data / FOLDER).boxes()
    return str(raised.value)


def use_log(data: Path) -> None:
    assert list(LogReader().read([data / "log"])) == []
    if not (data / SEGMENT).is_symlink():
        os.utime(data / SEGMENT, (1.0, 1.0))  # so old that a file would be removed
    times = map(float, count(10**9))
    log = RotatingLog(RecorderSettings(segment_bytes=1), data / "log", times.__next__, lambda: KnownTime(1e9, 1e9))
    for _ in range(4):
        log.write(b"{}\n")
    log.packer.close(10.0)
    log.close()
    assert log.failing is None


def use_lock(data: Path) -> None:
    with locked(data, ["face"]):
        pass


USES: dict[str, Callable[[Path], str | None]] = {
    "advisories.db": use_store,
    "losses.db": use_ledger,
    "robots.db": use_robots,
    "owners.json": use_owners,
    LEARNED: use_learned,
    RESERVED: use_reserved,
    f"{FOLDER}/{PENDING}": use_pending,
    f"{FOLDER}/{REGISTER}": use_register,
    SEGMENT: use_log,
    LOCK: use_lock,
}


@pytest.fixture(autouse=True)
def often_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(file_health, "REMOVED_SHOWN_S", 3.0)
    monkeypatch.setattr(refusal_health, "SHOWN_S", 3.0)
    monkeypatch.setattr(operator_sources, "REFUSALS_EVERY_S", 0.2)
    monkeypatch.setattr(file_health, "LOOK_EVERY_S", 0.2)
    monkeypatch.setattr("deconflict.roles.engine_role.LEARNED_EVERY_S", 0.5)


@pytest.fixture
def data(tmp_path: Path) -> Path:
    for folder in ("log", FOLDER):
        (tmp_path / folder).mkdir()
    return tmp_path


CASES = [(file, fault) for file in USES for fault in WORDS if fault is not huge or file not in READ_IN_PARTS]


@pytest.mark.parametrize(("file", "fault"), CASES, ids=lambda part: getattr(part, "__name__", part))
def test_no_use_of_a_file_opens_or_replaces_what_is_no_file(
    data: Path, file: str, fault: Fault, caplog: pytest.LogCaptureFixture
) -> None:
    with fault(data / file):
        before = (data / file).lstat()
        refuse_newer(data)
        reported = USES[file](data)
        assert (data / file).lstat().st_ino == before.st_ino
        assert file == SEGMENT or WORDS[fault] in f"{reported} {caplog.text}"
        assert "free some space" not in caplog.text


@contextmanager
def all_unfit(data: Path, fault: Fault) -> Iterator[list[str]]:
    """Every file that can be so is; the names of those of which health speaks."""
    files = [file for file, possible in CASES if possible is fault]
    with ExitStack() as faults:
        for file in files:
            faults.enter_context(fault(data / file))
        yield files


async def until_health(service: Running, wanted: Callable[[dict[str, Any]], bool]) -> None:
    async with asyncio.timeout(PATIENCE_S):
        while not wanted((await service.get("/healthz")).json()):
            await asyncio.sleep(0.1)


def is_said(words: str, health: dict[str, Any]) -> bool:
    return words in health["files"].get("reason", "")


@pytest.mark.parametrize("fault", WORDS, ids=lambda fault: fault.__name__)
async def test_a_service_starts_and_warns_without_any_file_says_each_and_uses_them_later(
    data: Path, fault: Fault
) -> None:
    with ExitStack() as until_repair:
        files = until_repair.enter_context(all_unfit(data, fault))
        with locked(data, ["face"]):
            refuse_newer(data)
            async with running(data) as service:
                driving = asyncio.create_task(drive(service.robots_url, CROSSING, 8))
                await service.until("/advisories", lambda answer: bool(answer["advisories"]))
                for file in files:
                    words = f"{data / file} has" if fault is huge else f"{data / file} {WORDS[fault]}"
                    await until_health(service, partial(is_said, words))
                await driving
                until_repair.close()
                await until_health(service, lambda health: health["files"]["status"] == "ok")
    assert all((data / file).is_file() for file in ("advisories.db", "robots.db", "owners.json", LEARNED))
