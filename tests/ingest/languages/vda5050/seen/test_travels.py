"""The heading and the direction of robots that do not say them, as they are seen to move."""

from math import pi
from typing import Any

import pytest

from ingest.languages.model import Update
from tests.helpers.vda_saying import node, order, position, state, under_way, visualization
from tests.ingest.languages.vda5050.made_vda import Listener, T


@pytest.mark.parametrize("velocity", [None, {"omega": 0.0}])
def test_a_robot_that_is_seen_to_drive_backwards_and_says_no_speed_goes_on_so(velocity: dict[str, Any] | None) -> None:
    nodes = [node(0, 0.0), node(1, -4.0), node(2, -10.0)]
    reports = [("state", under_way(T + s, -0.5 * s, 0.0, nodes[1:], velocity=velocity)) for s in range(3)]
    status = Listener().status_after(("order", order(T, nodes)), *reports)
    assert [row[3] for row in status.path.poses] == pytest.approx([0.0, 0.0])
    stood = [("state", under_way(T + s, -1.0, 0.0, nodes[1:], velocity=velocity, theta=pi)) for s in range(3, 9)]
    status = Listener().status_after(("order", order(T, nodes)), *reports, *stood)
    assert [abs(row[3]) for row in status.path.poses] == pytest.approx([pi, pi])


@pytest.mark.parametrize(("vx", "turns"), [(0.5, False), (-0.5, False), (0.0, True)])
def test_a_robot_without_theta_heads_as_it_moved_last(vx: float, turns: bool) -> None:
    nodes = [node(0, 0.0), node(1, 2.0), node(2, 2.0, 5.0)]
    on_the_way = ("state", under_way(T, 0.0, 0.0, nodes[1:], theta=None))
    at_corner = ("state", under_way(T + 4, 2.0, 0.0, nodes[2:], theta=None, velocity={"vx": vx}))
    status = Listener().status_after(("order", order(T, nodes)), on_the_way, at_corner)
    assert (len(status.path.poses) > 1) is turns
    assert status.path.ends_s[1] - T - 4 == pytest.approx(5.0 + (pi / 2 if turns else 0.0), abs=0.01)


@pytest.mark.parametrize("place", [(9.9, 0.06), (9.95, -0.05), (10.05, 0.1)])
def test_noise_of_a_position_near_a_node_is_no_corner(place: tuple[float, float]) -> None:
    nodes = [node(0, 0.0), node(1, 10.0), node(2, 20.0)]
    report = ("state", under_way(T, *place, nodes[1:], velocity={"vx": 1.0}))
    path = Listener().status_after(("order", order(T, nodes)), report).path
    assert [row[1:3] for row in path.poses] == [(10.0, 0.0), (20.0, 0.0)]


@pytest.mark.parametrize("keys", [{}, {"mapId": ""}, {"positionInitialized": False}])
@pytest.mark.parametrize("kind", ["state", "visualization"])
def test_zeros_of_one_topic_do_not_move_a_robot_that_the_other_shows_elsewhere(kind: str, keys: dict[str, Any]) -> None:
    zeros = {"agvPosition": position(0.0, 0.0, **keys)}
    report_of = {"state": state, "visualization": visualization}
    other = "visualization" if kind == "state" else "state"
    listener = Listener()
    listener.hears(other, report_of[other](T, 20.0, 10.0))
    ignored = listener.hears(kind, report_of[kind](T + 1, 20.0, 10.0, **zeros))
    assert isinstance(ignored, Update)
    assert ignored.findings == ("position-missing",)
    assert listener.status_after((kind, report_of[kind](T + 60, 20.0, 10.0, **zeros))).x == 0.0, "it says nothing else"
    near = listener.status_after((other, report_of[other](T + 61, 1.0, 0.5)), (kind, report_of[kind](T + 62, 0.0, 0.0)))
    assert (near.x, near.y) == (0.0, 0.0)
