"""States that name an order which was not heard."""

import msgspec
import pytest

from ingest.languages.geometry.trajectories import Curve
from ingest.languages.model import NO_PATH
from ingest.languages.vda5050.orders import MOST_CURVE_POINTS, NO_EDGE, Order, OrderNode
from ingest.languages.vda5050.seen.known_ways import KnownWays
from ingest.languages.vda5050.vda_messages import NodePlace
from tests.helpers.vda_saying import edge, node, order, position, under_way
from tests.ingest.languages.vda5050.made_vda import Listener, T

NODES = [node(0, 0.0), node(1, 10.0), node(2, 10.0, 8.0), node(3, 10.0, 16.0)]
HEARD = ("order", order(T, NODES, [edge(0, maxSpeed=0.5), edge(1, maxSpeed=0.5), edge(2)]))


@pytest.mark.parametrize("order_id", ["o0", "o2", "7c1f"])
def test_a_state_with_another_order_id_is_about_the_order_that_has_its_nodes(order_id: str) -> None:
    named = Listener().status_after(HEARD, ("state", under_way(T, 2.0, 0.0, NODES[1:])))
    status = Listener().status_after(HEARD, ("state", under_way(T, 2.0, 0.0, NODES[1:], orderId=order_id)))
    assert status.path.poses == named.path.poses
    assert status.findings == ("order-unseen",)


def test_an_order_that_was_lost_leads_along_nodes_and_edges_of_earlier_ones() -> None:
    back = [{**NODES[2], "sequenceId": 10}, {**NODES[3], "sequenceId": 12}]
    lost = under_way(T, 10.0, 3.0, back, orderId="lost", lastNodeId="n1", lastNodeSequenceId=8)
    status = Listener().status_after(HEARD, ("state", lost))
    assert [row[1:3] for row in status.path.poses][-2:] == [(10.0, 8.0), (10.0, 16.0)]
    assert status.path.most[-2:] == (0.5, float("inf"))


@pytest.mark.parametrize("place", [(2.0, 5.0), (-3.0, 0.0)])
def test_it_does_not_lead_there_if_the_robot_is_not_on_the_way(place: tuple[float, float]) -> None:
    lost = under_way(T, *place, [{**NODES[1], "sequenceId": 6}], orderId="lost", lastNodeSequenceId=4, lastNodeId="n0")
    status = Listener().status_after(HEARD, ("state", lost))
    assert status.path is NO_PATH
    assert status.findings == ("order-unseen", "node-without-place")


def test_a_node_that_nobody_placed_ends_the_path() -> None:
    lost = under_way(T, 2.0, 0.0, [NODES[1], node(9, None)], orderId="lost")
    status = Listener().status_after(HEARD, ("state", lost))
    assert [row[1:3] for row in status.path.poses] == [(10.0, 0.0)]
    assert not status.path.ends_in_stop


def test_nodes_before_those_of_an_update_remain_also_if_nobody_released_them() -> None:
    unreleased = [{**each, "released": False} for each in NODES]
    orders = [("order", order(T + s, unreleased[s : s + 2], orderUpdateId=s)) for s in range(3)]
    released = [{**each, "released": True} for each in unreleased]
    status = Listener().status_after(*orders, ("state", under_way(T + 3, 2.0, 0.0, released[1:])))
    assert [row[1:3] for row in status.path.poses][-1] == (10.0, 16.0)


def test_nodes_of_another_floor_are_not_those_of_a_lost_order() -> None:
    upstairs = [{**each, "nodePosition": each["nodePosition"] | {"mapId": "f2"}} for each in NODES]
    lost = under_way(T, 2.0, 0.0, NODES[1:], orderId="lost", agvPosition=position(2.0, 0.0, mapId="f1"))
    status = Listener().status_after(("order", order(T, upstairs)), ("state", lost))
    assert status.path is NO_PATH


def test_known_edges_keep_no_more_curves_than_an_order_may_have() -> None:
    curve = Curve(1, (), tuple((float(x), 0.0, 1.0) for x in range(MOST_CURVE_POINTS // 4)))
    ways = KnownWays()
    for number in range(0, 16, 2):
        ends = {each: OrderNode(True, NodePlace(float(each), 0.0), (), f"n{each}") for each in (number, number + 1)}
        edge = msgspec.structs.replace(NO_EDGE, curve=curve)
        ways = ways.after(Order("o", 0, ends, {number + 1: edge}))
    curved = [bool(edge.curve) for edge in ways.edges.values()]
    assert curved == [False] * 4 + [True] * 4
