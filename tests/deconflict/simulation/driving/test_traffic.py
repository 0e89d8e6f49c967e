"""The moving world: the same for the same seed, nobody jumps, nobody is stuck for good, envelopes keep apart."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import pytest

from deconflict.simulation.cast import cast
from deconflict.simulation.driving.routes import drive
from deconflict.simulation.driving.traffic import Doing, World
from deconflict.simulation.layout import layout_for
from deconflict.simulation.truth import near_pairs
from ingest.seam import Floats

ROBOTS, STEP_S, MINUTES = 24, 0.1, 10
SLACK_MPS = 0.35
"""On top of the greatest speed: a turning envelope's location, a person's sway."""
LONGEST_STILL_S = 120.0


def world(seed: int, robots: int = ROBOTS) -> World:
    return World(layout_for(robots), cast(robots), np.random.default_rng(seed))


def states(one: World, seconds: float) -> Iterator[Floats]:
    for _ in range(round(seconds / STEP_S)):
        one.step(STEP_S)
        yield np.column_stack([one.locations(), one.floor, one.battery_pct])


@dataclass
class Seen:
    """What ten minutes of one world showed."""

    fastest_mps: Floats
    still_s: Floats
    trips: Floats
    charged: set[int] = field(default_factory=set)
    rode: set[int] = field(default_factory=set)
    doing: set[Doing] = field(default_factory=set)
    overlaps_s: float = 0.0


@pytest.fixture(scope="module", params=[1, 5])
def seen(request: pytest.FixtureRequest) -> Seen:
    one = world(request.param)
    found = Seen(np.zeros(ROBOTS), np.zeros(ROBOTS), np.zeros(ROBOTS))
    moved_s = np.zeros(ROBOTS)
    for _ in range(round(MINUTES * 60 / STEP_S)):
        before, floor, doing = one.locations(), one.floor, one.doing.copy()
        one.step(STEP_S)
        same = one.floor == floor
        step_mps = np.hypot(*(one.locations() - before)[:, :2].T) / STEP_S
        found.fastest_mps = np.maximum(found.fastest_mps, np.where(same, step_mps, 0.0))
        moved_s[(np.abs(one.speed_mps) > 0.03) | (one.doing == Doing.STANDING)] = one.t_s
        found.still_s = np.maximum(found.still_s, one.t_s - moved_s)
        found.trips += (doing == Doing.DRIVING) & (one.doing == Doing.STANDING)
        found.charged |= set(np.flatnonzero(one.charging).tolist())
        found.rode |= set(np.flatnonzero(~same).tolist())
        found.doing |= {Doing(code) for code in np.unique(one.doing)}
        found.overlaps_s += STEP_S * sum(1 for _ in near_pairs(one.envelopes(), one.floor, 0.0))
    return found


def test_nobody_jumps(seen: Seen) -> None:
    greatest = np.array([member.make.max_speed_mps for member in cast(ROBOTS)])
    assert np.all(seen.fastest_mps <= greatest + SLACK_MPS)
    assert np.all(seen.fastest_mps > 0.5)


def test_nobody_is_stuck_for_good(seen: Seen) -> None:
    assert seen.still_s.max() < LONGEST_STILL_S
    assert seen.trips.min() >= 4


def test_envelopes_overlap_hardly_ever(seen: Seen) -> None:
    """At most two seconds of one pair in ten minutes of 24 robots."""
    assert seen.overlaps_s <= 2.0


def test_everything_that_robots_do_is_done(seen: Seen) -> None:
    assert seen.doing >= {Doing.STANDING, Doing.DRIVING, Doing.HALTED}
    assert seen.charged
    assert seen.rode


def test_the_same_seed_is_the_same_world() -> None:
    first, second, other = (list(states(world(seed), 30.0)) for seed in (3, 3, 4))
    assert all(np.array_equal(a, b) for a, b in zip(first, second, strict=True))
    assert not np.array_equal(first[-1], other[-1])


def test_no_two_robots_stop_in_one_bay() -> None:
    one = world(2)
    for _ in states(one, 120.0):
        taken = one.trips.bay[one.doing == Doing.STANDING]
        assert len(set(taken.tolist())) == len(taken)


def test_of_two_that_wait_for_each_other_one_backs_off_and_tries_again() -> None:
    one = world(1, 2)
    for robot, (start, end) in enumerate((((0.0, 12.0), (30.0, 12.0)), ((30.0, 12.0), (0.0, 12.0)))):
        yaw = float(np.arctan2(0.0, end[0] - start[0]))
        one.tracks.put(robot, drive([start, end], yaw, one.members[robot].make))
        one.trips.bay[robot] = 1
    one.doing[:] = Doing.DRIVING
    done: list[Doing] = []
    for _ in states(one, 60.0):
        done += [Doing(code) for code in one.doing]
        assert not list(near_pairs(one.envelopes(), one.floor, 0.0))
    assert {Doing.BACKING, Doing.HOLDING} <= set(done)


def test_more_robots_than_bays_are_refused() -> None:
    with pytest.raises(ValueError, match="use a larger layout"):
        World(layout_for(24), cast(200), np.random.default_rng(1))


@pytest.mark.parametrize("robots", [1, 4, 240])
def test_any_number_of_robots_moves(robots: int) -> None:
    one = world(1, robots)
    began = one.locations()
    for _ in states(one, 20.0):
        pass
    moved_m = np.hypot(*(one.locations() - began)[:, :2].T)
    assert np.mean(moved_m > 1.0) > 0.7
