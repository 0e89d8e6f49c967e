"""What the operator face keeps, driven over its link as an engine does."""

import asyncio
import gc
import json
import sqlite3
import threading
import time
import tracemalloc
from collections.abc import Iterator, Sequence
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path

import pytest
from pydantic_core import to_json

from deconflict.advisories.situations.situation_lifecycle import SituationLifecycle
from deconflict.operator.blackbox.archive import FOLDER
from deconflict.operator.blackbox.blackbox_request import NearPair
from deconflict.operator.blackbox.keeper import PENDING, SNAPSHOTS, Keeper
from deconflict.operator.ledger.loss_ledger import FILE_NAME as LOSSES
from deconflict.operator.ledger.loss_ledger import LossLedger
from deconflict.operator.store.learned_file import FILE_NAME as LEARNED
from deconflict.operator.store.publisher import PRUNED, TAIL_LENGTH
from deconflict.operator.store.store import Store
from deconflict.runtime.learned_state import packed
from deconflict.runtime.parcels import STORED, packed_parcel, unpacked_parcel
from deconflict.runtime.rpc import AsyncCaller
from deconflict.settings.hot_reload import SITE_FILE
from deconflict.settings.outlet_settings import Webhook
from deconflict.settings.shared_places import NamedArea
from deconflict.settings.site import BlackBox, LossSettings, Operator, Person, Site
from deconflict_client.advisory import AdvisoryState, AnyAdvisory, ClearedCode
from deconflict_client.situations import Situation, situations_of
from ingest.recording import replaced_file
from ingest.recording.clock_notes import DAY_S
from ingest.settings import Datum, Tls
from tests.deconflict.advisories.situations.made_situations import NOW_S, conflict
from tests.deconflict.operator.http.served_face import until
from tests.deconflict.operator.ledger.made_entries import QUEUED
from tests.deconflict.operator.outlets.made_outlets import SECRET, heard, hearing
from tests.deconflict.roles.made_disks import disk_that_can_stick, stuck
from tests.deconflict.roles.made_face import serving
from tests.helpers.made_advisories import cleared, made
from tests.helpers.made_clock import put_notes
from tests.helpers.patience import PATIENCE_S
from tests.helpers.plain_http import http_client
from tests.helpers.saying import HALL

EACH = 25
"""Advisories in a parcel, each raised and cleared."""
LEFT_BYTES = 100
"""Less than this may stay of each: less than anything that is kept for it."""


@pytest.fixture
def traced() -> Iterator[None]:
    tracemalloc.start()
    yield
    tracemalloc.stop()


def kept_bytes() -> int:
    gc.collect()
    return tracemalloc.get_traced_memory()[0]


async def test_the_memory_of_the_operator_face_stops_growing(tmp_path: Path, traced: None) -> None:
    async with serving(tmp_path) as (_, engine):
        await tell(engine, range(TAIL_LENGTH))
        grown = []
        for number in (1, 2):
            before = kept_bytes()
            await tell(engine, range(number * TAIL_LENGTH, (number + 1) * TAIL_LENGTH))
            grown.append(kept_bytes() - before)
    assert min(grown) < LEFT_BYTES * TAIL_LENGTH, "what is loaded once may grow once"


