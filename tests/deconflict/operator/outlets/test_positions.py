"""Where an outlet is in the stream, on a disk that is full or stuck: nothing is lost, nor doubled but at an end."""

import os
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from deconflict.operator.store.store import Store
from tests.deconflict.operator.http.served_face import until
from tests.deconflict.operator.outlets.made_outlets import SECRET, delivered, heard, hearing, kept, numbers, posting
from tests.deconflict.roles.made_disks import disk_of, fill
from tests.helpers.made_advisories import cleared, made
from tests.helpers.patience import PATIENCE_S

LIVES = range(1, 9)


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    with disk_of(tmp_path, "1m") as disk:
        yield disk


async def test_a_full_disk_delays_no_outlet_and_the_position_is_stored_when_there_is_room(
    tmp_path: Path, small_disk: Path
) -> None:
    with hearing() as other:
        with kept(small_disk) as (store, publisher):
            async with posting(other.url, store, publisher, tmp_path):
                await publisher.publish([made(1)])
                await delivered(publisher, 1)
                ballast = fill(small_disk)
                for number in LIVES:
                    await publisher.publish([made(number, 2), cleared(number, 3)])
                await delivered(publisher, 1 + 2 * len(LIVES))
                assert store.unstored > 0
                assert "full" in (publisher.failing or "")
                assert placed(small_disk) < numbers(other.heard)[-1], "a place beyond what is stored"
                ballast.unlink()
                await publisher.store_pending()
            await publisher.close()
            assert not store.has_pending
        assert placed(small_disk) == 1 + 2 * len(LIVES)
        with kept(small_disk) as (store, publisher):
            async with posting(other.url, store, publisher, tmp_path):
                await publisher.publish([made(30)])
                await delivered(publisher, 1)
    assert numbers(other.heard) == list(range(1, 3 + 2 * len(LIVES)))


def placed(disk: Path) -> int:
    """Where the outlet is, as the file has it."""
    with sqlite3.connect(disk / "advisories.db") as db:
        (seq,) = db.execute("SELECT seq FROM positions WHERE outlet = 'mes'").fetchone()
    db.close()
    return int(seq)


async def test_a_stuck_disk_delays_no_outlet(tmp_path: Path) -> None:
    """Another connection that holds the file stands in for a disk that does not answer."""
    with hearing() as other, kept(tmp_path) as (store, publisher):
        async with posting(other.url, store, publisher, tmp_path):
            await publisher.publish([made(1)])
            await delivered(publisher, 1)
            holding = sqlite3.connect(store.path, isolation_level=None)
            holding.execute("BEGIN IMMEDIATE")
            await publisher.publish([made(2)])
            await publisher.publish([made(3)])
            await delivered(publisher, 3)
            assert placed(tmp_path) <= 1
            holding.execute("ROLLBACK")
            holding.close()
            await publisher.close()
        assert placed(tmp_path) == 3
    assert numbers(other.heard) == [1, 2, 3]


DYING = """
import asyncio, sys
from pathlib import Path
from deconflict.operator.outlets.store_cursor import StoreCursor
from deconflict.settings.outlet_settings import Webhook
from deconflict.operator.outlets.webhooks import WebhookOutlet
from deconflict.operator.store.publisher import Publisher
from deconflict.operator.store.store import Store
from ingest.measures.measures import Measures
from tests.helpers.made_advisories import cleared, made
from tests.deconflict.roles.made_disks import fill

async def run(disk, url, secret, lives):
    store = Store(disk)
    publisher = Publisher(store, Measures())
    settings = Webhook(name="mes", url=url, secret=f"file:{secret}", retry_s=(0.02, 0.1), kinds=("advisory",))
    posting = asyncio.create_task(WebhookOutlet(settings, StoreCursor("mes", ["advisory"], store, publisher)).run())
    while not publisher.measures.values["deconflict_outlet_waiting"]:
        await asyncio.sleep(0.01)
    for number in range(1, lives):
        await publisher.publish([made(number), cleared(number)])
    fill(disk)
    for number in range(lives, 2 * lives):
        await publisher.publish([made(number), cleared(number)])
    await posting

asyncio.run(run(Path(sys.argv[1]), sys.argv[2], sys.argv[3], int(sys.argv[4])))
"""


async def test_an_outlet_killed_on_a_full_disk_loses_nothing_and_resends_what_has_no_stored_position(
    tmp_path: Path, small_disk: Path
) -> None:
    secret, lives = tmp_path / "secret", 6
    secret.write_text(SECRET)
    with hearing() as other:
        command = [sys.executable, "-c", DYING, str(small_disk), other.url, str(secret), str(lives)]
        root = Path(__file__).parents[4]
        with subprocess.Popen(command, env=os.environ | {"PYTHONPATH": str(root)}, stderr=subprocess.DEVNULL) as dying:
            await heard(other, 2 * (2 * lives - 1))
            dying.send_signal(signal.SIGKILL)
            dying.wait(PATIENCE_S)
        made_numbers = numbers(other.heard)
        assert made_numbers == list(range(1, 2 * (2 * lives - 1) + 1))
        (small_disk / "ballast").unlink()
        with kept(small_disk) as (store, publisher):
            stored, last = store.after(0, -1)[-1].seq, store.last_seq()
            assert 2 * (lives - 1) <= stored < made_numbers[-1] < last, "no number is given twice"
            assert placed(small_disk) <= stored, "what is told next would be passed over"
            async with posting(other.url, store, publisher, tmp_path):
                published = await publisher.publish([made(50), cleared(50)])
                await until(lambda: numbers(other.heard)[-1] == published[-1].seq)
        assert numbers(other.heard)[len(made_numbers) :][-2:] == [last + 1, last + 2]


async def test_an_outlet_that_catches_up_has_no_commit_for_each_revision(tmp_path: Path) -> None:
    with hearing() as other, kept(tmp_path) as (store, publisher):
        store.set_position("mes", 0)
        await publisher.publish([made(number) for number in range(1, 21)])
        statements: list[str] = []
        store.connections._file.writer.set_trace_callback(statements.append)
        async with posting(other.url, store, publisher, tmp_path):
            await delivered(publisher, 20)
            assert "COMMIT" not in statements
        await publisher.close()
        assert (statements.count("COMMIT"), placed(tmp_path)) == (1, 20)


def test_a_position_never_goes_back_and_is_known_before_it_is_stored(tmp_path: Path) -> None:
    store = Store(tmp_path)
    assert store.position("mes") is None
    store.append([made(1), made(2)])
    store.set_position("mes", 2)
    assert (store.position("mes"), store.has_pending, store.unstored) == (2, True, 0)
    store.flush()
    store.set_position("mes", 1)
    store.flush()
    assert (store.position("mes"), store.has_pending) == (2, False)
    store.close()
