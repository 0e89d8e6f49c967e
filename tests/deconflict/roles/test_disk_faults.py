"""A disk that is full, read-only or stuck: people are still told, health says what is not kept, and it is later."""

import asyncio
import sqlite3
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from math import pi
from pathlib import Path
from typing import Any

import pytest

from deconflict.operator.blackbox.blackbox_request import BoxSpan
from deconflict.operator.blackbox.blackbox_writer import published_in
from deconflict.operator.store.publisher import Publisher
from deconflict.operator.store.sqlite_connections import FILE_NAME
from deconflict.operator.store.store import Store, StoreError
from deconflict.roles import operator_sources
from deconflict.roles.health import refusal_health
from deconflict_client.advisory import Acknowledgement, AnyAdvisory
from ingest.measures.measures import Measures
from ingest.recording import log_packing, log_rotation
from ingest.recording.log_reader import LogReader, Tick
from tests.deconflict.operator.http.served_face import until
from tests.deconflict.operator.store.made_damage import damage, page
from tests.deconflict.roles.made_disks import disk_of, disk_that_can_stick, fill, mount, stuck
from tests.deconflict.roles.made_service import CROSSING, Course, Running, Served, drive, healthy, running
from tests.helpers.made_advisories import ROBOTS, START, cleared, deadlock, made
from tests.helpers.patience import PATIENCE_S
from tests.ingest.recording.made_logs import NOW_S, recorder
from tests.ingest.recording.packed_logs import names, seconds, settle, ticks


def in_pages(page_after: Callable[[Any], list[Any]]) -> list[Any]:
    """All entries, read in pages that follow the last entry of the page before."""
    entries: list[Any] = []
    while page := page_after(entries[-1] if entries else None):
        entries += page
    return entries


SPAN = BoxSpan(
    START.timestamp(), START.timestamp(), START.timestamp() + 60, START.timestamp() + 60, START.timestamp() + 180
)
READS: dict[str, Callable[[Store], Any]] = {
    "latest": lambda store: store.latest("all"),
    "two of it": lambda store: store.latest("all", limit=2),
    "open": lambda store: store.latest("open").advisories,
    "open in pages": lambda store: in_pages(lambda last: store.open_after(last.seq if last else 0, 2)),
    "cleared": lambda store: store.latest("cleared").advisories,
    "by robot": lambda store: store.latest("all", robot=ROBOTS[0]).advisories,
    "by vendor": lambda store: store.latest("all", vendor="Borealis").advisories,
    "by kind": lambda store: store.latest("all", kind="deadlock").advisories,
    "after": lambda store: store.after(2, 3),
    "all after": lambda store: store.after(0, -1),
    "one": lambda store: store.get("advisory-1"),
    "then": lambda store: store.open_at(START.timestamp() + 130),
    "in a span": lambda store: published_in(store.path, store.pending_until(SPAN.until_s), SPAN),
    "raised": lambda store: store.raised_between(START.timestamp(), START.timestamp() + 130),
    "last": Store.last_seq,
    "encounters in pages": lambda store: in_pages(
        lambda last: store.encounters_after(last[0] if last else ("", ""), 1)
    ),
    "burdens": Store.burdens_s,
}
LIFE: list[AnyAdvisory] = [made(1), made(2), deadlock(*ROBOTS), made(1, 2), cleared(2), made(3, encounter=4)]
LIFE += [cleared(1, 3)]


@pytest.fixture
def stores(tmp_path: Path) -> Iterator[tuple[Store, Store]]:
    """One whose disk takes everything, and one whose disk has taken only the beginning."""
    prompt, behind = Store(tmp_path / "prompt"), Store(tmp_path / "behind")
    yield prompt, behind
    prompt.close()
    behind.close()


@pytest.mark.parametrize("on_disk", range(len(LIFE)))
def test_pending_revisions_are_read_like_stored_ones_and_keep_their_numbers(
    stores: tuple[Store, Store], on_disk: int
) -> None:
    prompt, behind = stores
    stored = prompt.append(LIFE)
    behind.append(LIFE[:on_disk])
    assert behind.accept(LIFE) == stored
    assert behind.unstored == len(LIFE) - on_disk
    assert {name: read(behind) for name, read in READS.items()} == {name: read(prompt) for name, read in READS.items()}
    behind.flush()
    behind.close()
    again = Store(behind.path.parent)
    assert {name: read(again) for name, read in READS.items()} == {name: read(prompt) for name, read in READS.items()}
    again.close()


async def test_a_stalled_disk_delays_no_advisory_and_loses_nothing(tmp_path: Path) -> None:
    """Another connection that holds the file stands in for a disk that does not answer."""
    store, measures = Store(tmp_path), Measures()
    publisher = Publisher(store, measures)
    await publisher.publish([made(1)])
    holding = sqlite3.connect(store.path, isolation_level=None)
    holding.execute("BEGIN IMMEDIATE")
    following = asyncio.create_task(publisher.after(1))
    await publisher.publish([made(2), made(3)])
    assert [line.seq for line in (await following).lines] == [2, 3]
    assert publisher.failing
    assert measures.values["deconflict_store_unstored"] == {(): 2}
    await publisher.publish([made(2)])
    assert [advisory.seq for advisory in store.latest("open").advisories] == [3, 2, 1]
    holding.execute("COMMIT")
    holding.close()
    async with asyncio.timeout(PATIENCE_S):
        while publisher.failing:
            await publisher.store_pending()
    assert publisher.failing is None
    await publisher.publish([made(4)])
    await publisher.close()
    store.close()
    again = Store(tmp_path)
    assert [(each.id, each.seq) for each in again.after(0)] == [
        (f"advisory-{number}", number) for number in range(1, 5)
    ]
    again.close()


