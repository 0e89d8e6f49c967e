"""Whether probabilities above one half come true, and whether what came true had one: where alerts are decided."""

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
"""What came true should have been likely so long before its onset."""


class LikelyPairs:
    """Samples with a probability above `LIKELY`: a pair and a second each."""

    def __init__(self) -> None:
        self._bins = np.zeros((3, BINS))
        """Samples, sum of probabilities, and how many came true, in bins of a tenth."""
        self._groups = np.zeros((GROUPS, 3))
        """The same by group of pairs."""
        self._runs: dict[Pair, list[list[int]]] = {}
        """First and last of the whole seconds in a row for which `LIKELY` or more was published."""

    def publish(self, at_s: float, probabilities: Iterable[tuple[Pair, float]]) -> None:
        """Take what is published at one second."""
        second = floor(at_s)
        for pair, probability in probabilities:
            if probability >= LIKELY:
                runs = self._runs.setdefault(pair, [])
                if runs and runs[-1][1] == second - 1:
                    runs[-1][1] = second
                else:
                    runs.append([second, second])

    def add(self, probability: Floats, came: Bools, group: Ints) -> None:
        """Count samples (n,) of which it is known what came of them."""
        rows = np.flatnonzero(probability > LIKELY)
        if not len(rows):
            return
        columns = np.stack([np.ones(len(rows)), probability[rows], came[rows]])
        of_bins = np.minimum(((probability[rows] - LIKELY) * (BINS / (1 - LIKELY))).astype(np.int64), BINS - 1)
        np.add.at(self._bins.T, of_bins, columns.T)
        np.add.at(self._groups, group[rows], columns.T)

    def was_likely(self, pair: Pair, onset_s: float) -> bool:
        """Whether `LIKELY` or more was published for a pair at the whole second `AHEAD_S` before."""
        second = floor(onset_s - AHEAD_S)
        return any(first <= second <= last for first, last in self._runs.get(pair, ()))

    def figures(self, onsets: Sequence[tuple[Pair, float]]) -> dict[str, Any]:
        """How true they are; and of outcomes, pairs with their onsets, how many were likely before."""
        samples, said = self._bins[:2].sum(axis=1).tolist()
        ahead = np.array([self.was_likely(*onset) for onset in onsets], np.float64)
        groups = self._groups[self._groups[:, 0] > 0]
        return {
            "samples": int(samples),
            "probability": said / samples if samples else None,
            "came_true": ratio(groups[:, [2, 0]]),
            "came_true_interval": interval(groups[:, [2, 0]], ratios),
            "bins": [
                {"samples": int(count), "probability": said / count, "came_true": true / count}
                for count, said, true in self._bins.T.tolist()
                if count
            ],
            "outcomes": len(onsets),
            "outcomes_likely_before": mean(ahead),
            "outcomes_likely_before_interval": interval(ahead, means),
        }