async def test_what_was_removed_to_bound_the_database_is_counted_and_shown(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.append([cleared(number, 1, updated_at=datetime.now(UTC)) for number in range(5)])
    store.close()
    async with serving(tmp_path, advisories_bytes=1) as (role, _), http_client() as client:
        pruned = role._publisher.measures.values[PRUNED]
        await until(lambda: pruned.get(("size",)) == 5)
        health = (await client.get(f"http://127.0.0.1:{role.port}/healthz")).json()
        assert health["store"]["pruned_for_size"] == 5
        assert health["store"]["bytes"] == role._publisher.measures.values["deconflict_store_bytes"][()]


async def test_old_losses_that_could_not_be_removed_are_soon_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("deconflict.roles.operator_role.PRUNE_AGAIN_S", 0.1)
    monkeypatch.setattr("deconflict.roles.operator_role.MEASURE_SIZE_EVERY_S", 0.1)
    put_notes(tmp_path, time.time())
    with closing(LossLedger(tmp_path, LossSettings())) as ledger:
        ledger.add("engine", 1, [QUEUED._replace(from_s=time.time() - 120 * DAY_S)])
    with closing(sqlite3.connect(tmp_path / LOSSES, isolation_level=None)) as another:
        another.execute("BEGIN IMMEDIATE")
        async with serving(tmp_path):
            await until(lambda: "old losses can't be removed" in caplog.text)
            another.execute("ROLLBACK")
            await until(lambda: not another.execute("SELECT 1 FROM losses").fetchall())


async def test_an_invalid_revision_is_set_aside_and_the_others_of_its_parcel_are_stored(tmp_path: Path) -> None:
    unknown_kind = made(2).model_copy(update={"kind": "collision"})
    not_finite = made(3).model_copy(update={"min_separation_m": float("nan")})
    async with serving(tmp_path) as (role, engine):
        parcel = packed_parcel(
            {}, [to_json(made(1)), to_json(unknown_kind), b"{", to_json(not_finite), to_json(made(4))]
        )
        assert await engine.call("publish", parcel) == STORED
        assert [advisory.id for advisory in role._store.after(0)] == ["advisory-1", "advisory-4"]
        assert role._publisher.measures.values["deconflict_advisories_set_aside_total"]["invalid",] == 3


async def test_a_quiet_pass_ends_a_situation_and_what_is_being_made_is_published_before_the_role_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, revise = conflict("ab"), SituationLifecycle.revise

    def slow(self: SituationLifecycle, now_s: float, revisions: Sequence[AnyAdvisory]) -> list[Situation]:
        time.sleep(0.2)
        return revise(self, now_s, revisions)

    monkeypatch.setattr(SituationLifecycle, "revise", slow)
    async with serving(tmp_path) as (_, engine):
        for at_s, revisions in (
            (0, [first]),
            (1, [first.cleared_revision(NOW_S + 1, ClearedCode.PASSED, "they passed")]),
            (60, []),
        ):
            await engine.call("publish", packed_parcel({"passes_s": [NOW_S + at_s]}, map(to_json, revisions)))
    store = Store(tmp_path)
    assert [each.state for each in situations_of(store.after(0))][-1] is AdvisoryState.CLEARED
    store.close()


async def test_situations_name_places_by_a_site_that_was_changed_meanwhile(tmp_path: Path) -> None:
    outline = ((-5.0, -5.0), (5.0, -5.0), (5.0, 5.0), (-5.0, 5.0))
    site = Site(datums=(Datum(id=HALL, name="Hall"),), areas=(NamedArea(name="Bay 4", outline_m=outline),))
    async with serving(tmp_path) as (role, engine):
        (role._runtime / SITE_FILE).write_text(site.model_dump_json())
        await until(lambda: bool(role._site.areas))
        await engine.call("publish", packed_parcel({"passes_s": [NOW_S]}, [to_json(conflict("ab"))]))
    store = Store(tmp_path)
    assert "in Bay 4" in situations_of(store.after(0))[0].summary
    store.close()


async def tell(engine: AsyncCaller, numbers: range) -> None:
    """Advisories that come and go, a parcel at a time, and then what was learned, more often than it is remembered."""
    for first in range(numbers.start, numbers.stop, EACH):
        advisories = [make(number) for number in range(first, first + EACH) for make in (made, cleared)]
        await engine.call("publish", packed_parcel({"passes_s": [float(first)]}, map(to_json, advisories)))
    for number in range(SNAPSHOTS + 1):
        await engine.call("learn", learned(number))


async def test_a_role_starts_and_sends_whatever_has_become_of_secrets_and_certificates(tmp_path: Path) -> None:
    """They were verified when the service started. A role that dies later starts with the files as they are then."""
    gone, url = f"file:{tmp_path / 'gone'}", "http://127.0.0.1:9/"
    with hearing() as other:
        (tmp_path / "secret").write_text(SECRET)
        webhooks = (
            Webhook(name="late", url=url, secret=gone),
            Webhook(name="mes", url=other.url, secret=f"file:{tmp_path / 'secret'}", kinds=("advisory",)),
        )
        operator = Operator(
            port=0, people=(Person(name="Eva", role="administer", token=gone),), tls=Tls(certificate=gone)
        )
        async with serving(tmp_path, webhooks=webhooks, operator=operator) as (role, engine):
            assert await engine.call("publish", packed_parcel({}, [to_json(made(1))])) == STORED
            await heard(other, 1)
            assert role.port


async def test_a_stuck_disk_holds_up_no_advisory_beside_a_near_miss_nor_what_is_learned(tmp_path: Path) -> None:
    """Whatever else waits for the disk."""
    with disk_that_can_stick(tmp_path) as disk:
        async with serving(disk / "data") as (role, engine):
            await publish_beside_a_near_miss(engine, 1)
            await engine.call("answers", b"-1")  # SQLite notes the first reader of new pages in a file
            with stuck(disk):
                for number in range(2, 12):
                    await publish_beside_a_near_miss(engine, number)
                    assert await engine.call("learn", learned(number))
            async with http_client() as client:
                listed = (await client.get(f"http://127.0.0.1:{role.port}/advisories")).json()
        assert len(listed["advisories"]) == 11
        assert len(json.loads((disk / "data" / "blackbox" / PENDING).read_text())) == 11


async def test_advisories_go_out_from_memory_while_the_store_waits_for_a_disk_without_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As of a network drive that hangs: whoever asks the file for anything waits, and so do people."""
    monkeypatch.setattr("deconflict.operator.store.publisher.STUCK_S", 0.3)
    async with serving(tmp_path) as (role, engine), http_client(f"http://127.0.0.1:{role.port}") as client:
        assert await engine.call("publish", packed_parcel({}, [to_json(made(1)), to_json(made(2))])) == STORED
        connections = role._store.connections
        with connections.writing(), connections.numbering(), connections.reading(), connections.long_reading():
            asked = [asyncio.create_task(client.get("/advisories")) for _ in range(20)]
            began_s = time.monotonic()
            assert await engine.call("publish", packed_parcel({}, [to_json(cleared(1)), to_json(made(3))])) == STORED
            assert time.monotonic() - began_s < 3.0
            listed = (await client.get("/advisories")).json()["advisories"]
            assert [each["id"] for each in listed] == ["advisory-3", "advisory-2"]
            store = (await client.get("/healthz")).json()["store"]
            assert store["status"] == "in memory"
            assert "does not answer" in store["reason"]
        await asyncio.gather(*asked)
        await until(lambda: role._store.outage is None)
        listed = (await client.get("/advisories")).json()["advisories"]
        assert [each["id"] for each in listed] == ["advisory-3", "advisory-2"]


async def test_health_answers_and_an_engine_starts_while_the_disk_of_the_store_does_not_answer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also if nothing is published."""
    monkeypatch.setattr("deconflict.roles.operator_role.STUCK_S", 2.5)
    async with serving(tmp_path) as (role, engine), http_client(f"http://127.0.0.1:{role.port}") as client:
        assert await engine.call("publish", packed_parcel({}, [to_json(made(1))])) == STORED
        connections = role._store.connections
        with connections.writing(), connections.numbering(), connections.reading(), connections.long_reading():
            first, second = await asyncio.gather(client.get("/healthz"), client.get("/healthz"))
            assert "does not answer" in first.json()["store"]["reason"]
            assert "does not answer" in second.json()["store"]["reason"]
            await until(lambda: role._store.outage)
            _, lines = unpacked_parcel(await engine.call("restore", b"0"))
            assert [json.loads(line)["id"] for line in lines] == ["advisory-1"]
        await until(lambda: role._store.outage is None)


def test_what_waits_for_a_slow_disk_is_written_before_the_role_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each file has a second write that waits for the first one."""
    write, goes_on = replaced_file.replace_file, threading.Event()

    def slow(path: Path, data: bytes) -> None:
        assert goes_on.wait(PATIENCE_S)
        write(path, data)

    for user in ("blackbox.keeper", "store.learned_file"):
        monkeypatch.setattr(f"deconflict.operator.{user}.replace_file", slow)

    async def serve() -> None:
        async with serving(tmp_path) as (_, engine):
            for number in (1, 2):
                await publish_beside_a_near_miss(engine, number)
                assert await engine.call("learn", learned(number))
            asyncio.get_running_loop().call_later(0.5, goes_on.set)

    asyncio.run(serve())  # its end cancels what still runs, as the end of the process does
    assert len(json.loads((tmp_path / FOLDER / PENDING).read_text())) == 2
    assert (tmp_path / LEARNED).read_bytes() == learned(2)


async def test_a_near_miss_while_those_of_before_are_read_replaces_none_of_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read, is_published, pending = Keeper._read_pending, threading.Event(), tmp_path / FOLDER / PENDING
    pending.parent.mkdir()
    pending.write_text(json.dumps([["before", "b", time.time()]]))

    def slow(self: Keeper) -> list[NearPair]:
        pairs = read(self)
        assert is_published.wait(PATIENCE_S)
        return pairs

    def kept() -> list[str]:
        return [a for a, *_ in json.loads(pending.read_text())]

    monkeypatch.setattr(Keeper, "_read_pending", slow)
    async with serving(tmp_path) as (_, engine):
        await publish_beside_a_near_miss(engine, 1)
        assert kept() == ["before"], "a kill loses none of before"
        is_published.set()
        await until(lambda: len(kept()) == 2)
    assert kept() == ["a1", "before"]


async def test_no_two_writes_of_the_pending_near_misses_overlap(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first waits for the disk until its near miss has had its black box."""
    write, goes_on, writing, most = Keeper.write_pending, threading.Event(), list[int](), list[int]()

    def slow(self: Keeper) -> None:
        writing.append(1)
        most.append(len(writing))
        if self._pending:
            assert goes_on.wait(PATIENCE_S)
        write(self)
        writing.pop()

    monkeypatch.setattr(Keeper, "write_pending", slow)
    monkeypatch.setattr("deconflict.operator.blackbox.keeper.LATEST_S", 0.0)
    async with serving(tmp_path, blackbox=BlackBox(before_s=1.0, after_s=1.0)) as (role, engine):
        await publish_beside_a_near_miss(engine, 1)
        await until(lambda: bool(writing))
        await until(lambda: not role._keeper._pending)
        await asyncio.to_thread(most.count, 1)
        goes_on.set()
    assert max(most) == 1
    assert not (tmp_path / FOLDER / PENDING).exists()


def learned(at_s: float) -> bytes:
    return packed({"tick": {"now_s": float(at_s)}})


async def publish_beside_a_near_miss(engine: AsyncCaller, number: int) -> None:
    head = {"near_misses": [[f"a{number}", "b", time.time(), ["Alder", "Basalt"]]]}
    assert await engine.call("publish", packed_parcel(head, [to_json(made(number))])) == STORED
