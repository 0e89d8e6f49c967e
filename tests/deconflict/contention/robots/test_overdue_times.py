"""Robots that are past the time they announced and have not arrived."""

import numpy as np
import pytest
from scipy.special import lambertw

from deconflict.contention.robots.arrival_forecast import ArrivalForecast
from deconflict.contention.robots.overdue_times import MOST_ARRIVALS, OVERDUE_S, PRIOR_LATER, OverdueTimes, prior_left_s
from deconflict.contention.robots.place_geometry import PlaceGeometry
from deconflict.contention.robots.robot_table import RobotTable
from deconflict.sweep.robot_slots import RobotSlots
from deconflict_client.advisory import ContentionAdvisory
from tests.deconflict.contention.robots.made_reports import report
from tests.deconflict.contention.scenes import LINE, NOW_S, Scene, Script, raised, resource, site
from tests.helpers.saying import robot

DOCK = resource("d1", 0, 0, service_s=60.0)


def waits(*_: float) -> str:
    return "waitingExternalEvent"


def left_s(overdue: OverdueTimes, late_s: float) -> list[float]:
    """Quantiles of what is left to a robot of Alder that is so late."""
    return [float(np.interp(late_s, OVERDUE_S, column)) for column in overdue.table_s("Alder").T]


@pytest.mark.parametrize("end_rate", [1e-7, 1e-4, 1.0 / 600.0, 1.0 / 30.0])
def test_the_prior_solves_for_lamberts_w(end_rate: float) -> None:
    overdue_s = OVERDUE_S[:, None]
    w = lambertw(end_rate * overdue_s / PRIOR_LATER * np.exp(end_rate * overdue_s)).real
    assert prior_left_s(end_rate) == pytest.approx(w / end_rate - overdue_s, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(
    ("late_s", "expected_s"), [(0.0, 0.0), (10.0, 9.7), (100.0, 75.0), (300.0, 158.0), (1000.0, 266.0)]
)
def test_for_an_unknown_vendor_as_much_time_is_left_as_it_is_overdue_up_to_a_limit(
    late_s: float, expected_s: float
) -> None:
    low_s, middle_s, high_s = left_s(OverdueTimes(), late_s)
    assert middle_s == pytest.approx(expected_s, rel=0.03)
    assert late_s / 30 <= low_s <= late_s / 9
    assert middle_s <= high_s <= 9 * late_s


@pytest.mark.parametrize("wait_s", [60.0, 120.0])
def test_many_short_waits_predict_a_long_one(wait_s: float) -> None:
    """Waits that end at a constant rate: of one that has lasted as long as none before, as much is left as of any."""
    overdue, arrivals = OverdueTimes(), 100
    for number in range(arrivals):
        overdue.record("Alder", -wait_s * float(np.log((number + 0.5) / arrivals)), 100.0 * number)
    for late_s in (2 * wait_s, 8 * wait_s):
        assert 0.6 * wait_s < left_s(overdue, late_s)[1] < 1.6 * wait_s


def test_heavy_tailed_waits_are_learned_too() -> None:
    overdue, arrivals = OverdueTimes(), 100
    for number in range(arrivals):
        overdue.record("Alder", 10.0 * arrivals / (number + 0.5), 100.0 * number)
    assert left_s(overdue, 300.0)[1] == pytest.approx(300.0, rel=0.25)
    assert left_s(overdue, 600.0)[1] > 360.0


def test_for_a_known_vendor_the_time_left_is_that_of_arrivals_as_late() -> None:
    overdue = OverdueTimes()
    for number in range(60):
        overdue.record("Alder", (4.0, 200.0)[number % 2], 100.0 * number)
    assert left_s(overdue, 2.5)[1] <= 10.0
    assert left_s(overdue, 10.0)[1] == pytest.approx(190.0)
    assert left_s(overdue, 160.0)[1] == pytest.approx(40.0)
    assert 60.0 < left_s(overdue, 640.0)[1] < 640.0, "nobody was ever so late: the prior stands"


def test_arrivals_in_time_are_not_used_for_late_ones() -> None:
    overdue = OverdueTimes()
    for late_s in (0.0, -30.0):
        overdue.record("Alder", late_s, 100.0)
    assert overdue.learned()["late"] == {}


def test_old_arrivals_weigh_less_and_only_so_many_are_kept() -> None:
    overdue = OverdueTimes()
    for number in range(MOST_ARRIVALS):
        overdue.record("Alder", 500.0, float(number))
    for number in range(20):
        overdue.record("Alder", 100.0, 10 * 86400.0 + number)
    assert left_s(overdue, 40.0)[1] == pytest.approx(60.0)
    assert len(overdue.learned()["late"]["Alder"]) == MOST_ARRIVALS


def test_what_was_learned_goes_on_after_a_restart() -> None:
    overdue, resumed = OverdueTimes(), OverdueTimes()
    for number in range(20):
        overdue.record("Alder", 30.0 + number, 100.0 * number)
    resumed.resume(overdue.learned())
    np.testing.assert_array_equal(resumed.table_s("Alder"), overdue.table_s("Alder"))


def test_an_arrival_is_late_by_its_last_announcement() -> None:
    arrivals = ArrivalForecast()
    dock, away = ("hall", 10.0, 0.0), ("hall", 0.0, 0.0)
    report(arrivals, "r", 0.0, away, [dock], [60.0])
    report(arrivals, "r", 40.0, away, [dock], [90.0])
    report(arrivals, "r", 150.0, dock, [dock], [90.0])
    assert arrivals.overdue.learned()["late"] == {"Alder": [(150.0, 60.0)]}


def expected(at_s: float, stands: bool, *stops: tuple[float, float, float]) -> tuple[list[float], list[float]]:
    """In how long a robot is expected at its stops, and how surely; it has stood at x = 50 or drives towards 0."""
    script = Script([(0, 50, 0)] if stands else [(0, 50 + at_s, 0), (at_s + 50, 0, 0)], stops)
    scene, robots = Scene(site(DOCK), {"a": script}), RobotTable(PlaceGeometry([DOCK], ()), RobotSlots())
    for second in range(int(at_s) + 1):
        scene.fleet.receive(script.says("a", float(second)), NOW_S + second, LINE)
        robots.update(scene.fleet.next_batch(NOW_S + second))
    found = robots[robot("a")].stops
    return [stop.expected_s - NOW_S - at_s for stop in found], [stop.spread_s for stop in found]


def test_a_standing_robot_is_expected_later_the_longer_it_is_overdue() -> None:
    stop = (20.0, 0.0, 0.0)
    assert expected(10.0, True, stop)[0] == [25.0], "no sooner than it can drive there"
    assert expected(60.0, True, stop)[0] == [pytest.approx(35.4, abs=0.1)]
    (left,), (spread,) = expected(180.0, True, stop)
    assert left == pytest.approx(107.5, abs=0.1)
    assert spread > left


def test_an_overdue_robot_that_drives_comes_at_its_speed() -> None:
    assert expected(60.0, False, (20.0, 0.0, 0.0))[0] == [pytest.approx(50.0, abs=1.0)]


def test_the_next_stops_are_delayed_by_as_much() -> None:
    assert expected(60.0, True, (20.0, 0.0, 0.0), (50.0, 9.0, 0.0))[0] == [
        pytest.approx(35.4, abs=0.1),
        pytest.approx(65.4, abs=0.1),
    ]


def test_a_robot_overdue_for_minutes_makes_no_queue() -> None:
    stalled = Script([(0, 40, 0)], [(10, 0, 0)], state=waits)
    scene = Scene(site(DOCK), {"A": stalled, "B": Script([(0, 0, 130), (130, 0, 0)], [(130, 0, 0)])})
    scene.run(118)
    assert scene.engine.open() == []


def test_a_robot_that_has_not_left_in_time_is_expected_to_stay() -> None:
    """A keeps the dock long after it was to be elsewhere."""
    a = Script([(0, 0, 0)], [(30, 40, 0)], state=waits)
    scene = Scene(site(DOCK), {"A": a, "B": Script([(0, 0, 130), (130, 0, 0)], [(130, 0, 0)])})
    assert raised(scene.run(30), "contention") == []
    (advisory,) = raised(scene.run(118, from_s=30), "contention")
    assert isinstance(advisory, ContentionAdvisory)
    assert advisory.wait_s > 10


def test_a_robot_that_waits_at_a_taken_place_has_arrived() -> None:
    inside = Script([(0, 0, 0)], state=lambda _: "idle")
    scene = Scene(site(DOCK), {"A": inside, "B": Script([(0, 30, 0), (26, 4, 0), (500, 4, 0)], [(30, 0, 0)])})
    (advisory,) = raised(scene.run(20), "contention")
    assert isinstance(advisory, ContentionAdvisory)
    revisions = [each for each in scene.run(45, from_s=20) if isinstance(each, ContentionAdvisory)]
    assert scene.engine.open() != []
    assert all(each.queue_length == 1 for each in revisions)
