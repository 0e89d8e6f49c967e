"""The path along the released base of an order."""

import json
from itertools import pairwise
from math import hypot, pi, sqrt
from typing import Any

import pytest

from ingest.batch import Basis
from ingest.languages.model import NO_PATH, Path
from tests.helpers.vda_saying import (
    edge,
    factsheet,
    node,
    node_states,
    order,
    position,
    state,
    under_way,
    visualization,
)
from tests.ingest.languages.vda5050.made_vda import Listener, T

LINE = [node(0, 0.0), node(1, 4.0), node(2, 10.0)]
ORDERED = ("order", order(T, LINE))


def points(path: Path) -> list[tuple[float, ...]]:
    """Seconds from `T`, x and y."""
    return [(round(t_s - T, 3), round(x, 3), round(y, 3)) for t_s, x, y, _ in path.poses]


def on_line(*messages: tuple[str, bytes], **keys: Any) -> Path:
    """The path of a robot at (1, 0) on the way along `LINE`, after an order and further messages."""
    return (Listener().status_after(ORDERED, ("state", under_way(T, 1.0, 0.0, LINE[1:], **keys)), *messages)).path


def test_without_limits_it_drives_at_the_assumed_speed() -> None:
    assert points(on_line()) == [(3.0, 4.0, 0.0), (9.0, 10.0, 0.0)]


def test_without_limits_a_quicker_robot_keeps_its_speed() -> None:
    assert points(on_line(velocity={"vx": 1.5})) == [(2.0, 4.0, 0.0), (6.0, 10.0, 0.0)]


def test_the_speed_is_the_least_of_edge_and_robot() -> None:
    edges = [edge(0, maxSpeed=2.0), edge(1, maxSpeed=0.5)]
    status = Listener().status_after(
        ("factsheet", factsheet(T)), ("order", order(T, LINE, edges)), ("state", under_way(T, 1.0, 0.0, LINE[1:]))
    )
    assert points(status.path) == [(3.0, 4.0, 0.0), (15.0, 10.0, 0.0)]
    assert status.path_basis is Basis.ORDER


def test_version_3_calls_the_speed_otherwise() -> None:
    edges = [edge(0, maximumSpeed=2.0), edge(1, maximumSpeed=3.0)]
    status = Listener().status_after(("order", order(T, LINE, edges)), ("state", under_way(T, 0.0, 0.0, LINE[1:])))
    assert points(status.path) == [(2.0, 4.0, 0.0), (4.0, 10.0, 0.0)]


def test_a_factsheet_after_the_state_counts_at_once() -> None:
    parameters = {"length": 1.0, "width": 1.0, "speedMax": 3.0}
    assert points(on_line(("factsheet", factsheet(T + 1, physicalParameters=parameters))))[0] == (1.0, 4.0, 0.0)


def test_it_turns_on_the_spot_at_a_corner() -> None:
    nodes = [node(0, 0.0), node(1, 2.0), node(2, 2.0, 3.0)]
    status = Listener().status_after(("order", order(T, nodes)), ("state", under_way(T, 0.0, 0.0, nodes[1:])))
    corner_s = 2.0 + pi / 2
    straight, *turn, end = points(status.path)
    assert (straight, end) == ((2.0, 2.0, 0.0), (round(corner_s + 3, 3), 2.0, 3.0))
    assert turn[-1][0] == round(corner_s, 3)
    assert {point[1:] for point in turn} == {(2.0, 0.0)}
    yaws_rad = [row[3] for row in status.path.poses]
    assert yaws_rad == sorted(yaws_rad)
    assert yaws_rad[-2:] == [pi / 2, pi / 2]


def test_a_robot_under_way_does_not_turn_on_the_spot_first() -> None:
    standing = Listener().status_after(ORDERED, ("state", under_way(T, 0.0, 0.0, LINE[1:], theta=pi / 2)))
    driving = Listener().status_after(
        ORDERED, ("state", under_way(T, 0.0, 0.0, LINE[1:], velocity={"vx": 1.0}, theta=pi / 2))
    )
    assert points(driving.path) == [(4.0, 4.0, 0.0), (10.0, 10.0, 0.0)]
    assert points(standing.path)[-1][0] == round(10.0 + pi / 2, 3)


