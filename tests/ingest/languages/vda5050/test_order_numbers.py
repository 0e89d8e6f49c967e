"""Orders whose sequence ids have gaps, repeat or begin anew lead along the same way as conforming ones."""

from collections.abc import Callable
from random import Random
from typing import Any

import pytest

from ingest.languages.model import Status
from ingest.languages.rules import Findings
from ingest.languages.vda5050.order_numbers import edges_by_end
from ingest.languages.vda5050.vda_messages import Edge, VdaNode
from tests.helpers.vda_saying import edge, node, order, under_way
from tests.ingest.languages.vda5050.made_vda import Listener, T

Parts = list[dict[str, Any]]
Numbering = Callable[[int], int]
"""From a conforming sequence id to another."""


def way(random: Random, nodes: int) -> tuple[Parts, Parts]:
    """An order along a line with a speed on each edge."""
    places = [node(number, 3.0 * number, float(number % 2)) for number in range(nodes)]
    speeds = [random.choice((0.25, 0.5, 1.0)) for _ in places[1:]]
    return places, [edge(number, maxSpeed=speed) for number, speed in enumerate(speeds)]


def renumbered(parts: Parts, number_of: Numbering) -> Parts:
    return [{**part, "sequenceId": number_of(part["sequenceId"])} for part in parts]


def path_by(nodes: Parts, edges: Parts, states: Parts, last: int, **keys: Any) -> Status:
    named = {"nodeStates": states, "lastNodeId": "n0", "lastNodeSequenceId": last} | keys
    report = under_way(T, 0.5, 0.0, [], **named)
    return Listener().status_after(("order", order(T - 1, nodes, edges)), ("state", report))


def states_of(nodes: Parts) -> Parts:
    return [{key: each[key] for key in ("nodeId", "sequenceId", "released")} for each in nodes]


