"""A service whose files can't be used, at its start or while it runs: people are warned, and health says what is wrong.

`python -m benchmarks.faulty_files` drills every file with every fault, in a service of several processes.
"""

import asyncio
import json
import os
import shutil
import time
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AbstractContextManager, asynccontextmanager, closing
from pathlib import Path
from typing import Any

import pytest
from websockets.asyncio.client import connect

from benchmarks.faulty_files.faults import (
    blocked,
    disk_at,
    full_disk,
    held_alone,
    locked,
    missing,
    missing_disk,
    read_only_disk,
    remove,
)
from deconflict.operator.store.recovery.reserved_numbers import epoch
from deconflict.operator.store.store import Store
from deconflict.roles import operator_sources
from deconflict.roles.health import file_health, refusal_health
from deconflict.runtime.data_lock import DataDirectoryError, create_data_directory
from deconflict.runtime.data_lock import locked as locked_directory
from tests.deconflict.roles.made_service import CROSSING, Course, Running, Served, drive, running
from tests.helpers.patience import PATIENCE_S
from tests.helpers.saying import robot

LIKE_ANY_USER = ["setpriv", "--bounding-set=-dac_override,-dac_read_search"] if os.geteuid() == 0 else []
"""Starts a program for which the rights of files hold, also if the tests run as root."""
Harm = Callable[[Path], AbstractContextManager[None]]


def aside(course: Course) -> Course:
    """The same course, far from the robots of before."""
    return lambda t_s: (course(t_s)[0], course(t_s)[1] + 80.0, course(t_s)[2])


OTHERS = {name.replace("1", "2"): aside(course) for name, course in CROSSING.items()}


@pytest.fixture(autouse=True)
def shortly_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(file_health, "REMOVED_SHOWN_S", 3.0)
    monkeypatch.setattr(file_health, "LOOK_EVERY_S", 0.2)
    monkeypatch.setattr(refusal_health, "SHOWN_S", 3.0)
    monkeypatch.setattr(operator_sources, "REFUSALS_EVERY_S", 0.2)