def test_a_curve_is_followed_from_where_the_robot_is() -> None:
    quarter = {
        "degree": 2,
        "knotVector": [0.0, 0.0, 0.0, 1.0, 1.0, 1.0],
        "controlPoints": [{"x": 0.0, "y": 0.0}, {"x": 4.0, "y": 0.0, "weight": sqrt(0.5)}, {"x": 4.0, "y": 4.0}],
    }
    nodes = [node(0, 0.0), node(1, 4.0, 4.0)]
    middle = 4.0 * sqrt(0.5)
    status = Listener().status_after(
        ("order", order(T, nodes, [edge(0, trajectory=quarter)])),
        ("state", under_way(T, middle, 4.0 - middle, nodes[1:], velocity={"vx": 1.0})),
    )
    assert all(hypot(x, y - 4.0) == pytest.approx(4.0, abs=0.002) for _, x, y in points(status.path))
    assert status.path.ends_s[1] - T == pytest.approx(pi, abs=0.02), "half of the quarter, 3.14 m"
    assert all(later[0] > earlier[0] for earlier, later in pairwise(status.path.poses))


def test_it_stops_at_a_node_with_an_action_during_which_it_does_not_drive() -> None:
    nodes = [node(0, 0.0), node(1, 4.0, actions=[{"actionId": "a", "blockingType": "HARD"}]), node(2, 10.0)]
    ordered = ("order", order(T, nodes))
    stopping = Listener().status_after(ordered, ("state", under_way(T, 0.0, 0.0, nodes[1:])))
    assert points(stopping.path) == [(4.0, 4.0, 0.0)]
    assert points(stopping.destinations) == [(10.001, 10.0, 0.0)]
    done = [{"actionId": "a", "actionStatus": "FINISHED"}]
    going_on = Listener().status_after(ordered, ("state", under_way(T, 0.0, 0.0, nodes[1:], actionStates=done)))
    assert points(going_on.path)[-1] == (10.0, 10.0, 0.0)


@pytest.mark.parametrize("kind", ["NONE", "SINGLE"])
def test_it_drives_through_a_node_with_another_action(kind: str) -> None:
    nodes = [node(0, 0.0), node(1, 4.0, actions=[{"actionId": "a", "blockingType": kind}]), node(2, 10.0)]
    status = Listener().status_after(("order", order(T, nodes)), ("state", under_way(T, 0.0, 0.0, nodes[1:])))
    assert points(status.path)[-1] == (10.0, 10.0, 0.0)


def test_the_horizon_is_a_destination_and_is_driven_while_bases_are_extended_in_time() -> None:
    nodes = [*LINE, node(3, 10.0, 5.0, released=False), node(4, 10.0, 9.0, released=False)]
    listener = Listener()
    status = listener.status_after(("order", order(T, nodes)), ("state", under_way(T, 1.0, 0.0, nodes[1:])))
    assert [points(status.path)[row] for row in (0, 1, -1)] == [
        (3.0, 4.0, 0.0),
        (9.0, 10.0, 0.0),
        (round(18.0 + pi / 2, 3), 10.0, 9.0),
    ]
    assert not status.path.ends_in_stop
    assert [point[1:] for point in points(status.destinations)] == [(10.0, 0.0), (10.0, 9.0)]


def test_a_robot_whose_bases_are_extended_once_it_stands_stops_at_the_end_of_its_base() -> None:
    place, listener = LINE[:2], Listener()
    listener.hears("order", order(T, place))
    for number in range(2, 5):
        listener.hears("state", under_way(T + number, 4.0 * (number - 1), 0.0, place[-1:], driving=False))
        further = node(number, 4.0 * number)
        place.append(further)
        listener.hears("order", order(T + number, place, orderUpdateId=number))
    ahead = [*place[3:], node(5, 30.0, released=False)]
    listener.hears("order", order(T + 6, [*place, ahead[-1]], orderUpdateId=6))
    status = listener.status_after(("state", under_way(T + 6, 13.0, 0.0, ahead)))
    assert status.path.ends_in_stop
    assert points(status.path)[-1][1:] == (16.0, 0.0)


