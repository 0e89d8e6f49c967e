"""The moving world: the same for the same seed, nobody jumps, nobody is stuck for good, bodies never touch."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from benchmarks.watch_demo.true_encounters import near_pairs
from benchmarks.watch_demo.true_stops import Stops, TrueStop
from deconflict.simulation.driving.braking import MOVING_MPS
from deconflict.simulation.driving.motion import Activity
from deconflict.simulation.driving.protection import gaps
from deconflict.simulation.driving.routes import drive
from deconflict.simulation.driving.traffic import World
from deconflict.simulation.floor_layout import layout_for
from deconflict.simulation.participants import VendorName, participants
from ingest.batch import Floats

STEP_S, MINUTES = 0.1, 10
SLACK_MPS = 0.45
"""On top of the greatest speed: a turning envelope's location, a person's sway, a step aside."""
LONGEST_STILL_S = 90.0
"""Robots that brake for others go on, or find another way, within this."""


def world(seed: int, robots: int = 24) -> World:
    return World(layout_for(robots), participants(robots), np.random.default_rng(seed))


def states(simulated: World, seconds: float) -> Iterator[Floats]:
    for _ in range(round(seconds / STEP_S)):
        simulated.step(STEP_S)
        yield np.column_stack([simulated.locations(), simulated.floor, simulated.battery_pct])


def touching(simulated: World) -> list[tuple[int, int]]:
    """Pairs whose bodies touch."""
    x, y, yaw, length_m, width_m = simulated.envelopes().T
    pairs = cKDTree(np.column_stack([x + 1e5 * simulated.floor, y])).query_pairs(2.0, output_type="ndarray")
    a, b = pairs.T
    poses = np.stack([x, y, yaw])
    gap_m = gaps(poses[:, a], poses[:, b], (length_m[a], width_m[a]), (length_m[b], width_m[b]))
    return [(int(one_row), int(other)) for one_row, other in pairs[gap_m <= 0.0]]


@dataclass
class Seen:
    """What ten minutes of one world showed."""

    robots: int
    fastest_mps: Floats
    still_s: Floats
    trips: Floats
    charged: set[int] = field(default_factory=set)
    rode: set[int] = field(default_factory=set)
    doing: set[Activity] = field(default_factory=set)
    touched: list[tuple[int, int]] = field(default_factory=list)
    stops: list[TrueStop] = field(default_factory=list)


@pytest.fixture(scope="module", params=[(30, 2), (80, 2)], ids=str)
def seen(request: pytest.FixtureRequest) -> Seen:
    robots, seed = request.param
    simulated = world(seed, robots)
    found, stops = Seen(robots, np.zeros(robots), np.zeros(robots), np.zeros(robots)), Stops(simulated)
    moved_s = np.zeros(robots)
    for _ in range(round(MINUTES * 60 / STEP_S)):
        before, floor, doing = simulated.locations(), simulated.floor, simulated.doing.copy()
        simulated.step(STEP_S)
        stops.update(STEP_S)
        same = simulated.floor == floor
        step_mps = np.hypot(*(simulated.locations() - before)[:, :2].T) / STEP_S
        found.fastest_mps = np.maximum(found.fastest_mps, np.where(same, step_mps, 0.0))
        moved_s[(np.abs(simulated.speed_mps) > 0.03) | (simulated.doing == Activity.STANDING)] = simulated.t_s
        found.still_s = np.maximum(found.still_s, simulated.t_s - moved_s)
        found.trips += (doing == Activity.DRIVING) & (simulated.doing == Activity.STANDING)
        found.charged |= set(np.flatnonzero(simulated.charging).tolist())
        found.rode |= set(np.flatnonzero(~same).tolist())
        found.doing |= {Activity(code) for code in np.unique(simulated.doing)}
        found.touched += touching(simulated)
    found.stops = stops.found
    return found


def test_no_robot_jumps(seen: Seen) -> None:
    greatest = np.array([member.make.max_speed_mps for member in participants(seen.robots)])
    assert np.all(seen.fastest_mps <= greatest + SLACK_MPS)
    assert np.all(seen.fastest_mps > 0.5)


def test_no_robot_is_stuck_permanently(seen: Seen) -> None:
    assert seen.still_s.max() < LONGEST_STILL_S
    assert seen.trips.min() >= 2
    assert seen.trips.mean() >= 5


def test_bodies_never_touch(seen: Seen) -> None:
    assert seen.touched == []


def test_every_activity_occurs(seen: Seen) -> None:
    assert seen.doing >= {Activity.STANDING, Activity.DRIVING, Activity.HALTED}
    assert seen.charged
    assert seen.rode or seen.robots < 24


def test_robots_sometimes_yield_to_other_fleets(seen: Seen) -> None:
    """Traffic is mostly calm: each robot stops for one of another fleet every two to fifteen minutes."""
    of_another = [stop for stop in seen.stops if stop.counts]
    per_robot_hour = len(of_another) / (seen.robots * MINUTES / 60)
    assert 4.0 <= per_robot_hour <= 30.0


def test_every_two_fleets_have_stops_for_each_other(seen: Seen) -> None:
    fleets = [member.make.vendor for member in participants(seen.robots)]
    met = {frozenset((fleets[stop.robot], fleets[stop.other])) for stop in seen.stops if not stop.ordered}
    assert {frozenset(pair) for pair in combinations(VendorName, 2)} <= met


def test_the_same_seed_is_the_same_world() -> None:
    first, second, other = (list(states(world(seed), 30.0)) for seed in (3, 3, 4))
    assert all(np.array_equal(a, b) for a, b in zip(first, second, strict=True))
    assert not np.array_equal(first[-1], other[-1])


def test_no_two_robots_stop_in_one_bay() -> None:
    simulated = world(2)
    for _ in states(simulated, 120.0):
        taken = simulated.trips.bay[simulated.doing == Activity.STANDING]
        assert len(set(taken.tolist())) == len(taken)


@pytest.mark.parametrize(("robots", "seed"), [(12, 3), (12, 4), (60, 2)])
def test_with_other_seeds_bodies_never_touch_and_no_robot_is_stuck(robots: int, seed: int) -> None:
    simulated = world(seed, robots)
    moved_s = np.zeros(robots)
    for _ in states(simulated, 180.0):
        moved_s[(np.abs(simulated.speed_mps) > 0.03) | (simulated.doing == Activity.STANDING)] = simulated.t_s
        assert touching(simulated) == []
        assert (simulated.t_s - moved_s).max() < LONGEST_STILL_S


def head_on(seed: int) -> World:
    """Two robots that drive at each other on one line."""
    simulated = world(seed, 2)
    for robot, (start, end) in enumerate((((0.0, 12.0), (30.0, 12.0)), ((30.0, 12.0), (0.0, 12.0)))):
        yaw = float(np.arctan2(0.0, end[0] - start[0]))
        simulated.tracks.set_drive(robot, drive([start, end], yaw, simulated.members[robot].make))
        simulated.trips.bay[robot] = 1
    simulated.doing[:] = Activity.DRIVING
    return simulated


def test_two_oncoming_robots_brake_before_they_touch() -> None:
    simulated = head_on(1)
    for _ in states(simulated, 15.0):
        pass
    [(_, gap_m)] = near_pairs(simulated.envelopes(), simulated.floor, 1.2)
    assert gap_m > 0.4
    assert np.all(np.abs(simulated.speed_mps) < 0.05)
    assert simulated.braking.yields_to.tolist() == [1, 0]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_one_of_two_mutually_waiting_robots_makes_room(seed: int) -> None:
    simulated = head_on(seed)
    through = np.zeros(2, np.bool_)
    for _ in states(simulated, 120.0):
        assert touching(simulated) == []
        through |= simulated.progress_m > 17.0
        if through.all():
            return
    pytest.fail("they stand in each other's way for good")


def test_more_robots_than_bays_are_refused() -> None:
    with pytest.raises(ValueError, match="use a larger layout"):
        World(layout_for(24), participants(300), np.random.default_rng(1))


def test_no_more_members_drive_at_first_than_later() -> None:
    simulated = world(2, 60)
    simulated.spread_start()
    driving = []
    for _ in range(600):
        simulated.step(0.2)
        driving.append(np.count_nonzero(np.abs(simulated.speed_mps) > MOVING_MPS))
    assert max(driving[:300]) < 1.4 * np.mean(driving[400:])


@pytest.mark.parametrize("robots", [1, 4, 240])
def test_any_number_of_robots_moves(robots: int) -> None:
    simulated = world(1, robots)
    began = simulated.locations()
    for _ in states(simulated, 20.0):
        pass
    moved_m = np.hypot(*(simulated.locations() - began)[:, :2].T)
    assert np.mean(moved_m > 1.0) > 0.7
