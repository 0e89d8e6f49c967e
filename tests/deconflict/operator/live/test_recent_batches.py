import asyncio

import pytest

from deconflict.operator.live import recent_batches
from deconflict.operator.live.recent_batches import KEPT_S, RecentBatches, packed_batch, unpacked_batch
from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import Site
from ingest.fleet import fleet_report
from ingest.fleet.fleet import Fleet
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from tests.helpers.saying import identity, robot, status

NOW_S = 1_792_000_000.0


def fleet(*names: str) -> Fleet:
    receiving_fleet = fleet_of(Site(), Measures())
    for name in names:
        receiving_fleet.receive(status(name, NOW_S), NOW_S, Connection(1))
    return receiving_fleet


async def test_a_follower_gets_each_batch_in_the_order_of_the_engine() -> None:
    kept = RecentBatches()
    for step in range(3):
        kept.add(NOW_S + step, fleet(f"A-{step}").next_batch(NOW_S + step).to_bytes())
    message = await kept.after(round(NOW_S * 1e6))
    assert message
    number, whole, batch = unpacked_batch(message)
    assert batch
    assert (number, whole, batch.robots) == (round((NOW_S + 1) * 1e6), False, (robot("A-1"),))


async def test_a_follower_that_is_up_to_date_waits_for_the_next_tick() -> None:
    kept = RecentBatches()
    kept.add(NOW_S, fleet().next_batch(NOW_S).to_bytes())
    waiting = asyncio.create_task(kept.after(kept.number))
    await asyncio.sleep(0)
    assert not waiting.done()
    kept.add(NOW_S + 0.1, fleet("A-1").next_batch(NOW_S).to_bytes())
    assert unpacked_batch(await waiting or b"")[2]


async def test_without_a_tick_a_follower_gets_an_empty_batch(monkeypatch: pytest.MonkeyPatch) -> None:
    kept = RecentBatches()
    kept.add(NOW_S, fleet().next_batch(NOW_S).to_bytes())
    monkeypatch.setattr(recent_batches, "TICK_TIMEOUT_S", 0.01)
    assert await kept.after(kept.number) == packed_batch(kept.number, b"", whole=False)


async def test_before_the_first_tick_a_new_follower_waits_and_then_gets_the_whole_floor() -> None:
    kept = RecentBatches()
    waiting = asyncio.create_task(kept.after(0))
    await asyncio.sleep(0)
    assert not waiting.done()
    kept.add(NOW_S, fleet("A-1").next_batch(NOW_S).to_bytes())
    assert await waiting is None


async def test_a_new_follower_and_one_too_far_behind_need_the_whole_floor() -> None:
    kept = RecentBatches()
    ticks_s = [NOW_S, NOW_S + KEPT_S / 4, NOW_S + KEPT_S / 2, NOW_S + KEPT_S * 1.375]
    for tick_s in ticks_s:
        kept.add(tick_s, fleet().next_batch(tick_s).to_bytes())
    assert await kept.after(0) is None
    assert await kept.after(round(ticks_s[0] * 1e6)) is None
    assert await kept.after(round(ticks_s[1] * 1e6)) is not None


def test_a_snapshot_of_the_floor_changes_nothing_for_the_engine() -> None:
    looked, alone = fleet("A-1", "A-2"), fleet("A-1", "A-2")
    assert looked.snapshot(NOW_S).robots == (robot("A-1"), robot("A-2"))
    for receiving_fleet in (looked, alone):
        receiving_fleet.receive(identity("A-2", NOW_S), NOW_S, Connection(1))
    assert looked.next_batch(NOW_S + 1).to_bytes() == alone.next_batch(NOW_S + 1).to_bytes()
    assert fleet_report.unidentified(looked) == [robot("A-1")]