def test_a_state_that_names_an_order_nobody_saw_is_read_by_its_own_places() -> None:
    named = Listener().hears("state", under_way(T, 1.0, 0.0, LINE[1:]))
    assert named.findings.count("order-unseen") == 1
    places = [{**each, "nodePosition": {"x": x, "y": 0.0}} for each, x in zip(LINE[1:], (4.0, 10.0), strict=True)]
    status = Listener().status_after(("state", under_way(T, 1.0, 0.0, LINE[1:], nodeStates=places)))
    assert points(status.path) == [(3.0, 4.0, 0.0), (9.0, 10.0, 0.0)]


def test_a_node_without_a_place_ends_the_path() -> None:
    nodes = [node(0, 0.0), node(1, 4.0), node(2, None), node(3, 9.0)]
    status = Listener().status_after(("order", order(T, nodes)), ("state", under_way(T, 0.0, 0.0, nodes[1:])))
    assert points(status.path) == [(4.0, 4.0, 0.0)]
    assert "node-without-place" in status.findings


def test_an_update_of_the_order_counts_before_a_state_shows_it() -> None:
    longer = order(T + 1, [node(2, 10.0), node(3, 10.0, 3.0)], [edge(2)], orderUpdateId=1)
    assert points(on_line(("order", longer)))[-1][1:] == (10.0, 3.0)


def test_a_newer_state_is_believed_over_an_update_that_it_does_not_show() -> None:
    longer = order(T + 1, [node(2, 10.0), node(3, 10.0, 3.0)], [edge(2)], orderUpdateId=1)
    assert points(on_line(("order", longer), ("state", under_way(T + 2, 2.0, 0.0, LINE[1:]))))[-1][1:] == (10.0, 0.0)


def test_after_a_cancelled_order_there_is_no_path() -> None:
    status = Listener().status_after(
        ORDERED,
        ("state", under_way(T, 1.0, 0.0, LINE[1:])),
        ("state", state(T + 1, 1.0, 0.0, orderId="o1", nodeStates=[])),
    )
    assert (status.state, status.path) == ("idle", NO_PATH)


def test_a_new_order_counts_once_a_state_names_it() -> None:
    other = order(T + 1, [node(0, 1.0), node(1, 1.0, 7.0)], orderId="o2")
    assert points(on_line(("order", other)))[-1][1:] == (10.0, 0.0)
    after = under_way(T + 2, 1.0, 0.0, [node(1, 1.0, 7.0)], orderId="o2")
    assert points(on_line(("order", other), ("state", after)))[-1][1:] == (1.0, 7.0)


def test_a_visualization_moves_the_start_of_the_path() -> None:
    assert points(on_line(("visualization", visualization(T + 1, 2.0, 0.0)))) == [(3.0, 4.0, 0.0), (9.0, 10.0, 0.0)]


def test_a_backward_edge_has_the_heading_of_its_orientation() -> None:
    edges = [edge(0, orientation=pi), edge(1, orientation=pi)]
    keys = {"theta": pi, "velocity": {"vx": -1.0}}
    status = Listener().status_after(
        ("order", order(T, LINE, edges)), ("state", under_way(T, 0.0, 0.0, LINE[1:], **keys))
    )
    assert [abs(row[3]) for row in status.path.poses] == [pytest.approx(pi)] * 2


@pytest.mark.parametrize(("turn", "yaws"), [((10.0, 0.0), {pi}), ((4.0, 6.0), {pi, pi / 2}), ((0.0, 0.0), {pi})])
def test_a_robot_that_drives_backwards_goes_on_so_where_it_need_not_turn(
    turn: tuple[float, float], yaws: set[float]
) -> None:
    nodes = [node(0, 0.0), node(1, 4.0), node(2, *turn)]
    keys = {"agvPosition": position(1.0, theta=pi), "velocity": {"vx": -1.0}}
    status = Listener().status_after(("order", order(T, nodes)), ("state", under_way(T, 1.0, 0.0, nodes[1:], **keys)))
    driven = [row for before, row in pairwise(status.path.poses) if before[1:3] != row[1:3]]
    assert {abs(round(row[3], 6)) for row in (status.path.poses[0], *driven)} == {round(yaw, 6) for yaw in yaws}


