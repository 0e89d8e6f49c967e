"""Lanes: everybody can get everywhere by keeping right, and floors grow with the number of robots."""

from itertools import pairwise

import numpy as np
import pytest

from deconflict.simulation.floor_layout import GROUND, MEZZANINE, BayKind, Layout, layout_for


@pytest.fixture(scope="module")
def layout() -> Layout:
    return layout_for(24)


def length_m(layout: Layout, nodes: list[int]) -> float:
    return sum(layout.onward[a][b] for a, b in pairwise(nodes))


@pytest.mark.parametrize("floor", [GROUND, MEZZANINE])
def test_every_bay_can_be_reached_from_every_other_on_its_floor(layout: Layout, floor: int) -> None:
    nodes = [bay.node for bay in layout.bays if bay.floor == floor]
    ways = [
        *pairwise([*nodes, nodes[0]]),
        *((nodes[0], goal) for goal in nodes[1:]),
        *((a, nodes[0]) for a in nodes[1:]),
    ]
    for start, goal in ways:
        route = layout.route(start, goal, np.ones(len(layout.places)))
        assert route[0] == start
        assert route[-1] == goal
        assert all(b in layout.onward[a] for a, b in pairwise(route))


def test_no_path_has_a_u_turn(layout: Layout) -> None:
    opposite = layout.route(layout.bays[1].node, layout.bays[3].node, np.ones(len(layout.places)))
    for (ax, ay), (bx, by), (cx, cy) in zip(
        *(([layout.places[node] for node in opposite[skip:]]) for skip in range(3)), strict=False
    ):
        assert (bx - ax) * (cx - bx) + (by - ay) * (cy - by) >= 0


def test_bays_open_on_the_right(layout: Layout) -> None:
    for bay in layout.bays:
        gate = next(iter(layout.onward[bay.node]))
        after = next(node for node in layout.onward[gate] if node != bay.node)
        (x, y), (to_x, to_y) = layout.places[gate], layout.places[after]
        to_the_left = (to_x - x) * (bay.place[1] - y) - (to_y - y) * (bay.place[0] - x)
        assert to_the_left < 0


def test_detours_change_the_path(layout: Layout) -> None:
    start, goal = layout.bays[1].node, layout.bays[-1 - len(layout.bays) // 2].node
    shortest = layout.route(start, goal, np.ones(len(layout.places)))
    hindered = np.ones(len(layout.places))
    hindered[shortest[2:-2]] = 20.0
    assert layout.route(start, goal, hindered) != shortest
    assert length_m(layout, shortest) <= length_m(layout, layout.route(start, goal, hindered))


@pytest.mark.parametrize("robots", [1, 4, 24, 25, 240, 1000])
def test_the_floor_grows_with_the_robots_at_equal_density(robots: int) -> None:
    layout = layout_for(robots)
    open_bays = [bay for bay in layout.bays if bay.kind is not BayKind.LIFT]
    assert len(open_bays) >= 2 * robots
    assert {bay.floor for bay in layout.bays} == {GROUND, MEZZANINE}


@pytest.mark.parametrize("robots", [4, 100])
def test_each_lift_has_its_other_end_on_the_other_floor(robots: int) -> None:
    layout = layout_for(robots)
    lifts = [index for index, bay in enumerate(layout.bays) if bay.kind is BayKind.LIFT]
    assert sorted(layout.other_lift) == lifts
    for lift in lifts:
        assert layout.other_lift[layout.other_lift[lift]] == lift
        assert layout.bays[lift].floor != layout.bays[layout.other_lift[lift]].floor


def test_a_goal_on_the_other_floor_has_no_path(layout: Layout) -> None:
    start, goal = (next(bay.node for bay in layout.bays if bay.floor == floor) for floor in (GROUND, MEZZANINE))
    with pytest.raises(ValueError, match=f"no path from node {start} to node {goal}"):
        layout.route(start, goal, np.ones(len(layout.places)))
