"""What is learned of batteries from reported levels."""

from math import nan

import numpy as np
import pytest

from deconflict.contention.robots.battery_use import LEVELS_PCT, PRIOR_DRAIN_PCT_PER_S, BatteryUse


def batteries(slots: int = 1) -> BatteryUse:
    made = BatteryUse()
    made.make_room(slots)
    return made


def tell(
    made: BatteryUse, t_s: float, level_pct: float, left_s: float = nan, slot: int = 0, vendor: str = "Alder"
) -> float:
    """One report; the level before it."""
    report = (np.array([t_s]), np.array([level_pct]), np.array([left_s]))
    return float(made.add_levels(np.array([slot]), [vendor], *report)[0])


def drain(made: BatteryUse, slot: int = 0, vendor: str = "Alder") -> float:
    return float(made.drains(np.array([slot]), [vendor])[0])


def charge(
    made: BatteryUse, came_pct: float, left_pct: float = 90.0, charger: str = "c1", vendor: str = "Alder"
) -> None:
    made.arrive_at_charger(0, came_pct)
    made.leave_charger(0, vendor, charger, left_pct)


def test_a_robot_that_reports_only_its_level_is_taken_to_last_eight_hours() -> None:
    made = batteries()
    tell(made, 0.0, 50.0)
    assert drain(made) == pytest.approx(PRIOR_DRAIN_PCT_PER_S)


def test_a_reported_run_time_is_used_until_the_drain_is_measured() -> None:
    made = batteries()
    tell(made, 0.0, 50.0, left_s=3600.0)
    assert drain(made) == pytest.approx(50.0 / 3600.0)
    for t_s in range(60, 661, 60):
        tell(made, float(t_s), 50.0 - 0.03 * t_s, left_s=3600.0)
    assert drain(made) == pytest.approx(0.03)


def test_the_usual_drain_of_a_vendor_is_used_for_its_other_robots() -> None:
    made = batteries(5)
    for slot, rate in enumerate((0.01, 0.02, 0.04)):
        for t_s in (0.0, 1000.0):
            tell(made, t_s, 80.0 - rate * t_s, slot=slot)
    for slot, vendor in ((3, "Alder"), (4, "Corvid")):
        tell(made, 0.0, 40.0, left_s=4000.0, slot=slot, vendor=vendor)
    assert drain(made, 3) == pytest.approx(0.02)
    assert drain(made, 4, "Corvid") == pytest.approx(0.01)


def test_a_level_that_rises_is_no_drain() -> None:
    made = batteries()
    for t_s, level_pct in ((0.0, 30.0), (300.0, 60.0), (899.0, 60.0), (900.0, 54.0)):
        tell(made, t_s, level_pct)
    assert drain(made) == pytest.approx(6.0 / 600.0)


def test_reports_without_a_level_change_nothing() -> None:
    made = batteries()
    assert np.isnan(tell(made, 0.0, 50.0))
    assert tell(made, 10.0, nan) == 50.0
    assert tell(made, 20.0, 49.0) == 50.0
    made.forget(0)
    assert np.isnan(tell(made, 30.0, 48.0))


def test_an_unknown_vendors_robots_come_at_20_to_25_per_cent() -> None:
    below = batteries().share_below("Alder")
    assert np.interp([17.5, 22.5, 27.5], LEVELS_PCT, below) == pytest.approx([0.0, 0.5, 1.0])
    assert batteries().highest_pct("Alder") == 27.5


def test_levels_at_which_robots_came_are_learned_where_they_were_charged() -> None:
    made = batteries()
    for _ in range(27):
        charge(made, 40.0)
    below = made.share_below("Alder")
    assert np.interp(37.5, LEVELS_PCT, below) == pytest.approx(0.1)
    assert np.interp(42.5, LEVELS_PCT, below) == pytest.approx(1.0)
    assert made.highest_pct("Corvid") == 27.5
    assert made.chargers_of("Alder") == {"c1"}
    assert made.chargers_of("Corvid") == frozenset()


@pytest.mark.parametrize(("came_pct", "left_pct"), [(40.0, 40.5), (nan, 90.0), (40.0, nan)])
def test_a_robot_that_was_not_charged_or_has_no_level_teaches_nothing(came_pct: float, left_pct: float) -> None:
    made = batteries()
    charge(made, came_pct, left_pct)
    assert made.highest_pct("Alder") == 27.5
    assert made.chargers_of("Alder") == frozenset()


def test_what_was_learned_goes_on_after_a_restart() -> None:
    made, resumed = batteries(2), batteries(2)
    for t_s in (0.0, 700.0, 1400.0, 2100.0):
        tell(made, t_s, 90.0 - 0.02 * t_s)
    charge(made, 41.0)
    resumed.resume(made.learned())
    tell(resumed, 0.0, 50.0, slot=1)
    assert drain(resumed, 1) == pytest.approx(0.02)
    np.testing.assert_array_equal(resumed.share_below("Alder"), made.share_below("Alder"))
    assert resumed.learned() == made.learned()