def test_a_node_on_another_map_is_on_that_map() -> None:
    upstairs = {"x": 5.0, "y": 0.0, "mapId": "Loft"}
    nodes = [node(0, 0.0), node(1, 4.0), {**node(2, 5.0), "nodePosition": upstairs}]
    status = Listener().status_after(("order", order(T, nodes)), ("state", under_way(T, 0.0, 0.0, nodes[1:])))
    assert status.path.datums == ("hall", "loft")


@pytest.mark.parametrize("unread", ["order", "state"])
@pytest.mark.parametrize("order_id", [None, {}, []])
def test_without_an_order_id_the_newest_order_counts(unread: str, order_id: Any) -> None:
    raws = {"order": order(T - 1, LINE), "state": under_way(T, 1.0, 0.0, LINE[1:])}
    raws[unread] = json.dumps(json.loads(raws[unread]) | {"orderId": order_id}).encode()
    assert points(Listener().status_after(*raws.items()).path) == points(on_line())


BEND = [node(0, 0.0), node(1, 4.0), node(2, 4.0, 7.0)]


@pytest.mark.parametrize("update_id", [None, "v4", {}])
def test_an_order_without_an_update_id_that_can_be_read_is_the_next_update(update_id: Any) -> None:
    first = ("order", order(T, LINE, orderUpdateId=3))
    raw = json.dumps(json.loads(order(T + 1, BEND)) | {"orderUpdateId": update_id}).encode()
    status = Listener().status_after(first, ("order", raw), ("state", under_way(T + 2, 1.0, 0.0, BEND[1:])))
    assert points(status.path)[-1][1:] == (4.0, 7.0)


@pytest.mark.parametrize("named_first", [False, True])
def test_an_older_update_counts_while_a_state_names_it(named_first: bool) -> None:
    listener = Listener()
    listener.hears("order", order(T, LINE, orderUpdateId=3))
    listener.hears("state", under_way(T, 0.5, 0.0, LINE[1:], orderUpdateId=0 if named_first else 3))
    assert "order-outdated" in listener.hears("order", order(T + 1, BEND)).findings
    for seconds, update_id, end in ((2, 0, (4.0, 7.0)), (3, 3, (10.0, 0.0)), (4, 0, (4.0, 7.0))):
        nodes = BEND if update_id == 0 else LINE
        report = under_way(T + seconds, 1.0, 0.0, nodes[1:], orderUpdateId=update_id)
        assert points(listener.status_after(("state", report)).path)[-1][1:] == end


def test_an_older_update_that_no_state_names_is_not_used() -> None:
    first = ("order", order(T, LINE, orderUpdateId=3))
    report = ("state", under_way(T + 2, 1.0, 0.0, LINE[1:], orderUpdateId=3))
    status = Listener().status_after(first, ("order", order(T + 1, BEND)), report)
    assert points(status.path)[-1][1:] == (10.0, 0.0)


@pytest.mark.parametrize("unnamed", ["order", "state", None])
def test_a_node_of_an_order_is_used_only_for_a_state_of_the_same_node(unnamed: str | None) -> None:
    ordered = [node(0, 0.0), node(1, 2.0), node(2, 6.0), node(3, 9.0)]
    ahead = [node(1, 2.0), node(2, 0.0, nodeId="X"), node(3, 0.0, nodeId="Y")]
    for each in {"order": ordered[2:], "state": ahead[1:]}.get(unnamed or "", ()):
        each["nodeId"] = ""
    status = Listener().status_after(("order", order(T, ordered)), ("state", under_way(T, 1.0, 0.0, ahead)))
    assert ("order-unseen" in status.findings) == (unnamed is None)
    assert points(status.path)[-1][1:] == ((2.0, 0.0) if unnamed is None else (9.0, 0.0))


