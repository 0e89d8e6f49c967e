"""Forecasts follow what robots do: their pace, turns on the spot, and the way beyond a short path."""

import json
from collections.abc import Callable
from itertools import pairwise
from math import atan2, cos, hypot, pi, sin
from typing import Any

import numpy as np
import pytest

from ingest.batch import Basis
from ingest.fleet import fleet_report
from ingest.fleet.fleet import Fleet
from ingest.fleet.prediction.forecast_model import Forecast, Sighting
from ingest.fleet.prediction.pace import CORNER, Pace, Paces
from ingest.fleet.robot import Robot
from ingest.settings import Datum
from tests.helpers.iso_saying import CCS, identity, odometry, states, trajectory
from tests.helpers.iso_saying import line as iso_line
from tests.helpers.saying import HALL, angle, points, robot, status
from tests.helpers.vda_saying import MAP, edge, factsheet, line, node, order, position, under_way, vda, visualization
from tests.ingest.fleet.made_fleet import LINE, NOW_S, at, counted, document, documents, fleet, hall

FAR = [node(0, 0.0), node(1, 2000.0)]
Pose = tuple[float, float, float]
"""x_m, y_m, yaw_rad"""
LIMIT = {"physicalParameters": {"length": 1.2, "width": 0.8, "speedMax": 2.0}}


def drive(
    of: Fleet, mps: float, seconds: range, *, from_m: float = 0.0, serial: str = "0001", tells_speed: bool = True
) -> Robot:
    """Let a robot drive straight for some seconds, at the speed, along an order whose edge has no limit."""
    for s in seconds:
        if s == seconds.start:
            of.receive(factsheet(NOW_S + s, serialNumber=serial, **LIMIT), NOW_S + s, line("factsheet", serial))
            of.receive(order(NOW_S + s, FAR, serialNumber=serial), NOW_S + s, line("order", serial))
        velocity = {"vx": mps, "vy": 0.0, "omega": 0.0} if tells_speed else None
        x = from_m + mps * (s - seconds.start)
        raw = under_way(NOW_S + s, x, 0.0, FAR[1:], serialNumber=serial, velocity=velocity)
        of.receive(raw, NOW_S + s, line("state", serial))
    return next(each for each in of.robots.values() if each.serial == serial)


@pytest.mark.parametrize("tells_speed", [True, False])
def test_a_robot_slower_than_its_limit_is_foreseen_at_its_own_pace(tells_speed: bool) -> None:
    last_s = 1 if tells_speed else 7
    robot = drive(hall(), 0.5, range(last_s + 1), tells_speed=tells_speed)
    x, _, _ = at(robot.forecast, NOW_S + last_s + 10)
    assert x == pytest.approx(0.5 * (last_s + 10), abs=0.1)


def test_a_robot_of_which_nothing_is_known_goes_as_its_model_usually_does() -> None:
    of = hall()
    drive(of, 0.5, range(8))
    newcomer = drive(of, 0.0, range(8, 9), from_m=100.0, serial="0002", tells_speed=False)
    assert at(newcomer.forecast, NOW_S + 18)[0] == pytest.approx(105.0, abs=0.3)


def test_pace_follows_new_firmware_within_ten_minutes_of_driving() -> None:
    of = hall()
    drive(of, 0.4, range(300), tells_speed=False)
    faster = drive(of, 1.2, range(300, 900), tells_speed=False)
    assert at(faster.forecast, NOW_S + 909)[0] == pytest.approx(1.2 * 609, abs=0.3)
    newcomer = drive(of, 0.0, range(900, 901), serial="0002", tells_speed=False)
    assert at(newcomer.forecast, NOW_S + 910)[0] == pytest.approx(12.0, abs=1.0)


def test_a_limit_of_the_edge_bounds_what_a_robot_does_elsewhere() -> None:
    of, nodes = hall(), [node(0, 0.0), node(1, 10.0), node(2, 30.0)]
    edges = [edge(0), edge(1, maxSpeed=0.3)]
    of.receive(factsheet(NOW_S, **LIMIT), NOW_S, line("factsheet"))
    of.receive(order(NOW_S, nodes, edges), NOW_S, line("order"))
    for s in range(9):
        moving = under_way(NOW_S + s, float(s), 0.0, nodes[1:], velocity={"vx": 1.0, "omega": 0.0})
        of.receive(moving, NOW_S + s, line("state"))
    (robot,) = of.robots.values()
    assert at(robot.forecast, NOW_S + 10)[0] == pytest.approx(10.0, abs=0.1)
    knots = np.array(robot.forecast.knots if robot.forecast else ())
    slow = [(b[1] - a[1]) / (b[0] - a[0]) for a, b in pairwise(knots) if a[1] >= 10.0 and b[1] > a[1]]
    assert max(slow) <= 0.3


def turning(of: Fleet, *messages: bytes, length_m: float = 3.0) -> Forecast:
    sizes = {"physicalParameters": {"length": length_m, "width": 1.0, "speedMax": 1.0}}
    of.receive(factsheet(NOW_S, **sizes), NOW_S, line("factsheet"))
    for kind, raw in zip(("order", "state"), messages, strict=True):
        of.receive(raw, NOW_S, line(kind))
    (robot,) = of.robots.values()
    assert robot.forecast is not None
    return robot.forecast


@pytest.mark.parametrize("theta", [pi / 2, -pi / 2, 3.0])
def test_a_robot_turns_on_the_spot_as_a_node_says(theta: float) -> None:
    nodes = [node(0, 0.0), node(1, 0.0, nodePosition={"x": 0.0, "y": 0.0, "mapId": MAP, "theta": theta})]
    made = turning(hall(), order(NOW_S, nodes), under_way(NOW_S, 0.0, 0.0, nodes[1:]))
    assert made.basis is Basis.ORDER
    assert at(made, NOW_S + 10) == pytest.approx((0.0, 0.0, theta))
    assert abs(at(made, NOW_S + 1)[2]) == pytest.approx(1.0)


def test_a_robot_turns_where_it_arrives_and_before_an_edge_of_rotation() -> None:
    place = {"x": 5.0, "y": 0.0, "mapId": MAP}
    nodes = [node(0, 0.0), node(1, 5.0), node(2, 5.0, nodePosition=place)]
    edges = [edge(0, maxSpeed=1.0), edge(1, orientation=pi / 2, orientationType="GLOBAL", maxRotationSpeed=0.5)]
    made = turning(hall(), order(NOW_S, nodes, edges), under_way(NOW_S, 0.0, 0.0, nodes[1:], velocity={"vx": 1.0}))
    assert at(made, NOW_S + 5)[2] == pytest.approx(0.0)
    assert at(made, NOW_S + 7)[2] == pytest.approx(1.0, abs=0.05)
    assert at(made, NOW_S + 9)[2] == pytest.approx(pi / 2)


