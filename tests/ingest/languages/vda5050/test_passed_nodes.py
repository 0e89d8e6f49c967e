"""Nodes that a robot has passed although its newest state still names them."""

from collections.abc import Iterable, Iterator
from itertools import pairwise
from math import pi
from typing import Any

import pytest

from ingest.frames import way_pieces
from ingest.languages.vda5050.base_path import MOST_ROWS, PASSED_BY
from tests.helpers.vda_saying import edge, node, order, position, under_way, vda
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


def pieces_looked_at(monkeypatch: pytest.MonkeyPatch, listener: Listener, pose: dict[str, Any], **keys: Any) -> int:
    """How many straight pieces of ways are compared with a place for one visualization."""
    looked_at: list[object] = []

    def counted(points: Iterable[object]) -> Iterator[tuple[object, object]]:
        for piece in pairwise(points):
            looked_at.append(piece)
            yield piece

    with monkeypatch.context() as patch:
        patch.setattr(way_pieces, "pairwise", counted)
        listener.status_after(("visualization", vda(T + 9, agvPosition=pose, **keys)))
    return len(looked_at)


def test_a_long_plan_is_compared_with_each_of_the_next_nodes_once(monkeypatch: pytest.MonkeyPatch) -> None:
    nodes = [node(number, 0.3 * number, 3.0 if number % 6 else 0.0) for number in range(600)]
    points = [{"x": 0.4 * each, "y": 0.0} for each in range(500)]
    listener = Listener()
    listener.status_after(("order", order(T, nodes)), ("state", under_way(T, 0.0, 0.0, nodes[1:])))
    pieces = pieces_looked_at(
        monkeypatch, listener, position(0.1), plannedPath={"trajectory": {"controlPoints": points}}
    )
    assert len(points) < pieces <= len(points) * (MOST_ROWS + PASSED_BY)


def test_curves_far_from_a_robot_that_stands_across_its_way_are_not_compared_with_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    nodes = [node(number, 10.0 * number) for number in range(100)]
    bent = [(0.0, 0.0), (3.0, 1.0), (6.0, -1.0), (10.0, 0.0)]
    curves = [
        {"degree": 3, "controlPoints": [{"x": 10.0 * number + x, "y": y} for x, y in bent]} for number in range(99)
    ]
    edges = [edge(number, trajectory=curve) for number, curve in enumerate(curves)]
    listener = Listener()
    report = ("state", under_way(T, 0.0, 0.0, nodes[1:]))
    listener.status_after(("order", order(T, nodes, edges)), report)
    looked_at = pieces_looked_at(monkeypatch, listener, position(5.0, 0.0, pi / 2))
    assert len(bent) < looked_at < 10 * len(curves)


@pytest.mark.parametrize(
    ("pose", "next_point"),
    [
        ((10.0, 4.0, pi / 2), (10, 8)),
        ((3.0, 8.1, pi), (0, 8)),
        ((5.0, 0.0, 0.0), (10, 0)),
        ((5.0, 0.0, pi), (10, 0)),
        ((5.0, 4.0, pi), (10, 0)),
        ((10.0, 4.0, -pi / 2), (10, 0)),
    ],
)
def test_nodes_that_a_state_never_stops_naming_do_not_send_the_robot_back(
    pose: tuple[float, float, float], next_point: tuple[float, float]
) -> None:
    way = [(0, 0), (10, 0), (10, 8), (0, 8)]
    nodes = [node(number, *place) for number, place in enumerate(way)]
    report = under_way(T, *pose[:2], nodes[1:], velocity={"vx": 0.8}, theta=pose[2])
    status = Listener().status_after(("order", order(T, nodes)), ("state", report))
    assert next(row[1:3] for row in status.path.poses if row[1:3] != pose[:2]) == next_point
    assert ("node-passed" in status.findings) is (next_point != (10, 0))


def test_a_robot_that_never_names_nodes_drives_to_those_of_its_order_after_its_last() -> None:
    nodes = [node(0, 0.0), node(1, 10.0), node(2, 10.0, 8.0)]
    passed = {"lastNodeId": "n0", "lastNodeSequenceId": 0}
    ordered = ("order", order(T, nodes))
    status = Listener().status_after(ordered, ("state", under_way(T, 5.0, 0.0, [], **passed)))
    assert [row[1:3] for row in status.path.poses][-1] == (10.0, 8.0)
    cancelled = ("state", under_way(T + 1, 6.0, 0.0, [], **passed))
    status = Listener().status_after(ordered, ("state", under_way(T, 5.0, 0.0, nodes[1:])), cancelled)
    assert not status.path.poses, "it named them before"