def test_a_state_with_nodes_but_an_empty_order_id_is_of_the_newest_order() -> None:
    status = Listener().status_after(ORDERED, ("state", under_way(T, 1.0, 0.0, LINE[1:], orderId="")))
    assert points(status.path) == points(on_line())
    assert "order-unseen" not in status.findings


def dense(count: int, spacing_m: float) -> list[dict[str, Any]]:
    return [node(number, spacing_m * number) for number in range(count)]


FINE = {"degree": 1, "controlPoints": [{"x": 0.02 * step, "y": 0.0} for step in range(300)]}
FINER = {"degree": 1, "controlPoints": [{"x": 5.98 + 0.02 * step, "y": 0.0} for step in range(300)]}


@pytest.mark.parametrize(
    ("nodes", "edges", "end_m", "is_stop"),
    [
        (LINE, None, 10.0, True),
        (
            [node(0, 0.0), node(1, 5.98), node(2, 11.96)],
            [edge(0, trajectory=FINE), edge(1, trajectory=FINER)],
            11.96,
            True,
        ),
        (dense(400, 0.05), None, 19.95, True),
        (dense(40, 4.0), None, 44.0, False),
        (dense(400, 0.31), [edge(number, maxSpeed=2.0) for number in range(399)], 46.5, False),
        ([node(0, 0.0), node(1, 4.0), node(2, None), node(3, 9.0)], None, 4.0, False),
    ],
    ids=["short", "fine curves", "near nodes", "longer than 40 s", "many nodes", "no place"],
)
def test_a_path_is_a_stop_only_where_the_base_ends(
    nodes: list[dict[str, Any]], edges: list[dict[str, Any]] | None, end_m: float, is_stop: bool
) -> None:
    status = Listener().status_after(("order", order(T, nodes, edges)), ("state", under_way(T, 0.0, 0.0, nodes[1:])))
    assert points(status.path)[-1][1] == pytest.approx(end_m, abs=1.0)
    assert status.path.ends_in_stop == is_stop
    assert len(status.path.poses) <= 151


def test_nodes_that_are_passed_but_still_named_do_not_send_the_robot_back() -> None:
    named = {"nodeStates": node_states(LINE), "lastNodeId": "n1", "lastNodeSequenceId": 2}
    status = Listener().status_after(ORDERED, ("state", under_way(T, 5.0, 0.0, [], **named)))
    assert points(status.path) == [(5.0, 10.0, 0.0)]
    assert status.findings == ("node-passed",)
    arrived = named | {"lastNodeId": "n2", "lastNodeSequenceId": 4, "driving": False}
    status = Listener().status_after(ORDERED, ("state", under_way(T, 10.0, 0.0, [], **arrived)))
    assert (status.state, status.path) == ("waitingExternalEvent", NO_PATH)


@pytest.mark.parametrize(
    ("place", "y_m", "findings"),
    [
        ({"x": 0.0, "y": 0.0, "theta": 0.0, "mapId": ""}, 3.0, ("node-place-zero",)),
        ({"x": 0.0, "y": 0.0, "mapId": "hall"}, 3.0, ("node-place-zero",)),
        ({"x": 0.0, "y": 5.0}, 5.0, ()),
    ],
)
def test_a_place_in_a_state_that_is_not_filled_in_is_where_the_order_says(
    place: dict[str, Any], y_m: float, findings: tuple[str, ...]
) -> None:
    nodes = [node(0, 4.0, 3.0), node(1, 0.0, 3.0)]
    ahead = [{**each, "nodePosition": place} for each in node_states(nodes[1:])]
    report = under_way(T, 4.0, 3.0, nodes[1:], nodeStates=ahead, velocity={"vx": 1.0})
    status = Listener().status_after(("order", order(T, nodes)), ("state", report))
    assert points(status.path)[-1][1:] == (0.0, y_m)
    assert status.findings == findings