def test_a_node_whose_heading_may_differ_asks_for_no_turn() -> None:
    place = {"x": 0.0, "y": 0.0, "mapId": MAP, "theta": 1.0, "allowedDeviationTheta": 3.14}
    nodes = [node(0, 0.0), node(1, 0.0, nodePosition=place)]
    made = turning(hall(), order(NOW_S, nodes), under_way(NOW_S, 0.0, 0.0, nodes[1:]))
    assert at(made, NOW_S + 10)[2] == 0.0


def test_the_turn_of_a_body_off_its_centre_stays_on_its_circle() -> None:
    outline = [{"x": 0.0, "y": 0.5}, {"x": 0.0, "y": -0.5}, {"x": 3.0, "y": -0.5}, {"x": 3.0, "y": 0.5}]
    sheet = {
        "physicalParameters": {"length": 3.0, "width": 1.0, "speedMax": 1.0},
        "agvGeometry": {"envelopes2d": [{"set": "body", "polygonPoints": outline}]},
    }
    of = hall()
    of.receive(factsheet(NOW_S, **sheet), NOW_S, line("factsheet"))
    nodes = [node(0, 0.0), node(1, 0.0, nodePosition={"x": 0.0, "y": 0.0, "mapId": MAP, "theta": pi / 2})]
    of.receive(order(NOW_S, nodes), NOW_S, line("order"))
    of.receive(under_way(NOW_S, 0.0, 0.0, nodes[1:]), NOW_S, line("state"))
    (robot,) = of.robots.values()
    for t_s in np.linspace(NOW_S, NOW_S + 3, 13):
        x, y, _ = at(robot.forecast, t_s)
        assert hypot(x, y) == pytest.approx(1.5, abs=0.06)


def test_a_turn_rate_is_what_was_observed() -> None:
    of = hall()
    nodes = [node(0, 0.0), node(1, 0.0, nodePosition={"x": 0.0, "y": 0.0, "mapId": MAP, "theta": 3.0})]
    of.receive(order(NOW_S, nodes), NOW_S, line("order"))
    for s in range(5):
        place = position(0.0, 0.0, 0.25 * s)
        of.receive(under_way(NOW_S + s, 0.0, 0.0, nodes[1:], agvPosition=place), NOW_S + s, line("state"))
    (robot,) = of.robots.values()
    assert at(robot.forecast, NOW_S + 8)[2] == pytest.approx(2.0, abs=0.02)


def told(of: Fleet, *path: tuple[float, float, float], mps: float = 1.0, **keys: Any) -> Forecast:
    (_, to_x, to_y), *_ = path
    ways = points(*((NOW_S + t_s, x, y, atan2(to_y, to_x)) for t_s, x, y in path))
    of.receive(status("A", NOW_S, velocity={"linear": mps}, path=ways, **keys), NOW_S, LINE)
    made = of.robots[robot("A")].forecast
    assert made is not None
    return made


@pytest.mark.parametrize("count", [1, 2, 3, 5, 8])
def test_a_path_that_ends_before_the_horizon_goes_on_as_it_went(count: int) -> None:
    ways = [(float(s), 0.8 * s, 0.6 * s) for s in range(1, count + 1)]
    assert at(told(fleet(), *ways), NOW_S + 10)[:2] == pytest.approx((8.0, 6.0))


def test_a_path_that_slows_to_a_stop_or_ends_at_a_destination_ends_there() -> None:
    assert at(told(fleet(), (1, 1.0, 0.0), (2, 1.5, 0.0), (3, 1.51, 0.0)), NOW_S + 10)[0] == pytest.approx(1.51)
    there = points((NOW_S + 60, 3.2, 0.0, 0.0))
    made = told(fleet(), (1, 1.0, 0.0), (2, 2.0, 0.0), (3, 3.0, 0.0), destinations=there)
    assert at(made, NOW_S + 10)[0] == pytest.approx(3.0)


def test_a_robot_goes_on_towards_its_destination_and_stands_there() -> None:
    there = points((NOW_S + 60, 5.0, 2.0, pi / 2))
    made = told(fleet(), (1, 1.0, 0.0), (2, 2.0, 0.0), (3, 3.0, 0.0), destinations=there)
    assert at(made, NOW_S + 5)[:2] == pytest.approx((5.0, 0.0))
    assert at(made, NOW_S + 12)[:2] == pytest.approx((5.0, 2.0))


@pytest.mark.parametrize("off_m", [-0.3, 0.0, 0.3])
@pytest.mark.parametrize("aside_m", [6.0, -6.0])
def test_a_path_that_ends_at_the_corner_to_its_destination_turns_there(off_m: float, aside_m: float) -> None:
    there = points((NOW_S + 60, 3.0 + off_m, aside_m, pi / 2))
    made = told(fleet(), (1, 1.0, 0.0), (2, 2.0, 0.0), (3, 3.0, 0.0), destinations=there)
    x, y, _ = at(made, NOW_S + 8)
    assert abs(x - 3.0) <= 0.31
    assert y * aside_m > 0.0
    assert abs(y) > 2.0


def test_a_robot_that_only_tells_a_destination_turns_towards_it_and_at_it() -> None:
    there = points((NOW_S - 1, 0.0, 4.0, 0.0))
    of = fleet()
    of.receive(status("A", NOW_S, velocity={"linear": 0.0}, destinations=there), NOW_S, LINE)
    made = of.robots[robot("A")].forecast
    assert made is not None
    assert made.basis is Basis.DESTINATION
    turned_s = pi / 2
    assert at(made, NOW_S + turned_s) == pytest.approx((0.0, 0.0, pi / 2))
    assert at(made, NOW_S + turned_s + 4) == pytest.approx((0.0, 4.0, pi / 2))
    assert at(made, NOW_S + 2 * turned_s + 4) == pytest.approx((0.0, 4.0, 0.0), abs=1e-6)


@pytest.mark.parametrize("every_s", [5.0, 10.0, 30.0])
@pytest.mark.parametrize("state", ["navigating", "manualOverride"])
def test_a_robot_that_tells_its_place_alone_and_seldom_is_foreseen_until_its_next_report(
    every_s: float, state: str
) -> None:
    of, direction_rad = fleet(), 0.7
    for count in range(3):
        x, y = (1.2 * every_s * count * part for part in (cos(direction_rad), sin(direction_rad)))
        place = {"x": x, "y": y, "planarDatum": HALL}
        raw = status("A", NOW_S + every_s * count, location=place, operationalState=state, velocity=None)
        of.receive(raw, NOW_S + every_s * count, LINE)
    made = of.robots[robot("A")].forecast
    assert made is not None
    assert made.basis is Basis.VELOCITY
    x, y, _ = at(made, NOW_S + 3 * every_s + 9.9)
    assert hypot(x, y) == pytest.approx(1.2 * (3 * every_s + 9.9), rel=0.01)


