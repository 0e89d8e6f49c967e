from itertools import count
from random import Random

import pytest

from deconflict.engine.engine import Engine
from deconflict.engine.learned.map_drift import FEWEST_RESTS, MARK_RESTS, MapDrift
from deconflict.settings.shared_places import Resource
from deconflict.settings.site import Site
from ingest.fleet.fleet import Fleet
from ingest.fleet.owners.vendor_registry import VendorRegistry
from ingest.fleet.shown.quarantine import Quarantine
from ingest.frames.frame_registry import FrameRegistry
from ingest.measures import clock_changes
from ingest.measures.change_detection import ADOPTED_S, LEARNED
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.settings import Datum
from tests.helpers.saying import HALL, identity, points, status

NOW_S = 1_792_000_000.0
NUMBERS = count()
DOCKS = tuple(
    Resource(kind="dock", id=f"dock-{x}", datum=HALL, polygon=((x, 0), (x + 2, 0), (x + 2, 2), (x, 2)))
    for x in (0, 10, 20)
)


def rest_at(drift: MapDrift, dock: int, x_m: float, y_m: float, vendor: str = "Acme", at_s: float = NOW_S) -> None:
    """Another robot comes to a dock, stands, and says so twice."""
    at, uuid = (10 * dock + 1 + x_m, 1 + y_m), f"A-{next(NUMBERS)}"
    drift.begin_rest(uuid, vendor, HALL, at, at_s)
    drift.begin_rest(uuid, vendor, HALL, at, at_s)


def with_marks(spread_m: float = 0.05) -> tuple[MapDrift, Random]:
    """Every dock has its mark."""
    drift, rng = MapDrift.at(DOCKS), Random(3)
    for _ in range(MARK_RESTS):
        for dock in range(3):
            rest_at(drift, dock, rng.gauss(0, spread_m), rng.gauss(0, spread_m))
    return drift, rng


def test_the_drift_of_a_frame_is_how_far_it_has_shifted() -> None:
    drift, rng = with_marks()
    assert drift.drift_m() == {}
    for row in range(30):
        rest_at(drift, row % 3, 0.3 + rng.gauss(0, 0.05), -0.4 + rng.gauss(0, 0.05))
    assert drift.drift_m()["Acme",] == pytest.approx(0.5, abs=0.04)


def test_a_frame_that_stays_does_not_drift() -> None:
    drift, rng = with_marks()
    for row in range(60):
        rest_at(drift, row % 3, rng.gauss(0, 0.05), rng.gauss(0, 0.05))
    assert drift.drift_m()["Acme",] < 0.05


def test_one_dock_that_was_moved_is_no_drift() -> None:
    drift, rng = with_marks()
    for row in range(60):
        rest_at(drift, row % 3, (0.6 if row % 3 == 0 else 0.0) + rng.gauss(0, 0.05), rng.gauss(0, 0.05))
    assert drift.drift_m()["Acme",] < 0.1


def test_drift_needs_enough_rests_and_each_vendor_has_its_own_marks() -> None:
    drift, _ = with_marks()
    for _ in range(FEWEST_RESTS - 1):
        rest_at(drift, 0, 0.5, 0.0)
    rest_at(drift, 0, 0.5, 0.0, vendor="Bolt")
    assert drift.drift_m() == {}
    rest_at(drift, 0, 0.5, 0.0)
    assert set(drift.drift_m()) == {("Acme",)}


def test_the_engine_measures_the_drift_of_a_frame_by_robots_that_dock() -> None:
    site = Site(datums=(Datum(id=HALL, name="Hall"),), resources=DOCKS)
    fleet = Fleet(VendorRegistry(()), FrameRegistry(site.datums, ()), site.reading, Measures(), Quarantine())
    engine, t_s, line = Engine(site), NOW_S, Connection(1)
    fleet.receive(identity("A-1", t_s), t_s, line)
    for row in range(MARK_RESTS + FEWEST_RESTS):
        x_m = 1.0 if row < MARK_RESTS else 1.4
        away = points((t_s + 5, 8.0, 8.0, 0.0))
        for message in (
            status("A-1", t_s, 5.0, 8.0, path=away),
            status("A-1", t_s + 20, x_m, 1.0, operationalState="idle"),
        ):
            fleet.receive(message, t_s, line)
            engine.receive(fleet.next_batch(t_s))
            engine.step(t_s)
            t_s += 20
    engine.measures.as_document()
    assert engine.measures.values["deconflict_datum_drift_metres"]["Alder",] == pytest.approx(0.4)


