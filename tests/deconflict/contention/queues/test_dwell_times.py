"""How long resources are kept."""

import pytest

from deconflict.contention.queues.dwell_times import DwellTimes
from tests.deconflict.contention.scenes import resource


def test_a_prior_holds_until_enough_has_been_seen() -> None:
    dwells = DwellTimes(resource("c", 0, 0, kind="charger"))
    assert dwells.service_s == 900.0
    for _ in range(2):
        dwells.add(120.0)
    assert dwells.service_s == 900.0
    for _ in range(2):
        dwells.add(120.0)
    assert dwells.service_s == 120.0


def test_passing_through_is_no_dwell() -> None:
    dwells = DwellTimes(resource("d", 0, 0))
    for _ in range(20):
        dwells.add(1.0)
    assert dwells.service_s == 45.0


def test_a_service_time_of_the_site_file_is_not_replaced() -> None:
    dwells = DwellTimes(resource("d", 0, 0, service_s=30.0))
    for _ in range(20):
        dwells.add(300.0)
    assert dwells.service_s == 30.0


@pytest.mark.parametrize(("elapsed_s", "remaining_s"), [(0.0, 30.0), (25.0, 5.0), (40.0, 7.5), (400.0, 7.5)])
def test_a_robot_that_outstays_all_dwells_stays_a_quarter_of_a_dwell_more(elapsed_s: float, remaining_s: float) -> None:
    assert DwellTimes(resource("d", 0, 0, service_s=30.0)).remaining_s(elapsed_s) == remaining_s


def test_the_remaining_time_is_taken_from_longer_dwells() -> None:
    dwells = DwellTimes(resource("d", 0, 0))
    for dwell_s in (10.0, 10.0, 10.0, 10.0, 10.0, 100.0, 100.0):
        dwells.add(dwell_s)
    assert dwells.remaining_s(50.0) == 50.0


def test_dwells_are_kept_over_a_restart() -> None:
    dwells, resumed = DwellTimes(resource("c", 0, 0, kind="charger")), DwellTimes(resource("c", 0, 0, kind="charger"))
    for _ in range(9):
        dwells.add(120.0)
    resumed.resume(dwells.learned())
    assert resumed.service_s == 120.0
