import asyncio
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import Site
from ingest.batch import Batch
from ingest.fleet.fleet import Fleet
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.port.fair_delivery import Backlog
from ingest.port.rate_limits import ArrivedMessage
from ingest.port.time_slices import TimeSlices
from ingest.recording.log_reader import LogReader, Overtaken, Received, Tick
from ingest.recording.recorder import Recorder
from ingest.settings import RecorderSettings
from tests.helpers.saying import identity, robot, status

NOW_S = 1_700_000_000.0
ALDER, BASALT = Connection(1, "10.0.0.1", vendor="Alder"), Connection(2, "10.0.0.2", vendor="Basalt")


class Behind:
    """A backlog whose messages all wait until they are let go, and a fleet and a recording behind it."""

    def __init__(self, directory: Path) -> None:
        self.slices, self.measures = TimeSlices(slice_s=0.0), Measures()
        self.slices.run(lambda: None)
        self.fleet = fleet_of(Site(), self.measures)
        self.recorder = Recorder(RecorderSettings(), directory, Measures(), lambda: NOW_S)
        self.delivered: list[bytes] = []
        self.overtaken: list[bytes] = []
        self._backlog = Backlog(self.slices, self._deliver, self._overtake)

    def put(self, raw: bytes, arrival_s: float, connection: Connection = ALDER) -> None:
        self._backlog.add(ArrivedMessage(raw, arrival_s, connection))

    def next_batch(self, now_s: float) -> Batch:
        self.recorder.tick(now_s)
        return self.fleet.next_batch(now_s)

    def _deliver(self, raw: bytes, arrival_s: float, connection: Connection) -> None:
        self.delivered.append(raw)
        self.recorder.received(raw, arrival_s, connection, self.fleet.receive(raw, arrival_s, connection))

    def _overtake(self, arrived_message: ArrivedMessage, of: str) -> None:
        self.overtaken.append(arrived_message.raw)
        self.fleet.count_overtaken(of, arrived_message.arrival_s, arrived_message.connection)
        self.recorder.overtaken(*arrived_message)


def replayed(directory: Path) -> tuple[list[Batch], Counter[str]]:
    """The batches of a recording, and its events by kind."""
    fleet: Fleet = fleet_of(Site(), Measures())
    batches, kinds = [], Counter[str]()
    for event in LogReader().read([directory]):
        kinds[type(event).__name__] += 1
        if isinstance(event, Received):
            fleet.receive(event.raw, event.arrival_s, event.connection)
        elif isinstance(event, Tick):
            batches.append(fleet.next_batch(event.now_s))
    return batches, kinds


def test_of_the_waiting_statuses_of_a_robot_only_the_newest_is_read(tmp_path: Path) -> None:
    async def run() -> Behind:
        slow = Behind(tmp_path)
        for raw in (first, first_of_b, who, second, third):
            slow.put(raw, NOW_S)
        assert slow.delivered == []
        slow.slices.finish()
        return slow

    first, second, third = (status("A-1", NOW_S, x) for x in (1.0, 2.0, 3.0))
    first_of_b, who = status("A-2", NOW_S), identity("A-1", NOW_S)
    behind = asyncio.run(run())
    assert behind.delivered == [third, first_of_b, who]
    assert behind.overtaken == [first, second]


def test_without_a_backlog_every_message_is_read() -> None:
    async def at_once() -> list[bytes]:
        delivered: list[bytes] = []
        backlog = Backlog(
            TimeSlices(slice_s=60.0), lambda raw, *_: delivered.append(raw), lambda *_: pytest.fail("overtaken")
        )
        for raw in messages:
            backlog.add(ArrivedMessage(raw, NOW_S, ALDER))
        return delivered

    messages = [status("A-1", NOW_S + n) for n in range(5)]
    assert asyncio.run(at_once()) == messages


