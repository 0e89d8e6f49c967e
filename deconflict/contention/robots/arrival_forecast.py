"""How wrong a vendor's arrival times have been, and what to make of its next ones.

What a robot says of a destination is held against when it came. The error of a time that lies ahead is a ratio, time
taken over time told: what is late is late in proportion to how far it goes. Of a time that is past, see `overdue`.
"""

from bisect import bisect_left
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from deconflict.contention.robots.announced_arrivals import Promise, Promises, Spot, Spots
from deconflict.contention.robots.overdue_times import Overdue
from deconflict.foresight.forecast_errors.arrival_errors import ArrivalErrors
from deconflict.runtime.learned_state import Part, numbers
from ingest.batch import Batch, Floats, Ints

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
"""Of ratios, at `SHARES`."""
SHARES = (0.1, 0.5, 0.9)
"""A quantile is the smallest value at which the weight so far reaches its share of all."""


class Corrections(NamedTuple):
    """What the times that n robots tell are corrected by."""

    row: Ints
    """(n,) which of the v rows below is known of each robot's vendor."""
    rates: Floats
    """(v, 3) quantiles of time taken over time told."""
    left_s: Floats
    """(v, len(OVERDUE_S), 3) quantiles of what is left to a robot that stands and is so long overdue."""


@dataclass(slots=True)
class Ratios:
    """Ratios of one vendor, and their quantiles as they were last worked out."""

    seen: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=MOST_RATIOS))
    """When it was seen, and the ratio."""
    quantiles: Quantiles | None = None


class Arrivals:
    """What robots said of their arrivals, and how it came out."""

    def __init__(self) -> None:
        self.lateness = ArrivalErrors()
        self.overdue = Overdue()
        self._promises = Promises()
        self._ratios: dict[str, Ratios] = {}

    def heard(
        self, robot: str, vendor: str, now_s: float, here: Spot, spots: Sequence[Spot], told_s: Sequence[float]
    ) -> None:
        """A robot is at `here` and says when it will be at each of `spots`."""
        for said in self._promises.heard(robot, now_s, here, spots, told_s):
            self._arrived(vendor, now_s, said)

    def hear(self, batch: Batch, now_s: Floats, here: Spots) -> Corrections:
        """Robots are `here` by `now_s`, each (n,), and say where they go; what to correct that by.

        An arrival counts for the robots from its own row on.
        """
        numbers = {vendor: number for number, vendor in enumerate(dict.fromkeys(batch.vendors))}
        vendor = np.array([numbers[vendor] for vendor in batch.vendors], np.int64)
        known, row_of = [self._known(vendor) for vendor in numbers], vendor.copy()
        for row, kept in self._promises.hear(batch, now_s, here, batch.destinations):
            for said in kept:
                self._arrived(batch.vendors[row], float(now_s[row]), said)
            row_of[row:][vendor[row:] == vendor[row]] = len(known)
            known.append(self._known(batch.vendors[row]))
        rates, left_s = zip(*known, strict=True)
        return Corrections(row_of, np.array(rates), np.array(left_s))

    def _known(self, vendor: str) -> tuple[Quantiles, Floats]:
        return self.quantiles(vendor), self.overdue.table_s(vendor)

    def forget(self, robot: str) -> None:
        self._promises.forget(robot)

    def quantiles(self, vendor: str) -> Quantiles:
        """The 10, 50 and 90 % quantiles of time taken over time told; older arrivals weigh less."""
        ratios = self._ratios.get(vendor) or self._ratios.setdefault(vendor, Ratios())
        if ratios.quantiles is None:
            newest_s = ratios.seen[-1][0] if ratios.seen else 0.0
            weighed = [(ratio, 0.5 ** ((newest_s - at_s) / HALF_LIFE_S)) for at_s, ratio in ratios.seen]
            values, weights = zip(*sorted([*weighed, *((ratio, 1.0) for ratio in PRIOR_RATIOS)]), strict=True)
            so_far = list(accumulate(weights))
            low, middle, high = (values[bisect_left(so_far, share * so_far[-1])] for share in SHARES)
            ratios.quantiles = low, middle, high
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
        self.overdue.record(vendor, now_s - said[-1].told_s, now_s)
        ratios = self._ratios.setdefault(vendor, Ratios())
        low, high = RATIO_BOUNDS
        for one in said[:MOST_RATED]:
            if one.told_s - one.said_s >= SHORTEST_S:
                ratio = (now_s - one.said_s) / (one.told_s - one.said_s)
                ratios.seen.append((now_s, min(max(ratio, low), high)))
                ratios.quantiles = None
