from itertools import pairwise
from math import cos, hypot, pi, sin, sqrt
from typing import Any

import pytest

from ingest.batch import Basis
from ingest.frames.assumed_motion import ASSUMED_TURN_RADPS
from ingest.languages.geometry import trajectories
from ingest.languages.geometry.trajectories import MOST_POINTS, curve_of, polyline
from ingest.languages.model import NO_PATH
from ingest.languages.rules import Findings
from ingest.languages.timestamps import write
from ingest.languages.vda5050.vda_messages import ControlPoint, Trajectory
from tests.helpers.vda_saying import edge, factsheet, node, order, state, under_way
from tests.ingest.languages.vda5050.made_vda import Listener, T

QUARTER = [ControlPoint(2.0, 0.0), ControlPoint(2.0, 2.0, sqrt(0.5)), ControlPoint(0.0, 2.0)]
UNWEIGHTED = [ControlPoint(each.x, each.y) for each in QUARTER]
CLAMPED = [0.0, 0.0, 0.0, 1.0, 1.0, 1.0]


def test_a_rational_curve_of_degree_two_is_a_true_circle() -> None:
    points = polyline(Trajectory(QUARTER, 2, CLAMPED))
    assert points is not None
    assert points[0] == pytest.approx((2.0, 0.0))
    assert points[-1] == pytest.approx((0.0, 2.0))
    assert all(hypot(x, y) == pytest.approx(2.0) for x, y in points)


def test_without_weights_the_same_points_give_a_parabola() -> None:
    points = polyline(Trajectory(UNWEIGHTED, 2, CLAMPED))
    assert points is not None
    assert max(hypot(x, y) for x, y in points) == pytest.approx(sqrt(4.5))


def test_degree_and_knots_have_the_defaults_of_version_3() -> None:
    corners = [ControlPoint(0.0, 0.0), ControlPoint(3.0, 0.0), ControlPoint(3.0, 4.0)]
    assert polyline(Trajectory(corners)) == ((0.0, 0.0), (3.0, 0.0), (3.0, 4.0))
    assert polyline(Trajectory(QUARTER, 2)) == polyline(Trajectory(QUARTER, 2, CLAMPED))


def test_a_long_curve_has_a_limited_number_of_points() -> None:
    points = polyline(Trajectory([ControlPoint(900.0 * each.x, 900.0 * each.y) for each in QUARTER], 2, CLAMPED))
    assert points is not None
    assert len(points) == MOST_POINTS


@pytest.mark.parametrize(
    "trajectory",
    [
        Trajectory(QUARTER, 0),
        Trajectory(QUARTER, 3),
        Trajectory(QUARTER[:1], 1),
        Trajectory([*QUARTER[:2], ControlPoint(0.0, 2.0, 0.0)], 2, CLAMPED),
        Trajectory([*QUARTER[:2], ControlPoint(0.0, 2e7)], 2, CLAMPED),
        Trajectory(QUARTER * 400, 2),
    ],
    ids=["degree 0", "too few points", "one point", "weight 0", "far", "long"],
)
def test_what_is_no_clamped_curve_is_none(trajectory: Trajectory) -> None:
    findings = Findings()
    assert curve_of(trajectory, findings) is None
    assert tuple(findings) == ("trajectory-unreadable",)


def test_a_line_that_is_drawn_finely_is_thinned_and_keeps_its_corners() -> None:
    out = [ControlPoint(0.02 * step, 0.0) for step in range(201)]
    up = [ControlPoint(4.0, 0.02 * step) for step in range(1, 151)]
    points = polyline(Trajectory([*out, *up], 1))
    assert points is not None
    assert len(points) < 30
    assert {points[0], points[-1]} == {(0.0, 0.0), (4.0, 3.0)}
    assert (4.0, 0.0) in points


def test_a_circle_that_is_drawn_finely_stays_one() -> None:
    circle = [ControlPoint(cos(step / 50), sin(step / 50)) for step in range(300)]
    points = polyline(Trajectory(circle, 1))
    assert points is not None
    assert len(points) < 60
    assert all(hypot(ax + bx, ay + by) / 2 > 0.99 for (ax, ay), (bx, by) in pairwise(points))