def test_a_robot_reported_over_two_connections_waits_on_each(tmp_path: Path) -> None:
    async def run() -> Behind:
        slow = Behind(tmp_path)
        for n in range(4):
            slow.put(status("A-1", NOW_S + n), NOW_S + n, (ALDER, BASALT)[n % 2])
        slow.slices.finish()
        return slow

    behind = asyncio.run(run())
    assert behind.delivered == [status("A-1", NOW_S + 2), status("A-1", NOW_S + 3)]


def test_an_overtaken_status_is_counted_and_recorded(tmp_path: Path) -> None:
    async def run() -> tuple[Behind, Batch]:
        slow = Behind(tmp_path)
        slow.put(status("A-1", NOW_S - 1), NOW_S - 1)
        slow.slices.finish()
        slow.next_batch(NOW_S - 0.5)
        for n in range(4):
            slow.put(status("A-1", NOW_S + n, x=n), NOW_S + n)
        slow.put(status("A-2", NOW_S), NOW_S)
        slow.slices.finish()
        batch = slow.next_batch(NOW_S + 4)
        slow.recorder.close()
        return slow, batch

    behind, batch = asyncio.run(run())
    assert batch.robots == (robot("A-1"), robot("A-2"))
    assert batch.statuses.tolist() == [4, 1]
    assert (batch.first_arrival_s[0], batch.arrival_s[0]) == (NOW_S, NOW_S + 3)
    counted = behind.measures.values
    assert counted["deconflict_messages_total"] == {("Alder", "accepted"): 3, ("Alder", "overtaken"): 3}
    assert counted["deconflict_statuses_superseded_total"] == {("Alder",): 3}
    events = [event for event in LogReader().read([tmp_path]) if isinstance(event, Overtaken)]
    assert [(event.raw, event.arrival_s, event.connection.id) for event in events] == [
        (status("A-1", NOW_S + n, x=n), NOW_S + n, ALDER.id) for n in range(3)
    ]


def test_what_another_vendor_says_of_a_robot_and_overtakes_itself_is_that_vendors(tmp_path: Path) -> None:
    async def run() -> tuple[Behind, Batch]:
        slow = Behind(tmp_path)
        slow.put(status("A-1", NOW_S), NOW_S)
        slow.slices.finish()
        slow.next_batch(NOW_S + 0.5)
        for n in range(3):
            slow.put(status("A-1", NOW_S + n, x=900.0), NOW_S + n, BASALT)
        slow.put(status("A-1", NOW_S + 4), NOW_S + 4)
        slow.slices.finish()
        return slow, slow.next_batch(NOW_S + 5)

    behind, batch = asyncio.run(run())
    assert behind.measures.values["deconflict_messages_total"] == {
        ("Alder", "accepted"): 2,
        ("Basalt", "overtaken"): 2,
        ("Basalt", "rejected"): 1,
    }
    assert (batch.statuses.tolist(), batch.first_arrival_s.tolist()) == ([1], [NOW_S + 4])


def test_a_replay_of_an_overloaded_service_gives_the_same_batches(tmp_path: Path) -> None:
    async def run() -> list[Batch]:
        behind, batches, rng = Behind(tmp_path), [], np.random.default_rng(1)
        for n in range(600):
            behind.put(status(f"A-{rng.integers(8)}", NOW_S + n / 50, x=float(n)), NOW_S + n / 50)
            if n % 30 == 29:
                await asyncio.sleep(0)
                batches.append(behind.next_batch(NOW_S + n / 50))
        behind.slices.finish()
        batches.append(behind.next_batch(NOW_S + 20))
        behind.recorder.close()
        assert behind.overtaken
        return batches

    live = asyncio.run(run())
    again, kinds = replayed(tmp_path)
    assert kinds["Received"] + kinds["Overtaken"] == 600
    assert len(live) == len(again)
    for first, other in zip(live, again, strict=True):
        assert first.robots == other.robots
        assert first.arrival_s.tolist() == other.arrival_s.tolist()
        assert first.forecasts.x_m.tolist() == other.forecasts.x_m.tolist()
