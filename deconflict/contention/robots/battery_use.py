"""Batteries: how fast each robot uses its own, at what level robots of a vendor go to a charger, and to which.

Learned from what robots tell (standard 5.3), from priors on: how fast a level falls while nothing charges it, and the
level at which a robot came to a charger at which it then was charged.
"""

from collections import deque
from collections.abc import Iterable
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from deconflict.runtime.learned_state import Part, UnreadableError
from ingest.batch import Floats, Ints
from ingest.kernels import kernel, ready

DRAINS_S = 600.0
"""How fast a level falls is measured over at least this time."""
CHARGED_PCT = 1.0
"""A level that has risen by so much was charged."""
PRIOR_LEVELS_PCT = (20.0, 22.5, 25.0)
"""At which robots come to a charger, of a vendor of which nothing has been seen; each of the weight of one seen."""
LEVEL_SPREAD_PCT = 2.5
"""A level that was seen stands for those up to so much above and below it."""
PRIOR_DRAIN_PCT_PER_S = 100.0 / (8 * 3600.0)
"""Of a robot that tells no run time, of a vendor of which nothing has been seen."""
FEWEST_DRAINS = 3
MOST_LEVELS, MOST_DRAINS = 100, 100
"""Kept of one vendor."""
LEVEL_STEP_PCT = 0.5
LEVELS_PCT: Floats = np.arange(0.0, 100.0 + LEVEL_STEP_PCT, LEVEL_STEP_PCT)
ROUNDING = 1e-9
"""Shares that differ by less are the same."""

BATTERY = np.dtype(
    [
        ("level_pct", np.float64),  # as told last; nan where it was never told
        ("told_s", np.float64),  # when that was
        ("run_time_left_s", np.float64),  # told with it; nan where it was not
        ("since_s", np.float64),  # from when on, and from which level, the fall of the level is measured now
        ("since_pct", np.float64),
        ("drain_pct_per_s", np.float64),  # how fast it uses its battery, by its own levels; nan where that is not known
        ("came_pct", np.float64),  # level at which it came to the charger where it is; nan where it did not come to any
    ],
    align=True,
)
_BATTERIES = numba.types.Array(numba.from_dtype(BATTERY), 1, "C")
_FLOATS, _INTS = (numba.types.Array(kind, 1, "C", readonly=True) for kind in (numba.float64, numba.int64))
_NEVER_TOLD = np.array((np.nan,) * len(BATTERY.names or ()), BATTERY)


@kernel(numba.float64[:, ::1](_BATTERIES, _INTS, *[_FLOATS] * 3, *[numba.float64] * 2))
def _take_in(
    batteries: NDArray[Any],
    slots: Ints,
    event_s: Floats,
    level_pct: Floats,
    run_time_left_s: Floats,
    drains_s: float,
    charged_pct: float,
) -> Floats:
    """(n, 2) the level before each row, and how fast it fell where that was measured in full; nan where not known."""
    found = np.full((len(slots), 2), np.nan)
    for row in range(len(slots)):
        one, level = batteries[slots[row]], level_pct[row]
        found[row, 0] = one.level_pct
        if not level >= 0.0:
            continue
        over_s = event_s[row] - one.since_s
        if not over_s >= 0.0 or level > one.since_pct + charged_pct / 2:
            one.since_s, one.since_pct = event_s[row], level
        elif over_s >= drains_s:
            drain = max(one.since_pct - level, 0.0) / over_s
            found[row, 1] = drain
            known = one.drain_pct_per_s >= 0.0
            one.drain_pct_per_s = (one.drain_pct_per_s + drain) / 2 if known else drain
            one.since_s, one.since_pct = event_s[row], level
        one.level_pct, one.told_s, one.run_time_left_s = level, event_s[row], run_time_left_s[row]
    return found


