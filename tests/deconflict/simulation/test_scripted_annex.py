"""The annex: what its players say leads to a queue and a deadlock that are told ahead of time."""

from itertools import pairwise
from math import hypot

import numpy as np
import pytest

from benchmarks.watch_demo.true_encounters import near_pairs
from deconflict.engine.engine import Engine
from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site_file import load
from deconflict.simulation.demo.demo_site import demo_site
from deconflict.simulation.participants import TUG, participants
from deconflict.simulation.scripted_annex import CHARGER, FEWEST, ROLES, TRAIN, split
from deconflict.simulation.vendors.dialects import DIALECTS
from deconflict_client.advisory import AdvisoryState, AnyAdvisory
from ingest.measures.measures import Measures
from ingest.port.connection import Connection

NOW_S = 1_790_000_000.0


def test_every_member_is_in_the_halls_or_in_the_annex() -> None:
    members = participants(24)
    halls, annex = split(members)
    assert tuple(member.make.vendor for member in annex.members) == ROLES
    assert sorted(member.name for member in (*halls, *annex.members)) == sorted(member.name for member in members)
    assert annex.members[TRAIN].make is TUG
    assert split(participants(FEWEST - 1))[1].members == ()


@pytest.mark.parametrize("row", range(len(ROLES)))
def test_scripted_robots_move_without_jumps_and_repeat_their_script(row: int) -> None:
    _, annex = split(participants(24))
    robots = [annex.robot(row, t / 2) for t in range(2 * 350)]
    assert all(hypot(b.x_m - a.x_m, b.y_m - a.y_m) <= 0.61 for a, b in pairwise(robots))
    assert any(abs(robot.linear_mps) > 0.5 for robot in robots)


def test_scripted_robots_never_touch() -> None:
    _, annex = split(participants(24))
    for t in range(0, 500, 2):
        robots = [annex.robot(row, float(t)) for row in range(len(ROLES))]
        bodies = [robot.member.make.body for robot in robots]
        envelopes = np.array(
            [
                (state.x_m, state.y_m, state.yaw_rad, body.length_m, body.width_m)
                for state, body in zip(robots, bodies, strict=True)
            ]
        )
        assert not [pair for pair, apart_m in near_pairs(envelopes, np.zeros(5, int), 0.1) if apart_m == 0]


def told(seconds: int) -> list[AnyAdvisory]:
    """The advisories on the annex, as the service gives them."""
    site = load(demo_site())
    _, annex = split(participants(24))
    fleet, engine, revisions = fleet_of(site, Measures()), Engine(site), list[AnyAdvisory]()
    lines = [Connection(row, vendor=role.value) for row, role in enumerate(ROLES)]
    for tick in range(4 * seconds):
        now_s = NOW_S + tick / 4
        if tick % 4 == 0:
            for row, role in enumerate(ROLES):
                for message in DIALECTS[role].messages(annex.robot(row, tick / 4), now_s, introduce=tick == 0):
                    assert fleet.receive(message, now_s, lines[row]) is None
        engine.receive(fleet.next_batch(now_s))
        revisions += engine.step(now_s)
    return revisions


def test_a_queue_and_a_deadlock_are_repeatedly_raised_ahead() -> None:
    revisions = told(300)
    raised = [revision for revision in revisions if revision.state is AdvisoryState.RAISED]
    locks = [advisory for advisory in raised if advisory.kind == "deadlock"]
    queues = [advisory for advisory in raised if advisory.kind == "contention"]
    assert len(locks) == 2
    assert all(4 < lock.time_to_conflict_s < 12 and len(lock.robots) == 2 for lock in locks)
    assert queues
    assert all(queue.location.x == pytest.approx(CHARGER[0]) for queue in queues)
    assert max(queue.time_to_conflict_s for queue in queues) > 5
    over = [revision.id for revision in revisions if revision.state is AdvisoryState.CLEARED]
    assert all(lock.id in over for lock in locks)