GAPS: tuple[Numbering, ...] = (lambda n: 10 * n + 10, lambda n: n * n + n, lambda n: 1000 + 7 * n)
REPEATS: tuple[Numbering, ...] = (lambda _: 0, lambda n: n // 4, lambda n: n % 4)


@pytest.mark.parametrize("number_of", GAPS)
@pytest.mark.parametrize("seed", range(20))
def test_gaps_between_sequence_ids_cost_no_edge(number_of: Numbering, seed: int) -> None:
    random = Random(seed)
    nodes, edges = way(random, random.randint(3, 12))
    usual = path_by(nodes, edges, states_of(nodes[1:]), 0)
    odd_nodes, odd_edges = renumbered(nodes, number_of), renumbered(edges, number_of)
    random.shuffle(odd_edges)
    if seed % 2:
        odd_edges = [{key: each[key] for key in each if not key.endswith("NodeId")} for each in odd_edges]
    status = path_by(odd_nodes, odd_edges, states_of(odd_nodes[1:]), number_of(0))
    assert status.path.poses == usual.path.poses
    assert len(status.path.poses) > 1
    assert status.findings == usual.findings == ()


@pytest.mark.parametrize("number_of", REPEATS)
@pytest.mark.parametrize("seed", range(20))
def test_sequence_ids_that_repeat_or_fall_are_counted_and_the_ids_of_nodes_count(
    number_of: Numbering, seed: int
) -> None:
    random = Random(seed)
    nodes, edges = way(random, random.randint(5, 12))
    usual = path_by(nodes, edges, states_of(nodes[1:]), 0)
    odd_nodes, odd_edges = renumbered(nodes, number_of), renumbered(edges, number_of)
    listener = Listener()
    found = listener.hears("order", order(T - 1, odd_nodes, odd_edges))
    assert "sequence-ids-odd" in found.findings
    assert found.oddities[0].path.startswith("nodes[")
    report = under_way(T, 0.5, 0.0, [], nodeStates=states_of(odd_nodes[1:]), lastNodeId="n0", lastNodeSequenceId=0)
    assert listener.status_after(("state", report)).path.poses == usual.path.poses


def test_an_update_that_begins_to_count_anew_continues_the_order() -> None:
    first, then = [node(0, 0.0), node(1, 4.0)], [node(1, 4.0, sequenceId=0), node(2, 8.0, sequenceId=2)]
    edges = [edge(1, sequenceId=1, maxSpeed=0.5)]
    listener = Listener()
    listener.hears("order", order(T - 2, first, [edge(0, maxSpeed=1.0)]))
    found = listener.hears("order", order(T - 1, then, edges, orderUpdateId=1))
    assert found.findings == ("sequence-ids-odd",)
    status = listener.status_after(("state", under_way(T, 0.0, 0.0, [node(1, 4.0), node(2, 8.0)])))
    assert [(round(t_s - T), x) for t_s, x, _, _ in status.path.poses] == [(4, 4.0), (12, 8.0)]


def test_an_edge_that_leads_elsewhere_is_counted() -> None:
    nodes = [node(0, 0.0), node(1, 4.0)]
    stray = edge(0, startNodeId="n7", endNodeId="n8", maxSpeed=0.5)
    found = Listener().hears("order", order(T - 1, nodes, [stray]))
    assert found.findings == ("edge-misfit",)
    assert path_by(nodes, [stray], states_of(nodes[1:]), 0).path.ends_s[1] == T + 7.0, "used by its sequence id"


def test_a_long_order_counts_where_the_robot_is() -> None:
    nodes = [node(number, 2.0 * number) for number in range(1500)]
    listener = Listener()
    listener.hears("order", order(T - 1, nodes))
    status = listener.status_after(("state", under_way(T, 2.0 * 1400 - 1.0, 0.0, nodes[1400:])))
    assert status.findings == ()
    assert [round(x) for _, x, _, _ in status.path.poses[:2]] == [2800, 2802]


def test_of_an_order_beyond_the_limit_the_part_from_the_robot_on_is_kept() -> None:
    nodes = [node(number, 2.0 * number) for number in range(4000)]
    listener = Listener()
    listener.hears("state", under_way(T - 2, 6998.0, 0.0, nodes[3500:], lastNodeId="n3499"))
    assert listener.hears("order", order(T - 1, nodes)).findings == ("order-too-long",)
    status = listener.status_after(("state", under_way(T, 6999.0, 0.0, nodes[3500:])))
    assert [round(x) for _, x, _, _ in status.path.poses[:2]] == [7000, 7002]


def test_ids_that_differ_in_case_and_outer_spaces_are_the_same() -> None:
    nodes = [node(0, 0.0), node(1, 4.0), node(2, 9.0)]
    states = [{**each, "nodeId": f" {each['nodeId'].upper()}"} for each in states_of(nodes[1:])]
    status = path_by(nodes, [], states, 0, orderId="O1 ", lastNodeId="N0")
    assert [x for _, x, _, _ in status.path.poses] == [4.0, 9.0]
    assert status.findings == ()


def test_of_more_edges_than_the_limit_those_from_the_robot_on_are_kept() -> None:
    nodes = [node(number, 2.0 * number) for number in range(4000)]
    edges = [edge(number, maxSpeed=0.5) for number in range(4500)]
    listener = Listener()
    listener.hears("state", under_way(T - 2, 6998.0, 0.0, nodes[3500:], lastNodeId="n3499"))
    found = listener.hears("order", order(T - 1, nodes, edges))
    assert found.findings == ("order-too-long",)
    assert [(oddity.path, oddity.value) for oddity in found.oddities] == [("nodes", "4000"), ("edges", "4500")]
    status = listener.status_after(("state", under_way(T, 6999.0, 0.0, nodes[3500:])))
    assert [(round(t_s - T), round(x)) for t_s, x, _, _ in status.path.poses[:1]] == [(2, 7000)]


class ComparedId(int):
    """Counts how often sequence ids are compared."""

    comparisons = 0

    def __lt__(self, other: int) -> bool:
        ComparedId.comparisons += 1
        return super().__lt__(other)

    def __gt__(self, other: int) -> bool:
        ComparedId.comparisons += 1
        return super().__gt__(other)


def test_edges_between_the_same_nodes_cost_no_time_for_each_pair() -> None:
    numbered = [(number, VdaNode(2 * number, "A")) for number in range(300)]
    edges = [Edge(ComparedId(2 * number + 10_000), "A", "A") for number in range(1000)]
    ComparedId.comparisons = 0
    assert len(edges_by_end(numbered, edges, Findings())) == 299
    assert ComparedId.comparisons < 30_000


def test_edges_name_nodes_in_another_case_too() -> None:
    nodes = [node(0, 0.0), node(1, 4.0), node(2, 9.0)]
    edges = [edge(0, sequenceId=9, maxSpeed=0.5), edge(1, sequenceId=9, maxSpeed=0.5)]
    usual = path_by(nodes, edges, states_of(nodes[1:]), 0)
    assert usual.path.most == (0.5, 0.5)
    upper = [
        {**each, "startNodeId": each["startNodeId"].upper(), "endNodeId": f"{each['endNodeId']} "} for each in edges
    ]
    found = Listener().hears("order", order(T - 1, nodes, upper))
    assert found.findings == ()
    assert path_by(nodes, upper, states_of(nodes[1:]), 0).path.most == usual.path.most


@pytest.mark.parametrize(("keys", "count"), [({}, 2), ({"driving": False}, 0), ({"lastNodeId": "n7"}, 0)])
def test_a_robot_under_way_without_node_states_is_on_its_order(keys: dict[str, Any], count: int) -> None:
    nodes = [node(0, 0.0), node(1, 4.0), node(2, 9.0)]
    report = under_way(T, 1.0, 0.0, nodes[1:], nodeStates=None, velocity={"vx": 1.0}, **keys)
    status = Listener().status_after(("order", order(T - 1, nodes)), ("state", report))
    assert len(status.path.poses) == count
