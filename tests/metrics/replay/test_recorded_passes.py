"""When passes are made over a log, and whose advice its robots may have heard."""

from collections.abc import Iterable
from itertools import pairwise
from math import pi
from pathlib import Path
from random import Random

import pytest

from deconflict.engine.engine import Engine
from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import DEFAULT
from deconflict_client.advisory import AnyAdvisory
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.recording.log_reader import EngineStarted, Event, LogReader, Received, Tick
from ingest.recording.recorder import Recorder, quantise
from metrics.replay.recorded_passes import HELD_S, EnginePass, PassReader
from tests.helpers.saying import identity, points, robot, status

NOW_S = 1_790_000_000.0


OURS, ANOTHERS = Connection(1, "peer"), Connection(0)


def passes(*events: Event) -> list[EnginePass]:
    reader = PassReader(DEFAULT)
    return [*reader.passes_of(events), *reader.last_passes()]


def heard(*events: Event) -> list[bool]:
    return [engine_pass.is_own_log for engine_pass in passes(*events)]


def said(at_s: float, connection: Connection = OURS) -> Received:
    return Received(status("A-1", NOW_S + at_s), NOW_S + at_s, connection)


def times_s(*events: Event) -> list[float]:
    return [engine_pass.now_s - NOW_S for engine_pass in passes(*events)]


def test_messages_before_the_engine_started_belong_to_its_first_pass() -> None:
    early = [Received(identity("A-1", NOW_S), NOW_S, OURS), *(said(n / 2) for n in range(10))]
    started = passes(*early, EngineStarted(NOW_S + 5.0), Tick(NOW_S + 5.1), said(5.2), Tick(NOW_S + 5.3))
    assert [engine_pass.now_s - NOW_S for engine_pass in started] == pytest.approx([5.1, 5.3])
    assert started[0].batch.robots == (robot("A-1"),)
    assert started[0].is_own_log
    assert times_s(*early, Tick(NOW_S + 5.1)) == pytest.approx([5.1])


@pytest.mark.parametrize("connection", [OURS, ANOTHERS])
def test_a_log_without_ticks_has_passes_at_regular_times(connection: Connection) -> None:
    assert times_s(said(0.0, connection), said(1.0, connection)) == pytest.approx([0.25, 0.5, 0.75, 1.0, 1.25])


def test_if_time_goes_back_no_pass_is_repeated_and_every_message_is_fed() -> None:
    reader, times_s = PassReader(DEFAULT), [0.0, 1.0, 0.4, 0.6, 1.1, 0.2, 1.3]
    made = [*reader.passes_of(said(t_s, ANOTHERS) for t_s in times_s), *reader.last_passes()]
    assert [engine_pass.now_s - NOW_S for engine_pass in made] == pytest.approx([0.25, 0.5, 0.75, 1.0, 1.25, 1.5])
    assert reader.messages == 7
    assert reader.span_s == pytest.approx(1.3)


def test_a_shuffled_log_makes_no_more_passes_than_one_in_order() -> None:
    times_s = [0.5 * n for n in range(200)]
    events = [said(t_s, ANOTHERS) for t_s in times_s]
    assert len(passes(*Random(1).sample(events, len(events)))) <= len(passes(*events)) == 399


def test_a_long_own_log_without_ticks_is_not_held_in_memory_to_its_end() -> None:
    reader = PassReader(DEFAULT)
    list(reader.passes_of([said(0.0), said(HELD_S - 1.0)]))
    assert reader.messages == 0
    assert list(reader.passes_of([said(HELD_S + 1.0), said(HELD_S + 2.0)]))
    assert reader.messages == 4


def test_only_passes_of_an_own_log_are_marked_as_such() -> None:
    assert heard(said(0.0), Tick(NOW_S + 0.1), said(0.2), Tick(NOW_S + 0.3)) == [True, True]
    others = heard(said(0.0), said(1.0))
    assert len(others) >= 4
    assert not any(others)


TICKS_S = (0.02, 0.021, 0.05, 0.1, 0.7)
"""Times between two ticks."""


def crossing(t_s: float) -> list[Received]:
    """The reports at `t_s` of two robots that meet after 12 s."""
    courses = {"A-1": (t_s - 12.0, 0.0, 1.0, 0.0), "B-1": (0.0, t_s - 12.0, 0.0, 1.0)}
    reports = []
    for name, (x_m, y_m, x_mps, y_mps) in courses.items():
        yaw_rad, at_s = y_mps * pi / 2, quantise(NOW_S + t_s)
        path = points(*((at_s + s, x_m + x_mps * s, y_m + y_mps * s, yaw_rad) for s in range(1, 11)))
        reports.append(Received(status(name, at_s, x_m, y_m, yaw_rad, path=path), at_s, OURS))
    return reports


def live(log: Path) -> list[AnyAdvisory]:
    """What the engine publishes in passes of which none is as long after the one before; all is recorded in `log`."""
    fleet, engine, random = fleet_of(DEFAULT, Measures()), Engine(DEFAULT), Random(3)
    recorder, published = Recorder(DEFAULT.recorder, log, Measures(), lambda: NOW_S), []
    recorder.engine_started(NOW_S)
    tick_s, due_s = 0.0, 0.0
    while tick_s < 20.0:
        before_s, tick_s = tick_s, tick_s + random.choice(TICKS_S)
        while due_s <= tick_s:
            for report in crossing(due_s):
                fleet.receive(report.raw, report.arrival_s, report.connection)
                recorder.received(report.raw, report.arrival_s, report.connection, None)
            due_s += 0.25
        now_s, pending = quantise(NOW_S + tick_s), engine.pending()
        recorder.tick(now_s, 0, pending)
        engine.receive(fleet.next_batch(now_s, everything=before_s == 0.0))
        published += engine.step(now_s, pending=pending)
    recorder.close()
    return published


def replayed(engine_passes: Iterable[EnginePass]) -> list[AnyAdvisory]:
    engine, published = Engine(DEFAULT), list[AnyAdvisory]()
    for engine_pass in engine_passes:
        engine.receive(engine_pass.batch)
        published += engine.step(engine_pass.now_s, engine_pass.effort, engine_pass.pending, engine_pass.is_own_log)
    return published


def test_a_log_of_irregular_ticks_replays_to_the_same_advisories(tmp_path: Path) -> None:
    published = live(tmp_path)
    assert len(published) >= 2
    again = list(PassReader(DEFAULT).passes_of(LogReader().read([tmp_path])))
    assert replayed(again) == published
    apart_s = {round(after.now_s - before.now_s, 3) for before, after in pairwise(again)}
    assert apart_s == set(TICKS_S)