@contextmanager
def held(path: Path) -> Iterator[None]:
    """Another connection that holds the file stands in for a disk that does not answer."""
    with closing(sqlite3.connect(path, isolation_level=None)) as holding:
        holding.execute("BEGIN IMMEDIATE")
        yield
        holding.execute("COMMIT")


async def test_answers_on_a_stalled_disk_delay_no_advisory_and_are_stored_later(tmp_path: Path) -> None:
    store = Store(tmp_path)
    publisher, given = Publisher(store, Measures()), Acknowledgement(name="Kim", reason="seen", at=START)
    await publisher.publish([made(1)])
    with held(store.path):
        answering = asyncio.create_task(publisher.acknowledge("advisory-1", given))
        await asyncio.sleep(0)
        await publisher.publish([made(1, 2), made(2)])
        assert [line.seq for line in (await publisher.after(0)).lines] == [1, 2, 3, 4]
        answered = await answering
        assert answered is not None
        assert answered.acknowledgement == given
        second = await publisher.acknowledge("advisory-2", given)
        assert second is not None
        assert (second.seq, second.acknowledgement) == (5, given)
        again = Acknowledgement(name="Lee", reason="me too", at=START)
        await publisher.acknowledge("advisory-1", again)
        (third,) = await publisher.publish([made(1, 3)])
        assert third.acknowledgement == again
        assert await publisher.acknowledge("advisory-9", given) is None
        assert store.unstored == 6
    async with asyncio.timeout(PATIENCE_S):
        while store.unstored:
            await publisher.store_pending()
    store.close()
    reopened = Store(tmp_path)
    assert [(each.revision, each.seq, each.acknowledgement) for each in reopened.get("advisory-1")] == [
        (1, 1, None),
        (1, 2, given),
        (2, 3, given),
        (2, 6, again),
        (3, 7, again),
    ]
    assert [(each.seq, each.acknowledgement) for each in reopened.get("advisory-2")] == [(4, None), (5, given)]
    reopened.close()


async def test_a_stalled_disk_is_waited_for_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("deconflict.operator.store.publisher.DISK_TIMEOUT_S", 1.0)
    store = Store(tmp_path)
    publisher = Publisher(store, Measures())
    with held(store.path):
        began_s = time.monotonic()
        for number in range(10):
            await publisher.publish([made(number)])
        assert time.monotonic() - began_s < 5.0
    await publisher.close()
    store.close()


