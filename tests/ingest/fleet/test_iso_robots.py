"""Robots of ISO 21423 in the fleet."""

import pytest

from ingest.batch import Basis
from ingest.languages.front_ends import language_of_topic
from ingest.settings import Datum
from tests.helpers.iso_saying import CCS, ROBOT, identity, line, odometry, states, topic, trajectory
from tests.ingest.fleet.made_fleet import NOW_S, counted, fleet


def test_a_robot_has_vendor_name_and_forecast_by_its_messages() -> None:
    of = fleet(datums=(Datum(id=CCS, name="Hall"),))
    of.receive(odometry(NOW_S), NOW_S, line("odometry"))
    assert of.robots[ROBOT].vendor == "unknown"
    of.receive(identity(NOW_S), NOW_S, line("identity"))
    of.receive(states(NOW_S, "MODE_AUTO"), NOW_S, line("status"))
    of.next_batch(NOW_S)
    robot = of.robots[ROBOT]
    assert (robot.vendor, robot.name, robot.language, robot.state) == ("Acme", "Acme 42", "iso21423", "navigating")
    ahead = trajectory(NOW_S, *((NOW_S + i, float(i), 0.0) for i in range(1, 6)))
    of.receive(ahead, NOW_S, line("localTrajectory"))
    of.next_batch(NOW_S)
    assert robot.forecast is not None
    assert robot.forecast.basis is Basis.PATH
    assert robot.forecast.knots[5][:3] == pytest.approx((NOW_S + 5, 5.0, 0.0))
    assert robot.forecast.knots[-1][:3] == pytest.approx((NOW_S + 10, 10.0, 0.0))
    assert robot.forecast.length_m == 1.2
    assert counted(of, "rejections_total") == {}


def test_a_robot_is_forecast_once_for_all_updates_between_two_batches() -> None:
    of = fleet(datums=())
    of.receive(identity(NOW_S), NOW_S, line("identity"))
    of.receive(odometry(NOW_S), NOW_S, line("odometry"))
    of.next_batch(NOW_S)
    robot = of.robots[ROBOT]
    unknown = robot.deviations["datum-unknown"]
    of.receive(trajectory(NOW_S, (NOW_S + 1, 1.0, 0.0)), NOW_S, line("localTrajectory"))
    of.receive(states(NOW_S, "MODE_AUTO"), NOW_S, line("status"))
    of.next_batch(NOW_S)
    of.next_batch(NOW_S + 1)
    assert robot.deviations["datum-unknown"] == unknown + 1


def test_points_that_all_have_the_present_time_get_times_by_speed() -> None:
    of = fleet(datums=(Datum(id=CCS, name="Hall"),))
    of.receive(identity(NOW_S), NOW_S, line("identity"))
    of.receive(trajectory(NOW_S, *((NOW_S, float(i), 0.0) for i in range(1, 6))), NOW_S, line("localTrajectory"))
    of.receive(odometry(NOW_S, speed=1.0), NOW_S, line("odometry"))
    robot = of.robots[ROBOT]
    assert robot.forecast is not None
    assert robot.forecast.knots[5][:2] == pytest.approx((NOW_S + 5, 5.0))
    assert robot.deviations["path-retimed"] == 1


def test_its_topics_belong_to_its_language() -> None:
    assert language_of_topic(topic("odometry")) == "iso21423"
    assert language_of_topic("/ISO_21423/v1/DOOR/x/status") is None
