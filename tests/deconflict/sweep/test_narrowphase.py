import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from deconflict.sweep.incremental import ACCURACY_M, ROUNDS, TOLERANCE_M
from deconflict.sweep.narrowphase import (
    CLEAR,
    MET,
    MOTION,
    OPEN,
    Motions,
    apart,
    first_contact,
    gap,
    nearest_centres,
    smallest_separation,
)
from ingest.batch import Floats
from tests.helpers.made_motion import completed, motions, sampled, true_distance

RNG = np.random.default_rng(11)
N = 4_000


def gaps(motion: Motions, t: Floats | None = None) -> tuple[Floats, Floats, Floats]:
    """Distances and directions at `t`, or where each motion begins."""
    found = np.array([gap(m, at) for m, at in zip(motion, motion["begin"] if t is None else t, strict=True)])
    return found[:, 0], found[:, 1], found[:, 2]


def contacts(motion: Motions, target_m: float) -> Floats:
    found = [first_contact(m, target_m, TOLERANCE_M, ROUNDS) for m in motion]
    assert {state for _, state in found} <= {MET, CLEAR}
    return np.array([t if state == MET else np.inf for t, state in found])


def standing(x: Floats, y: Floats, yaw: Floats, half_a: Floats, half_b: Floats) -> Motions:
    """B at (x, y) with heading `yaw` from an upright A; half sides are (2, n)."""
    made = np.zeros(len(x), MOTION)
    made["dx"], made["dy"], made["yaw_b"] = x, y, yaw
    (made["length_a"], made["width_a"]), (made["length_b"], made["width_b"]) = half_a, half_b
    return completed(made)


def test_the_gap_is_the_distance_of_the_polygons() -> None:
    motion = motions(RNG, N, least_m=0.005, most_m=1.5)
    t = RNG.uniform(motion["begin"], motion["end"])
    true = true_distance(motion, t)
    assert 0.2 < np.mean(true > 0) < 0.95
    np.testing.assert_allclose(gaps(motion, t)[0], true, atol=1e-12)


def test_parallel_rectangles_and_bars_that_cross() -> None:
    quarter = np.pi / 2
    x, y, yaw = np.array([[2.5, 0, 0], [0, 3.25, quarter], [2, 0, 0], [0, 0, quarter], [0, 0, 0]]).T
    values = np.array([[1.0, 1.0, 1.0, 2.0, 1.0], [1.0, 1.0, 1.0, 0.01, 0.5]])
    np.testing.assert_allclose(gaps(standing(x, y, yaw, values, values))[0], [0.5, 1.25, 0, 0, 0], atol=1e-12)


def test_moving_along_the_direction_closes_the_gap_by_as_much() -> None:
    motion = motions(RNG, N)
    distance, nx, ny = gaps(motion)
    there = distance > 1e-6
    closer = motion.copy()
    closer["dx"] -= nx * distance / 2
    closer["dy"] -= ny * distance / 2
    np.testing.assert_allclose(true_distance(closer, closer["begin"])[there], distance[there] / 2, atol=1e-9)
    assert (nx[distance == 0] == 0).all()


@given(st.integers(-6, 0), st.floats(-10, 10), st.floats(0.05, 3))
def test_a_gap_of_any_smallness_is_told_from_contact(exponent: int, yaw: float, width: float) -> None:
    made = np.zeros(1, MOTION)
    at = width / 2 + 0.5 + 10.0**exponent
    made["dx"], made["dy"], made["yaw_a"], made["yaw_b"] = at * np.cos(yaw), at * np.sin(yaw), yaw, yaw
    made["length_a"], made["width_a"], made["length_b"], made["width_b"] = width / 2, 1.0, 0.5, 1.0
    distance, nx, ny = gap(completed(made)[0], 0.0)
    assert distance == pytest.approx(10.0**exponent, abs=1e-12)
    assert (nx, ny) == pytest.approx((np.cos(yaw), np.sin(yaw)), abs=1e-6)


def test_the_axes_never_claim_more_than_the_distance() -> None:
    motion = motions(RNG, N)
    widest = np.array([apart(m, m["begin"], 0.0)[0] for m in motion])
    true = true_distance(motion, motion["begin"])
    assert (widest <= true + 1e-12).all()
    np.testing.assert_array_equal(widest > 0, true > 0)