@pytest.mark.parametrize("code", ["Robot Stuck", "E-Stop pressed"])
def test_a_robot_that_drives_keeps_its_path_whatever_error_it_reports(code: str) -> None:
    of = fleet()
    for s, mps in enumerate((1.0, 1.0, 0.0, 0.0)):
        x = float(min(s, 2))
        ways = points(*((NOW_S + s + i, x + i, 0.0, 0.0) for i in range(1, 11)))
        raw = status("A", NOW_S + s, x, velocity={"linear": mps}, path=ways, errorCodes=[code])
        of.receive(raw, NOW_S + s, LINE)
        made = of.robots[robot("A")].forecast
        assert made is not None
        assert made.basis is (Basis.PATH if mps else Basis.STATIONARY)


def test_a_path_under_another_spelling_of_its_datum_stays_on_the_robots_floor() -> None:
    of = fleet()
    ways = points(*((NOW_S + i, float(i), 0.0, 0.0) for i in range(1, 11)))
    for each in ways:
        each["planarDatumUUID"] = "Hall-1"
    for s in range(2):
        of.receive(status("A", NOW_S + s, velocity={"linear": 1.0}, path=ways), NOW_S + s, LINE)
    made = of.robots[robot("A")].forecast
    assert made is not None
    assert made.basis is Basis.PATH
    assert set(made.floors) == {0}
    assert counted(of, "deviations_total")["unknown", "path-datum-unknown"] == 2
    named = [value["value"] for value in document(of, "A")["odd_values"] if value["rule"] == "path-datum-unknown"]
    assert named == ["hall-1"]


@pytest.mark.parametrize(("off_m", "follows"), [(0.0, True), (300.0, False), (-40.0, False)])
def test_an_order_on_a_map_that_nobody_has_is_followed_only_by_a_robot_that_drives_that_way(
    off_m: float, follows: bool
) -> None:
    of, places = hall(), [(0.0, 0.0), (6.0, 0.0), (6.0, 30.0)]
    nodes = [
        node(row, 0.0, nodePosition={"x": x + off_m, "y": y + off_m, "mapId": "plan"})
        for row, (x, y) in enumerate(places)
    ]
    of.receive(order(NOW_S, nodes), NOW_S, line("order"))
    for s in range(12):
        x, y, theta = (1.0 + s, 0.0, 0.0) if s < 6 or not follows else (6.0, s - 5.0, pi / 2)
        pose, ahead = position(x, y, theta), nodes[1:] if s < 5 else nodes[2:]
        of.receive(under_way(NOW_S + s, x, y, ahead, agvPosition=pose), NOW_S + s, line("state"))
        (robot,) = of.robots.values()
        assert robot.forecast is not None
        assert robot.forecast.basis is (Basis.ORDER if follows or s < 4 else Basis.VELOCITY)
    assert at(robot.forecast, NOW_S + 16)[:2] == pytest.approx((6.0, 11.0) if follows else (17.0, 0.0), abs=0.3)
    (odd,) = [odd for odd in documents(of)[0]["odd_values"] if odd["rule"] == "path-datum-unknown"]
    assert odd["reading"].startswith("the robot's own floor" if follows else "not followed")


def test_an_order_that_comes_later_keeps_the_speed_that_was_observed() -> None:
    of = hall()
    robot = drive(of, 0.5, range(3), tells_speed=False)
    of.receive(vda(NOW_S + 2.5, orderId="", connectionState="ONLINE"), NOW_S + 2.5, line("connection"))
    of.receive(factsheet(NOW_S + 2.6, **LIMIT), NOW_S + 2.6, line("factsheet"))
    assert robot.seen is not None
    assert robot.seen.linear_mps == pytest.approx(0.5)


def test_a_robot_that_reports_its_turn_rate_turns_at_it() -> None:
    nodes = [node(0, 0.0), node(1, 0.0, nodePosition={"x": 0.0, "y": 0.0, "mapId": MAP, "theta": 1.5})]
    moving = under_way(NOW_S, 0.0, 0.0, nodes[1:], velocity={"vx": 0.0, "omega": 0.3})
    assert at(turning(hall(), order(NOW_S, nodes), moving), NOW_S + 2)[2] == pytest.approx(0.6, abs=0.01)


def test_what_a_corner_takes_beyond_its_turn_is_learned() -> None:
    """The robot turns in the time that is assumed, and loses 1.5 s by braking and starting at each corner."""
    of, lost_s, side_m, turn_s = hall(), 1.5, 6.0, pi / 2
    places = [(0.0, 0.0), (6.0, 0.0), (6.0, 6.0), (0.0, 6.0)]
    nodes = [node(number, *places[number % 4]) for number in range(13)]
    of.receive(order(NOW_S, nodes), NOW_S, line("order"))
    for s in range(60):
        side, since_s = divmod(float(s), side_m + turn_s + lost_s)
        part, number = min(since_s / side_m, 1.0), int(side)
        (from_x, from_y), (to_x, to_y) = places[number % 4], places[(number + 1) % 4]
        x, y = from_x + part * (to_x - from_x), from_y + part * (to_y - from_y)
        yaw_rad = number * pi / 2 + min(max(since_s - side_m - lost_s / 2, 0.0), turn_s)
        velocity = {"vx": 1.0 if part < 1.0 else 0.0, "omega": 0.0}
        place = position(x, y, yaw_rad)
        moving = under_way(NOW_S + s, x, y, nodes[number + 1 :], agvPosition=place, velocity=velocity)
        of.receive(moving, NOW_S + s, line("state"))
    (robot,) = of.robots.values()
    assert robot.pace.seen(CORNER) == pytest.approx(lost_s, abs=0.4)
    assert Paces(Pace(), Sighting(NOW_S, 0, 0.0, 0.0, 0.0)).corner_s == 0.0


def test_a_robot_that_turns_where_its_path_stands_goes_on_turning() -> None:
    here = points(*((NOW_S + s, 0.0, 0.0, 0.0) for s in range(1, 11)))
    of = fleet()
    of.receive(status("A", NOW_S, velocity={"linear": 0.0, "angular": angle(0.3)}, path=here), NOW_S, LINE)
    made = of.robots[robot("A")].forecast
    assert at(made, NOW_S + 5)[2] == pytest.approx(1.5)


