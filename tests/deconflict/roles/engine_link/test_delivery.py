"""Delivery of the engine's decisions: any amount, in order, to an operator face that refuses or is away."""

import asyncio
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from deconflict.operator.ledger.loss_ledger import LedgerEntry
from deconflict.operator.ledger.loss_questions import LossQuestion
from deconflict.operator.store.store import Store
from deconflict.operator.store.tables import StoreError
from deconflict.roles.engine_link import delivery
from deconflict.roles.engine_link.delivery import Delivery, DeliveryFaultError, UndeliveredError
from deconflict.roles.operator_role import OperatorRole
from deconflict.roles.service import runtime_directory
from deconflict.runtime.parcels import MOST_LINES, REFUSED, STORED, unpacked_parcel
from deconflict.runtime.rpc import listening, socket_path
from deconflict.settings.site import Operator, Site
from deconflict_client.advisory import ADVISORY
from ingest.measures.measures import Measures
from metrics.monitoring.exposition import render
from tests.deconflict.operator.http.served_face import until
from tests.helpers.made_advisories import made
from tests.helpers.patience import PATIENCE_S

NOW_S = 1_792_000_000.0
NEAR = ("a", "b", NOW_S, ("Acme", "Acme"))


@asynccontextmanager
async def delivering(publish: Callable[[bytes], Awaitable[bytes]]) -> AsyncIterator[Delivery]:
    """A delivery to an operator face that answers each parcel so."""
    with runtime_directory() as runtime:
        async with listening(socket_path(Path(runtime), "operator"), {"publish": publish}):
            running_delivery = Delivery(Path(runtime))
            running_delivery.start()
            try:
                yield running_delivery
            finally:
                await asyncio.to_thread(running_delivery.stop)


async def test_a_pass_larger_than_what_may_wait_for_the_disk_is_stored_in_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("deconflict.operator.store.store.MOST_PENDING", 100)
    count = 2 * MOST_LINES + 100
    with runtime_directory() as runtime:
        stop = asyncio.Event()
        role = OperatorRole(Site(operator=Operator(port=0)), Path(runtime), tmp_path, render)
        running = asyncio.create_task(role.run(stop))
        await role.ready.wait()
        running_delivery, begun = Delivery(Path(runtime)), role._store.last_seq()
        running_delivery.start()
        running_delivery.add_pass(NOW_S, [made(number) for number in range(count)], {}, Measures(), [NEAR] * count)
        await until(lambda: role._store.last_seq() == begun + count)
        await asyncio.to_thread(running_delivery.stop)
        stop.set()
        await running
    store = Store(tmp_path)
    assert [revision.id for revision in store.after(0, -1)] == [f"advisory-{number}" for number in range(count)]
    store.close()


async def test_losses_of_a_pass_reach_the_ledger(tmp_path: Path) -> None:
    with runtime_directory() as runtime:
        stop = asyncio.Event()
        role = OperatorRole(Site(operator=Operator(port=0)), Path(runtime), tmp_path, render)
        running = asyncio.create_task(role.run(stop))
        await role.ready.wait()
        running_delivery = Delivery(Path(runtime))
        running_delivery.start()
        loss = LedgerEntry(
            60.0, "Alder", "A100", "Corvid", "Basalt", "queue", "hall", "Dock", 4.1, 7.9, 8.0, 8.0, is_sure=True
        )
        for _ in range(2):
            running_delivery.add_pass(NOW_S, [], {}, Measures(), losses=[loss])
        await asyncio.to_thread(running_delivery.stop)
        async with asyncio.timeout(PATIENCE_S):
            while (await kept_losses(role)) != (16.0, 2):
                await asyncio.sleep(0.05)
        stop.set()
        await running


async def kept_losses(role: OperatorRole) -> tuple[float, int] | None:
    """Seconds and number of the losses in the ledger; None while a slow disk keeps its file locked."""
    try:
        kept = (await role.sources.losses(LossQuestion(0.0, 3600.0))).total
    except StoreError:
        return None
    return kept.lost_s, kept.losses


