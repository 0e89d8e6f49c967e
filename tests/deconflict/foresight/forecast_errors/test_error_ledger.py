import numpy as np
import pytest
from numpy.random import default_rng

from deconflict.foresight.forecast_errors.error_ledger import (
    COLUMNS,
    HALF_LIFE_S,
    HIGHEST_LEVEL,
    HORIZONS,
    LEVEL_GAIN,
    LOWEST_LEVEL,
    MOST_CLASSES,
    PRIOR_MPS,
    SHARES,
    Ledger,
)
from deconflict.foresight.forecast_errors.track_kernels import ROBOT, Errors
from deconflict.foresight.forecast_errors.upper_quantiles import bins, upper_quantiles
from deconflict.foresight.probability.error_band_kernels import reach_m
from ingest.batch import Basis, Floats
from tests.deconflict.foresight.forecast_errors.made_errors import off

NOW_S = 1_790_000_000.0


def errors(ledger: Ledger, row: int, horizon_s: int, along_m: Floats) -> Errors:
    return off(row, horizon_s, along_m, np.zeros(len(along_m)), ledger.bands_m[row, horizon_s - 1])


def reach(ledger: Ledger, row: int, ahead_s: float) -> float:
    """The reach of a robot without size or position doubt, which is the band alone."""
    robot = np.zeros(1, ROBOT)
    robot["kind"] = row
    return float(reach_m(ledger.bands_m, np.array([0]), robot, np.zeros((2, 1)), 0.0, ahead_s, np.inf)[0])


@pytest.mark.parametrize("scale_m", [0.01, 0.5])
def test_bands_keep_their_coverage_as_errors_drift(scale_m: float) -> None:
    ledger, rng = Ledger(), default_rng(7)
    row = ledger.row("Alder", "A-7", Basis.PATH, NOW_S)
    inside = []
    for second in range(3000):
        grown_m = scale_m * (1 + second / 1500)
        now = errors(ledger, row, 1, grown_m * rng.standard_t(3, 4))
        if second > 300:
            inside.append(np.abs(now["along_m"])[:, None] <= now["bands_m"])
        ledger.record(now, NOW_S + second)
    assert np.concatenate(inside).mean(axis=0) == pytest.approx([0.5, 0.8, 0.9], abs=0.025)


def test_counting_many_errors_equals_counting_them_one_by_one() -> None:
    ledger, rng, n = Ledger(), default_rng(8), 400
    for model in ("A-7", "A-8", "A-9"):
        ledger.row("Alder", model, Basis.PATH, NOW_S)
    now_s = NOW_S + HALF_LIFE_S
    before = {name: getattr(ledger, name).copy() for name in COLUMNS}
    along_m, across_m = rng.normal(0, 0.2, (2, n))
    now = off(0, 1, along_m, across_m, np.sort(rng.uniform(0, 0.5, (n, 3)), axis=1))
    now["kind"], now["horizon_s"] = rng.integers(0, 2, n), rng.integers(1, HORIZONS + 1, n)
    ledger.record(now, now_s)
    kind, column = now["kind"], now["horizon_s"] - 1
    counts, bias_m, covered = before["counts"].copy(), before["bias_m"].copy(), before["covered"].copy()
    for faded in (counts, bias_m, covered):
        faded[:2] *= 0.5
    for size, distance_m in enumerate((np.hypot(along_m, across_m), np.abs(along_m), np.abs(across_m))):
        np.add.at(counts, (kind, np.full(n, size), column, bins(distance_m)), 1.0)
    np.add.at(bias_m, (kind, column), np.stack([along_m, across_m], axis=-1))
    inside = now["radial_m"][:, None] <= now["bands_m"]
    np.add.at(covered, (kind, column), inside)
    level = before["level"].copy()
    np.add.at(level, (kind, column), LEVEL_GAIN * (SHARES - inside))
    assert ledger.counts == pytest.approx(counts)
    assert ledger.bias_m == pytest.approx(bias_m)
    assert ledger.covered == pytest.approx(covered)
    assert ledger.level == pytest.approx(np.clip(level, LOWEST_LEVEL, HIGHEST_LEVEL))
    assert ledger.cases.sum() == n
    assert ledger.as_of_s.tolist() == [now_s, now_s, NOW_S]
    radii_m = upper_quantiles(ledger.counts[:, 0], ledger.level)
    assert ledger.bands_m == pytest.approx(np.maximum.accumulate(np.maximum.accumulate(radii_m, axis=2), axis=1))


def test_bands_always_widen_with_the_horizon() -> None:
    ledger = Ledger()
    row = ledger.row("Alder", "A-7", Basis.PATH, NOW_S)
    ledger.record(errors(ledger, row, 2, np.full(100, 3.0)), NOW_S)
    assert np.all(np.diff(ledger.bands_m[row], axis=0) >= 0)
    assert np.all(np.diff(ledger.bands_m[row], axis=1) >= 0)
    assert ledger.bands_m[row, 9, 0] >= 3.0


def test_an_unknown_kind_begins_with_a_prior_for_its_basis() -> None:
    ledger = Ledger()
    row = ledger.row("Alder", "A-7", Basis.VELOCITY, NOW_S)
    assert reach(ledger, row, 5.0) == pytest.approx(5 * PRIOR_MPS[Basis.VELOCITY], rel=0.15)


def test_reach_is_linear_between_and_beyond_whole_seconds() -> None:
    ledger = Ledger()
    row = ledger.row("Alder", "A-7", Basis.PATH, NOW_S)
    at = [reach(ledger, row, ahead_s) for ahead_s in (0.0, 0.5, 1.0, 9.0, 10.0, 20.0)]
    assert at[0] == 0
    assert at[1] == pytest.approx(at[2] / 2)
    assert at[5] == pytest.approx(at[4] + 10 * (at[4] - at[3]))


def test_old_errors_fade_by_a_half() -> None:
    ledger = Ledger()
    row = ledger.row("Alder", "A-7", Basis.PATH, NOW_S)
    ledger.record(errors(ledger, row, 1, np.ones(8)), NOW_S)
    ledger.record(errors(ledger, row, 2, np.ones(1)), NOW_S + HALF_LIFE_S)
    assert ledger.cases[row, :2].tolist() == pytest.approx([4.0, 1.0])


def test_kinds_are_bounded_and_the_rest_share_one() -> None:
    ledger = Ledger()
    rows = {ledger.row("Alder", f"model-{n}", Basis.PATH, NOW_S) for n in range(MOST_CLASSES + 50)}
    assert len(rows) == MOST_CLASSES + 1
    assert MOST_CLASSES < len(ledger.bands_m) < 2 * MOST_CLASSES
    assert ledger.bands_m.shape[1:] == (HORIZONS, 3)
    kinds, more = (["Alder", "Corvid", "Corvid"], ["new", "new", "newer"], [Basis.PATH] * 3), MOST_CLASSES
    assert ledger.rows(*kinds, NOW_S) == ledger.rows(*kinds, NOW_S) == [more, more + 1, more + 1]


def test_bands_follow_errors_after_the_clock_was_set_back() -> None:
    ledger = Ledger()
    row = ledger.row("Alder", "A-7", Basis.PATH, NOW_S)
    ledger.record(errors(ledger, row, 1, np.zeros(100)), NOW_S)
    ledger.record(errors(ledger, row, 1, np.full(400, 2.0)), NOW_S - 3600)
    assert ledger.bands_m[row, 0, 0] >= 2.0