class Batteries:
    """By slot of `Robots`, and what is learned by vendor."""

    def __init__(self) -> None:
        self.records: NDArray[Any] = np.zeros(0, BATTERY)
        self._levels_pct: dict[str, deque[float]] = {}
        """At which robots came to a charger."""
        self._drains: dict[str, deque[float]] = {}
        """Per cent a second."""
        self._used: dict[str, dict[str, int]] = {}
        """How often robots of a vendor were charged at each charger."""
        self._shares: dict[str, Floats] = {}
        """`share_below` of vendors of whose robots none was charged since it was asked for."""

    def make_room(self, slots: int) -> None:
        if slots > len(self.records):
            self.records = np.concatenate([self.records, np.full(slots - len(self.records), _NEVER_TOLD, BATTERY)])

    def forget(self, slot: int) -> None:
        self.records[slot] = _NEVER_TOLD

    def take_in(
        self, slots: Ints, vendors: Iterable[str], event_s: Floats, level_pct: Floats, run_time_left_s: Floats
    ) -> Floats:
        """Take in what n robots tell; (n,) the level that each had told before, nan where none."""
        told = (ready(event_s), ready(level_pct), ready(run_time_left_s))
        found: Floats = _take_in(self.records, slots, *told, DRAINS_S, CHARGED_PCT)
        if not np.isnan(found[:, 1]).all():
            for vendor, drain in zip(vendors, found[:, 1].tolist(), strict=True):
                if drain >= 0.0:
                    self._drains.setdefault(vendor, deque(maxlen=MOST_DRAINS)).append(drain)
        return found[:, 0]

    def came(self, slot: int, level_pct: float) -> None:
        """A robot has come to a charger at that level."""
        self.records["came_pct"][slot] = level_pct

    def left(self, slot: int, vendor: str, charger: str, level_pct: float) -> None:
        """A robot leaves a charger at that level: a lesson where it came to it and was charged there."""
        came_pct = float(self.records["came_pct"][slot])
        self.records["came_pct"][slot] = np.nan
        if level_pct >= came_pct + CHARGED_PCT:
            self._levels_pct.setdefault(vendor, deque(maxlen=MOST_LEVELS)).append(came_pct)
            used = self._used.setdefault(vendor, {})
            used[charger] = used.get(charger, 0) + 1
            self._shares.pop(vendor, None)

    def chargers_of(self, vendor: str) -> frozenset[str]:
        """Where robots of a vendor were charged."""
        return frozenset(self._used.get(vendor, ()))

    def share_below(self, vendor: str) -> Floats:
        """(len(LEVELS_PCT),) the share of a vendor's robots that come to a charger at that level or below it."""
        if vendor not in self._shares:
            levels_pct = np.array([*self._levels_pct.get(vendor, ()), *PRIOR_LEVELS_PCT])
            reached = (LEVELS_PCT[:, None] - levels_pct + LEVEL_SPREAD_PCT) / (2 * LEVEL_SPREAD_PCT)
            self._shares[vendor] = reached.clip(0.0, 1.0).mean(axis=1)
        return self._shares[vendor]

    def highest_pct(self, vendor: str) -> float:
        """At no higher level do robots of a vendor come to a charger."""
        lower = LEVELS_PCT[self.share_below(vendor) < 1.0 - ROUNDING]
        return float(lower.max(initial=0.0)) + LEVEL_STEP_PCT

    def drains(self, slots: Ints, vendors: Iterable[str]) -> Floats:
        """(n,) per cent a second: by a robot's own levels, or its vendor's others, or the run time that it tells."""
        one = self.records[slots]
        with np.errstate(divide="ignore", invalid="ignore"):
            told = np.where(one["run_time_left_s"] > 0.0, one["level_pct"] / one["run_time_left_s"], np.nan)
        usual = np.array([self._usual_drain(vendor) for vendor in vendors])
        drains: Floats = one["drain_pct_per_s"].copy()
        for instead in (usual, told, PRIOR_DRAIN_PCT_PER_S):
            drains = np.where(np.isnan(drains), instead, drains)
        return drains

    def _usual_drain(self, vendor: str) -> float:
        known = self._drains.get(vendor, ())
        return float(np.median(known)) if len(known) >= FEWEST_DRAINS else np.nan

    def learned(self) -> Part:
        """By vendor, the newest last."""
        vendors = sorted(self._levels_pct.keys() | self._drains.keys())
        return {
            "vendors": vendors,
            "levels_pct": [list(self._levels_pct.get(vendor, ())) for vendor in vendors],
            "drains": [list(self._drains.get(vendor, ())) for vendor in vendors],
            "used": [self._used.get(vendor, {}) for vendor in vendors],
        }

    def resume(self, part: Part) -> None:
        """Go on with what `learned` told. Raises `UnreadableError`."""
        try:
            rows = zip(*(part.get(name, ()) for name in ("vendors", "levels_pct", "drains", "used")), strict=True)
            for vendor, levels_pct, drains, used in rows:
                self._levels_pct[str(vendor)] = deque(map(float, levels_pct), maxlen=MOST_LEVELS)
                self._drains[str(vendor)] = deque(map(float, drains), maxlen=MOST_DRAINS)
                self._used[str(vendor)] = {str(charger): int(times) for charger, times in used.items()}
        except (TypeError, ValueError, AttributeError) as error:
            raise UnreadableError(f"batteries are not told: {error}") from error
        self._shares.clear()