def test_marks_are_kept_over_a_restart_except_of_docks_that_were_removed() -> None:
    drift, _ = with_marks()
    resumed, smaller = MapDrift.at(DOCKS), MapDrift.at(DOCKS[:1])
    for map_drift in (resumed, smaller):
        map_drift.resume(drift.learned())
    for map_drift in (drift, resumed, smaller):
        for _ in range(FEWEST_RESTS):
            rest_at(map_drift, 1, 0.5, 0.0)
    assert resumed.drift_m() == drift.drift_m()
    assert drift.drift_m()["Acme",] == pytest.approx(0.5, abs=0.1)
    assert smaller.drift_m() == {}


def test_a_frame_that_moves_is_reported_with_its_time_until_it_is_back() -> None:
    drift, rng = with_marks()
    changes = []
    for row in range(150):
        shift_m = 0.4 if 60 <= row < 100 else 0.0
        rest_at(drift, row % 3, shift_m + rng.gauss(0, 0.05), rng.gauss(0, 0.05), at_s=NOW_S + 300 * row)
        changes.append(drift.changed().get("Acme"))
    assert not any(changes[:60])
    change = changes[99]
    assert change
    assert change.by == pytest.approx(0.4, abs=0.05)
    assert abs(change.since_s - (NOW_S + 300 * 60)) <= 900
    assert changes[-1] is None


def test_a_frame_that_stays_moved_for_a_day_gets_new_marks() -> None:
    drift, rng = with_marks()
    found, every_s = [], 600.0
    for row in range(60 + int(ADOPTED_S / every_s) + 6 * MARK_RESTS):
        shift_m = 0.4 if row >= 60 else 0.0
        rest_at(drift, row % 3, shift_m + rng.gauss(0, 0.05), rng.gauss(0, 0.05), at_s=NOW_S + every_s * row)
        found.append((drift.drift_m().get(("Acme",), 0.0), drift.changed()))
    assert found[100][0] > 0.3
    assert found[100][1]
    assert found[-1][0] < 0.1
    assert not found[-1][1]


def test_the_engine_measures_since_when_a_frame_has_moved() -> None:
    site = Site(datums=(Datum(id=HALL, name="Hall"),), resources=DOCKS)
    fleet = Fleet(VendorRegistry(()), FrameRegistry(site.datums, ()), site.reading, Measures(), Quarantine())
    engine, line, moved_at = Engine(site), Connection(1), MARK_RESTS + 2 * LEARNED
    fleet.receive(identity("A-1", NOW_S), NOW_S, line)
    for row in range(moved_at + LEARNED):
        t_s, x_m = NOW_S + 40 * row, 1.0 if row < moved_at else 1.4
        away = points((t_s + 5, 8.0, 8.0, 0.0))
        for message, at_s in (
            (status("A-1", t_s, 5.0, 8.0, path=away), t_s),
            (status("A-1", t_s + 20, x_m, 1.0, operationalState="idle"), t_s + 20),
        ):
            fleet.receive(message, at_s, line)
            engine.receive(fleet.next_batch(at_s))
            engine.step(at_s)
    engine.measures.as_document()
    values = engine.measures.values
    assert values[clock_changes.AMOUNTS["datum"]]["Alder",] == pytest.approx(0.4, abs=0.02)
    assert values[clock_changes.SINCE]["Alder", "datum"] == pytest.approx(NOW_S + 40 * moved_at, abs=60)
