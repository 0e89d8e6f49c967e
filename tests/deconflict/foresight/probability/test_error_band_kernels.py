"""Overlaps measured by the kernel equal those computed pair by pair."""

from math import inf

import numpy as np
import pytest
from scipy.special import ndtr

from deconflict.foresight.forecast_errors.track_kernels import ERROR, ROBOT, RelativePoses, Robots
from deconflict.foresight.probability.error_band_kernels import (
    EIGHTY,
    EXACT_M,
    FINEST_BAND_M,
    SOON,
    SURPRISE_KEEPS,
    SURPRISE_MOST,
    Bounds,
    measure_overlaps,
    normal_shares,
    update_surprise,
)
from deconflict.foresight.probability.pair_table import PAIR
from deconflict.sweep.geometry.encounter import STANDING_MPS
from ingest.batch import Floats

NOW_S, HORIZON_S, WITHIN_M, APART_M = 1000.0, 10.0, 0.3, 0.4
AHEAD_S = np.arange(11.0)
ROBOTS, PAIRS, PAST = 8, 40, 5


def band_m(bands_m: Floats, ahead_s: float) -> float:
    """Radius of the 80 % band of one kind (horizons, 3), linear from 0 at the report."""
    radii = np.concatenate([[0.0], bands_m[:, 1]])
    beyond = max(ahead_s - (len(radii) - 1), 0.0) * (radii[-1] - radii[-2])
    return float(np.interp(ahead_s, np.arange(len(radii)), radii) + beyond)


def sd_m(robots: Robots, bands_m: Floats, newest: Floats, slots: tuple[int, int], after_s: float) -> float:
    """Standard deviation of the distance of two robots, `after_s` from now."""
    square = 0.0
    for slot in slots:
        row = robots[slot]
        silent_s = 0.0 if row["rests"] else max(NOW_S - newest[slot, 0], 0.0)
        reach = band_m(bands_m[row["kind"]], after_s + silent_s) * max(row["surprise"], 1.0) / EIGHTY
        square += reach**2 + row["doubt_m"] ** 2
    return float(np.sqrt(square) + EXACT_M)