def test_the_heading_of_a_point_of_an_iso_trajectory_is_a_turn() -> None:
    of = fleet(datums=(Datum(id=CCS, name="Hall"),))
    of.receive(identity(NOW_S), NOW_S, iso_line("identity"))
    sent = json.loads(trajectory(NOW_S, (NOW_S + 2, 0.0, 0.0), (NOW_S + 8, 0.0, 0.0)))
    for point, yaw_rad in zip(sent["localTrajectory"], (0.0, 1.2), strict=True):
        point["orientation"] = {"yaw": yaw_rad}
    of.receive(json.dumps(sent).encode(), NOW_S, iso_line("localTrajectory"))
    of.receive(odometry(NOW_S), NOW_S, iso_line("odometry"))
    (robot,) = of.robots.values()
    assert at(robot.forecast, NOW_S + 5)[2] == pytest.approx(0.6)
    assert at(robot.forecast, NOW_S + 9)[2] == pytest.approx(1.2)


def test_a_destination_without_a_time_is_a_destination() -> None:
    there = points((NOW_S, 4.0, 0.0, 0.0))
    del there[0]["timestamp"]
    of = fleet()
    of.receive(status("A", NOW_S, velocity={"linear": 0.0}, destinations=there), NOW_S, LINE)
    made = of.robots[robot("A")].forecast
    assert at(made, NOW_S + 4)[0] == pytest.approx(4.0)
    assert counted(of, "deviations_total")["unknown", "point-time-unreadable"] == 1


STOPS, HELD_UP = (1.0, 1.0, 0.0, 0.0), (1.0, 1.0, *(0.0,) * 5)
"""Speeds, one for each second."""


@pytest.mark.parametrize(
    ("speeds_mps", "arrives_s", "ends_m"),
    [
        (STOPS, None, 6.0),
        (HELD_UP, None, 2.0),
        (HELD_UP, -5.0, 2.0),
        (HELD_UP, 4.0, 2.0),
        (HELD_UP, 9.0, 6.0),
        (HELD_UP, 1.0, 2.0),
        (HELD_UP[:4], None, 6.0),
        ((0.0,) * 3, None, 6.0),
        ((0.0,) * 6, None, 0.0),
    ],
)
def test_a_robot_that_is_held_up_heads_for_its_destination_only_if_its_times_let_it_stand(
    speeds_mps: tuple[float, ...], arrives_s: float | None, ends_m: float
) -> None:
    of, x_m = fleet(), 0.0
    for s, mps in enumerate(speeds_mps):
        x_m += mps
        there = points((NOW_S + s + (arrives_s or 0.0), 6.0, 0.0, 0.0))
        if arrives_s is None:
            del there[0]["timestamp"]
        of.receive(status("A", NOW_S + s, x_m, velocity={"linear": mps}, destinations=there), NOW_S + s, LINE)
    assert at(of.robots[robot("A")].forecast, NOW_S + len(speeds_mps) + 10)[0] == pytest.approx(ends_m)