@pytest.mark.parametrize("target_m", [0.0, 0.3])
def test_nothing_comes_within_the_target_while_the_axes_say_clear(target_m: float) -> None:
    motion = motions(RNG, 800)
    clear_s = np.array([apart(m, m["begin"], target_m)[1] for m in motion])
    t, distance = sampled(motion, 200)
    clear = t < motion["begin"] + clear_s
    assert clear.mean() > 0.2
    assert (distance[clear] >= target_m - 1e-9).all()


def test_no_sample_has_the_centres_nearer_than_their_nearest() -> None:
    motion = motions(RNG, 300)
    for m, t in zip(motion, np.linspace(motion["begin"], motion["end"], 50).T, strict=True):
        into, (at, nearest_m) = t - m["begin"], nearest_centres(m)
        centres_m = np.hypot(m["dx"] + m["vx"] * into, m["dy"] + m["vy"] * into)
        assert nearest_m <= centres_m.min() + 1e-12
        assert m["begin"] <= at <= m["end"]


@pytest.mark.parametrize("turning", [True, False])
@pytest.mark.parametrize("target_m", [0.0, 0.3])
def test_contact_is_never_late_and_early_by_the_tolerance_at_most(turning: bool, target_m: float) -> None:
    motion = motions(np.random.default_rng(31), 500, turning=turning)
    t, distance = sampled(motion, 200)
    within = distance <= target_m
    first = np.where(within.any(axis=0), np.take_along_axis(t, within.argmax(axis=0)[None], 0)[0], np.inf)
    found = contacts(motion, target_m)
    hit = np.isfinite(found)
    assert 0.1 < hit.mean() < 0.9
    assert (found <= first + 1e-9).all()
    there = true_distance(motion, np.where(hit, found, motion["begin"]))
    assert (there[hit] <= target_m + TOLERANCE_M + 1e-9).all()
    assert ((motion["begin"] <= found) & (found <= motion["end"]))[hit].all()


def test_an_undecided_contact_is_open_from_no_later_than_the_contact() -> None:
    motion = motions(np.random.default_rng(31), 500)
    left = [first_contact(m, 0.3, TOLERANCE_M, 2) for m in motion]
    contact = contacts(motion, 0.3)
    open_ = np.array([state == OPEN for _, state in left])
    assert open_.any()
    assert (np.array([t for t, _ in left])[open_] <= contact[open_]).all()


def test_what_is_within_the_target_from_the_start_is_in_contact_then() -> None:
    motion = motions(np.random.default_rng(32), 500)
    close = true_distance(motion, motion["begin"]) <= 0.3
    assert close.any()
    np.testing.assert_array_equal(contacts(motion, 0.3)[close], motion["begin"][close])


def test_robots_that_draw_apart_or_stand_apart_are_not_in_contact() -> None:
    motion = motions(np.random.default_rng(33), 500, turning=False)
    far = true_distance(motion, motion["begin"]) > 0.1
    _, nx, ny = gaps(motion)
    for vx, vy in ((nx, ny), (0.0, 0.0)):
        motion["vx"], motion["vy"] = vx, vy
        assert not np.isfinite(contacts(motion, 0.05))[far].any()


@pytest.mark.parametrize("turning", [True, False])
def test_the_smallest_separation_is_reached_and_no_sample_is_closer(turning: bool) -> None:
    motion = motions(np.random.default_rng(21), 600, turning=turning)
    separation, when = np.array(
        [smallest_separation(motion[row : row + 1], ACCURACY_M) for row in range(len(motion))]
    ).T
    _, distance = sampled(motion, 200)
    lowest = distance.min(axis=0)
    assert 0.2 < np.mean(lowest > 0) < 0.9
    assert (separation <= lowest + ACCURACY_M).all()
    assert ((motion["begin"] <= when) & (when <= motion["end"])).all()
    np.testing.assert_allclose(true_distance(motion, when), separation, atol=1e-9)


def test_of_several_motions_the_closest_counts() -> None:
    motion = motions(np.random.default_rng(22), 600)
    each = np.array([smallest_separation(motion[row : row + 1], ACCURACY_M)[0] for row in range(600)]).reshape(-1, 3)
    together = np.array([smallest_separation(motion[row : row + 3], ACCURACY_M)[0] for row in range(0, 600, 3)])
    assert np.abs(together - each.min(axis=1)).max() <= ACCURACY_M
