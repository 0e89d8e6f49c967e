"""Whether probabilities of pairs to get in each other's way mean what they say."""

import numpy as np

from benchmarks.planned_floors.scoring.figure import Figure, alone, share
from benchmarks.planned_floors.scoring.judged_cases import Cases
from ingest.seam import Floats

BINS = 10
LIKELY = 0.5


def calibration(cases: Cases) -> dict[str, Figure]:
    """The figures of the published probabilities; None where there were none."""
    probability, came_true = cases.probabilities[:, 0], cases.probabilities[:, 1]
    likely = probability > LIKELY
    return {
        "calibration error": alone(calibration_error(probability, came_true), len(probability)),
        "Brier skill": alone(brier_skill(probability, came_true), len(probability)),
        "above 0.5, stated": alone(_mean(probability[likely]), int(likely.sum())),
        "above 0.5, came true": share(came_true[likely]),
        "outcomes above 0.5 at 2 s": share(cases.two_s_ahead[:, 0] >= LIKELY),
    }


def calibration_error(probability: Floats, came_true: Floats) -> float:
    """The mean difference of stated probability and share that came true, over 10 bins of as many samples each."""
    if len(probability) < BINS:
        return np.nan
    order = np.argsort(probability, kind="stable")
    bins = zip(np.array_split(probability[order], BINS), np.array_split(came_true[order], BINS), strict=True)
    return float(sum(abs(stated.mean() - true.mean()) * len(stated) for stated, true in bins) / len(probability))


def brier_skill(probability: Floats, came_true: Floats) -> float:
    """How much smaller the mean squared error is than that of always saying the base rate."""
    if not len(probability) or not 0 < came_true.mean() < 1:
        return np.nan
    base = float(np.mean((came_true - came_true.mean()) ** 2))
    return 1 - float(np.mean((probability - came_true) ** 2)) / base


def _mean(values: Floats) -> float:
    return float(values.mean()) if len(values) else np.nan
