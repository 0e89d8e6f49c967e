"""Small cases of every attack, one after the other on one service, beside honest robots whose meetings are known."""

import time

import pytest

from benchmarks.attack import maker_burst
from benchmarks.attack.attack_run import ATTACKS, Plan, attacking
from benchmarks.attack.floods import FLOODS
from benchmarks.attack.measuring import Subscriber, health_document, is_well
from benchmarks.attack.senders import sending
from benchmarks.attack.swarms import SWARMS
from benchmarks.drawn_floors.motion import sent_by
from benchmarks.endtoend import benchmark_site, service
from deconflict.settings.fleet_factory import fast_fleet_of
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from tests.helpers.patience import PATIENCE_S

PAIRS, SETTLE_S, FLOOD_S = 8, 10.0, 2.0
ROBOTS = 60
HELD = (*FLOODS, "crowd", "large", "makers", "silent-crowd")
"""The attacks that a service withstands, of those that need no broker."""
NOW_S = 1_790_000_000


def test_beside_every_attack_honest_robots_are_warned_and_no_role_ends() -> None:
    with service() as running:
        subscriber, start_s = Subscriber(f"ws://{running.face}/advisories/stream", PAIRS), time.time()
        with sending(running.url, "honest", 2 * PAIRS, start_s):
            time.sleep(SETTLE_S)
            began_s = time.time()
            for attack in HELD:
                with attacking(running, attack, Plan(robots=ROBOTS, seconds=FLOOD_S), start_s):
                    time.sleep(FLOOD_S)
            ended_s = time.time()
        until_s = time.monotonic() + PATIENCE_S
        while not is_well(running.face) and time.monotonic() < until_s:
            time.sleep(0.2)
        assert is_well(running.face), health_document(running.face)
        subscriber.stop()
        number, meetings = subscriber.told(start_s, PAIRS, began_s, ended_s)
        assert (number, meetings > 5) == (meetings, True)
        assert subscriber.told(start_s, PAIRS, ended_s + 20, ended_s + 40)[0] == 0, "of these nothing was received"
        assert {role.role: role.restarts for role in running.roles} == {"receiver": 0, "engine": 0, "operator": 0}


def test_every_attack_is_a_different_one() -> None:
    assert len(set(FLOODS.values())) == len(FLOODS)
    assert len(set(ATTACKS)) == len(ATTACKS)


@pytest.mark.parametrize("attack", SWARMS)
def test_every_message_of_an_attack_with_robots_is_valid(attack: str) -> None:
    fleet = fast_fleet_of(benchmark_site(0, 0), Measures())
    robots = SWARMS[attack](ROBOTS, 100.0, FLOOD_S)
    for at_s, number, raw in sent_by(robots, FLOOD_S, NOW_S):
        maker = robots[number].maker
        assert fleet.receive(raw, NOW_S + at_s, Connection(number + 1, "10.0.0.1", f"/{maker}", maker)) is None, raw
    assert len(fleet.next_batch(NOW_S + FLOOD_S)) == ROBOTS


def test_a_burst_is_of_valid_states_of_as_many_makers_as_it_says() -> None:
    fleet, left = fast_fleet_of(benchmark_site(0, 0), Measures()), maker_burst.burst(NOW_S, 90, 30)
    while left:
        topic, raw, left = _first_packet(left)
        connection = Connection(1, "broker", language="vda5050", topic=topic)
        assert fleet.receive(raw, NOW_S, connection) is None, raw
    batch = fleet.next_batch(NOW_S)
    assert (len(batch), sum(batch.statuses)) == (30, 90)
    assert len({robot.vendor for robot in fleet.robots.values()}) == 30


def _first_packet(packets: bytes) -> tuple[str, bytes, bytes]:
    """The topic and body of the first packet that publishes, and what follows it."""
    assert packets[0] == 0x30
    length, at = 0, 1
    while True:
        length |= (packets[at] & 127) << 7 * (at - 1)
        at += 1
        if packets[at - 1] < 128:
            break
    topic_ends = at + 2 + int.from_bytes(packets[at : at + 2])
    return packets[at + 2 : topic_ends].decode(), packets[topic_ends : at + length], packets[at + length :]
