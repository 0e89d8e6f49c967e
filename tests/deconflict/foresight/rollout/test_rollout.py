"""Robots that are driven on together: which pairs get in each other's way."""

import numpy as np
import pytest

from deconflict.foresight.rollout.rollout import MOST_BESIDE, NOBODY, RolloutInput, RolloutResult, run_rollout
from deconflict.foresight.rollout.start_samples import SAMPLES, key_of, paces, quantiles

HORIZON_S, CLEARANCE_M = 10.0, 0.3
Way = tuple[tuple[float, float], tuple[float, float]]
"""Place of a robot in metres, and its velocity."""


def crowd(
    *ways: Way,
    stands: tuple[int, ...] = (),
    late_s: float = 0.0,
    bottoms_m: tuple[float, ...] = (),
    watched: tuple[tuple[int, int], ...] = (),
) -> RolloutInput:
    """Robots of 0.9 m by 0.7 m that go straight on; those that stand start `late_s` later."""
    n, ahead_s = len(ways), np.arange(13.0)
    track = np.zeros((n, 13, 4))
    for robot, ((x, y), (vx, vy)) in enumerate(ways):
        track[robot, :, 0], track[robot, :, 1] = x + vx * ahead_s, y + vy * ahead_s
        track[robot, :, 2] = np.arctan2(vy, vx)
    bottom_m = np.array(bottoms_m or (0.0,) * n)
    standing = np.isin(np.arange(n), stands)
    return RolloutInput(
        slot=np.arange(n) + 10,
        key=np.arange(n) * 7919,
        since_s=np.zeros(n),
        track=track,
        half_m=np.tile([[0.45], [0.35]], n),
        levels_m=np.stack([bottom_m, bottom_m + 2.0]),
        stands=standing,
        starts_s=np.tile(np.where(standing, late_s, 0.0), (SAMPLES, 1)),
        watched=np.array(watched, np.int64).reshape(-1, 2),
    )


def shares(result: RolloutResult) -> dict[tuple[int, int], float]:
    """By pair of robots, the share of samples in which they get in each other's way."""
    share = 1 / (1 + np.exp(-result.features[:, 0]))
    low, high = np.minimum(result.a, result.b) - 10, np.maximum(result.a, result.b) - 10
    return dict(zip(zip(low.tolist(), high.tolist(), strict=True), share.tolist(), strict=True))


EAST: Way = ((-6.0, 0.0), (1.0, 0.0))
NORTH: Way = ((0.0, -6.0), (0.0, 1.0))


def test_of_robots_that_drive_through_each_other_only_watched_pairs_are_driven_on() -> None:
    ways = [EAST, NORTH, *(((-6.0 + 0.1 * n, 0.0), (1.0, 0.0)) for n in range(2 * MOST_BESIDE))]
    few = run_rollout(crowd(*ways[:4]), HORIZON_S, CLEARANCE_M)
    assert len(few.a) == 6
    many = run_rollout(crowd(*ways, watched=((0, 1),)), HORIZON_S, CLEARANCE_M)
    assert set(shares(many)) == {(0, 1)}
    assert shares(many)[0, 1] > 0.95


def test_robots_that_drive_through_each_other_change_nothing_for_others() -> None:
    far_off = [((x + 100.0, y + 100.0), velocity) for (x, y), velocity in (EAST, NORTH)]
    ways = [*far_off, *(((-6.0 + 0.1 * n, 0.0), (1.0, 0.0)) for n in range(3 * MOST_BESIDE))]
    found = shares(run_rollout(crowd(*ways), HORIZON_S, CLEARANCE_M))
    assert found == shares(run_rollout(crowd(*far_off), HORIZON_S, CLEARANCE_M))
    assert found[0, 1] > 0.95


def test_one_of_two_that_would_cross_gives_way() -> None:
    assert shares(run_rollout(crowd(EAST, NORTH), HORIZON_S, CLEARANCE_M))[0, 1] > 0.95


def test_robots_that_pass_each_other_get_in_nobodys_way() -> None:
    result = run_rollout(crowd(EAST, ((6.0, 1.5), (-1.0, 0.0))), HORIZON_S, CLEARANCE_M)
    assert shares(result)[0, 1] < 0.05


def test_a_robot_stopped_by_a_third_one_does_not_meet_the_second() -> None:
    """It waits for a robot that stands in its way, and so does not meet the one that crosses behind that robot."""
    third = ((-3.0, 0.0), (0.0, 0.0))
    found = shares(run_rollout(crowd(EAST, NORTH, third, stands=(2,)), HORIZON_S, CLEARANCE_M))
    assert found[0, 2] > 0.95
    assert found[0, 1] < 0.05


def test_a_late_start_delays_or_prevents_a_meeting() -> None:
    waiting, crossing = ((0.0, -1.8), (0.0, 1.0)), EAST
    at_once = shares(run_rollout(crowd(crossing, waiting, stands=(1,)), HORIZON_S, CLEARANCE_M))
    late = shares(run_rollout(crowd(crossing, waiting, stands=(1,), late_s=9.0), HORIZON_S, CLEARANCE_M))
    assert late.get((0, 1), 0.0) < 0.05
    assert at_once[0, 1] == late[0, 1]
    near = shares(run_rollout(crowd(((-2.5, 0.0), (1.0, 0.0)), waiting, stands=(1,)), HORIZON_S, CLEARANCE_M))
    assert near[0, 1] > 0.95


def test_a_robot_that_stands_before_another_waits_for_it() -> None:
    blocked, blocker = ((0.0, 0.0), (1.0, 0.0)), ((1.3, 0.0), (0.0, 0.0))
    result = run_rollout(crowd(blocked, blocker, stands=(0, 1)), HORIZON_S, CLEARANCE_M)
    assert result.waits_for.tolist() == [11, NOBODY]
    assert shares(result)[0, 1] < 0.05, "it had stood already"


def test_robots_at_other_heights_are_in_nobodys_way() -> None:
    result = run_rollout(crowd(EAST, NORTH, bottoms_m=(0.0, 5.0)), HORIZON_S, CLEARANCE_M)
    assert not len(result.a)


def test_a_rollout_without_robots_is_empty() -> None:
    result = run_rollout(crowd(EAST), HORIZON_S, CLEARANCE_M)
    assert not len(result.a)
    assert result.waits_for.tolist() == [NOBODY]


@pytest.mark.parametrize("drawn", [1, 2])
def test_each_robot_has_one_sample_in_each_part_of_a_distribution(drawn: int) -> None:
    part = quantiles(np.array([key_of(f"robot {number}") for number in range(50)]), drawn)
    assert (np.sort(part, axis=0) == ((np.arange(SAMPLES) + 0.5) / SAMPLES)[:, None]).all()
    assert len({tuple(order) for order in part.T.tolist()}) > 15, "the order is each robot's own"


def test_paces_are_around_what_was_forecast() -> None:
    pace = paces(np.arange(20) * 7919)
    assert pace.mean() == pytest.approx(1.0, abs=0.001)
    assert 0.03 < pace.std() < 0.06