async def test_a_read_only_file_is_logged_and_counted_and_written_once_possible(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    store, measures = Store(tmp_path), Measures()
    publisher = Publisher(store, measures)
    store.connections._file.writer.execute("PRAGMA query_only = ON")
    for number in (1, 2):
        await publisher.publish([made(number)])
    assert publisher.failing
    assert "readonly" in publisher.failing
    assert publisher.last_seq == 2
    assert measures.values["deconflict_store_failures_total"] == {(): 2}
    with pytest.raises(StoreError, match="readonly"):
        store.append([made(9)])
    store.connections._file.writer.execute("PRAGMA query_only = OFF")
    await publisher.store_pending()
    assert (store.unstored, len(store.after(0))) == (0, 2)
    assert [record.levelname for record in caplog.records] == ["ERROR", "WARNING"], "told once, and its end once"
    store.close()


def test_pending_revisions_are_bounded_and_further_ones_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("deconflict.operator.store.store.MOST_PENDING", 5)
    store = Store(tmp_path)
    store.accept([made(number) for number in range(5)])
    with pytest.raises(StoreError, match="5 revisions wait for the disk"):
        store.accept([made(5)])
    store.flush()
    assert store.accept([made(5)])[0].seq == 6
    store.close()


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    with disk_of(tmp_path, "1500k") as disk:
        yield disk


async def measured(service: Running, name: str) -> float:
    lines = (await service.get("/metrics")).text.splitlines()
    return float(next((line.split()[-1] for line in lines if line.startswith(name)), "nan"))


async def test_a_full_disk_delays_no_advisory_and_shows_and_is_filled_up_later(
    small_disk: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(refusal_health, "SHOWN_S", 5.0)
    monkeypatch.setattr(operator_sources, "REFUSALS_EVERY_S", 0.2)
    async with running(small_disk) as service:
        await service.until("/healthz", lambda health: health["status"] == "ok")
        ballast = fill(small_disk)
        driving = asyncio.create_task(drive(service.robots_url, CROSSING, 60))
        row = await service.until("/advisories?state=cleared", lambda answer: answer["advisories"])
        sick = await service.get("/healthz")
        assert (sick.status_code, sick.json()["store"]["status"]) == (503, "failing")
        assert sick.json()["store"]["unstored"] >= 2
        assert "full" in sick.json()["store"]["reason"]
        assert await measured(service, "deconflict_recorded_lines_dropped_total") > 0
        driving.cancel()
        ballast.unlink()
        await service.until("/healthz", lambda health: health["status"] == "ok")
        assert await measured(service, "deconflict_store_unstored") == 0
        resumed_s = time.time()
        await asyncio.wait_for(drive(service.robots_url, CROSSING, 2.0, resumed_s), PATIENCE_S)
    store = Store(small_disk)
    kept = [advisory for advisory in store.after(0, -1) if advisory.id == row["advisories"][0]["id"]]
    assert [advisory.revision for advisory in kept] == list(range(1, len(kept) + 1))
    assert kept[-1].seq == row["advisories"][0]["seq"]
    store.close()
    events = list(LogReader().read([small_disk / "log"]))
    assert any(isinstance(event, Tick) and event.now_s > resumed_s for event in events), "recording resumed"


def test_segments_that_a_full_disk_does_not_take_packed_stay_plain_and_are_packed_later(
    small_disk: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = small_disk / "log"
    monkeypatch.setattr(log_packing, "PLAIN_SEGMENTS", 100)
    ticks(folder, range(12))
    monkeypatch.undo()
    ballast = fill(small_disk)
    writer, _ = recorder(folder, segment_bytes=100)
    writer.tick(NOW_S)
    assert writer.sync()
    settle(writer)
    assert "No space left" in (writer.files.packer.failing or "")
    assert writer.failing
    assert seconds(folder) == list(range(12))
    assert not list(folder.glob("*.zst"))
    assert not (folder / log_packing.UNFINISHED).exists()
    ballast.unlink()
    monkeypatch.setattr(log_packing, "RETRY_S", 0.0)
    monkeypatch.setattr(log_rotation, "RETRY_S", 0.0)
    ticks(folder, range(12, 18), writer)
    assert not writer.files.packer.failing
    assert not writer.failing
    assert names(folder).count("packed") >= 3
    assert seconds(folder) == list(range(18))


async def test_a_log_on_a_read_only_disk_shows_and_recording_resumes(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    log = tmp_path / "log"
    log.mkdir()
    mount(log, "ro,size=4m")
    try:
        async with running(tmp_path) as service:
            driving = asyncio.create_task(drive(service.robots_url, CROSSING, 9))
            await service.until("/advisories?state=all", lambda answer: answer["advisories"])
            async with asyncio.timeout(PATIENCE_S):
                while not await measured(service, "deconflict_recorded_lines_dropped_total") > 0:
                    await asyncio.sleep(0.1)
            assert "Read-only file system" in caplog.text
            await asyncio.to_thread(subprocess.run, ["mount", "-o", "remount,rw", str(log)], check=True)
            async with asyncio.timeout(PATIENCE_S):
                while not any(file.stat().st_size for file in log.iterdir()):
                    await asyncio.sleep(0.1)
            driving.cancel()
        assert "recording again" in caplog.text
    finally:
        subprocess.run(["umount", "-l", str(log)], check=True)


async def test_a_service_whose_database_is_damaged_continues_its_advisories_and_says_so(tmp_path: Path) -> None:
    meeting: dict[str, Course] = {"A-1": lambda t: (-20.0 + t, 0.0, 0.0), "B-1": lambda t: (20.0 - t, 0.0, pi)}
    start_s = time.time() - 13.0
    async with running(tmp_path) as service:
        driving = asyncio.create_task(drive(service.robots_url, meeting, 60, start_s))
        before = (await service.until("/advisories", lambda answer: len(answer["advisories"]) == 1))["advisories"][0]
        driving.cancel()
    damage(tmp_path / FILE_NAME, page(1))
    async with running(tmp_path) as service:
        driving = asyncio.create_task(drive(service.robots_url, meeting, 60, start_s))
        (after,) = (
            await service.until(
                "/advisories", lambda answer: answer["advisories"] and answer["advisories"][0]["seq"] > before["seq"]
            )
        )["advisories"]
        driving.cancel()
        health = await service.get("/healthz")
        assert "deconflict_store_renewed 1" in (await service.metrics_with("deconflict_store_renewed"))
    assert after["id"] == before["id"]
    assert after["revision"] > before["revision"]
    assert (health.status_code, health.json()["store"]["status"]) == (503, "begun anew")
    assert (tmp_path / health.json()["store"]["set_aside"]).exists()
    assert health.json()["store"]["copied"] >= before["revision"]


async def test_a_start_that_waits_for_a_stuck_disk_says_so(tmp_path: Path) -> None:
    log = tmp_path / "log.txt"
    with disk_that_can_stick(tmp_path) as disk, ExitStack() as at_end:
        served = Served(disk / "data", log=log)
        (disk / "data").mkdir()
        with stuck(disk):
            at_end.enter_context(served.running())
            await until(lambda: f"the disk of {disk / 'data'} has not answered for 10 s" in log.read_text())
        await served.until("/healthz", healthy)