@pytest.mark.parametrize(
    ("trajectory", "usual"),
    [
        (Trajectory(QUARTER, 2, [0.0, 0.0, 1.0, 1.0]), Trajectory(QUARTER, 2)),
        (Trajectory(QUARTER, 2, [0.0, 0.0, 1.0, 0.5, 1.0, 1.0]), Trajectory(QUARTER, 2)),
        (Trajectory(QUARTER, 2, [1.0] * 6), Trajectory(QUARTER, 2)),
        (Trajectory([ControlPoint(each.x, each.y, 0.0) for each in QUARTER], 2), Trajectory(UNWEIGHTED, 2)),
    ],
    ids=["too few knots", "unsorted", "no span", "weights 0"],
)
def test_knots_and_weights_that_can_not_be_used_are_as_if_absent(trajectory: Trajectory, usual: Trajectory) -> None:
    findings = Findings()
    assert curve_of(trajectory, findings) == curve_of(usual, Findings())
    assert tuple(findings) == ("trajectory-odd",)


def test_a_line_of_many_points_is_thinned_before_they_are_counted() -> None:
    line = [ControlPoint(0.02 * step, 0.0) for step in range(700)]
    points = polyline(Trajectory(line, 1))
    assert points is not None
    assert points[-1][0] == pytest.approx(13.98)


ARC: dict[str, Any] = {"degree": 2, "controlPoints": [{"x": 0.0, "y": 0.0}, {"x": 4.0, "y": 0.0}, {"x": 4.0, "y": 4.0}]}
CORNERS = [node(0, 0.0), node(1, 4.0, 4.0)]


def on_arc(*messages: tuple[str, bytes]) -> list[tuple[float, float]]:
    """The points of the path of the last status, which must go along `ARC`."""
    ahead = [(round(x, 9), round(y, 9)) for _, x, y, _ in Listener().status_after(*messages).path.poses]
    assert len(ahead) > 5
    assert max(x - y for x, y in ahead) == pytest.approx(2.0, abs=0.1)
    assert ahead[-1] == (4.0, 4.0)
    return ahead


def test_a_curve_of_a_state_is_followed_where_the_order_has_none() -> None:
    states = [{"edgeId": "e0", "sequenceId": 1, "released": True, "trajectory": ARC}]
    report = ("state", under_way(T, 0.0, 0.0, CORNERS[1:], edgeStates=states))
    expected = on_arc(("order", order(T, CORNERS, [edge(0, trajectory=ARC)])), report)
    limited = ("order", order(T, CORNERS, [edge(0, maxSpeed=0.5)]))
    assert on_arc(limited, report) == expected
    assert Listener().status_after(limited, report).path.most[0] == 0.5


def test_a_planned_path_is_the_way_to_the_nodes() -> None:
    plan = {"trajectory": ARC}
    report = under_way(T, 0.0, 0.0, CORNERS[1:], plannedPath=plan)
    ahead = on_arc(("state", report))
    assert on_arc(("state", state(T, driving=True, plannedPath=plan))) == ahead
    assert Listener().status_after(("state", report)).path_basis is Basis.ORDER
    assert on_arc(("order", order(T, CORNERS)), ("state", report)) == ahead
    far = Listener().status_after(("state", state(T, 0.0, 9.0, driving=True, plannedPath=plan)))
    assert (far.path, far.destinations.poses[0][1:3]) == (NO_PATH, (4.0, 4.0))


def test_a_curve_that_leads_from_its_end_to_its_start_is_turned_round() -> None:
    knots = [0.0, 0.0, 0.0, 1.0, 1.0, 1.0]
    back = {"degree": 2, "knotVector": knots, "controlPoints": ARC["controlPoints"][::-1]}
    ordered, report = order(T, CORNERS, [edge(0, trajectory=back)]), ("state", under_way(T, 0.0, 0.0, CORNERS[1:]))
    usual = on_arc(("order", order(T, CORNERS, [edge(0, trajectory=ARC)])), report)
    assert on_arc(("order", ordered), report) == usual
    assert Listener().hears("order", ordered).findings == ("trajectory-odd",)
    states = [{"edgeId": "e0", "sequenceId": 1, "released": True, "trajectory": back}]
    acknowledged = ("state", under_way(T, 0.0, 0.0, CORNERS[1:], edgeStates=states))
    assert on_arc(("order", order(T, CORNERS)), acknowledged) == usual


