"""What a vendor's robots say of their arrivals, held against when they came."""

import numpy as np
import pytest

from deconflict.contention import arrivals as arrivals_module
from deconflict.contention.arrivals import MOST_RATIOS, Arrivals
from deconflict.contention.promises import Promises, Spot

DOCK: Spot = ("hall", 10.0, 0.0)
AWAY: Spot = ("hall", 0.0, 0.0)


def trip(arrivals: Arrivals, robot: str, begins_s: float, takes_s: float, told_s: float) -> None:
    arrivals.heard(robot, "Alder", begins_s, AWAY, [DOCK], [begins_s + told_s])
    arrivals.heard(robot, "Alder", begins_s + takes_s, DOCK, [DOCK], [begins_s + told_s])


def expected(arrivals: Arrivals, vendor: str, now_s: float, told_s: float) -> tuple[float, float]:
    """Of one robot."""
    found_s, spread_s = arrivals_module.expected(
        np.array([arrivals.quantiles(vendor)]), np.array([now_s]), np.array([told_s])
    )
    return float(found_s[0]), float(spread_s[0])


def test_nothing_seen_means_that_the_robot_is_believed() -> None:
    expected_s, spread_s = expected(Arrivals(), "Alder", 100.0, 160.0)
    assert expected_s == 160.0
    assert 0 < spread_s < 30


def test_a_vendor_that_is_always_late_is_expected_late() -> None:
    arrivals = Arrivals()
    for number in range(20):
        trip(arrivals, "r", 1000.0 * number, takes_s=90.0, told_s=60.0)
    expected_s, spread_s = expected(arrivals, "Alder", 0.0, 100.0)
    assert expected_s == pytest.approx(150.0)
    assert spread_s < 30
    assert expected(arrivals, "Corvid", 0.0, 100.0)[0] == 100.0


def test_a_time_that_is_past_is_now() -> None:
    assert expected(Arrivals(), "Alder", 100.0, 60.0) == (100.0, 0.0)


def test_a_plan_that_is_given_up_teaches_nothing() -> None:
    arrivals = Arrivals()
    arrivals.heard("r", "Alder", 0.0, AWAY, [DOCK], [60.0])
    arrivals.heard("r", "Alder", 10.0, AWAY, [("hall", 50.0, 0.0)], [60.0])
    arrivals.heard("r", "Alder", 300.0, DOCK, [], [])
    assert arrivals.seen().get("Alder", 0) == 0


def test_a_robot_that_stands_at_its_destination_teaches_nothing() -> None:
    arrivals = Arrivals()
    for t in range(100):
        arrivals.heard("r", "Alder", float(t), DOCK, [DOCK], [500.0])
    assert arrivals.seen().get("Alder", 0) == 0


def test_what_is_kept_is_bounded() -> None:
    arrivals = Arrivals()
    for number in range(2 * MOST_RATIOS):
        trip(arrivals, "r", 1000.0 * number, takes_s=60.0, told_s=60.0)
    assert arrivals.seen() == {"Alder": MOST_RATIOS}


def test_what_was_learned_goes_on_after_a_restart() -> None:
    arrivals, resumed = Arrivals(), Arrivals()
    for number in range(20):
        trip(arrivals, "r", 1000.0 * number, takes_s=90.0, told_s=60.0)
    resumed.resume(arrivals.learned())
    assert resumed.quantiles("Alder") == arrivals.quantiles("Alder")
    assert resumed.seen() == {"Alder": 20}


def test_a_word_that_is_repeated_is_kept_every_half_minute_and_held_against_the_arrival() -> None:
    arrivals = Arrivals()
    for t in range(101):
        arrivals.heard("r", "Alder", float(t), DOCK if t == 100 else AWAY, [DOCK], [110.0])
    assert arrivals.seen() == {"Alder": 4}


def test_where_a_robot_comes_and_whence_it_sets_out_again_is_seen_as_if_it_said_something_new_each_time() -> None:
    rng, spots = np.random.default_rng(1), [DOCK, ("hall", 10.0, 2.04), ("yard", 10.0, 0.0)]
    again, anew, came = Promises(), Promises(), 0
    for _ in range(20):
        way_m = np.array([9.0, 0.0]) + np.cumsum(rng.normal(scale=0.2, size=(400, 2)), axis=0)
        for t, (x_m, y_m) in enumerate(way_m.tolist()):
            now, told_s = ("r", float(t), ("hall", x_m, y_m)), [t + 40.0, t + 60.0, t + 90.0]
            turn = 1 - t % 2 * 2
            expected = anew.heard(*now, spots[::turn], told_s[::turn])
            assert sorted(again.heard(*now, spots, told_s)) == sorted(expected)
            came += len(expected)
        again.forget("r")
        anew.forget("r")
    assert came > 50
