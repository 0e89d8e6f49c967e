"""Whether probabilities above one half come true, and whether outcomes had one before. Alerts are decided there."""

from collections.abc import Iterable, Sequence
from math import floor
from typing import Any

import numpy as np

from ingest.batch import Bools, Floats, Ints, Pair
from metrics.scoring.bootstrap import GROUPS, interval
from metrics.scoring.summaries import mean, means, ratio, ratios

LIKELY = 0.5
BINS = 5
AHEAD_S = 2.0
"""An outcome should have been likely this long before its onset."""


class LikelyPairs:
    """Samples with a probability above `LIKELY`. A sample is a pair and a second."""

    def __init__(self) -> None:
        self._bins = np.zeros((3, BINS))
        """(3, BINS) number of samples, sum of probabilities, and number that came true, in bins of a tenth."""
        self._groups = np.zeros((GROUPS, 3))
        """(GROUPS, 3) the same by group of pairs."""
        self._runs: dict[Pair, list[list[int]]] = {}
        """By pair: first and last of consecutive whole seconds with a published probability of at least `LIKELY`."""

    def add_published(self, at_s: float, probabilities: Iterable[tuple[Pair, float]]) -> None:
        """Add the probabilities that are published at one second."""
        second = floor(at_s)
        for pair, probability in probabilities:
            if probability >= LIKELY:
                runs = self._runs.setdefault(pair, [])
                if runs and runs[-1][1] == second - 1:
                    runs[-1][1] = second
                else:
                    runs.append([second, second])

    def add_outcomes(self, probability: Floats, came: Bools, group: Ints) -> None:
        """Count samples (n,) with a known outcome."""
        rows = np.flatnonzero(probability > LIKELY)
        if not len(rows):
            return
        columns = np.stack([np.ones(len(rows)), probability[rows], came[rows]])
        of_bins = np.minimum(((probability[rows] - LIKELY) * (BINS / (1 - LIKELY))).astype(np.int64), BINS - 1)
        np.add.at(self._bins.T, of_bins, columns.T)
        np.add.at(self._groups, group[rows], columns.T)

    def was_likely(self, pair: Pair, onset_s: float) -> bool:
        """Whether at least `LIKELY` was published for a pair at the whole second `AHEAD_S` before."""
        second = floor(onset_s - AHEAD_S)
        return any(first <= second <= last for first, last in self._runs.get(pair, ()))

    def figures(self, onsets: Sequence[tuple[Pair, float]]) -> dict[str, Any]:
        """The share of samples that came true; and the share of outcomes, given as pairs with onsets, that were likely
        before."""
        samples, probability_sum = self._bins[:2].sum(axis=1).tolist()
        ahead = np.array([self.was_likely(*onset) for onset in onsets], np.float64)
        groups = self._groups[self._groups[:, 0] > 0]
        return {
            "samples": int(samples),
            "probability": probability_sum / samples if samples else None,
            "came_true": ratio(groups[:, [2, 0]]),
            "came_true_interval": interval(groups[:, [2, 0]], ratios),
            "bins": [
                {"samples": int(count), "probability": probability_sum / count, "came_true": came_true / count}
                for count, probability_sum, came_true in self._bins.T.tolist()
                if count
            ],
            "outcomes": len(onsets),
            "outcomes_likely_before": mean(ahead),
            "outcomes_likely_before_interval": interval(ahead, means),
        }
