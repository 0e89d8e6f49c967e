"""Whose messages a pass reflects, and since when they waited."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from deconflict.engine.engine import Engine
from deconflict.engine.message_latency import arrivals_s
from deconflict.roles.engine_role import EngineRole
from deconflict.settings.site import DEFAULT
from ingest.fleet.fleet import Fleet
from ingest.fleet.owners.vendor_registry import VendorRegistry
from ingest.fleet.shown.quarantine import Quarantine
from ingest.frames.frame_registry import FrameRegistry
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.settings import Reading, Vendor
from tests.helpers.saying import status

NOW_S = 1_792_000_000.0


def fleet() -> Fleet:
    vendors = (Vendor(name="Acme"), Vendor(name="Bolt"))
    return Fleet(VendorRegistry(vendors), FrameRegistry((), vendors), Reading(), Measures(), Quarantine())


def test_each_valid_status_counts_once_for_its_vendor_and_a_replaced_one_from_the_first() -> None:
    receiving_fleet, acme, bolt = fleet(), Connection(1, vendor="Acme"), Connection(2, vendor="Bolt")
    for i in range(3):
        receiving_fleet.receive(status("A-1", NOW_S + i), NOW_S + i, acme)
    receiving_fleet.receive(status("B-1", NOW_S + 1), NOW_S + 1.5, bolt)
    batch = receiving_fleet.next_batch(NOW_S + 3)
    waited = {
        vendor: sorted((arrivals - NOW_S).tolist()) for vendor, arrivals in arrivals_s(batch, batch.now_s).items()
    }
    assert waited == {"Acme": [0.0, 0.0, 2.0], "Bolt": [1.5]}


def test_arrivals_are_times_of_the_host_clock_also_after_it_was_set() -> None:
    receiving_fleet = fleet()
    receiving_fleet.receive(status("A-1", NOW_S), NOW_S, Connection(1, vendor="Acme"))
    numbers = arrivals_s(receiving_fleet.next_batch(NOW_S + 0.1), NOW_S + 7200.1)
    assert numbers["Acme"].tolist() == pytest.approx([NOW_S + 7200.0])


def test_a_new_engine_counts_no_message_twice() -> None:
    receiving_fleet, acme = fleet(), Connection(1, vendor="Acme")
    receiving_fleet.receive(status("A-1", NOW_S), NOW_S, acme)
    receiving_fleet.next_batch(NOW_S + 0.1)
    again = arrivals_s(receiving_fleet.next_batch(NOW_S + 60, everything=True), NOW_S + 60)
    assert {vendor: len(arrivals) for vendor, arrivals in again.items()} == {"Acme": 0}


def test_a_judge_that_fails_is_counted_and_begins_anew(tmp_path: Path) -> None:
    class FailingJudge:
        def add(self, *_: object) -> None:
            raise ValueError

        def begin_anew(self) -> None:
            raise AssertionError

    judges: list[FailingJudge] = []

    def made(*_: object) -> Any:
        judges.append(FailingJudge())
        return judges[-1]

    role, engine = EngineRole(DEFAULT, tmp_path, make_judge=made), Engine(DEFAULT)
    role._judge = role._judge_of(engine)
    role._judge_pass(engine, fleet().next_batch(NOW_S), np.zeros(0), [])
    assert (role._judge, len(judges)) == (judges[1], 2)
    assert engine.measures.values["deconflict_judge_failures_total"] == {(): 1}