RARE, REPEATED = [(0.0, 0.0, 1.0), (5.0, 4.5, 0.0)], [(s // 2, 0.0, 0.0) for s in range(12)]
"""Seconds, metres and speeds of reports."""


@pytest.mark.parametrize(("reports", "heads"), [(RARE, True), (REPEATED, False)])
def test_how_long_a_robot_stands_is_known_from_where_it_was(reports: list[tuple[float, ...]], heads: bool) -> None:
    of = fleet()
    for t_s, x_m, mps in reports:
        there = points((NOW_S + t_s, 20.0, 0.0, 0.0))
        of.receive(status("A", NOW_S + t_s, x_m, velocity={"linear": mps}, destinations=there), NOW_S + t_s, LINE)
    last_s, last_m, _ = reports[-1]
    assert (at(of.robots[robot("A")].forecast, NOW_S + last_s + 5)[0] > last_m) is heads


@pytest.mark.parametrize("limits_mps", [(0.6, 1.0, 1.4, 1.8), (2.0, 0.8, 1.5, None)])
def test_a_robot_of_one_pace_keeps_it_whatever_each_edge_allows(limits_mps: tuple[float | None, ...]) -> None:
    of, nodes = hall(), [node(number, 4.0 * number) for number in range(len(limits_mps) + 1)]
    edges = [edge(number, maxSpeed=mps) for number, mps in enumerate(limits_mps)]
    of.receive(factsheet(NOW_S, **LIMIT), NOW_S, line("factsheet"))
    of.receive(order(NOW_S, nodes, edges), NOW_S, line("order"))
    for s in range(12):
        x = 0.5 * s
        raw = under_way(NOW_S + s, x, 0.0, nodes[int(x // 4) + 1 :], velocity={"vx": 0.5, "omega": 0.0})
        of.receive(raw, NOW_S + s, line("state"))
    (robot,) = of.robots.values()
    assert at(robot.forecast, NOW_S + 21)[0] == pytest.approx(10.5, abs=0.5)


def test_a_robot_with_an_error_that_moves_all_the_same_keeps_its_order() -> None:
    """It says neither its speed nor that it drives: the second report with the error shows that it goes on."""
    of, nodes = hall(), [node(0, 0.0), node(1, 40.0)]
    of.receive(order(NOW_S, nodes), NOW_S, line("order"))
    bases = []
    fatal = [{"errorType": "motor", "errorLevel": "FATAL"}]
    for s in range(6):
        errors = fatal if s >= 2 else []
        raw = under_way(NOW_S + s, float(min(s, 4)), 0.0, nodes[1:], driving=False, errors=errors)
        of.receive(raw, NOW_S + s, line("state"))
        (robot,) = of.robots.values()
        assert robot.forecast is not None
        bases.append(robot.forecast.basis)
    moves, stands = Basis.ORDER, Basis.STATIONARY
    assert bases[2:] == [stands, moves, moves, stands]


HINDERED: tuple[dict[str, Any], ...] = (
    {"errors": [{"errorType": "motor", "errorLevel": "FATAL"}]},
    {"safetyState": {"eStop": "NONE", "fieldViolation": True}},
    {"safetyState": {"eStop": "HALTED", "fieldViolation": False}},
)


@pytest.mark.parametrize("keys", HINDERED)
@pytest.mark.parametrize("stated", [{"vx": 0.0, "vy": 0.0, "omega": 0.0}, None])
def test_a_hindered_robot_that_only_says_that_it_drives_stands_once_it_has_stood(
    keys: dict[str, Any], stated: dict[str, float] | None
) -> None:
    of, nodes = hall(), [node(0, 0.0), node(1, 40.0)]
    of.receive(order(NOW_S, nodes), NOW_S, line("order"))
    bases = []
    for s in range(9):
        raw = under_way(NOW_S + s, 1.0 + max(s - 6, 0), 0.0, nodes[1:], velocity=stated, **keys)
        of.receive(raw, NOW_S + s, line("state"))
        (robot,) = of.robots.values()
        assert robot.forecast is not None
        bases.append(robot.forecast.basis)
    assert bases[:3] == [Basis.ORDER] * 3
    assert bases[4:7] == [Basis.STATIONARY] * 3
    assert bases[8] is Basis.ORDER


@pytest.mark.parametrize("every_s", [1.0, 5.0, 20.0])
def test_a_robot_that_says_nothing_but_its_place_is_foreseen_by_its_displacement(every_s: float) -> None:
    of = hall()
    for count in range(3):
        raw = vda(NOW_S + every_s * count, agvPosition=position(1.2 * every_s * count, 0.0))
        of.receive(raw, NOW_S + every_s * count, line("state"))
    (robot,) = of.robots.values()
    assert robot.forecast is not None
    assert robot.forecast.basis is Basis.VELOCITY
    assert at(robot.forecast, NOW_S + 2 * every_s + 9)[0] == pytest.approx(1.2 * (2 * every_s + 9))


@pytest.mark.parametrize("state", ["idle", "charging", "disabled", "waitingHumanEvent", "waitingInternalEvent"])
@pytest.mark.parametrize("every_s", [1.0, 10.0])
def test_a_robot_that_never_says_that_it_drives_is_foreseen_by_its_displacement(state: str, every_s: float) -> None:
    of = hall()
    bases = []
    for count in range(5):
        x_m = 0.5 * every_s * min(count, 3)
        raw = status("1", NOW_S + every_s * count, x_m, 0.0, operationalState=state, velocity=None)
        of.receive(raw, NOW_S + every_s * count, LINE)
        (robot,) = of.robots.values()
        assert robot.forecast is not None
        bases.append(robot.forecast.basis)
    assert bases == [Basis.STATIONARY, Basis.VELOCITY, Basis.VELOCITY, Basis.VELOCITY, Basis.STATIONARY]


def chain(every_s: float, first: int = 1) -> list[dict[str, Any]]:
    """Destinations 2 m apart along x, with so much time between them."""
    stops = [(NOW_S + every_s * count, 2.0 * count, 0.0, 0.0) for count in range(first, first + 8)]
    return points(*stops)


@pytest.mark.parametrize(("every_s", "ends_m"), [(2.0, 10.0), (10.0, 2.0)])
def test_a_robot_passes_destinations_at_which_its_times_leave_no_stop(every_s: float, ends_m: float) -> None:
    of = hall()
    raw = status("1", NOW_S, 0.0, 0.0, velocity={"linear": 1.0}, destinations=chain(every_s))
    of.receive(raw, NOW_S, LINE)
    (robot,) = of.robots.values()
    assert at(robot.forecast, NOW_S + 10)[0] == pytest.approx(ends_m, abs=0.3)


def test_destinations_that_a_robot_has_passed_do_not_hold_it() -> None:
    of = hall()
    raw = status("1", NOW_S, 3.0, 0.0, velocity={"linear": 1.0}, destinations=chain(2.0, first=-1))
    of.receive(raw, NOW_S, LINE)
    (robot,) = of.robots.values()
    assert at(robot.forecast, NOW_S + 8)[0] == pytest.approx(11.0, abs=0.3)


def test_bytes_that_are_no_letters_cost_no_place_and_no_document() -> None:
    of = hall()
    for s in range(2):
        raw = under_way(NOW_S + s, float(s), 0.0, FAR[1:], errors=[{"errorType": "Stoerung", "errorDescription": "oe"}])
        of.receive(raw.replace(b"oe", b"\xf6"), NOW_S + s, line("state"))
    (robot,) = of.robots.values()
    assert robot.seen is not None
    assert robot.seen.x_m == 1.0
    shown = fleet_report.robot_document(of, robot, NOW_S + 1)
    assert shown["status"]["errors"][0]["errorType"] == "St\ufffdrung"


@pytest.mark.parametrize("limit_mps", [1e-320, 1e-6])
def test_a_limit_that_no_robot_can_keep_leaves_forecasts_finite(limit_mps: float) -> None:
    of = hall()
    sheet = {"physicalParameters": {"length": 1.2, "width": 0.8, "speedMax": limit_mps}}
    of.receive(factsheet(NOW_S, **sheet), NOW_S, line("factsheet"))
    of.receive(order(NOW_S, FAR), NOW_S, line("order"))
    for s in range(3):
        of.receive(under_way(NOW_S + s, 0.0, 0.0, FAR[1:]), NOW_S + s, line("state"))
    (robot,) = of.robots.values()
    assert robot.forecast is not None
    assert np.isfinite(np.array(robot.forecast.knots)).all()


@pytest.mark.parametrize("hertz", [1, 2, 5, 10, 20])
@pytest.mark.parametrize("stated", [{"vx": 0.0, "vy": 0.0, "omega": 0.0}, None])
def test_displacement_is_motion_however_often_it_is_reported(hertz: int, stated: dict[str, float] | None) -> None:
    of = hall()
    for report in range(3 * hertz + 1):
        now_s = NOW_S + report / hertz
        raw = vda(now_s, headerId=report, driving=True, agvPosition=position(report / hertz, 0.0), velocity=stated)
        of.receive(raw, now_s, line("state"))
    (robot,) = of.robots.values()
    assert robot.seen
    assert robot.seen.linear_mps == pytest.approx(1.0, abs=0.1)
    assert at(robot.forecast, NOW_S + 6)[0] == pytest.approx(6.0, abs=0.5)
    assert ("speed-contradicts-motion" in robot.deviations) is (stated is not None)


@pytest.mark.parametrize("stated", [{"vx": 0.0, "vy": 0.8, "omega": 0.0}, {"vx": 0.8, "vy": 0.0, "omega": 0.0}, None])
@pytest.mark.parametrize("theta", [0.0, 2.0])
def test_a_robot_that_drives_sideways_is_foreseen_where_it_goes_with_its_nose_where_it_is(
    stated: dict[str, float] | None, theta: float
) -> None:
    of = hall()
    for s in range(3):
        place = position(-0.8 * s * sin(theta), 0.8 * s * cos(theta), theta)
        of.receive(vda(NOW_S + s, driving=True, agvPosition=place, velocity=stated), NOW_S + s, line("state"))
    (robot,) = of.robots.values()
    is_wrong = stated is not None and not stated["vy"]
    assert ("heading-contradicts-motion" in robot.deviations) is is_wrong
    assert at(robot.forecast, NOW_S + 7) == pytest.approx((-5.6 * sin(theta), 5.6 * cos(theta), theta), abs=0.2)


def test_a_velocity_in_the_frame_of_the_map_counts_as_the_robot_moves() -> None:
    of = hall()
    for s in range(3):
        place, velocity = position(0.0, 0.8 * s, pi / 2), {"vx": 0.0, "vy": 0.8, "omega": 0.0}
        of.receive(vda(NOW_S + s, driving=True, agvPosition=place, velocity=velocity), NOW_S + s, line("state"))
    (robot,) = of.robots.values()
    assert "heading-contradicts-motion" in robot.deviations
    assert at(robot.forecast, NOW_S + 7) == pytest.approx((0.0, 5.6, pi / 2), abs=0.2)


def test_a_robot_that_turned_a_corner_between_two_reports_does_not_drive_sideways() -> None:
    of = hall()
    for s, place in ((0, position(0.0, 0.0, 0.0)), (2, position(1.0, 0.3, pi / 2))):
        of.receive(vda(NOW_S + s, driving=True, agvPosition=place), NOW_S + s, line("state"))
    (robot,) = of.robots.values()
    assert robot.seen
    assert robot.seen.sideways_rad == 0.0
    x, y, _ = at(robot.forecast, NOW_S + 7)
    assert x == pytest.approx(1.0)
    assert y > 0.3


def reported(
    of: Fleet, seconds: float, place: Callable[[float], Pose], hertz: float = 1.0, **keys: Any
) -> tuple[Robot, float]:
    """A robot that reports for some seconds where it is, and when it did last."""
    for report in range(round(seconds * hertz) + 1):
        now_s = NOW_S + report / hertz
        of.receive(status("A", now_s, *place(now_s - NOW_S), **keys), now_s, LINE)
    return of.robots[robot("A")], now_s


@pytest.mark.parametrize("mps", [1.0, -1.0])
@pytest.mark.parametrize("hertz", [0.5, 1.0, 5.0])
@pytest.mark.parametrize("off_rad", [-2.0, -0.6, 0.35, 1.2])
def test_a_robot_that_moves_off_its_heading_as_fast_as_it_says_goes_on_as_it_moves(
    off_rad: float, hertz: float, mps: float
) -> None:
    def place(s: float) -> Pose:
        return mps * s * cos(0.7 + off_rad), mps * s * sin(0.7 + off_rad), 0.7

    seen, now_s = reported(hall(), 6.0, place, hertz, velocity={"linear": mps}, path=None)
    assert at(seen.forecast, now_s + 8) == pytest.approx(place(now_s - NOW_S + 8), abs=0.1)
    assert "heading-contradicts-motion" in seen.deviations


@pytest.mark.parametrize("radps", [0.05, 0.2, 0.5])
def test_a_robot_on_an_arc_or_with_noise_does_not_move_off_its_heading(radps: float) -> None:
    noise_m = np.random.default_rng(4).normal(0.0, 0.03, (50, 2))

    def place(s: float) -> Pose:
        x_m, y_m = noise_m[round(s)]
        return sin(radps * s) / radps + x_m, (1 - cos(radps * s)) / radps + y_m, radps * s

    seen, _ = reported(hall(), 40.0, place, velocity={"linear": 1.0, "angular": angle(radps)})
    assert seen.seen
    assert seen.seen.sideways_rad == 0.0
    assert not {"heading-contradicts-motion", "turn-rate-contradicts-motion"} & set(seen.deviations)


def test_one_jump_to_the_side_does_not_turn_a_forecast() -> None:
    seen, now_s = reported(hall(), 4.0, lambda s: (s, 0.5 if s > 3.5 else 0.0, 0.0), velocity={"linear": 1.0})
    assert at(seen.forecast, now_s + 8) == pytest.approx((12.0, 0.5, 0.0))


@pytest.mark.parametrize("radps", [0.3, -0.6, 0.9])
@pytest.mark.parametrize("mps", [0.0, 1.0])
def test_a_turn_rate_that_headings_do_not_bear_out_in_a_few_reports_is_set_aside(mps: float, radps: float) -> None:
    keys: dict[str, Any] = {"velocity": {"linear": mps, "angular": angle(radps)}}
    seen, now_s = reported(hall(), 6.0, lambda s: (mps * s, 0.0, 0.0), **keys)
    assert at(seen.forecast, now_s + 8) == pytest.approx((14.0 * mps, 0.0, 0.0))
    assert "turn-rate-contradicts-motion" in seen.deviations


def test_a_turn_rate_counts_where_a_turn_begins() -> None:
    keys: dict[str, Any] = {"velocity": {"linear": 1.0, "angular": angle(0.6)}}
    seen, now_s = reported(hall(), 1.0, lambda s: (s, 0.0, 0.05 * s), **keys)
    assert at(seen.forecast, now_s + 5)[2] == pytest.approx(3.05)


@pytest.mark.parametrize("state", ["navigating", "idle", "rotating", "manualOverride"])
@pytest.mark.parametrize("radps", [0.4, -0.4, None])
def test_a_robot_that_turns_on_the_spot_goes_on_turning_whatever_its_state(radps: float | None, state: str) -> None:
    """If no turn rate is sent, the headings show it."""
    if radps is None and state in ("idle", "manualOverride"):
        velocity: dict[str, Any] | None = {"linear": 0.0}
    else:
        velocity = None if radps is None else {"linear": 0.0, "angular": angle(radps)}
    turns_radps = 0.4 if radps is None else radps
    seen, now_s = reported(
        hall(), 3.0, lambda s: (0.0, 0.0, turns_radps * s), velocity=velocity, operationalState=state
    )
    turned_rad = at(seen.forecast, now_s + 5)[2] - at(seen.forecast, now_s)[2]
    assert turned_rad == pytest.approx(5 * turns_radps)


@pytest.mark.parametrize("state", ["navigating", "idle"])
def test_a_robot_that_stands_with_noisy_headings_stands(state: str) -> None:
    noise_rad = np.random.default_rng(5).normal(0.0, 0.03, 50)
    seen, _ = reported(hall(), 40.0, lambda s: (0.0, 0.0, noise_rad[round(s)]), velocity=None, operationalState=state)
    assert seen.forecast
    assert len(np.unique(np.array(seen.forecast.knots)[:, 3])) == 1


def test_a_robot_that_says_it_is_offline_while_it_drives_drives() -> None:
    seen, now_s = reported(hall(), 3.0, lambda s: (s, 0.0, 0.0), velocity={"linear": 1.0}, operationalState="offline")
    assert at(seen.forecast, now_s + 5)[0] == pytest.approx(8.0)


@pytest.mark.parametrize("resource", ["status", "connection"])
def test_a_robot_of_a_broker_that_went_offline_drives_once_it_moves_again(resource: str) -> None:
    of = hall()
    for s in range(6):
        if resource == "status":
            of.receive(odometry(NOW_S + s, float(s), speed=1.0), NOW_S + s, iso_line("odometry"))
        else:
            velocity = {"vx": 1.0, "vy": 0.0, "omega": 0.0}
            raw = vda(NOW_S + s, agvPosition=position(float(s), 0.0), velocity=velocity)
            of.receive(raw, NOW_S + s, line("visualization"))
        if s == 2:
            if resource == "status":
                of.receive(states(NOW_S + s, "OFFLINE"), NOW_S + s, iso_line("status"))
            else:
                of.receive(vda(NOW_S + s, connectionState="OFFLINE"), NOW_S + s, line("connection"))
            of.next_batch(NOW_S + s)
            (robot,) = of.robots.values()
            assert at(robot.forecast, NOW_S + 7)[0] == pytest.approx(2.0)
    (robot,) = of.robots.values()
    assert at(robot.forecast, NOW_S + 10)[0] == pytest.approx(10.0)


@pytest.mark.parametrize(
    "first", [(0.1, 0.3), (0.2, 1.0), (1.0, 1.2)], ids=["late by 0.2 m", "far ahead", "late, a second apart"]
)
@pytest.mark.parametrize("every_s", [0.1, 1.0])
def test_a_short_path_goes_on_at_the_speed_of_its_parts_and_not_of_a_gap_before_it(
    first: tuple[float, float], every_s: float
) -> None:
    noise_m = np.random.default_rng(6).normal(0.0, 0.02, 40)
    begin_s, begin_m = first
    steps = [step * every_s for step in range(round(3.0 / every_s) + 1)]
    rows = [(NOW_S + begin_s + s, begin_m + s + noise, 0.0, 0.0) for s, noise in zip(steps, noise_m, strict=False)]
    of = hall()
    of.receive(status("A", NOW_S, velocity={"linear": 1.0}, path=points(*rows)), NOW_S, LINE)
    end_s, end_m = begin_s + steps[-1], begin_m + steps[-1]
    assert at(of.robots[robot("A")].forecast, NOW_S + 10)[0] == pytest.approx(end_m + 10.0 - end_s, abs=0.4)


@pytest.mark.parametrize("mps", [0.0, 0.5])
@pytest.mark.parametrize("at_m", [10.0, 7.0, 4.0, 0.0])
def test_a_path_whose_times_are_past_does_not_lead_back(at_m: float, mps: float) -> None:
    rows = [(NOW_S - 20 + x_m, x_m, 0.0, 0.0) for x_m in (0.0, 5.0, 10.0)]
    of = hall()
    of.receive(status("A", NOW_S, at_m, velocity={"linear": mps}, path=points(*rows)), NOW_S, LINE)
    forecast = of.robots[robot("A")].forecast
    assert forecast
    assert min(knot[1] for knot in forecast.knots) == at_m
    assert max(knot[1] for knot in forecast.knots) >= 10.0


def driven(
    of: Fleet, *, seconds: int, every_s: float = 1.0, says: Callable[[float], dict[str, Any]], mps: float = 1.0
) -> Robot:
    """A robot that drives along x at a speed and says so, with what else it says at each time."""
    for count in range(round(seconds / every_s) + 1):
        t_s = NOW_S + every_s * count
        keys = {"velocity": {"linear": mps}} | says(t_s)
        of.receive(status("A", t_s, mps * every_s * count, **keys), t_s, LINE)
    return of.robots[robot("A")]


@pytest.mark.parametrize("first_s", [0.0, -NOW_S], ids=["times are past", "no times"])
@pytest.mark.parametrize("mps", [0.5, 1.0])
def test_a_path_that_is_repeated_unchanged_does_not_lead_back_a_robot_that_drove_on(mps: float, first_s: float) -> None:
    sent = points(*((NOW_S + first_s + s, mps * s, 0.0, 0.0) for s in range(1, 6)))
    made = driven(hall(), seconds=12, says=lambda _: {"path": sent}, mps=mps)
    assert at(made.forecast, NOW_S + 20)[0] == pytest.approx(20.0 * mps)


def test_a_path_without_usable_times_does_not_turn_back_a_robot_that_drives_along_it_the_other_way() -> None:
    sent = points(*((NOW_S - 90 + s, 30.0 - s, 0.0, 0.0) for s in range(30)))
    made = driven(hall(), seconds=5, says=lambda _: {"path": sent})
    assert at(made.forecast, NOW_S + 12)[0] == pytest.approx(12.0)


@pytest.mark.parametrize(
    "time_of_point",
    [lambda s: s + 3600.0, lambda s: s + 4.0, lambda s: 1000.0 * s, lambda s: 600.0 * (s - 1)],
    ids=["another time zone", "another clock", "another unit", "all but the first are late"],
)
def test_path_times_that_hold_back_a_robot_that_drives_are_replaced(time_of_point: Callable[[float], float]) -> None:
    def path(t_s: float) -> dict[str, Any]:
        return {"path": points(*((t_s + time_of_point(s), t_s - NOW_S + s, 0.0, 0.0) for s in range(1, 11)))}

    of = hall()
    made = driven(of, seconds=5, says=path)
    assert made.forecast
    assert made.forecast.basis is Basis.PATH
    assert at(made.forecast, NOW_S + 15)[0] == pytest.approx(15.0)
    assert made.deviations["path-retimed"] >= 4


def test_a_robot_that_slows_down_for_a_planned_wait_keeps_the_times_of_its_path() -> None:
    def path(t_s: float) -> dict[str, Any]:
        return {"path": points((NOW_S + 6, 6.0, 0.0, 0.0), (NOW_S + 30, 6.0, 0.0, 0.0), (NOW_S + 31, 7.0, 0.0, 0.0))}

    made = driven(hall(), seconds=5, says=path)
    assert at(made.forecast, NOW_S + 15)[0] == pytest.approx(6.0)
    assert "path-retimed" not in made.deviations


@pytest.mark.parametrize("every_s", [0.25, 0.5, 1.0])
def test_a_robot_that_brakes_by_its_path_for_a_planned_wait_is_not_foreseen_to_drive_on(every_s: float) -> None:
    of, stop_m = hall(), 17.25
    for count in range(round(14 / every_s) + 1):
        after_s = every_s * count
        braked_s = min(max(after_s - 10.0, 0.0), 3.0)
        x, mps = 1.5 * (min(after_s, 10.0) + braked_s) - 0.25 * braked_s**2, 1.5 - 0.5 * braked_s
        marks = [(NOW_S + 2.0 * m, 3.0 * m, 0.0, 0.0) for m in range(1, 6) if 2.0 * m > after_s]
        path = points(*marks, *((NOW_S + s, stop_m + 1.5 * (s - 30), 0.0, 0.0) for s in (30.5, 32.0, 34.0)))
        of.receive(status("A", NOW_S + after_s, x, velocity={"linear": mps}, path=path), NOW_S + after_s, LINE)
        made = of.robots[robot("A")]
        assert after_s < 10.0 or at(made.forecast, NOW_S + after_s + 8)[0] < stop_m + 1.0
    assert "path-retimed" not in made.deviations


@pytest.mark.parametrize("every_s", [8.0, 12.0, 30.0])
def test_a_path_that_is_over_soon_after_the_next_report_goes_on(every_s: float) -> None:
    def path(t_s: float) -> dict[str, Any]:
        return {"path": points(*((t_s + s, t_s - NOW_S + s, 0.0, 0.0) for s in range(1, 11)))}

    made = driven(hall(), seconds=120, every_s=every_s, says=path)
    assert at(made.forecast, NOW_S + 120 + every_s + 4)[0] == pytest.approx(120 + every_s + 4)


@pytest.mark.parametrize("share", [3.6, 1 / 3.6, 2.237, 60.0, -3.6], ids=["km/h", "as if km/h", "mph", "%", "sign too"])
@pytest.mark.parametrize("every_s", [0.2, 1.0, 5.0])
def test_a_robot_that_states_its_speed_in_another_unit_is_foreseen_as_it_moves(share: float, every_s: float) -> None:
    made = driven(hall(), seconds=15, every_s=every_s, says=lambda _: {"velocity": {"linear": 0.8 * share}}, mps=0.8)
    assert at(made.forecast, NOW_S + 25)[0] == pytest.approx(20.0)
    assert made.deviations["speed-contradicts-motion"] >= 2


@pytest.mark.parametrize("brakes_mps2", [0.5, 1.0, 2.0])
def test_the_speed_of_a_robot_that_starts_or_brakes_is_what_it_says(brakes_mps2: float) -> None:
    of, x, mps = hall(), 0.0, 0.0
    for second in range(20):
        aim_mps = 1.6 if second < 10 else 0.0
        for _ in range(100):
            mps += min(max(aim_mps - mps, -0.01 * brakes_mps2), 0.01 * brakes_mps2)
            x += 0.01 * mps
        of.receive(status("A", NOW_S + second, x, velocity={"linear": mps}), NOW_S + second, LINE)
        seen = of.robots[robot("A")].seen
        assert seen
        assert seen.linear_mps == pytest.approx(mps)


@pytest.mark.parametrize("keys", [{}, {"path": points(*((NOW_S + 3600, float(x), 0.0, 0.0) for x in (60, 70)))}])
def test_a_robot_whose_clock_stands_is_where_it_says_when_its_messages_arrive(keys: dict[str, Any]) -> None:
    of = hall()
    for second in range(12):
        raw = status("A", NOW_S, float(second), velocity={"linear": 1.0}, **keys)
        of.receive(raw, NOW_S + second, LINE)
    made = of.robots[robot("A")]
    assert at(made.forecast, NOW_S + 20)[0] == pytest.approx(20.0)
    assert made.deviations["stamp-unchanged"] >= 8


def test_a_robot_whose_clock_stands_is_heard_when_it_parks_and_repeats_itself() -> None:
    of = hall()
    for second in range(30):
        x, mps = float(min(second, 20)), 1.0 if second < 20 else 0.0
        raw = status("A", NOW_S, x, velocity={"linear": mps})
        of.receive(raw, NOW_S + second, LINE)
        assert (of.robots[robot("A")].arrival_s, at(of.robots[robot("A")].forecast, 0.0)[0]) == (NOW_S + second, x)
    assert "stamp-not-increasing" not in of.robots[robot("A")].deviations


@pytest.mark.parametrize("every_s", [0.01, 0.5])
def test_messages_that_were_held_up_count_from_when_they_were_sent_though_two_have_one_stamp(every_s: float) -> None:
    of = hall()
    of.receive(order(NOW_S, FAR), NOW_S, line("order"))
    for second in range(30):
        t_s, keys = NOW_S + second, {"velocity": {"vx": 1.5, "vy": 0.0, "omega": 0.0}, "headerId": second}
        arrival_s = t_s if second < 10 else NOW_S + 18 + every_s * (second - 10)
        of.receive(under_way(t_s, 1.5 * second, 0.0, FAR[1:], **keys), arrival_s, line("state"))
        of.receive(visualization(t_s, 1.5 * second, 0.0, **keys), arrival_s, line("visualization"))
        (made,) = of.robots.values()
        assert made.seen
        assert (made.seen.t_s, made.seen.x_m) == (min(t_s, arrival_s), 1.5 * second)
    assert "stamp-unchanged" not in made.deviations


def test_a_status_that_is_sent_again_stays_as_old_as_it_is() -> None:
    of, raw = hall(), status("A", NOW_S, velocity={"linear": 1.0})
    for second in range(9):
        of.receive(raw, NOW_S + second, LINE)
    made = of.robots[robot("A")]
    assert at(made.forecast, NOW_S + 9)[0] == pytest.approx(9.0)
    assert "stamp-unchanged" not in made.deviations


@pytest.mark.parametrize("keys", [{}, {"path": points(*((NOW_S - 90 + x, 5.0 * x, 0.0, pi) for x in range(8)))}])
def test_a_robot_that_backs_up_and_has_no_heading_is_foreseen_as_it_moves(keys: dict[str, Any]) -> None:
    of = hall()
    for second in range(6):
        here = {"x": float(second), "y": 0.0, "planarDatum": HALL}
        of.receive(status("A", NOW_S + second, location=here, velocity={"linear": -1.0}, **keys), NOW_S + second, LINE)
    assert at(of.robots[robot("A")].forecast, NOW_S + 15)[0] == pytest.approx(15.0, abs=0.01)


def test_an_idle_robot_whose_heading_jitters_widely_is_charged_with_no_turn_rate() -> None:
    seen, _ = reported(
        hall(), 4.0, lambda s: (0.0, 0.0, 0.25 * (round(10 * s) % 2)), 10.0, velocity=None, operationalState="idle"
    )
    assert "turn-rate-contradicts-motion" not in seen.deviations
    assert seen.forecast
    assert len(seen.forecast.knots) == 1


def test_noise_of_a_robot_that_stands_is_no_pace() -> None:
    """Reports ten times a second: positions that are off by a few centimetres look like 0.2 m/s."""
    of, x = hall(), 0.0
    of.receive(factsheet(NOW_S, **LIMIT), NOW_S, line("factsheet"))
    of.receive(order(NOW_S, FAR), NOW_S, line("order"))
    for step in range(300):
        mps = 0.8 if step < 100 else 0.0
        x += mps / 10
        raw = under_way(NOW_S + step / 10, x + 0.05 * (step % 10 < 5), 0.0, FAR[1:], velocity={"vx": mps, "omega": 0.0})
        of.receive(raw, NOW_S + step / 10, line("state"))
    (robot,) = of.robots.values()
    assert {kind: speeds.usual for kind, speeds in robot.pace.own.items()} == {2.0: pytest.approx(0.8, abs=0.11)}
