"""What a vendor's robots say of their arrivals, held against when they came."""

import numpy as np
import pytest

from deconflict.contention.robots.announced_arrivals import AnnouncedArrivals, Announcement, DatumPoint
from deconflict.contention.robots.arrival_forecast import MOST_RATIOS, ArrivalCorrections, ArrivalForecast
from deconflict.contention.robots.destinations import write_stops
from deconflict.contention.robots.lookahead import look_ahead
from deconflict.contention.robots.record_kernels import STOP, Outlines
from deconflict.sweep.robot_slots import RobotSlots
from ingest.batch import Batch
from tests.deconflict.contention.robots.made_reports import report, report_of

DOCK: DatumPoint = ("hall", 10.0, 0.0)
AWAY: DatumPoint = ("hall", 0.0, 0.0)


def trip(arrivals: ArrivalForecast, robot: str, begins_s: float, takes_s: float, told_s: float) -> None:
    report(arrivals, robot, begins_s, AWAY, [DOCK], [begins_s + told_s])
    report(arrivals, robot, begins_s + takes_s, DOCK, [DOCK], [begins_s + told_s])


def arrivals_of(announced: AnnouncedArrivals, batch: Batch) -> list[tuple[int, list[list[Announcement]]]]:
    at = (batch.forecasts.floor, batch.forecasts.x_m, batch.forecasts.y_m)
    return list(announced.add_batch(batch, batch.event_s, at, batch.destinations))


def expected(arrivals: ArrivalForecast, vendor: str, now_s: float, told_s: float) -> tuple[float, float]:
    """Of one robot that goes to another floor."""
    batch, stops = report_of("r", now_s, AWAY, [("loft", 10.0, 0.0)], [told_s]), np.zeros((1, 1), STOP)
    nothing = Outlines(np.empty(0, np.int64), np.empty((0, 4)))
    known = ArrivalCorrections(np.zeros(1, np.int64), np.array([arrivals.quantiles(vendor)]), np.zeros((1, 1, 3)))
    view = look_ahead(batch.forecasts, now_s)
    write_stops(stops, np.zeros(1, np.int64), np.arange(2), batch.destinations, now_s, view, known, nothing)
    return float(stops["t_s"][0, 0]), float(stops["spread_s"][0, 0])


def test_without_arrivals_the_announced_time_is_used() -> None:
    expected_s, spread_s = expected(ArrivalForecast(), "Alder", 100.0, 160.0)
    assert expected_s == 160.0
    assert 0 < spread_s < 30


def test_a_vendor_that_is_always_late_is_expected_late() -> None:
    arrivals = ArrivalForecast()
    for number in range(20):
        trip(arrivals, "r", 1000.0 * number, takes_s=90.0, told_s=60.0)
    expected_s, spread_s = expected(arrivals, "Alder", 0.0, 100.0)
    assert expected_s == pytest.approx(150.0)
    assert spread_s < 30
    assert expected(arrivals, "Corvid", 0.0, 100.0)[0] == 100.0


def test_a_past_announcement_counts_as_now() -> None:
    assert expected(ArrivalForecast(), "Alder", 100.0, 60.0) == (100.0, 0.0)


def test_an_arrival_that_is_given_up_teaches_nothing() -> None:
    arrivals = ArrivalForecast()
    report(arrivals, "r", 0.0, AWAY, [DOCK], [60.0])
    report(arrivals, "r", 10.0, AWAY, [("hall", 50.0, 0.0)], [60.0])
    report(arrivals, "r", 300.0, DOCK, [], [])
    assert arrivals.counts().get("Alder", 0) == 0


def test_a_robot_that_stands_at_its_destination_teaches_nothing() -> None:
    arrivals = ArrivalForecast()
    for t in range(100):
        report(arrivals, "r", float(t), DOCK, [DOCK], [500.0])
    assert arrivals.counts().get("Alder", 0) == 0


def test_announcements_and_ratios_are_bounded() -> None:
    arrivals = ArrivalForecast()
    for number in range(2 * MOST_RATIOS):
        trip(arrivals, "r", 1000.0 * number, takes_s=60.0, told_s=60.0)
    assert arrivals.counts() == {"Alder": MOST_RATIOS}


def test_what_was_learned_goes_on_after_a_restart() -> None:
    arrivals, resumed = ArrivalForecast(), ArrivalForecast()
    for number in range(20):
        trip(arrivals, "r", 1000.0 * number, takes_s=90.0, told_s=60.0)
    resumed.resume(arrivals.learned())
    assert resumed.quantiles("Alder") == arrivals.quantiles("Alder")
    assert resumed.counts() == {"Alder": 20}


def test_a_repeated_announcement_is_kept_every_half_minute_and_compared_with_the_arrival() -> None:
    arrivals = ArrivalForecast()
    for t in range(101):
        report(arrivals, "r", float(t), DOCK if t == 100 else AWAY, [DOCK], [110.0])
    assert arrivals.counts() == {"Alder": 4}


def test_skipping_unchanged_reports_finds_the_same_arrivals() -> None:
    rng, points = np.random.default_rng(1), [DOCK, ("hall", 10.0, 2.04), ("yard", 10.0, 0.0), ("", 10.0, 0.0)]
    again, anew, came = AnnouncedArrivals(), AnnouncedArrivals(), 0
    for trip_number in range(20):
        robot = f"r{trip_number % 3}"
        way_m = np.array([9.0, 0.0]) + np.cumsum(rng.normal(scale=0.2, size=(400, 2)), axis=0)
        for t, (x_m, y_m) in enumerate(way_m.tolist()):
            result = slice(t // 100 % 2, 3 + t // 150 % 2)
            at, to, told_s = ("hall", x_m, y_m), points[result], [t + 40.0, t + 60.0, t + 90.0, t + 99.0][result]
            found = arrivals_of(again, report_of(robot, float(t), at, to, told_s))
            kept = anew.add(robot, float(t), at, to, told_s)
            assert found == ([(0, kept)] if kept else [])
            came += len(kept)
        again.forget(robot)
        anew.forget(robot)
    assert came > 50


def test_a_robot_that_is_in_a_batch_twice_counts_in_the_order_of_its_reports() -> None:
    batches = [report_of("r", t, ("hall", t, 0.0), [DOCK], [12.0]) for t in (0.0, 9.0, 10.0, 11.0)]
    assert arrivals_of(AnnouncedArrivals(), Batch.joined(batches)) == [(2, [[Announcement(0.0, 12.0)]])]


def test_a_reused_slot_keeps_nothing_of_its_last_robot() -> None:
    slots = RobotSlots()
    announced = AnnouncedArrivals(slots)
    arrivals_of(announced, report_of("r", 0.0, AWAY, [DOCK], [60.0]))
    announced.forget("r")
    slots.release(["r"])
    assert arrivals_of(announced, report_of("s", 1.0, AWAY, [DOCK], [60.0])) == []
    assert arrivals_of(announced, report_of("s", 2.0, DOCK, [DOCK], [60.0])) == [(0, [[Announcement(1.0, 60.0)]])]
