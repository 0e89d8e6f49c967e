"""Whether published probabilities mean what they say: calibration error, Brier score and skill, reliability diagram.

A sample is a pair and a second for which a probability was published. It came true where an encounter of the pair
began within the next 10 s. Pairs that are in an encounter are left out. So are those of which a robot left before
anything happened: nobody knows what would have. Those that are known stand for them (`deconflict.foresight.leaving`).
Those of which a robot waited as advised are counted apart.
"""

from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain
from math import floor, inf, pi
from typing import Any
from zlib import crc32

import numpy as np

from deconflict.foresight.leaving import PARTS, STAYED, part_of, weights
from ingest.seam import Floats, Ints
from metrics.bootstrap import Interval, interval
from metrics.summaries import brier, brier_skill, brier_skills, briers
from metrics.truth import Encounter, Pair, Truth
from metrics.waits import Waits

HORIZON_S = 10.0
SETTLED_S = 120.0
"""The first minutes, in which probabilities rest on what was known before the log began."""
BINS = 10
"""Of the reliability diagram, as many samples in each as can be."""
FINE = 1000
"""Steps of the arcsine of the root of a probability, so that small ones and those near 1 are told apart too."""
GROUPS = 32
"""Pairs fall into so many groups, which the bootstrap draws whole: seconds of one pair are no independent cases."""

_STEPS = np.sin((np.arange(FINE) + 0.5) / FINE * (pi / 2)) ** 2
"""Where one step of probability ends and the next begins."""

EACH_ONCE = np.ones(PARTS + 1)
"""Weights that leave out what is left out, without making up for it."""

Vendors = tuple[str, str]


class Tally:
    """Samples counted by what became of them, by probability and by group of pairs: bounded however long a log is."""

    def __init__(self) -> None:
        self.fine = np.zeros((2, PARTS + 1, FINE + 1))
        """Samples and sum of probabilities, by when it became known (`leaving`) and step of the probability."""
        self.groups = np.zeros((2, PARTS + 1, GROUPS))
        """Samples and sum of squared errors, by when it became known and group."""
        self.left = np.zeros(PARTS + 1)
        """Samples of which a robot left before anything happened, by when it did."""

    def add(self, group: Ints, probability: Floats, part: Ints) -> None:
        """Samples (n,) that each came true in a part of the horizon, or not (`STAYED`)."""
        step = np.searchsorted(_STEPS, probability)
        squared = [off**2 for off in (probability - (part < STAYED)).tolist()]
        for (samples, sums), column, by in ((self.fine, step, probability), (self.groups, group, squared)):
            at = part * samples.shape[1] + column
            np.add.at(samples.reshape(-1), at, 1.0)
            np.add.at(sums.reshape(-1), at, by)

    @classmethod
    def joined(cls, parts: Iterable["Tally"]) -> "Tally":
        whole = cls()
        for part in parts:
            whole.fine += part.fine
            whole.groups += part.groups
            whole.left += part.left
        return whole

    def weights(self) -> Floats:
        """(PARTS + 1,) what a sample counts, by when it became known."""
        return weights(self.fine[0].sum(axis=1), self.left)

    def bins(self, weights: Floats | None = None) -> Floats:
        """(b, 3) samples, mean probability and share that came true; at most `BINS`, of equal mass as far as equal
        probabilities are not torn apart."""
        weights = self.weights() if weights is None else weights
        counts, probabilities = np.tensordot(weights, self.fine, (0, 1))
        total = counts.sum()
        if not total:
            return np.empty((0, 3))
        middle = np.cumsum(counts) - counts / 2
        bin_of = np.minimum((middle * BINS / total).astype(np.int64), BINS - 1)
        true = counts - weights[STAYED] * self.fine[0, STAYED]
        sums = np.stack([np.bincount(bin_of, row, BINS) for row in (counts, probabilities, true)], axis=1)
        sums = sums[sums[:, 0] > 0]
        return np.column_stack([sums[:, 0], sums[:, 1:] / sums[:, :1]])

    def by_group(self, weights: Floats | None = None) -> Floats:
        """(g, 3) samples, those that came true and squared errors of each group of pairs that has any."""
        samples, squared = self.groups
        weights = self.weights() if weights is None else weights
        every = weights @ np.stack([samples, samples * (np.arange(PARTS + 1) < STAYED)[:, None], squared])
        held: Floats = every.T[every[0] > 0]
        return held

    def ece(self, weights: Floats | None = None) -> float | None:
        """Expected calibration error: mean distance of probability and share over the bins, by samples."""
        bins = self.bins(weights)
        return float(np.average(np.abs(bins[:, 1] - bins[:, 2]), weights=bins[:, 0])) if len(bins) else None

    def figures(self) -> dict[str, Any]:
        return {
            "samples": int(self.fine[0].sum()),
            "ece": self.ece(),
            "brier": brier(self.by_group()),
            "brier_skill": brier_skill(self.by_group()),
            "ece_unweighted": self.ece(EACH_ONCE),
            "brier_skill_unweighted": brier_skill(self.by_group(EACH_ONCE)),
            "reliability": [
                {"samples": round(count), "probability": probability, "came_true": share}
                for count, probability, share in self.bins().tolist()
            ],
        }

    def intervals(self) -> dict[str, Interval]:
        """Of the Brier score and its skill, by drawing groups of pairs."""
        groups = self.by_group()
        return {"brier": interval(groups, briers), "brier_skill": interval(groups, brier_skills)}


