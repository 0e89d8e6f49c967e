"""How wrong a vendor's arrival times have been, and what to make of its next ones.

What a robot says of a destination is held against when it came. The error is a ratio, time taken over
time told: what is late is late in proportion to how far it goes.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from deconflict.contention.promises import Promise, Promises, Spot
from deconflict.foresight.lateness import Lateness
from deconflict.learned import Part, numbers
from ingest.seam import Floats

SHORTEST_S = 5.0
"""Nearer arrivals than this teach nothing: their ratios are noise."""
MOST_RATED = 8
"""Of the words on one destination, so many of the first count."""
MOST_RATIOS = 200
"""Kept of one vendor."""
HALF_LIFE_S = 86400.0
PRIOR_RATIOS = (0.9, 1.0, 1.0, 1.0, 1.3)
"""What is thought of a vendor of which nothing has been seen, each of the weight of one arrival just seen."""
RATIO_BOUNDS = (0.2, 10.0)

Quantiles = tuple[float, float, float]
"""Of ratios: 10, 50 and 90 %."""


@dataclass(slots=True)
class Ratios:
    """Ratios of one vendor, and their quantiles as they were last worked out."""

    seen: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=MOST_RATIOS))
    """When it was seen, and the ratio."""
    quantiles: Quantiles | None = None


class Arrivals:
    """What robots said of their arrivals, and how it came out."""

    def __init__(self) -> None:
        self.lateness = Lateness()
        self._promises = Promises()
        self._ratios: dict[str, Ratios] = {}

    def heard(
        self, robot: str, vendor: str, now_s: float, here: Spot, spots: Sequence[Spot], told_s: Sequence[float]
    ) -> None:
        """A robot is at `here` and says when it will be at each of `spots`."""
        for said in self._promises.heard(robot, now_s, here, spots, told_s):
            self._arrived(vendor, now_s, said)

    def awaits(self, robot: str) -> bool:
        """Whether it has said that it comes somewhere, and not since then that it goes nowhere."""
        return robot in self._promises

    def forget(self, robot: str) -> None:
        self._promises.forget(robot)

    def quantiles(self, vendor: str) -> Quantiles:
        """The 10, 50 and 90 % quantiles of time taken over time told; older arrivals weigh less."""
        ratios = self._ratios.get(vendor) or self._ratios.setdefault(vendor, Ratios())
        if ratios.quantiles is None:
            newest_s = ratios.seen[-1][0] if ratios.seen else 0.0
            weighed = [(ratio, 0.5 ** ((newest_s - at_s) / HALF_LIFE_S)) for at_s, ratio in ratios.seen]
            weighed = sorted([*weighed, *((ratio, 1.0) for ratio in PRIOR_RATIOS)])
            ratios.quantiles = (_quantile(weighed, 0.1), _quantile(weighed, 0.5), _quantile(weighed, 0.9))
        return ratios.quantiles

    def seen(self) -> dict[str, int]:
        """How many arrivals are known, by vendor."""
        return {vendor: len(ratios.seen) for vendor, ratios in self._ratios.items()}

    def learned(self) -> Part:
        """By vendor, when arrivals were seen, and their ratios."""
        return {vendor: list(ratios.seen) for vendor, ratios in self._ratios.items() if ratios.seen}

    def resume(self, part: Part) -> None:
        """Go on with what `learned` told. Raises `UnreadableError`."""
        for vendor in part:
            seen = numbers(part, vendor, (None, 2)).tolist()
            self._ratios[vendor] = Ratios(deque(((at_s, ratio) for at_s, ratio in seen), maxlen=MOST_RATIOS))

    def _arrived(self, vendor: str, now_s: float, said: list[Promise]) -> None:
        said_s, told_s = np.array(said).T
        self.lateness.record(vendor, told_s - said_s, now_s - told_s, now_s)
        ratios = self._ratios.setdefault(vendor, Ratios())
        low, high = RATIO_BOUNDS
        for one in said[:MOST_RATED]:
            if one.told_s - one.said_s >= SHORTEST_S:
                ratio = (now_s - one.said_s) / (one.told_s - one.said_s)
                ratios.seen.append((now_s, min(max(ratio, low), high)))
                ratios.quantiles = None


def expected(rates: Floats, now_s: Floats, told_s: Floats) -> tuple[Floats, Floats]:
    """When robots that tell `told_s` (m,) will come, and half the width of the middle 80 % of it, never past.

    `rates` (m, 3) are the quantiles of their vendors.
    """
    low, middle, high = rates.T
    ahead_s = np.maximum(told_s - now_s, 0.0)
    return now_s + middle * ahead_s, (high - low) / 2 * ahead_s


def _quantile(weighed: list[tuple[float, float]], share: float) -> float:
    """The smallest value at which the weight so far reaches `share` of all."""
    wanted, so_far = share * sum(weight for _, weight in weighed), 0.0
    for value, weight in weighed:
        so_far += weight
        if so_far >= wanted:
            return value
    return weighed[-1][0]
