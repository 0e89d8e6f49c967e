"""Calibration of published probabilities: calibration error, Brier score and skill, reliability diagram.

A sample is a pair and a second for which a probability was published. It came true if the outcome (see
`metrics/scoring/warnings/outcomes_by_moment.py`) began within the next 10 s. A pair that is already within the outcome
is excluded. If a robot left before any outcome, the sample is censored: the samples with a known outcome get a larger
weight in its place (`deconflict.foresight.probability.censoring`). Samples of which a robot waited as advised, or may
have waited on an order of its fleet, are only counted.
"""

from collections import defaultdict, deque
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from math import floor, inf, pi
from typing import Any, NamedTuple
from zlib import crc32

import numba
import numpy as np

from deconflict.foresight.probability.censoring import PARTS, STAYED, part_of, weights
from ingest.batch import Bools, Floats, Ints, Pair
from ingest.kernels import BOOLS, CUBE, FLOATS, INTS, kernel
from metrics.scoring.bootstrap import GROUPS, Interval, interval
from metrics.scoring.summaries import brier, brier_skill, brier_skills, briers
from metrics.scoring.warnings.likely_pairs import LikelyPairs
from metrics.scoring.warnings.outcomes_by_moment import HORIZON_S, OutcomeLookup
from metrics.truth.advised_waits import AdvisedWaits

SETTLED_S = 120.0
"""The first minutes, in which probabilities depend on what was known before the log began."""
BINS = 10
"""Bins of the reliability diagram, of equal mass as far as possible."""
FINE = 1000
"""Steps of the arcsine of the square root of a probability. So values near 0 and near 1 also have fine steps."""

_STEPS = np.sin((np.arange(FINE) + 0.5) / FINE * (pi / 2)) ** 2
"""Probabilities at the boundaries between the steps."""

LEFT = PARTS + 1
"""Used instead of a part of the horizon for a censored sample: a robot left before any outcome."""
EACH_ONCE = np.append(np.ones(PARTS + 1), 0.0)
"""Weights that ignore censored samples without compensating for them."""
EVERY = np.ones(PARTS + 2)
"""Weights that count every censored sample as not met."""

Vendors = tuple[str, str]


class CalibrationSamples(NamedTuple):
    """Published probabilities of pairs, and their outcomes. Arrays are (n,)."""

    group: Ints
    """Bootstrap group of the pair."""
    step: Ints
    """Step of the probability, see `FINE`."""
    probability: Floats
    squared: Floats
    """Squared error of the probability."""
    part: Ints
    """Part of the horizon in which it came true or a robot left; `STAYED` if neither happened."""
    known: Bools
    """Whether the outcome is known: no robot left before it."""

    @classmethod
    def of(cls, group: Ints, probability: Floats, part: Ints, known: Bools) -> "CalibrationSamples":
        squared = [off**2 for off in (probability - (part < STAYED)).tolist()]
        return cls(group, np.searchsorted(_STEPS, probability), probability, np.array(squared), part, known)


