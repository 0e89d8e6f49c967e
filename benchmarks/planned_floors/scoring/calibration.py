"""Whether probabilities of pairs to get in each other's way mean what they say.

Seconds of one pair are no independent cases: intervals come from draws of groups of pairs of one floor, each drawn
whole.
"""

import numpy as np

from benchmarks.planned_floors.scoring.figure import Figure, alone, of_cases, ratio, share
from benchmarks.planned_floors.scoring.judged_cases import Cases
from ingest.batch import Floats, Ints
from metrics.scoring.bootstrap import DRAWS, SEED, Interval, middle

BINS = 10
LIKELY = 0.5


def calibration(cases: Cases) -> dict[str, Figure]:
    """The figures of the published probabilities. None if there were none."""
    probability, came_true = cases.probabilities[:, 0], cases.probabilities[:, 1]
    group = np.unique(cases.probabilities[:, 2], return_inverse=True)[1]
    sums, likely = _group_sums(probability, came_true, group), int((probability > LIKELY).sum())
    return {
        "calibration error": {
            **alone(calibration_error(probability, came_true), len(probability)),
            "interval": _error_interval(probability, came_true, group),
        },
        "Brier skill": of_cases(sums, _brier_skills, len(probability)),
        "above 0.5, pair-seconds": alone(float(likely) if len(probability) else np.nan, likely),
        "above 0.5, stated": of_cases(sums, lambda draws: _share_of_likely(draws, 4), likely),
        "above 0.5, came true": of_cases(sums, lambda draws: _share_of_likely(draws, 5), likely),
        "outcomes above 0.5 at 2 s": share(cases.two_s_ahead[:, 0] >= LIKELY),
    }


def calibration_error(probability: Floats, came_true: Floats) -> float:
    """The mean difference between probability and share that came true, over 10 bins of equal size."""
    order = np.argsort(probability, kind="stable")
    return _error(probability[order], came_true[order], np.ones(len(order)))


def _error(probability: Floats, came_true: Floats, weights: Floats) -> float:
    """The calibration error of weighted samples (n,), sorted by probability; nan if there are too few."""
    total = weights.sum()
    if total < BINS:
        return np.nan
    bins = np.minimum((np.cumsum(weights) - weights / 2) * BINS // total, BINS - 1).astype(np.int64)
    off = np.bincount(bins, weights * (probability - came_true), BINS)
    return float(np.abs(off).sum() / total)


def _error_interval(probability: Floats, came_true: Floats, group: Ints) -> Interval:
    """The bootstrap interval of the calibration error of samples (n,)."""
    if len(probability) < BINS:
        return None
    order = np.argsort(probability, kind="stable")
    probability, came_true, group = probability[order], came_true[order], group[order]
    groups = int(group.max()) + 1
    rng = np.random.default_rng(SEED)
    drawn = rng.multinomial(groups, np.full(groups, 1 / groups), DRAWS).astype(np.float64)
    errors = [_error(probability, came_true, times[group]) for times in drawn]
    return middle([error for error in errors if not np.isnan(error)])


def _group_sums(probability: Floats, came_true: Floats, group: Ints) -> Floats:
    """(groups, 6) samples, those that came true, squared errors; of those above 0.5 samples, probability, those that
    came true."""
    likely = probability > LIKELY
    squared = (probability - came_true) ** 2
    columns = (np.ones(len(group)), came_true, squared, likely, likely * probability, likely * came_true)
    return np.stack([np.bincount(group, column) for column in columns], axis=1)


def _brier_skills(draws: Floats) -> Floats:
    """(d,) the relative gain in mean squared error over a constant base rate."""
    samples, came_true, squared = draws.sum(axis=1)[:, :3].T
    base_rate = ratio(came_true, samples)
    return 1 - ratio(squared, samples * base_rate * (1 - base_rate))


def _share_of_likely(draws: Floats, column: int) -> Floats:
    """(d,) a column of `_group_sums` over the samples above 0.5."""
    in_all = draws.sum(axis=1)
    return ratio(in_all[:, column], in_all[:, 3])
