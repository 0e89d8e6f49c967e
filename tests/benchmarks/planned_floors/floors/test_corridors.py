import json

import numpy as np
import pytest

from benchmarks.planned_floors.floors.corridors import Corridors, simulate
from benchmarks.planned_floors.logs.recording import Recording
from benchmarks.planned_floors.truth.encounters import encounters
from benchmarks.planned_floors.truth.motion import near
from benchmarks.planned_floors.truth.outcomes import fresh

CORRIDORS = 3


@pytest.fixture(scope="module")
def head_on() -> Recording:
    return simulate(Corridors("head_on", seconds=170.0, corridors=CORRIDORS))


def test_two_that_meet_head_on_brake_and_stand_at_the_gap(head_on: Recording) -> None:
    motion = head_on.truth.motion
    assert encounters(motion, 0.3) == []
    assert near(motion, 1.0).separation_m.min() == pytest.approx(0.6, abs=0.15)


def test_the_robots_of_a_corridor_meet_repeatedly(head_on: Recording) -> None:
    half_width_m = dict.fromkeys(head_on.truth.motion.robots, 0.35)
    stops = fresh(head_on.truth.stops, half_width_m)
    by_pair = {stop.pair: [other.start_s for other in stops if other.pair == stop.pair] for stop in stops}
    assert len(by_pair) == CORRIDORS
    for starts_s in by_pair.values():
        assert len(starts_s) >= 3
        assert np.diff(starts_s) == pytest.approx(40.0, abs=0.3)


def test_paths_in_corridors_are_straight(head_on: Recording) -> None:
    """Eight seconds before the onset both tell that they will be beyond the place where they meet."""
    stop = head_on.truth.stops[-1]
    heard = [
        message
        for line in head_on.lines
        if (message := json.loads(line.message))["uuid"] == stop.robot
        and "path" in message
        and stop.start_s - 8 <= line.received_s < stop.start_s - 7
    ]
    motion = head_on.truth.motion
    meets_m = motion.x_m[motion.sample(stop.start_s + 2.0), motion.robots.index(stop.robot)]
    x_m = [point["x"] for point in heard[-1]["path"]]
    assert min(x_m) < meets_m - 0.3 < meets_m + 0.3 < max(x_m)


def test_two_way_corridors_have_no_stops_and_keep_their_gap() -> None:
    recording = simulate(Corridors("two_way", seconds=100.0, corridors=2))
    assert recording.truth.stops == []
    assert near(recording.truth.motion, 1.0).separation_m.min() == pytest.approx(0.8, abs=0.01)