def test_a_node_without_a_place_is_where_the_curve_to_it_ends() -> None:
    line = {"controlPoints": [{"x": 0.0, "y": 0.0}, {"x": 4.0, "y": 0.0}]}
    nodes = [node(0, 0.0), node(1, None)]
    ordered = ("order", order(T, nodes, [edge(0, trajectory=line)]))
    status = Listener().status_after(ordered, ("state", under_way(T, 1.0, 0.0, nodes[1:])))
    assert ([row[1:3] for row in status.path.poses], status.findings) == ([(4.0, 0.0)], ())


AROUND = {"trajectory": {"controlPoints": [{"x": x, "y": y} for x, y in ((0, 0), (0, 6), (8, 6), (8, 0))]}}


def planned(nodes: list[dict[str, Any]], *further: tuple[str, bytes], **keys: Any) -> list[tuple[float, float]]:
    """The places to which a robot drives that is at 0, 0 and plans to drive `AROUND`."""
    report = ("state", under_way(T, 0.0, 0.0, nodes[1:], plannedPath=AROUND, **keys))
    status = Listener().status_after(("order", order(T - 1, nodes)), report, *further)
    places = dict.fromkeys((round(x, 6), round(y, 6)) for _, x, y, _ in status.path.poses)
    return [place for place in places if place != (0.0, 0.0)]


def test_a_planned_path_leads_past_nodes_and_ends_at_a_stop() -> None:
    goal = node(3, 8.0, 0.2)
    assert planned([node(0, 0.0), goal]) == [(0.0, 6.0), (8.0, 6.0), (8.0, 0.2)]
    lift: dict[str, Any] = {"actions": [{"actionId": "a", "actionType": "pick", "blockingType": "HARD"}]}
    assert planned([node(0, 0.0), node(1, 4.0, 6.5, **lift), goal]) == [(0.0, 6.0), (4.0, 6.0)]
    assert planned([node(0, 0.0), node(1, 4.0, 3.0), goal]) == [(0.0, 6.0), (8.0, 6.0), (8.0, 0.2)]
    assert planned([node(0, 0.0), node(1, 8.0, 0.0), node(2, 20.0)])[-2:] == [(8.0, 0.0), (20.0, 0.0)]


def test_a_plan_that_ends_early_is_driven_to_its_end_unless_it_leads_away() -> None:
    assert planned([node(0, 0.0), node(1, 8.0, -9.0)]) == [(0.0, 6.0), (8.0, 6.0), (8.0, 0.0), (8.0, -9.0)]
    assert planned([node(0, 0.0), node(1, -9.0)]) == [(-9.0, 0.0)]


def test_a_plan_that_is_older_than_the_order_is_followed_only_to_nodes_of_the_order() -> None:
    newer = order(T + 1, [node(0, 0.0), node(1, 9.0, -9.0)], orderUpdateId=1)
    assert planned([node(0, 0.0), node(1, 8.0)], ("order", newer)) == [(9.0, -9.0)]
    same_way = order(T + 1, [node(0, 0.0), node(1, 8.0, 6.0)], orderUpdateId=1)
    assert planned([node(0, 0.0), node(1, 8.0)], ("order", same_way)) == [(0.0, 6.0), (8.0, 6.0)]


@pytest.mark.parametrize("plan", [AROUND, None])
def test_the_order_goes_on_where_a_path_with_times_ends(plan: dict[str, Any] | None) -> None:
    nodes = [node(0, 0.0), node(1, 0.0, 6.0), node(2, 8.0, 6.0)]
    polyline = [{"x": 0.0, "y": each / 2, "eta": write(T + each)} for each in range(1, 4)]
    report = under_way(T, 0.0, 0.0, nodes[1:], intermediatePath={"polyline": polyline}, plannedPath=plan)
    ordered = ("order", order(T - 1, nodes, [edge(0, maxSpeed=2.0), edge(1)]))
    status = Listener().status_after(ordered, ("state", report))
    rows = [(round(t_s - T, 3), x, y) for t_s, x, y, _ in status.path.poses]
    assert rows[:4] == [(1.0, 0.0, 0.5), (2.0, 0.0, 1.0), (3.0, 0.0, 1.5), (12.0, 0.0, 6.0)]
    assert rows[-1][1:] == (8.0, 6.0)
    assert (status.path_basis, status.path.most, status.path.ends_in_stop) == (Basis.PATH, (), True)