async def test_a_refused_parcel_is_sent_again_before_the_next(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(delivery, "RETRY_S", 0.01)
    monkeypatch.setattr(delivery, "MEASURES_EVERY_S", float("inf"))
    seen: list[int] = []

    async def publish(parcel: bytes) -> bytes:
        first = ADVISORY.validate_json(unpacked_parcel(parcel)[1][0])
        seen.append(int(first.id.removeprefix("advisory-")))
        return STORED if seen.count(seen[-1]) == 3 else REFUSED

    async with delivering(publish) as running_delivery:
        running_delivery.add_pass(NOW_S, [made(number) for number in range(MOST_LINES + 1)], {}, Measures())
        running_delivery.add_pass(NOW_S, [made(MOST_LINES + 1)], {}, Measures())
        await until(lambda: len(seen) == 9)
    assert seen == [0, 0, 0, *[MOST_LINES] * 3, *[MOST_LINES + 1] * 3]


async def test_the_times_of_passes_come_with_the_last_parcel_of_the_next_that_has_something_to_send(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(delivery, "MEASURES_EVERY_S", float("inf"))
    times_s: list[list[float] | None] = []

    async def publish(parcel: bytes) -> bytes:
        times_s.append(unpacked_parcel(parcel)[0].get("passes_s"))
        return STORED

    passes = (0, 0, MOST_LINES + 1, 1)
    async with delivering(publish) as running_delivery:
        for number, revisions in enumerate(passes):
            running_delivery.add_pass(NOW_S + number, [made(each) for each in range(revisions)], {}, Measures())
        await until(lambda: len(times_s) == 3)
    assert times_s == [None, [NOW_S, NOW_S + 1, NOW_S + 2], [NOW_S + 3]]


async def test_revisions_do_not_wait_for_the_measures_of_their_pass() -> None:
    heads: list[dict[str, Any]] = []

    async def publish(parcel: bytes) -> bytes:
        heads.append(unpacked_parcel(parcel)[0])
        return STORED

    async with delivering(publish) as running_delivery:
        running_delivery.add_pass(NOW_S, [made(0)], {}, Measures(), presence=lambda: {"silent": []})
        await until(lambda: len(heads) == 2)
    assert ["measures" in head for head in heads] == [False, True]
    assert [head.get("passes_s") for head in heads] == [[NOW_S], []]
    assert "queued_s" not in heads[1]
    assert heads[1]["presence"] == {"silent": []}


async def test_what_follows_an_undelivered_parcel_is_not_delivered_at_the_end() -> None:
    seen: list[int] = []

    async def publish(parcel: bytes) -> bytes:
        seen.append(len(unpacked_parcel(parcel)[1]))
        return REFUSED if len(seen) == 1 else STORED

    async with delivering(publish) as running_delivery:
        running_delivery._stopping.set()
        running_delivery.add_pass(NOW_S, [made(number) for number in range(MOST_LINES + 1)], {}, Measures())
    assert seen == [MOST_LINES]


async def test_undelivered_passes_are_bounded_and_the_engine_restarts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(delivery, "MOST_WAITING_BYTES", 1 << 20)
    monkeypatch.setattr(delivery, "STUCK_S", 0.5)
    running_delivery, arrived_s = Delivery(tmp_path), {"Acme": np.full(10_000, NOW_S)}
    running_delivery.start()
    for _ in range(13):
        running_delivery.add_pass(NOW_S, [], arrived_s, Measures(), [NEAR])
        assert running_delivery.has_room()
    running_delivery.add_pass(NOW_S, [], arrived_s, Measures(), [NEAR])
    with pytest.raises(UndeliveredError):
        await until(running_delivery.has_room)
    running_delivery.stop()


async def test_a_slow_operator_face_delays_the_next_pass_and_ends_no_engine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(delivery, "MOST_WAITING_BYTES", 1 << 20)
    monkeypatch.setattr(delivery, "STUCK_S", 0.5)

    async def publish(_: bytes) -> bytes:
        await asyncio.sleep(0.1)
        return STORED

    async with delivering(publish) as running_delivery:
        running_delivery.add_pass(NOW_S, [], {}, Measures(), [NEAR] * (12 * MOST_LINES))
        running_delivery.add_pass(NOW_S, [], {"Acme": np.full(200_000, NOW_S)}, Measures(), [NEAR])
        began_s = time.monotonic()
        assert not running_delivery.has_room()
        await until(running_delivery.has_room)
        assert time.monotonic() - began_s > 2 * delivery.STUCK_S


async def test_any_amount_is_delivered_to_an_operator_face_that_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(delivery, "MOST_WAITING_BYTES", 1 << 20)
    monkeypatch.setattr(delivery, "MEASURES_EVERY_S", float("inf"))
    taken = 0

    async def publish(_: bytes) -> bytes:
        nonlocal taken
        taken += 1
        return STORED

    async with delivering(publish) as running_delivery:
        for number in range(1, 101):
            running_delivery.add_pass(NOW_S, [], {"Acme": np.full(10_000, NOW_S)}, Measures(), [NEAR])
            await until(lambda count=number: taken == count)
            await until(running_delivery.has_room)
    waits = running_delivery.measures.histograms["deconflict_message_to_advisory_seconds"]["Acme",]
    assert sum(waits.counts) == 100 * 10_000


async def test_an_engine_whose_decisions_are_sent_no_more_ends_with_the_cause() -> None:
    """So the supervisor starts it again, and what is open is delivered."""

    async def stored(_: bytes) -> bytes:
        return STORED

    async def no_json(_: bytes) -> bytes:
        return b"no JSON"

    with runtime_directory() as runtime:
        async with listening(socket_path(Path(runtime), "operator"), {"publish": stored, "answers": no_json}):
            failing = Delivery(Path(runtime))
            failing.start()
            assert failing.has_room()
            failing.add_pass(NOW_S, [made(1)], {}, Measures())
            await until(lambda: failing._fault)
            with pytest.raises(DeliveryFaultError) as raised:
                failing.has_room()
            assert isinstance(raised.value.__cause__, ValueError)
            await asyncio.to_thread(failing.stop)
