"""theta 0 of nodes at which robots do not turn."""

from math import pi
from typing import Any

import pytest

from tests.helpers.vda_saying import factsheet, node, node_states, order, under_way
from tests.ingest.languages.vda5050.made_vda import Listener, T


def with_theta(nodes: list[dict[str, Any]], theta: float) -> list[dict[str, Any]]:
    return [{**each, "nodePosition": each["nodePosition"] | {"theta": theta}} for each in nodes]


ACROSS = [node(0, 0.0), node(1, 0.0, 4.0), node(2, 0.0, 8.0), node(3, 5.0, 8.0)]


@pytest.mark.parametrize(
    ("sent", "turns_s"),
    [
        (ACROSS, 2.0),
        (with_theta(ACROSS, 0.0), 2.0),
        (with_theta(ACROSS, pi / 2), 3.0),
        (with_theta(ACROSS[:2], 0.0) + with_theta(ACROSS[2:], 0.5), 4.32),
    ],
    ids=["none", "0 at all", "meant", "0 and others"],
)
def test_theta_0_at_all_nodes_of_a_way_across_is_no_turn(sent: list[dict[str, Any]], turns_s: float) -> None:
    reported = ("state", under_way(T, 0.0, 0.0, sent[1:]))
    path = Listener().status_after(("order", order(T, sent)), reported).path
    assert path.ends_s[1] - T == pytest.approx(13.0 + turns_s * pi / 2, abs=0.1)


def test_theta_0_is_left_out_also_of_two_nodes_at_a_time_and_of_states_alone() -> None:
    nodes = with_theta(ACROSS, 0.0)
    updates = [("order", order(T + s, nodes[s : s + 2], orderUpdateId=s)) for s in range(3)]
    path = Listener().status_after(*updates, ("state", under_way(T + 3, 0.0, 2.0, nodes[1:], theta=pi / 2))).path
    assert path.ends_s[1] - T == pytest.approx(3.0 + 11.0 + pi / 2, abs=0.1)
    states = zip(node_states(nodes), nodes, strict=True)
    placed = [{**each, "nodePosition": sent["nodePosition"]} for each, sent in states]
    alone = under_way(T, 0.0, -2.0, nodes, nodeStates=placed, theta=pi / 2)
    assert Listener().status_after(("state", alone)).path.ends_s[1] - T == pytest.approx(15.0 + pi / 2, abs=0.1)


def test_a_robot_that_drives_in_any_direction_keeps_theta_0() -> None:
    abilities = ("factsheet", factsheet(T, typeSpecification={"seriesName": "Carrier", "agvKinematic": "OMNI"}))
    nodes = with_theta(ACROSS, 0.0)
    report = ("state", under_way(T, 0.0, 0.0, nodes[1:], theta=0.0))
    path = Listener().status_after(abilities, ("order", order(T, nodes)), report).path
    assert {row[3] for row in path.poses} == {0.0}


def test_one_station_with_theta_0_is_meant_also_after_the_others_of_its_way_were_passed() -> None:
    meant = [ACROSS[0], *with_theta(ACROSS[1:2], 0.0), *ACROSS[2:]]
    report = ("state", under_way(T, 0.0, 0.0, meant[1:]))
    path = Listener().status_after(("order", order(T, meant)), report).path
    assert path.ends_s[1] - T == pytest.approx(13.0 + 4 * pi / 2, abs=0.1)
