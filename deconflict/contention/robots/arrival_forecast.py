"""Corrects announced arrival times by how wrong those of a vendor have been.

Announced times are compared with arrivals. The error of a time ahead is a ratio, time taken over time announced:
robots are late in proportion to how far they go. For times that are past, see `overdue_times`.
"""

from bisect import bisect_left
from collections import deque
from dataclasses import dataclass, field
from itertools import accumulate
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field

from deconflict.contention.robots.announced_arrivals import AnnouncedArrivals, Announcement, FloorPoints
from deconflict.contention.robots.overdue_times import OverdueTimes
from deconflict.foresight.forecast_errors.arrival_errors import ArrivalErrors
from deconflict.runtime.learned_state import Form, Part, Seconds
from deconflict.sweep.robot_slots import RobotSlots
from ingest.batch import Batch, Floats, Ints

SHORTEST_S = 5.0
"""Arrivals that are nearer are not used: their ratios are noise."""
MOST_RATED = 8
"""The first announcements of one destination count, up to this number."""
MOST_RATIOS = 200
"""Number of ratios that are kept for one vendor."""
HALF_LIFE_S = 86400.0
PRIOR_RATIOS = (0.9, 1.0, 1.0, 1.0, 1.3)
"""The prior for every vendor; each ratio has the weight of one new arrival."""
RATIO_BOUNDS = (0.2, 10.0)
_Ratio = Annotated[float, Field(ge=RATIO_BOUNDS[0], le=RATIO_BOUNDS[1])]
FORM = Form(
    "when arrivals were, and time taken over time announced", {"ratios": dict[str, list[tuple[Seconds, _Ratio]]]}
)

Quantiles = tuple[float, float, float]
"""Quantiles of ratios, at `SHARES`."""
SHARES = (0.1, 0.5, 0.9)
"""A quantile is the smallest value at which the cumulated weight reaches its share."""


class ArrivalCorrections(NamedTuple):
    """Corrections of the arrival times that n robots announce."""

    row: Ints
    """(n,) the row of the two tables below that applies to each robot."""
    rates: Floats
    """(v, 3) quantiles of time taken over time announced."""
    left_s: Floats
    """(v, len(OVERDUE_S), 3) quantiles of the time until arrival of a robot that stands, by how long it is overdue."""


@dataclass(slots=True)
class VendorRatios:
    """The ratios of one vendor."""

    seen: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=MOST_RATIOS))
    """Time of the arrival, and its ratio."""
    quantiles: Quantiles | None = None
    """Computed when they are needed; None after each new ratio."""


class ArrivalForecast:
    """The announcements of robots, and how wrong they were."""

    def __init__(self, slots: RobotSlots | None = None) -> None:
        self.lateness = ArrivalErrors()
        self.overdue = OverdueTimes()
        self._announced = AnnouncedArrivals(slots)
        self._ratios: dict[str, VendorRatios] = {}

    def add_batch(self, batch: Batch, here: FloorPoints) -> ArrivalCorrections:
        """Add the destinations of a batch, whose robots (n,) are `here`; return the corrections of them.

        An arrival counts for the robots from its own row on.
        """
        numbers = {vendor: number for number, vendor in enumerate(dict.fromkeys(batch.vendors))}
        vendor = np.array([numbers[vendor] for vendor in batch.vendors], np.int64)
        known, row_of = [self._known(name) for name in numbers], vendor.copy()
        now_s = np.full(len(batch), batch.now_s)
        for row, arrivals in self._announced.add_batch(batch, now_s, here, batch.destinations):
            for announcements in arrivals:
                self._record_arrival(batch.vendors[row], batch.now_s, announcements)
            row_of[row:][vendor[row:] == vendor[row]] = len(known)
            known.append(self._known(batch.vendors[row]))
        rates, left_s = zip(*known, strict=True)
        return ArrivalCorrections(row_of, np.array(rates), np.array(left_s))

    def _known(self, vendor: str) -> tuple[Quantiles, Floats]:
        return self.quantiles(vendor), self.overdue.table_s(vendor)

    def forget(self, robot: str) -> None:
        self._announced.forget(robot)

    def quantiles(self, vendor: str) -> Quantiles:
        """The 10, 50 and 90 % quantiles of time taken over time announced; older arrivals weigh less."""
        ratios = self._ratios.get(vendor) or self._ratios.setdefault(vendor, VendorRatios())
        if ratios.quantiles is None:
            newest_s = ratios.seen[-1][0] if ratios.seen else 0.0
            weighed = [(ratio, 0.5 ** ((newest_s - at_s) / HALF_LIFE_S)) for at_s, ratio in ratios.seen]
            values, weights = zip(*sorted([*weighed, *((ratio, 1.0) for ratio in PRIOR_RATIOS)]), strict=True)
            so_far = list(accumulate(weights))
            low, middle, high = (values[bisect_left(so_far, share * so_far[-1])] for share in SHARES)
            ratios.quantiles = low, middle, high
        return ratios.quantiles

    def counts(self) -> dict[str, int]:
        """How many ratios are known, by vendor."""
        return {vendor: len(ratios.seen) for vendor, ratios in self._ratios.items()}

    def learned(self) -> Part:
        """By vendor, when arrivals were, and their ratios."""
        ratios = {vendor: list(ratios.seen) for vendor, ratios in self._ratios.items() if ratios.seen}
        return FORM.part({"ratios": ratios})

    def resume(self, part: Part) -> None:
        """Continue from what `learned` gave. Raises `UnreadableError`."""
        for vendor, seen in FORM.checked(part)["ratios"].items():
            self._ratios[vendor] = VendorRatios(deque(seen, maxlen=MOST_RATIOS))

    def _record_arrival(self, vendor: str, now_s: float, announcements: list[Announcement]) -> None:
        """Record that a robot has arrived, after these announcements of it."""
        made_s, announced_s = np.array(announcements).T
        self.lateness.record(vendor, announced_s - made_s, now_s - announced_s, now_s)
        self.overdue.record(vendor, now_s - announcements[-1].announced_s, now_s)
        ratios = self._ratios.setdefault(vendor, VendorRatios())
        low, high = RATIO_BOUNDS
        for said_at_s, announced_at_s in announcements[:MOST_RATED]:
            if announced_at_s - said_at_s >= SHORTEST_S:
                ratio = (now_s - said_at_s) / (announced_at_s - said_at_s)
                ratios.seen.append((now_s, min(max(ratio, low), high)))
                ratios.quantiles = None