class Calibration:
    """One clearance's probabilities, sampled at whole seconds and told apart by pair of vendors."""

    def __init__(self, clearance_m: float) -> None:
        self._clearance_m = clearance_m
        self._waiting: deque[tuple[float, Sequence[tuple[Pair, float]]]] = deque()
        self._second = -1
        self._settled_from_s = inf
        self.by_vendors: dict[Vendors, Tally] = {}
        self.settled = Tally()
        """What was said after the first minutes."""
        self.waits = Waits()
        self.heeded = 0
        """Samples of which a robot waited as advised before anything happened."""

    def sample(self, now_s: float, probabilities: Sequence[tuple[Pair, float]]) -> None:
        """Take what is published at the first pass of each second."""
        if floor(now_s) == self._second:
            return
        self._second = floor(now_s)
        self._settled_from_s = min(self._settled_from_s, now_s + SETTLED_S)
        if probabilities:
            self._waiting.append((now_s, probabilities))

    def resolve(self, truth: Truth, vendor_of: Mapping[str, str]) -> None:
        """Count every sample of which it is known what followed."""
        due: list[tuple[float, Pair, float]] = []
        while self._waiting and self._waiting[0][0] + HORIZON_S <= truth.until_s:
            at_s, probabilities = self._waiting.popleft()
            due += [(at_s, pair, probability) for pair, probability in probabilities]
        if due:
            at, pairs, said = zip(*due, strict=True)
            self._judge(np.array(at), pairs, np.array(said), truth, vendor_of)

    def whole(self) -> Tally:
        return Tally.joined(self.by_vendors.values())

    def _judge(
        self, at_s: Floats, pairs: Sequence[Pair], said: Floats, truth: Truth, vendor_of: Mapping[str, str]
    ) -> None:
        """Count samples (n,), but for those that were said within an encounter."""
        met = truth.by_pair(self._clearance_m)
        each = list(zip(at_s.tolist(), pairs, strict=True))
        began_s = np.array([_began_s(met[pair], one_s) if pair in met else inf for one_s, pair in each])
        waited_s = np.array([self.waits.began_s(pair, one_s, one_s + HORIZON_S) for one_s, pair in each])
        last_s = {robot: truth.motion.last_seen_s(robot) for robot in set(chain.from_iterable(pairs))}
        last = np.array([min(last_s[a], last_s[b]) for a, b in pairs])
        part = part_of(np.minimum(began_s, last) - at_s, HORIZON_S)
        outside, heeded = began_s != at_s, waited_s < began_s
        self.heeded += int((outside & heeded).sum())
        rows = np.flatnonzero(outside & ~heeded)
        groups = {pair: crc32("".join(pair).encode()) % GROUPS for pair in set(pairs)}
        group = np.array([groups[pair] for pair in pairs])
        came = began_s < inf
        part = np.where(came, np.minimum(part, STAYED - 1), part)
        is_known = came | (part == STAYED)
        settled = (self.settled, rows[at_s[rows] >= self._settled_from_s])
        for tally, of in (*self._by_vendors(rows, pairs, vendor_of), settled):
            known, left = of[is_known[of]], of[~is_known[of]]
            tally.add(group[known], said[known], part[known])
            np.add.at(tally.left, part[left], 1.0)

    def _by_vendors(
        self, rows: Ints, pairs: Sequence[Pair], vendor_of: Mapping[str, str]
    ) -> Iterator[tuple[Tally, Ints]]:
        """The chosen samples of each two vendors, and where they are counted."""
        vendors = {pair: _sorted(vendor_of[pair[0]], vendor_of[pair[1]]) for pair in set(pairs)}
        chosen: dict[Vendors, list[int]] = {}
        for row in rows.tolist():
            chosen.setdefault(vendors[pairs[row]], []).append(row)
        for both, some in chosen.items():
            yield self.by_vendors.setdefault(both, Tally()), np.array(some)


def _sorted(a: str, b: str) -> Vendors:
    return (a, b) if a <= b else (b, a)


def _began_s(encounters: Sequence[Encounter], at_s: float) -> float:
    """When the next one within the horizon begins; `at_s` within one, inf where there is none."""
    began_s = inf
    for one in reversed(encounters):
        if one.start_s <= at_s:
            return at_s if at_s <= one.end_s else began_s
        if one.start_s <= at_s + HORIZON_S:
            began_s = one.start_s
    return began_s