@pytest.fixture(scope="session")
def left(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a service has left that has warned."""
    path = tmp_path_factory.mktemp("left") / "data"

    async def leave() -> None:
        async with running(path) as service:
            await raised(service, CROSSING)

    asyncio.run(leave())
    (path / "blackbox").mkdir(exist_ok=True)
    return path


@pytest.fixture
def data(tmp_path: Path, left: Path) -> Path:
    return Path(shutil.copytree(left, tmp_path / "data"))


@pytest.fixture
def disk(tmp_path: Path, data: Path) -> Iterator[Path]:
    """A disk of its own with the same data."""
    try:
        with disk_at(tmp_path / "disk", 16) as disk:
            shutil.copytree(data, disk, dirs_exist_ok=True)
            yield disk
    except PermissionError:
        pytest.skip("may not mount a disk")


async def raised(service: Running, courses: dict[str, Course]) -> dict[str, Any]:
    """The first revision of the advisory on two robots that meet, as a subscriber receives it."""
    async with connect(f"ws://{service.face}/advisories/stream") as stream, driving(service, courses):
        async with asyncio.timeout(PATIENCE_S):
            while True:
                revision: dict[str, Any] = json.loads(await stream.recv())
                if set(revision["robots"]) == {robot(name) for name in courses}:
                    return revision


@asynccontextmanager
async def driving(service: Running, courses: dict[str, Course]) -> AsyncIterator[None]:
    task = asyncio.create_task(drive(service.robots_url, courses, 120))
    try:
        yield
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


async def sick(service: Running, words: str) -> Any:
    """The health once it says so."""
    return await service.health(lambda health: words in str(health) and health["status"] == "degraded")


def numbers(directory: Path, advisory_id: str = "") -> list[int]:
    """Of all stored revisions, or of those of an advisory."""
    with closing(Store(directory)) as store:
        return [each.seq for each in (store.get(advisory_id) if advisory_id else store.after(0, -1))]


AT_START: list[tuple[str, Harm, str]] = [
    ("advisories.db", held_alone, "locked by another program"),
    ("advisories.db", blocked, "in memory"),
    ("losses.db", held_alone, "locked by another program"),
    ("robots.db", held_alone, "locked by another program"),
    ("log", blocked, "a file where a directory is expected"),
]


@pytest.mark.parametrize(("file", "harm", "words"), AT_START, ids=lambda part: getattr(part, "__name__", part))
async def test_a_service_starts_and_warns_without_a_file_and_uses_it_later(
    data: Path, file: str, harm: Harm, words: str
) -> None:
    fault = harm(data / file)
    fault.__enter__()
    async with running(data) as service:
        await sick(service, words)
        first = await raised(service, OTHERS)
        listed = await service.until("/advisories?state=all", lambda answer: answer["advisories"])
        assert first["id"] in {each["id"] for each in listed["advisories"]}
        fault.__exit__(None, None, None)
        await service.until("/healthz", lambda health: health["status"] == "ok")
        answer = (await service.get(f"/advisories/{first['id']}")).json()
        assert answer["advisories"][0]["seq"] == first["seq"]
    assert first["seq"] in numbers(data, first["id"])


@pytest.mark.parametrize("harm", [full_disk, read_only_disk, missing_disk])
async def test_a_service_starts_and_warns_without_its_disk_and_uses_it_later(disk: Path, harm: Harm) -> None:
    directory = disk if harm is not missing_disk else disk / "data"
    if harm is missing_disk:
        shutil.copytree(disk, directory, ignore=lambda *_: ["data"])
    before = numbers(directory)
    fault = harm(directory)
    fault.__enter__()
    async with running(directory) as service:
        if harm is not missing_disk:
            await sick(service, "in memory")
        first = await raised(service, OTHERS)
        fault.__exit__(None, None, None)
        await service.until("/healthz", lambda health: health["status"] == "ok")
    after = numbers(directory)
    assert after[: len(before)] == before
    assert first["seq"] > before[-1]


@pytest.mark.parametrize("file", ["advisories.db", "losses.db", "robots.db", "log"])
async def test_a_service_goes_on_without_a_file_that_is_removed_while_it_runs(
    data: Path, file: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with running(data) as service:
        await service.until("/healthz", lambda health: health["status"] == "ok")
        with missing(data / file), monkeypatch.context() as until_seen:
            until_seen.setattr(file_health, "REMOVED_SHOWN_S", PATIENCE_S)
            await sick(service, "removed")
            first = await raised(service, OTHERS)
        await service.until("/healthz", lambda health: health["status"] == "ok")
    assert (data / file).exists()
    assert first["seq"] in numbers(data, first["id"])


async def test_health_says_that_the_database_was_lost_and_a_new_epoch_begins(data: Path) -> None:
    remove(data / "advisories.db")
    before = epoch(time.time())
    async with running(data) as service:
        health = await sick(service, "was gone at the start")
        assert health["store"]["status"] == "begun anew"
        assert "a new epoch" in health["store"]["reason"]
        assert health["store"]["seq"] >= before
        await service.metrics_with("deconflict_store_renewed 1")


async def test_a_ledger_that_is_locked_while_the_service_runs_delays_no_advisory(data: Path) -> None:
    async with running(data) as service:
        await service.until("/healthz", lambda health: health["status"] == "ok")
        with locked(data / "losses.db"):
            await sick(service, "losses.db is locked by another program")
            await raised(service, OTHERS)
            assert (await service.get("/losses")).status_code in (200, 503)
        await service.until("/healthz", lambda health: health["status"] == "ok")


async def test_processes_start_with_locked_databases_on_a_full_disk_and_none_restarts(disk: Path) -> None:
    served = Served(disk)
    with full_disk(disk), held_alone(disk / "losses.db"), served.running():
        health = await served.until("/healthz", lambda answer: answer.get("roles", {}).get("engine") == "up")
        async with served.with_robots(time.time() - 25.0):
            listed = await served.until("/advisories", lambda answer: answer.get("advisories"))
        health = await served.until("/healthz", lambda answer: "full" in answer["files"].get("reason", ""))
    assert health["status"] == "degraded"
    assert health["store"]["status"] == "in memory"
    assert set(health["restarts"].values()) == {0}
    assert listed["advisories"][0]["state"] != "cleared"


async def test_a_service_that_may_not_enter_its_directory_starts_and_warns_and_uses_it_once_it_may(data: Path) -> None:
    """As a volume of another user. What may not be looked at for a while is not called removed afterwards."""
    served = Served(data, prefix=LIKE_ANY_USER)
    before = numbers(data)
    data.chmod(0)
    try:
        with served.running():
            health = await served.until("/healthz", lambda answer: answer.get("roles", {}).get("engine") == "up")
            assert "advisories.db: Permission denied; check its owner" in health["files"]["reason"]
            async with served.with_robots(time.time() - 25.0):
                listed = await served.until("/advisories", lambda answer: answer.get("advisories"))
            data.chmod(0o755)
            await served.until("/healthz", lambda answer: answer["files"]["status"] == "ok")
            data.chmod(0)
            await served.until("/healthz", lambda answer: "Permission denied" in answer["files"].get("reason", ""))
            data.chmod(0o755)
            health = await served.until("/healthz", lambda answer: answer["files"]["status"] == "ok")
            assert set(health["restarts"].values()) == {0}
    finally:
        data.chmod(0o755)
    assert {*before, listed["advisories"][0]["seq"]} <= {*numbers(data)}


async def test_a_service_whose_directory_is_a_link_to_a_missing_disk_starts_and_uses_it_once_it_is_there(
    data: Path,
) -> None:
    """As a disk that is mounted late. Who owned the robots of before is known then."""
    before, owned = numbers(data), owned_robots(data)
    (link := data.with_name("link")).symlink_to(data)
    served = Served(link)
    fault = missing_disk(data)
    fault.__enter__()
    with served.running():
        await served.until("/healthz", lambda answer: "missing or no directory" in answer["files"].get("reason", ""))
        async with served.with_robots(time.time() - 25.0):
            listed = await served.until("/advisories", lambda answer: answer.get("advisories"))
        fault.__exit__(None, None, None)
        health = await served.until("/healthz", lambda answer: answer["files"]["status"] == "ok")
        assert set(health["restarts"].values()) == {0}
    assert {*before, listed["advisories"][0]["seq"]} <= {*numbers(data)}
    assert owned
    assert owned <= owned_robots(data)


def owned_robots(directory: Path) -> set[str]:
    return {uuid for uuid, _ in json.loads((directory / "owners.json").read_text())["owners"]}


def test_a_directory_that_cannot_be_written_stops_no_start_but_a_second_service_is_refused(disk: Path) -> None:
    with read_only_disk(disk):
        create_data_directory(disk)
        with locked_directory(disk, ["face"]):
            pass
    with (
        locked_directory(disk, ["face"]),
        pytest.raises(DataDirectoryError, match="in use"),
        locked_directory(disk, ["face"]),
    ):
        pytest.fail("it is taken")
