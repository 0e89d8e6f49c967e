import json
from datetime import datetime

import numpy as np

from benchmarks.who_left.__main__ import totals
from benchmarks.who_left.scenes import STALLS_AT, STAND_AT, scene_of
from benchmarks.who_left.walks import PASSES_M, START_S, Walk, log_of, meetings, walked


def test_a_walk_swerves_around_who_stands_and_ends_where_it_should() -> None:
    at_m = walked([((0.0, 5.0), 0.0), ((10.0, 5.0), 0.0)], 1.0, [(5.0, 5.2)])
    assert 0.9 * PASSES_M < np.hypot(*(at_m - (5.0, 5.2)).T).min() < PASSES_M + 0.01
    assert np.allclose(at_m[-1], (10.0, 5.0), atol=0.01)


def test_a_meeting_is_with_one_that_is_silent_and_there() -> None:
    stands = Walk("stands", 0.0, np.array([(5.0, 5.2)]), True, stays=True, silent=[(0.0, 20.0)])
    passes = Walk("passes", 5.0, walked([((0.0, 5.0), 0.0), ((10.0, 5.0), 0.0)], 1.0, [(5.0, 5.2)]), True)
    (met,) = meetings([stands, passes], 20.0)
    assert (met.silent, met.other) == (stands.uuid, passes.uuid)
    assert 8.0 < met.at_s - START_S < 11.0
    stands.silent = [(7.0, 20.0)]
    assert not list(meetings([stands, passes], 20.0))


def test_a_scene_is_the_same_each_time_and_nobody_reports_in_silence() -> None:
    logs = [list(log_of(scene_of("hall", 3, 60.0).walks, 60.0, np.random.default_rng(3), "hall")) for _ in range(2)]
    assert logs[0] == logs[1]
    parked = next(walk for walk in scene_of("hall", 3, 60.0).walks if walk.silent)
    messages = [json.loads(line)["message"] for line in logs[0]]
    stamps = [each["timestamp"] for each in messages if "location" in each and each["uuid"] == parked.uuid]
    reported_s = [datetime.fromisoformat(stamp).timestamp() for stamp in stamps]
    assert reported_s
    assert not any(parked.is_silent(at_s - START_S) for at_s in reported_s)
    assert {zone.kind for zone in scene_of("hall", 3, 9.0).site.zones} == {"door"}
    assert not set(STALLS_AT) & set(STAND_AT)


def test_shares_are_of_all_seeds() -> None:
    row = {"scene": "street", "seed": 0, "alerts": 10, "raised on gone": 0, "on gone": 1, "meetings": 4, "told of": 2}
    (total,) = totals([row, row | {"seed": 1, "on gone": 0}])
    assert (total["on gone, share"], total["told of, share"]) == (0.05, 0.5)
