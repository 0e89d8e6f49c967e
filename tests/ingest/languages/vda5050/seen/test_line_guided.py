"""Robots that say which node they have passed, and not where they are."""

from math import pi
from typing import Any

import pytest

from ingest.languages.model import Status, Update
from tests.helpers.vda_saying import MAP, edge, node, order, position, under_way, visualization
from tests.ingest.languages.vda5050.made_vda import Listener, T

NODES = [node(0, 0.0), node(1, 10.0), node(2, 10.0, 8.0)]


def told(s: float, to: list[dict[str, Any]], **keys: Any) -> tuple[str, bytes]:
    """The state of a robot that drives to the given nodes and sends no position."""
    return "state", under_way(T + s, 0.0, 0.0, to, **({"agvPosition": None} | keys))


@pytest.mark.parametrize(
    ("since_m", "place", "yaw_rad"),
    [(3.0, (3.0, 0.0), 0.0), (99.0, (10.0, 0.0), 0.0), (None, (0.0, 0.0), 0.0)],
)
def test_a_robot_without_position_is_so_far_along_its_edge_as_it_says(
    since_m: float | None, place: tuple[float, float], yaw_rad: float
) -> None:
    report = told(0.0, NODES[1:], distanceSinceLastNode=since_m)
    status = Listener().status_after(("order", order(T, NODES)), report)
    assert (status.x, status.y, status.yaw_rad, status.datum) == (*place, yaw_rad, MAP)
    assert status.findings == ("position-by-node",)
    assert status.oddities[0].reading == f"{since_m or 0.0:.1f} m after node n0"
    assert status.path.poses[-1][1:3] == (10.0, 8.0)


def test_it_follows_the_curve_of_the_edge_and_backs_up_as_its_speed_says() -> None:
    corner = {"degree": 1, "controlPoints": [{"x": 0.0, "y": 0.0}, {"x": 0.0, "y": 8.0}, {"x": 10.0, "y": 8.0}]}
    nodes = [node(0, 0.0), node(1, 10.0, 8.0)]
    report = told(0.0, nodes[1:], distanceSinceLastNode=9.0, velocity={"vx": -0.5})
    status = Listener().status_after(("order", order(T, nodes, [edge(0, trajectory=corner)])), report)
    assert (status.x, status.y, abs(status.yaw_rad)) == pytest.approx((1.0, 8.0, pi))


@pytest.mark.parametrize("sent_m", [None, 0.0])
def test_without_a_distance_it_drives_on_at_its_speed_from_when_it_passed_the_node(sent_m: float | None) -> None:
    moving = {"velocity": {"vx": 0.8}, "distanceSinceLastNode": sent_m}
    reports = [told(s, NODES[1:], **moving) for s in (0.0, 1.0, 3.5)]
    status = Listener().status_after(("order", order(T, NODES)), *reports)
    assert (status.x, status.y) == pytest.approx((2.8, 0.0))
    status = Listener().status_after(("order", order(T, NODES)), *reports, told(9.0, NODES[2:], **moving))
    assert (status.x, status.y) == (10.0, 0.0)


def test_without_distance_and_speed_it_stays_foreseen_from_the_node() -> None:
    listener = Listener()
    first = listener.status_after(("order", order(T, NODES)), told(0.0, NODES[1:]))
    assert isinstance(listener.hears(*told(2.0, NODES[1:])), Update)
    again = listener.front_end.status(b"", listener.memory, None)
    assert again is not None
    assert (again.stamp_s, again.path.poses) == (T, first.path.poses)
    standing = told(4.0, NODES[1:], driving=False)
    assert isinstance(listener.hears(*standing), Update), "it may stand anywhere on the edge"


def test_a_robot_that_stands_at_its_node_keeps_its_heading_and_stays_heard() -> None:
    arrived = {"driving": False, "velocity": {"vx": 0.0}}
    on_the_way = told(0.0, NODES[1:], distanceSinceLastNode=9.0)
    reports = [told(s, NODES[2:], **arrived) for s in (1.0, 2.0)]
    status = Listener().status_after(("order", order(T, NODES)), on_the_way, *reports)
    assert (status.stamp_s, status.x, status.y, status.yaw_rad) == (T + 2, 10.0, 0.0, 0.0)


def test_nodes_of_earlier_orders_are_known_unless_their_ids_are_used_anew_elsewhere() -> None:
    report = told(20.0, [NODES[2]], orderId="lost", distanceSinceLastNode=2.0)
    earlier = ("order", order(T, NODES))
    between = ("order", order(T + 9, [node(7, 0.0, 50.0), node(8, 9.0, 50.0)], orderId="o2"))
    status = Listener().status_after(earlier, between, report)
    assert (status.x, status.y) == (10.0, 2.0)
    elsewhere = ("order", order(T + 9, [node(0, 70.0), node(3, 80.0)], orderId="o2"))
    listener = Listener()
    for message in (earlier, elsewhere):
        listener.hears(*message)
    assert listener.hears(*report).findings == ("position-missing",)


def test_zeros_of_a_robot_that_does_not_know_where_it_is_are_no_position() -> None:
    zeros = position(0.0, 0.0, positionInitialized=False, mapId="")
    keys: dict[str, Any] = {"agvPosition": zeros, "distanceSinceLastNode": 3.0}
    status = Listener().status_after(("order", order(T, NODES[1:])), told(0.0, NODES[2:], **keys))
    assert (status.x, status.y, status.is_lost, status.datum) == (10.0, 3.0, False, MAP)
    unknown = Listener().hears("state", under_way(T, 0.0, 0.0, NODES[1:], agvPosition=zeros))
    assert isinstance(unknown, Status)
    assert unknown.is_lost


def test_a_position_that_only_visualizations_say_counts_for_more_than_nodes() -> None:
    listener, seen = Listener(), ("visualization", visualization(T + 1, 4.0, 0.3))
    listener.status_after(("order", order(T, NODES)), told(0.0, NODES[1:]), seen)
    assert isinstance(listener.hears(*told(2.0, NODES[1:], distanceSinceLastNode=5.0)), Update)
    later = listener.status_after(told(60.0, NODES[1:], distanceSinceLastNode=5.0))
    assert (later.x, later.y) == (5.0, 0.0)
