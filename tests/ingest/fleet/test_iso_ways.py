"""Robots of ISO 21423 that tell their way as a curve without times."""

from math import pi, sqrt
from typing import Any

import pytest

from ingest.batch import Basis
from ingest.fleet.robot import Robot
from ingest.settings import Datum
from tests.helpers.iso_saying import CCS, ROBOT, identity, iso, line, odometry, points, states, trajectory
from tests.helpers.iso_saying import at as place
from tests.ingest.fleet.made_fleet import NOW_S, at, fleet

CORNER = ((0.0, 0.0), (12.0, 0.0), (12.0, 20.0))


def way(*corners: tuple[float, float], ccs: str = CCS, **keys: Any) -> bytes:
    control = [{"locationPoint": place(x, y, ccsId=ccs)} for x, y in corners]
    return iso(NOW_S, globalPath={"degree": 1, "controlPoints": control} | keys)


def told(*messages: tuple[str, bytes]) -> Robot:
    of = fleet(datums=(Datum(id=CCS, name="Hall"),))
    for resource, raw in (("identity", identity(NOW_S)), ("status", states(NOW_S, "MODE_AUTO")), *messages):
        of.receive(raw, NOW_S + 2, line(resource))
    of.next_batch(NOW_S + 2)
    return of.robots[ROBOT]


def drives(x: float = 6.0, y: float = 0.0, yaw: float | None = 0.0, speed: float = 1.0) -> tuple[str, bytes]:
    return "odometry", odometry(NOW_S + 2, x, y, yaw, speed)


@pytest.mark.parametrize("yaw", [0.0, None])
def test_a_robot_that_drives_goes_along_its_way(yaw: float | None) -> None:
    made = told(("odometry", odometry(NOW_S + 1, 5.0, 0.0, yaw, 1.0)), ("globalPath", way(*CORNER)), drives(yaw=yaw))
    assert made.forecast
    assert made.forecast.basis is Basis.ORDER
    assert at(made.forecast, NOW_S + 7)[:2] == pytest.approx((11.0, 0.0), abs=0.1)
    x, y, yaw_rad = at(made.forecast, NOW_S + 12)
    assert x == pytest.approx(12.0)
    assert 1.5 < y < 3.5
    assert yaw_rad == pytest.approx(pi / 2)


def test_a_way_is_used_where_odometry_sends_no_speed_but_moves() -> None:
    still = iso(NOW_S + 2, pose={"locationPoint": place(5.0, 0.0), "orientation": {"yaw": 0.0}}, velocity={})
    before = iso(NOW_S + 1, pose={"locationPoint": place(4.0, 0.0), "orientation": {"yaw": 0.0}}, velocity={})
    made = told(("globalPath", way(*CORNER)), ("odometry", before), ("odometry", still))
    assert at(made.forecast, NOW_S + 12)[0] == pytest.approx(12.0)


@pytest.mark.parametrize(
    "odd", [drives(speed=0.0), drives(y=9.0), drives(x=12.0, y=20.0)], ids=["stands", "is elsewhere", "is at its end"]
)
def test_a_robot_that_does_not_drive_along_its_way_is_foreseen_without_it(odd: tuple[str, bytes]) -> None:
    made, other = told(("globalPath", way(*CORNER)), odd), told(odd)
    assert at(made.forecast, NOW_S + 10) == pytest.approx(at(other.forecast, NOW_S + 10))


def test_a_way_on_another_map_is_not_used() -> None:
    made = told(("globalPath", way(*CORNER, ccs="yard")), drives())
    assert at(made.forecast, NOW_S + 12)[:2] == pytest.approx((16.0, 0.0))


def test_a_trajectory_goes_on_along_the_way() -> None:
    ahead = trajectory(NOW_S + 2, *((NOW_S + 2 + s, 6.0 + s, 0.0) for s in (1, 2, 3)))
    made = told(("globalPath", way(*CORNER)), ("localTrajectory", ahead), drives())
    assert made.forecast
    assert made.forecast.basis is Basis.PATH
    assert at(made.forecast, NOW_S + 5)[:2] == pytest.approx((9.0, 0.0))
    assert at(made.forecast, NOW_S + 7)[:2] == pytest.approx((11.0, 0.0))
    assert at(made.forecast, NOW_S + 12)[:2] == pytest.approx((12.0, 4.0 - pi / 2), abs=0.1)


@pytest.mark.parametrize(("stops_m", "goes_on"), [(9.0, False), (12.0, True)])
def test_a_trajectory_that_slows_to_a_stop_goes_on_only_at_a_corner_of_the_way(stops_m: float, goes_on: bool) -> None:
    rows = [(1.0, stops_m - 0.5, 0.0), (2.0, stops_m, 0.0), (3.0, stops_m, 0.0)]
    ahead = trajectory(NOW_S + 2, *((NOW_S + 2 + s, x, y) for s, x, y in rows))
    made = told(("globalPath", way(*CORNER)), ("localTrajectory", ahead), drives(x=stops_m - 1.2))
    x, y, _ = at(made.forecast, NOW_S + 12)
    assert x == pytest.approx(stops_m)
    assert (y > 2.0) is goes_on


def test_a_curve_is_followed() -> None:
    sent = way((10.0, 0.0), (10.0, 10.0), (0.0, 10.0), degree=2, knots=[0, 0, 0, 1, 1, 1])
    control = [(10.0, 0.0, 1.0), (10.0, 10.0, sqrt(0.5)), (0.0, 10.0, 1.0)]
    corners = [{"locationPoint": place(x, y), "weight": weight} for x, y, weight in control]
    sent = iso(NOW_S, globalPath={"degree": 2, "controlPoints": corners, "knots": [0, 0, 0, 1, 1, 1]})
    made = told(("globalPath", sent), drives(10.0, 0.0, pi / 2))
    x, y, _ = at(made.forecast, NOW_S + 10)
    assert x**2 + y**2 == pytest.approx(100.0, abs=1.0)
    assert y == pytest.approx(7.2, abs=0.4)


@pytest.mark.parametrize("keys", [{"controlPoints": []}, {"degree": 7}, {"degree": "one"}, {"controlPoints": "none"}])
def test_a_way_that_can_not_be_read_costs_itself(keys: dict[str, Any]) -> None:
    made = told(("globalPath", way(*CORNER, **keys)), drives())
    assert made.forecast
    assert at(made.forecast, NOW_S + 7)[0] == pytest.approx(11.0)


def test_a_path_of_many_dense_points_ends_where_it_ends() -> None:
    rows = [(0.02 * row, min(0.02 * row, 6.0)) for row in range(1, 501)]
    ahead = trajectory(NOW_S + 2, *((NOW_S + 2 + s, 6.0 + x, 0.0) for s, x in rows))
    made = told(("localTrajectory", ahead), drives())
    assert at(made.forecast, NOW_S + 6)[0] == pytest.approx(10.0)
    assert at(made.forecast, NOW_S + 12)[0] == pytest.approx(12.0)


def test_a_plan_of_many_dense_nodes_ends_where_it_ends() -> None:
    rows = [(NOW_S + 2 + 0.02 * row, 6.0 + 0.02 * row, 0.0) for row in range(1, 401)]
    made = told(("globalPlan", iso(NOW_S + 2, globalPlan=points(*rows))), drives())
    assert at(made.forecast, NOW_S + 6)[0] == pytest.approx(10.0, abs=0.3)
    assert at(made.forecast, NOW_S + 12)[0] == pytest.approx(14.0, abs=0.1)
