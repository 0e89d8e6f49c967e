"""Whose messages a pass reflects, and since when they waited."""

import asyncio
from pathlib import Path

import numpy as np
import pytest

from deconflict.engine.message_latency import arrivals_s
from deconflict.roles import engine_role
from deconflict.roles.engine_role import Delivery, UndeliveredError
from deconflict.roles.service import runtime_directory
from deconflict.runtime.rpc import listening, socket_path
from ingest.fleet.fleet import Fleet
from ingest.fleet.owners.vendor_registry import VendorRegistry
from ingest.fleet.quarantine import Quarantine
from ingest.frames.frame_registry import FrameRegistry
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.settings import Reading, Vendor
from tests.deconflict.operator.http.served_face import until
from tests.helpers.saying import status

NOW_S = 1_792_000_000.0


def fleet() -> Fleet:
    vendors = (Vendor(name="Acme"), Vendor(name="Bolt"))
    return Fleet(VendorRegistry(vendors), FrameRegistry((), vendors), Reading(), Measures(), Quarantine())


def test_each_valid_status_counts_once_for_its_vendor_and_a_replaced_one_from_the_first() -> None:
    one, acme, bolt = fleet(), Connection(1, vendor="Acme"), Connection(2, vendor="Bolt")
    for i in range(3):
        one.receive(status("A-1", NOW_S + i), NOW_S + i, acme)
    one.receive(status("B-1", NOW_S + 1), NOW_S + 1.5, bolt)
    batch = one.next_batch(NOW_S + 3)
    waited = {
        vendor: sorted((arrivals - NOW_S).tolist()) for vendor, arrivals in arrivals_s(batch, batch.now_s).items()
    }
    assert waited == {"Acme": [0.0, 0.0, 2.0], "Bolt": [1.5]}


def test_arrivals_are_times_of_the_host_clock_also_after_it_was_set() -> None:
    one = fleet()
    one.receive(status("A-1", NOW_S), NOW_S, Connection(1, vendor="Acme"))
    told = arrivals_s(one.next_batch(NOW_S + 0.1), NOW_S + 7200.1)
    assert told["Acme"].tolist() == pytest.approx([NOW_S + 7200.0])


def test_a_new_engine_counts_no_message_twice() -> None:
    one, acme = fleet(), Connection(1, vendor="Acme")
    one.receive(status("A-1", NOW_S), NOW_S, acme)
    one.next_batch(NOW_S + 0.1)
    again = arrivals_s(one.next_batch(NOW_S + 60, everything=True), NOW_S + 60)
    assert {vendor: len(arrivals) for vendor, arrivals in again.items()} == {"Acme": 0}


def test_undelivered_passes_are_bounded_and_the_engine_restarts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engine_role, "MOST_WAITING_BYTES", 1 << 20)
    outbox, arrived_s = Delivery(tmp_path), {"Acme": np.full(10_000, NOW_S)}
    outbox.start()
    for _ in range(13):
        outbox.add_pass([], arrived_s, Measures())
    with pytest.raises(UndeliveredError):
        outbox.add_pass([], arrived_s, Measures())
    outbox.stop()


async def test_any_amount_is_delivered_to_an_operator_face_that_answers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engine_role, "MOST_WAITING_BYTES", 1 << 20)
    taken = 0

    async def publish(_: bytes) -> bytes:
        nonlocal taken
        taken += 1
        return b"stored"

    with runtime_directory() as runtime:
        async with listening(socket_path(Path(runtime), "operator"), {"publish": publish}):
            outbox = Delivery(Path(runtime))
            outbox.start()
            for number in range(1, 101):
                outbox.add_pass([], {"Acme": np.full(10_000, NOW_S)}, Measures(), [("a", "b", NOW_S, ("Acme", "Acme"))])
                await until(lambda count=number: taken == count)
            await asyncio.to_thread(outbox.stop)
    waits = outbox.measures.histograms["deconflict_message_to_advisory_seconds"]["Acme",]
    assert sum(waits.counts) == 100 * 10_000
