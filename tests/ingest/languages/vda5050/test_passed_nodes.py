"""Nodes that a robot has passed although its newest state still names them."""

from math import pi
from typing import Any

import pytest

from tests.helpers.vda_saying import node, order, position, under_way, vda
from tests.ingest.languages.vda5050.made_vda import Listener, T


@pytest.mark.parametrize(
    ("way", "pose", "next_point"),
    [
        ([(0, 0), (10, 0), (10, 8), (0, 8)], (5.0, 0.0, 0.0), (10, 0)),
        ([(0, 0), (10, 0), (10, 8), (0, 8)], (10.0, 3.0, pi / 2), (10, 8)),
        ([(0, 0), (10, 0), (10, 8), (0, 8)], (4.0, 8.2, pi), (0, 8)),
        ([(0, 0), (10, 0), (10, 8), (0, 8)], (5.0, 4.0, pi / 2), (10, 0)),
        ([(0, 0), (4, 0), (10, 0)], (4.3, 0.0, 0.0), (10, 0)),
        ([(0, 0), (10, 0), (0, 0)], (6.0, 0.0, 0.0), (10, 0)),
        ([(0, 0), (10, 0), (0, 0)], (6.0, 0.0, pi), (0, 0)),
        ([(0, 0), (10, 0), (10, 8), (0, 0), (10, 0)], (6.0, 0.0, 0.0), (10, 0)),
    ],
)
def test_a_visualization_shows_which_nodes_the_robot_has_passed_since_its_state(
    way: list[tuple[float, float]], pose: tuple[float, float, float], next_point: tuple[float, float]
) -> None:
    nodes = [node(number, *place) for number, place in enumerate(way)]
    later = ("visualization", vda(T + 9, agvPosition=position(*pose)))
    status = Listener().status_after(("order", order(T, nodes)), ("state", under_way(T, 1.0, 0.0, nodes[1:])), later)
    there = [row[1:3] for row in status.path.poses]
    assert there[0] in {next_point, pose[:2]}
    assert next(place for place in there if place != pose[:2]) == next_point
    assert there[-1] == way[-1]


@pytest.mark.parametrize("motion", [{}, {"velocity": {"vx": 0.0, "vy": 0.0, "omega": 0.0}}])
@pytest.mark.parametrize(
    ("pose", "next_point"),
    [
        ((5.01, 0.0, 0.0), (0, 0)),
        ((3.0, 0.0, 0.1), (0, 0)),
        ((3.0, 0.0, pi), (0, 0)),
        ((12.0, 0.0, 0.0), (20, 0)),
    ],
)
def test_a_nose_that_points_away_from_the_way_since_the_state_does_not_show_the_direction_of_driving(
    motion: dict[str, Any], pose: tuple[float, float, float], next_point: tuple[float, float]
) -> None:
    nodes = [node(0, 5.0), node(1, 0.0), node(2, 20.0)]
    later = ("visualization", vda(T + 9, agvPosition=position(*pose), **motion))
    report = ("state", under_way(T, 5.0, 0.0, nodes[1:], **motion))
    status = Listener().status_after(("order", order(T, nodes)), report, later)
    there = [row[1:3] for row in status.path.poses]
    assert next(place for place in there if place != pose[:2]) == next_point