def test_measured_overlaps_equal_those_computed_pair_by_pair() -> None:
    rng = np.random.default_rng(3)
    robots, newest = np.zeros(ROBOTS, ROBOT), np.zeros((ROBOTS, 5))
    robots["kind"], robots["doubt_m"] = rng.integers(0, 2, ROBOTS), rng.uniform(0, 0.3, ROBOTS)
    robots["surprise"], robots["rests"] = rng.uniform(0, 4, ROBOTS), rng.uniform(size=ROBOTS) < 0.3
    newest[:, 0] = NOW_S + rng.uniform(-4, 1, ROBOTS)
    bands_m = np.cumsum(rng.uniform(0, 0.3, (2, 10, 3)), axis=1)
    a = np.arange(PAIRS) % ROBOTS
    b = (a + 1 + np.arange(PAIRS) // ROBOTS) % ROBOTS
    pairs, rows = np.zeros(PAIRS + 3, PAIR), np.arange(PAIRS) + 1
    pairs["started_s"] = pairs["last_within_s"] = -inf
    pairs["in_encounter"] = rng.uniform(size=len(pairs)) < 0.3
    before = pairs.copy()
    swept_rows = rows[::3].copy()
    swept_m, swept_s = rng.uniform(-0.1, 0.3, len(swept_rows)), NOW_S + rng.uniform(0, 10, len(swept_rows))
    contact_s = NOW_S + rng.uniform(0, 10, len(swept_rows))
    past_s = NOW_S - 1 + np.tile(np.arange(1, PAST + 1) / PAST, (PAIRS, 1))
    apart_m = rng.uniform(-0.2, 1.5, (PAIRS, PAST + len(AHEAD_S)))
    is_same_floor, speed_mps = rng.uniform(size=apart_m.shape) < 0.9, rng.uniform(0, 1, (2, PAIRS))
    known_m = np.where(is_same_floor, apart_m, inf)
    unused = np.zeros_like(apart_m)
    poses = RelativePoses(past_s, unused, unused, unused, unused, is_same_floor, speed_mps)
    where, bounds = (poses, apart_m, bands_m, robots, newest), Bounds(WITHIN_M, APART_M, HORIZON_S)
    sds = measure_overlaps(pairs, rows, a, b, swept_rows, swept_m, swept_s, contact_s, *where, AHEAD_S, NOW_S, bounds)
    for n, row in enumerate(rows.tolist()):
        at_s, apart = (NOW_S + AHEAD_S).tolist(), known_m[n, PAST:].tolist()
        if row in swept_rows.tolist():
            at_s.insert(0, float(swept_s[n // 3]))
            apart.insert(0, float(swept_m[n // 3]))
        slots = (int(a[n]), int(b[n]))
        within = [
            (WITHIN_M - m) / sd_m(robots, bands_m, newest, slots, s - NOW_S) for m, s in zip(apart, at_s, strict=True)
        ]
        soonest = max(each for each, s in zip(within, at_s, strict=True) if s - NOW_S <= SOON * HORIZON_S)
        assert pairs["near_s"][row] == at_s[int(np.argmin(apart))]
        assert pairs["near_m"][row] == max(min(apart), 0.0)
        assert pairs["now_m"][row] == max(known_m[n, PAST], 0.0)
        assert pairs["contact_s"][row] == (contact_s[n // 3] if row in swept_rows.tolist() else inf)
        needed_s = max(known_m[n, PAST] - WITHIN_M, 0.0) / speed_mps[:, n].sum()
        assert sds[:, n] == pytest.approx([max(within), soonest])
        assert pairs["features"][row, 3] == pytest.approx(min(needed_s / HORIZON_S, 1.0))
        assert pairs["features"][row, [0, 4]].tolist() == [1.0, (speed_mps[:, n] < STANDING_MPS).any()]
        below = np.flatnonzero(known_m[n, :PAST] <= WITHIN_M)
        began = bool(len(below)) and not before["in_encounter"][row]
        assert pairs["started_s"][row] == (past_s[n, below[0]] if began else -inf)
        assert pairs["last_within_s"][row] == (past_s[n, below[-1]] if len(below) else -inf)
        drew_apart = APART_M < known_m[n, PAST - 1] < inf
        assert pairs["in_encounter"][row] == ((before["in_encounter"][row] or began) and not drew_apart)
    others = np.setdiff1d(np.arange(len(pairs)), rows)
    for name in PAIR.names or ():
        assert pairs[name][others].tolist() == before[name][others].tolist()


def test_surprise_follows_errors_a_second_ahead_and_the_last_of_a_robot_counts() -> None:
    robots = np.zeros(4, ROBOT)
    robots["surprise"] = 1.0
    errors = np.zeros(6, ERROR)
    errors["robot"], errors["horizon_s"] = [0, 1, 1, 2, 3, 1], [1, 1, 1, 1, 2, 3]
    errors["radial_m"], errors["bands_m"] = [0.4, 9.0, 0.6, 50.0, 9.0, 9.0], 0.2
    errors["bands_m"][0] = 0.0
    update_surprise(robots, errors)
    ratios = np.array([0.4 / FINEST_BAND_M, 3.0, SURPRISE_MOST])
    assert robots["surprise"][:3] == pytest.approx(SURPRISE_KEEPS + (1 - SURPRISE_KEEPS) * ratios)
    assert robots["surprise"][3] == 1.0


def test_shares_of_a_normal_distribution_are_those_of_scipy() -> None:
    sds = np.array([[-inf, -40.0, -8.0, -1.0, 0.0], [0.5, 1.28, 6.0, 40.0, inf]])
    assert normal_shares(sds) == pytest.approx(ndtr(sds), rel=1e-13, abs=0.0)