class CalibrationTally:
    """Counts of samples by outcome, by probability and by group of pairs. The memory does not depend on the log."""

    def __init__(self) -> None:
        self.fine = np.zeros((2, PARTS + 2, FINE + 1))
        """(2, PARTS + 2, FINE + 1) number of samples and sum of probabilities, by part of the horizon or `LEFT`, and
        step."""
        self.groups = np.zeros((2, PARTS + 2, GROUPS))
        """(2, PARTS + 2, GROUPS) number of samples and sum of squared errors, by part of the horizon or `LEFT`, and
        group."""
        self.left = np.zeros(PARTS + 1)
        """(PARTS + 1,) censored samples, by the part of the horizon in which the robot left."""

    def add(self, samples: CalibrationSamples, rows: Ints) -> None:
        """Count the samples of `rows` (m,)."""
        _count(rows, *samples, self.fine, self.groups, self.left)

    @classmethod
    def joined(cls, parts: Iterable["CalibrationTally"]) -> "CalibrationTally":
        whole = cls()
        for part in parts:
            whole.fine += part.fine
            whole.groups += part.groups
            whole.left += part.left
        return whole

    def weights(self) -> Floats:
        """(PARTS + 2,) weight of a sample, by the part of the horizon in which it became known; 0 for `LEFT`."""
        return np.append(weights(self.known().sum(axis=1), self.left), 0.0)

    def known(self) -> Floats:
        """(PARTS + 1, FINE + 1) samples with a known outcome."""
        return self.fine[0, :LEFT]

    def bins(self, weights: Floats | None = None) -> Floats:
        """(b, 3) number of samples, mean probability and share that came true, of at most `BINS` bins. The bins have
        equal mass, except that equal probabilities stay in one bin."""
        weights = self.weights() if weights is None else weights
        counts, probabilities = np.tensordot(weights, self.fine, (0, 1))
        total = counts.sum()
        if not total:
            return np.empty((0, 3))
        middle = np.cumsum(counts) - counts / 2
        bin_of = np.minimum((middle * BINS / total).astype(np.int64), BINS - 1)
        true = weights[:STAYED] @ self.fine[0, :STAYED]
        sums = np.stack([np.bincount(bin_of, row, BINS) for row in (counts, probabilities, true)], axis=1)
        sums = sums[sums[:, 0] > 0]
        return np.column_stack([sums[:, 0], sums[:, 1:] / sums[:, :1]])

    def by_group(self, weights: Floats | None = None) -> Floats:
        """(g, 3) number of samples, number that came true and sum of squared errors, of each group with samples."""
        every = self.every_group(weights)
        return every[every[:, 0] > 0]

    def every_group(self, weights: Floats | None = None) -> Floats:
        """(GROUPS, 3) as `by_group`, but of all groups. A pair is in the same row of every tally."""
        samples, squared = self.groups
        weights = self.weights() if weights is None else weights
        came_true = samples * (np.arange(PARTS + 2) < STAYED)[:, None]
        return (weights @ np.stack([samples, came_true, squared])).T

    def ece(self, weights: Floats | None = None) -> float | None:
        """Expected calibration error: mean distance between probability and share over the bins, weighted by
        samples."""
        bins = self.bins(weights)
        return float(np.average(np.abs(bins[:, 1] - bins[:, 2]), weights=bins[:, 0])) if len(bins) else None

    def figures(self) -> dict[str, Any]:
        return {
            "samples": int(self.known().sum()),
            "ece": self.ece(),
            "brier": brier(self.by_group()),
            "brier_skill": brier_skill(self.by_group()),
            "ece_unweighted": self.ece(EACH_ONCE),
            "brier_skill_unweighted": brier_skill(self.by_group(EACH_ONCE)),
            "ece_all": self.ece(EVERY),
            "brier_skill_all": brier_skill(self.by_group(EVERY)),
            "reliability": [
                {"samples": round(count), "probability": probability, "came_true": share}
                for count, probability, share in self.bins().tolist()
            ],
        }

    def intervals(self) -> dict[str, Interval]:
        """Bootstrap intervals of the Brier score and skill, over groups of pairs."""
        groups = self.by_group()
        return {"brier": interval(groups, briers), "brier_skill": interval(groups, brier_skills)}