def test_the_order_goes_on_with_a_turn_where_a_path_with_times_ends_at_a_corner() -> None:
    nodes = [node(0, 0.0), node(1, 3.0), node(2, 3.0, 6.0)]
    polyline = [{"x": float(each), "y": 0.0, "eta": write(T + each)} for each in range(1, 4)]
    keys = {"intermediatePath": {"polyline": polyline}, "velocity": {"vx": 1.0}}
    status = Listener().status_after(
        ("order", order(T - 1, nodes)), ("state", under_way(T, 0.0, 0.0, nodes[1:], **keys))
    )
    assert status.path.ends_s[1] - T == pytest.approx(9.0 + pi / 2 / ASSUMED_TURN_RADPS)


def test_a_limit_that_is_nearly_zero_gives_no_times_without_end() -> None:
    limits = {"physicalParameters": {"length": 1.2, "width": 0.8, "speedMax": 1e-320, "maximumAngularSpeed": 1e-320}}
    nodes = [node(0, 0.0), node(1, 3.0), node(2, 3.0, 6.0)]
    polyline = [{"x": float(each), "y": 0.0, "eta": write(T + each)} for each in range(1, 3)]
    report = ("state", under_way(T, 0.0, 0.0, nodes[1:], intermediatePath={"polyline": polyline}))
    status = Listener().status_after(("factsheet", factsheet(T, **limits)), ("order", order(T - 1, nodes)), report)
    assert len(status.path.poses) > 2
    assert status.path.ends_s[1] < T + 300.0


def test_a_crawl_at_the_end_of_a_path_with_times_is_not_how_fast_the_robot_drives() -> None:
    nodes = [node(0, 0.0), node(1, 6.0)]
    polyline = [{"x": 0.0, "y": 0.0, "eta": write(T + 1)}, {"x": 0.1, "y": 0.0, "eta": write(T + 1.5)}]
    report = ("state", under_way(T, 0.0, 0.0, nodes[1:], intermediatePath={"polyline": polyline}))
    assert Listener().status_after(("order", order(T - 1, nodes)), report).path.ends_s[1] == pytest.approx(T + 7.4)


def test_a_path_with_times_that_leads_elsewhere_than_the_order_stays_as_it_is() -> None:
    nodes = [node(0, 0.0), node(1, 0.0, 6.0), node(2, 8.0, 6.0)]
    polyline = [{"x": float(each), "y": -3.0, "eta": write(T + each)} for each in range(1, 4)]
    report = under_way(T, 0.0, 0.0, nodes[1:], intermediatePath={"polyline": polyline})
    status = Listener().status_after(("order", order(T - 1, nodes)), ("state", report))
    assert len(status.path.poses) == 3


def test_the_last_curve_of_a_long_order_is_followed() -> None:
    nodes = [node(number, 4.0 * number, 4.0 * (number % 2)) for number in range(300)]
    edges = []
    for number, (start, end) in enumerate(pairwise(each["nodePosition"] for each in nodes)):
        corner = {"x": end["x"], "y": start["y"]}
        edges.append(edge(number, trajectory={"degree": 2, "controlPoints": [start, corner, end]}))
    report = under_way(T, 4.0 * 298, 0.0, nodes[299:])
    status = Listener().status_after(("order", order(T, nodes, edges)), ("state", report))
    assert len(status.path.poses) > 5
    assert status.findings == ()


def test_few_long_curves_are_cached_and_a_planned_path_that_is_not_followed_is_not() -> None:
    cached = trajectories._points_along
    assert (cached.cache_info().maxsize or 10**9) <= 256
    cached.cache_clear()
    plan, straight = {"trajectory": ARC}, {"trajectory": ARC | {"degree": 1, "knotVector": None}}
    read = Listener().status_after(("state", state(T, plannedPath=plan)))
    assert read.destinations.poses[0][1:3] == (4.0, 4.0)
    assert len(Listener().status_after(("state", state(T, driving=True, plannedPath=straight))).path.poses) > 1
    assert cached.cache_info().currsize == 0
    assert on_arc(("state", state(T, driving=True, plannedPath=plan)))
    assert cached.cache_info().currsize == 1
