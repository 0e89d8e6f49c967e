"""Long messages of one source take a limited part of the memory, and usual ones of the same source are heard."""

import pytest

from ingest.fleet.fleet import Fleet
from ingest.fleet.owners import kept_bytes
from ingest.languages.vda5050.orders import MOST_NODES
from ingest.languages.vda5050.vda_memory import VdaMemory
from ingest.port.connection import Connection
from tests.helpers import iso_saying
from tests.helpers.saying import identity, status
from tests.helpers.vda_saying import edge, line, node, node_states, order, state, under_way, vda
from tests.ingest.fleet.made_fleet import NOW_S, counted, fleet

TOO_MANY = "robots-too-many"
LONG_NODES = node_states([node(number, 0.0) for number in range(2500)])
HALF = 1 << 20


@pytest.fixture(autouse=True)
def _small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept_bytes, "MOST_BYTES", 2 * HALF)


def long_state(t_s: float) -> bytes:
    return state(t_s, nodeStates=LONG_NODES, note="a" * 200_000)


def kept(of: Fleet, source: str) -> int:
    return of.owners.kept_bytes._of_source[source]


def test_long_messages_of_a_source_are_refused_beyond_its_bytes_and_counted() -> None:
    of = fleet()
    rules = [of.receive(long_state(NOW_S), NOW_S, line("state", str(serial))) for serial in range(40)]
    heard = len(of.robots)
    assert 3 <= heard < 10
    assert rules == [None] * heard + [TOO_MANY] * (40 - heard)
    assert sum(counted(of, "rejections_total").values()) == 40 - heard
    assert kept(of, line("state").source) < 3 * HALF
    assert of.receive(status("A-1", NOW_S), NOW_S, Connection(1, "10.0.0.7")) is None, "another source"


def test_a_known_robot_may_send_usual_messages_and_shorter_ones_than_before() -> None:
    of = fleet()
    for serial in range(10):
        assert of.receive(state(NOW_S), NOW_S, line("state", f"usual {serial}")) is None
    for serial in range(40):
        of.receive(long_state(NOW_S), NOW_S, line("state", str(serial)))
    for second in range(1, 20):
        assert of.receive(state(NOW_S + second), NOW_S + second, line("state", "usual 1")) is None
    assert of.receive(long_state(NOW_S + 20), NOW_S + 20, line("state", "usual 2")) == TOO_MANY
    assert of.receive(state(NOW_S + 20), NOW_S + 20, line("state", "usual 2")) is None
    for second in range(20, 600):
        assert of.receive(state(NOW_S + second), NOW_S + second, line("state", "0")) is None, "shorter than before"
    assert of.receive(long_state(NOW_S + 600), NOW_S + 600, line("state", "usual 2")) is None, "there is room again"


def test_of_a_full_source_known_robots_are_heard_and_new_ones_are_not(monkeypatch: pytest.MonkeyPatch) -> None:
    of = fleet()
    of.receive(state(NOW_S), NOW_S, line("state", "known"))
    monkeypatch.setattr(kept_bytes, "MOST_BYTES", 0)
    assert of.receive(state(NOW_S + 1), NOW_S + 1, line("state", "known")) is None
    assert of.receive(state(NOW_S + 1), NOW_S + 1, line("state", "new")) == TOO_MANY


def test_of_a_full_source_a_long_robot_is_heard_while_it_grows_no_more_than_goes_unmeasured(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    of = fleet()
    of.receive(long_state(NOW_S), NOW_S, line("state"))
    monkeypatch.setattr(kept_bytes, "MOST_BYTES", 0)
    longer = state(NOW_S + 1, nodeStates=LONG_NODES, note="a" * 200_001)
    assert of.receive(longer, NOW_S + 1, line("state")) is None
    goodbye = vda(NOW_S + 2, connectionState="OFFLINE")
    assert of.receive(goodbye, NOW_S + 2, line("connection")) is None
    rules = []
    for step in range(1, 11):
        growing = state(NOW_S + 2 + step, nodeStates=LONG_NODES, note="a" * (200_000 + 30_000 * step))
        rules.append(of.receive(growing, NOW_S + 2 + step, line("state")))
    assert rules == [None] + [TOO_MANY] * 9, "not an eighth more each time"


def test_of_a_long_state_the_nodes_and_edges_within_the_limit_are_kept() -> None:
    of, nodes = fleet(), [node(number, 2.0 * number) for number in range(4000)]
    of.receive(under_way(NOW_S, 0.0, 0.0, nodes, edgeStates=list(map(edge, range(3999)))), NOW_S, line("state"))
    (robot,) = of.robots.values()
    assert robot.deviations["order-too-long"] == 1
    assert isinstance(robot.memory, VdaMemory)
    assert robot.memory.state is not None
    assert len(robot.memory.state.node_states or ()) == len(robot.memory.state.edge_states or ()) == MOST_NODES


def test_what_is_kept_of_forgotten_robots_counts_no_more() -> None:
    of = fleet(forget_after_s=60.0)
    of.receive(long_state(NOW_S), NOW_S, line("state", "1"))
    assert kept(of, line("state").source) > 300_000
    of.next_batch(NOW_S + 100)
    assert not of.robots
    assert kept(of, line("state").source) == 0


def test_updates_of_an_order_that_are_short_add_up() -> None:
    of = fleet()
    for number in range(400):
        long_name = [node(number, 5.0 * number, nodeId="n" * 10_000)]
        of.receive(order(NOW_S + number, long_name, orderUpdateId=number), NOW_S + number, line("order"))
    assert kept(of, line("order").source) < 3 * HALF
    assert counted(of, "rejections_total")


def test_statuses_and_identities_of_every_language_count() -> None:
    of, socket = fleet(), Connection(1, "10.0.0.7")
    for second in range(3):
        of.receive(status("A-1", NOW_S + second, note="a" * 50_000), NOW_S + second, socket)
        of.receive(identity("A-1", NOW_S + second, note="a" * 50_000), NOW_S + second, socket)
    assert 100_000 < kept(of, "10.0.0.7") < 110_000
    trajectory = iso_saying.trajectory(NOW_S, *((NOW_S + i, float(i), 0.0) for i in range(1, 1000)))
    of.receive(trajectory, NOW_S, iso_saying.line("localTrajectory"))
    assert kept(of, iso_saying.line("localTrajectory").source) > 8000


@pytest.mark.parametrize("number", [10**30, -(10**30)])
def test_a_number_that_no_encoding_has_counts_too(number: int) -> None:
    of = fleet()
    assert of.receive(state(NOW_S, lastNodeSequenceId=number, note="a" * 20_000), NOW_S, line("state")) is None
    assert kept(of, line("state").source) > 20_000


def test_ten_thousand_usual_robots_take_less_than_half(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    of, nodes = fleet(), [node(number, 5.0 * number) for number in range(30)]
    for second in range(0, 40, 2):
        of.receive(order(NOW_S + second, nodes, orderUpdateId=second), NOW_S + second, line("order"))
        usual = under_way(NOW_S + second + 1, 0.0, 0.0, nodes, nodeStates=nodes)
        assert 4000 < len(usual) < 6000
        of.receive(usual, NOW_S + second + 1, line("state"))
    assert 0 < 10_000 * kept(of, line("state").source) < kept_bytes.MOST_BYTES / 2