class CalibrationScores:
    """The calibration of probabilities of one kind, sampled at whole seconds, by pair of vendors."""

    def __init__(self, waits: AdvisedWaits) -> None:
        """`waits` are the times at which robots waited as advised."""
        self._waits = waits
        self._waiting: deque[tuple[float, Sequence[tuple[Pair, float]]]] = deque()
        self._second = -1
        self._settled_from_s = inf
        self.by_vendors: defaultdict[Vendors, CalibrationTally] = defaultdict(CalibrationTally)
        self.settled = CalibrationTally()
        """Samples after the first minutes."""
        self.likely = LikelyPairs()
        self.heeded = 0
        """Samples of which a robot waited as advised before anything happened."""
        self.doubted = 0
        """Samples of which a robot waited, and it is unknown whether its fleet had ordered that."""

    def sample(self, now_s: float, probabilities: Sequence[tuple[Pair, float]]) -> None:
        """Add the probabilities that are published at the first pass of each second."""
        if floor(now_s) == self._second:
            return
        self._second = floor(now_s)
        self._settled_from_s = min(self._settled_from_s, now_s + SETTLED_S)
        if probabilities:
            self._waiting.append((now_s, probabilities))
            self.likely.add_published(now_s, probabilities)

    def resolve(self, outcomes: OutcomeLookup, vendor_of: Mapping[str, str]) -> None:
        """Count every sample whose outcome is known by now."""
        due: list[tuple[float, Sequence[tuple[Pair, float]]]] = []
        while self._waiting and self._waiting[0][0] + HORIZON_S <= outcomes.until_s:
            due.append(self._waiting.popleft())
        if due:
            at_s = np.repeat([at_s for at_s, _ in due], [len(published) for _, published in due])
            pairs, probabilities = zip(*chain.from_iterable(published for _, published in due), strict=True)
            self._judge(at_s, pairs, np.array(probabilities), outcomes, vendor_of)

    def whole(self) -> CalibrationTally:
        return CalibrationTally.joined(self.by_vendors.values())

    def _judge(
        self,
        at_s: Floats,
        pairs: Sequence[Pair],
        probabilities: Floats,
        outcomes: OutcomeLookup,
        vendor_of: Mapping[str, str],
    ) -> None:
        """Count samples (n,), except those of a pair that is already within the outcome."""
        index: dict[Pair, int] = {}
        which = np.array([index.setdefault(pair, len(index)) for pair in pairs])
        every = list(index)
        began_s, left_s, doubted = outcomes.after(every, which, at_s)
        waited_s = self._waited_s(every, which, at_s)
        outside, heeded = began_s != at_s, waited_s < began_s
        self.heeded += int((outside & heeded).sum())
        self.doubted += int((outside & ~heeded & doubted).sum())
        came = began_s < inf
        part = part_of(np.where(came, began_s, left_s) - at_s, HORIZON_S)
        part = np.where(came, np.minimum(part, STAYED - 1), part)
        group = np.array([crc32("".join(pair).encode()) % GROUPS for pair in every])[which]
        samples = CalibrationSamples.of(group, probabilities, part, came | (part == STAYED))
        rows = np.flatnonzero(outside & ~heeded & ~doubted)
        vendors = [(min(vendor_of[a], vendor_of[b]), max(vendor_of[a], vendor_of[b])) for a, b in every]
        self._add(samples, rows, [vendors[pair] for pair in which[rows].tolist()])
        self.settled.add(samples, rows[at_s[rows] >= self._settled_from_s])
        known = rows[samples.known[rows]]
        self.likely.add_outcomes(probabilities[known], came[known], group[known])

    def _waited_s(self, every: Sequence[Pair], which: Ints, at_s: Floats) -> Floats:
        """(n,) when one of each pair first waited as advised within the horizon; inf if neither did."""
        waited_s = np.full(len(which), inf)
        for row in np.flatnonzero(np.array([pair in self._waits for pair in every])[which]).tolist():
            waited_s[row] = self._waits.began_s(every[which[row]], at_s[row], at_s[row] + HORIZON_S)
        return waited_s

    def _add(self, samples: CalibrationSamples, rows: Ints, vendors: Sequence[Vendors]) -> None:
        """Count the samples of `rows` (m,), given the pair of vendors of each."""
        chosen: dict[Vendors, list[int]] = {}
        for row, pair_of_vendors in zip(rows.tolist(), vendors, strict=True):
            chosen.setdefault(pair_of_vendors, []).append(row)
        for pair_of_vendors, chosen_rows in chosen.items():
            self.by_vendors[pair_of_vendors].add(samples, np.array(chosen_rows))


@kernel(numba.void(*[INTS] * 3, *[FLOATS] * 2, INTS, BOOLS, *[CUBE] * 2, FLOATS))
def _count(
    rows: Ints,
    group: Ints,
    step: Ints,
    probability: Floats,
    squared: Floats,
    part: Ints,
    known: Bools,
    fine: Floats,
    groups: Floats,
    left: Floats,
) -> None:
    """Add the samples of `rows` to the counts."""
    for row in rows:
        at = part[row]
        error = squared[row]
        if not known[row]:
            left[at] += 1.0
            at, error = LEFT, probability[row] ** 2
        fine[0, at, step[row]] += 1.0
        fine[1, at, step[row]] += probability[row]
        groups[0, at, group[row]] += 1.0
        groups[1, at, group[row]] += error
