"""Small cases of every attack, one after the other on one service, beside honest robots whose meetings are known."""

import time

from benchmarks.attack.attack_run import ATTACKS
from benchmarks.attack.floods import FLOODS, Target, flooding
from benchmarks.attack.measuring import Subscriber, health
from benchmarks.attack.senders import sending
from benchmarks.endtoend import service
from tests.helpers.patience import PATIENCE_S

PAIRS, SETTLE_S, FLOOD_S = 8, 10.0, 2.0


def test_beside_every_attack_honest_robots_are_warned_and_no_role_ends() -> None:
    with service() as running:
        subscriber, start_s = Subscriber(f"ws://{running.face}/advisories/stream", PAIRS), time.time()
        target = Target(running.url.removeprefix("ws://"), running.face)
        with sending(running.url, "honest", 2 * PAIRS, start_s):
            time.sleep(SETTLE_S)
            began_s = time.time()
            for attack in FLOODS:
                with flooding(target, attack):
                    time.sleep(FLOOD_S)
            with sending(running.url, "crowd", 60, start_s):
                time.sleep(FLOOD_S)
            ended_s = time.time()
        until_s = time.monotonic() + PATIENCE_S
        while health(running.face) != "ok" and time.monotonic() < until_s:
            time.sleep(0.2)
        assert health(running.face) == "ok"
        subscriber.stop()
        number, meetings = subscriber.told(start_s, PAIRS, began_s, ended_s)
        assert (number, meetings > 5) == (meetings, True)
        assert subscriber.told(start_s, PAIRS, ended_s + 20, ended_s + 40)[0] == 0, "of these nothing was received"
        assert {role.role: role.restarts for role in running.roles} == {"receiver": 0, "engine": 0, "operator": 0}


def test_every_attack_is_a_different_one() -> None:
    assert len(set(FLOODS.values())) == len(FLOODS)
    assert len(set(ATTACKS)) == len(ATTACKS)
