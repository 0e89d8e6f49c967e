"""Batteries: how fast each robot uses its own, at what level the robots of a vendor go to a charger, and to which.

Learned from reported levels (standard 5.3) and priors: how fast a level falls while it is not charged, and the level at
which a robot came to a charger that then charged it.
"""

from collections import deque
from collections.abc import Iterable
from typing import Annotated, Any

import numba
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from deconflict.runtime.learned_state import Count, Form, Part
from ingest.batch import Floats, Ints
from ingest.kernels import FLOAT, MATRIX, READ_FLOATS, READ_INTS, kernel, ready

DRAINS_S = 600.0
"""A drain is measured over at least this time."""
CHARGED_PCT = 1.0
"""A battery whose level has risen by this much was charged."""
PRIOR_LEVELS_PCT = (20.0, 22.5, 25.0)
"""The prior of the levels at which robots come to a charger; each has the weight of an observed level."""
LEVEL_SPREAD_PCT = 2.5
"""An observed level stands for all levels up to this much above and below it."""
PRIOR_DRAIN_PCT_PER_S = 100.0 / (8 * 3600.0)
"""The prior of a drain, if neither robot nor vendor are known and no run time is reported."""
FEWEST_DRAINS = 3
"""A vendor's usual drain is known from this many on."""
MOST_LEVELS, MOST_DRAINS = 100, 100
"""Kept for one vendor."""
LEVEL_STEP_PCT = 0.5
LEVELS_PCT: Floats = np.arange(0.0, 100.0 + LEVEL_STEP_PCT, LEVEL_STEP_PCT)
ROUNDING = 1e-9
"""Shares that differ by less are equal."""
_Percent = Annotated[float, Field(ge=0.0, le=100.0)]
FORM = Form(
    "levels in per cent at which robots come to chargers, drains in per cent a second, and how often each charger",
    {
        "levels_pct": dict[str, list[_Percent]],
        "drains": dict[str, list[_Percent]],
        "used": dict[str, dict[str, Count]],
    },
)

BATTERY = np.dtype(
    [
        ("level_pct", np.float64),  # as last reported; nan if never
        ("reported_s", np.float64),  # when that was
        ("run_time_left_s", np.float64),  # reported with it; nan if not
        ("since_s", np.float64),  # since when the drain is measured now
        ("since_pct", np.float64),  # the level then
        ("drain_pct_per_s", np.float64),  # its drain by its own levels; nan if not known
        ("came_pct", np.float64),  # level at which it came to its charger; nan if it is at none
    ],
    align=True,
)
_BATTERIES = numba.types.Array(numba.from_dtype(BATTERY), 1, "C")
_NEVER_REPORTED = np.array((np.nan,) * len(BATTERY.names or ()), BATTERY)


@kernel(MATRIX(_BATTERIES, READ_INTS, *[READ_FLOATS] * 3, *[FLOAT] * 2))
def _update_levels(
    batteries: NDArray[Any],
    slots: Ints,
    event_s: Floats,
    level_pct: Floats,
    run_time_left_s: Floats,
    drains_s: float,
    charged_pct: float,
) -> Floats:
    """(n, 2) the level before each row, and the drain if its measurement is complete; nan if not known."""
    found = np.full((len(slots), 2), np.nan)
    for row in range(len(slots)):
        battery, level = batteries[slots[row]], level_pct[row]
        found[row, 0] = battery.level_pct
        if not level >= 0.0:
            continue
        over_s = event_s[row] - battery.since_s
        if not over_s >= 0.0 or level > battery.since_pct + charged_pct / 2:
            battery.since_s, battery.since_pct = event_s[row], level
        elif over_s >= drains_s:
            drain = max(battery.since_pct - level, 0.0) / over_s
            found[row, 1] = drain
            known = battery.drain_pct_per_s >= 0.0
            battery.drain_pct_per_s = (battery.drain_pct_per_s + drain) / 2 if known else drain
            battery.since_s, battery.since_pct = event_s[row], level
        battery.level_pct, battery.reported_s, battery.run_time_left_s = level, event_s[row], run_time_left_s[row]
    return found


class BatteryUse:
    """The batteries of robots, by slot of `RobotTable`, and what is learned of each vendor."""

    def __init__(self) -> None:
        self.records: NDArray[Any] = np.zeros(0, BATTERY)
        self._levels_pct: dict[str, deque[float]] = {}
        """By vendor, levels at which robots came to a charger."""
        self._drains: dict[str, deque[float]] = {}
        """By vendor, in per cent a second."""
        self._used: dict[str, dict[str, int]] = {}
        """By vendor and charger, how often robots were charged there."""
        self._shares: dict[str, Floats] = {}
        """By vendor, the `share_below` that was asked for since its last charging."""

    def make_room(self, slots: int) -> None:
        if slots > len(self.records):
            self.records = np.concatenate([self.records, np.full(slots - len(self.records), _NEVER_REPORTED, BATTERY)])

    def forget(self, slot: int) -> None:
        self.records[slot] = _NEVER_REPORTED

    def add_levels(
        self, slots: Ints, vendors: Iterable[str], event_s: Floats, level_pct: Floats, run_time_left_s: Floats
    ) -> Floats:
        """Add the reports of n robots; (n,) the level that each reported before, nan if none."""
        reports = (ready(event_s), ready(level_pct), ready(run_time_left_s))
        found: Floats = _update_levels(self.records, slots, *reports, DRAINS_S, CHARGED_PCT)
        if not np.isnan(found[:, 1]).all():
            for vendor, drain in zip(vendors, found[:, 1].tolist(), strict=True):
                if drain >= 0.0:
                    self._drains.setdefault(vendor, deque(maxlen=MOST_DRAINS)).append(drain)
        return found[:, 0]

    def arrive_at_charger(self, slot: int, level_pct: float) -> None:
        """A robot has come to a charger at that level."""
        self.records["came_pct"][slot] = level_pct

    def leave_charger(self, slot: int, vendor: str, charger: str, level_pct: float) -> None:
        """A robot leaves a charger at that level; learn from it if it was charged there."""
        came_pct = float(self.records["came_pct"][slot])
        self.records["came_pct"][slot] = np.nan
        if level_pct >= came_pct + CHARGED_PCT:
            self._levels_pct.setdefault(vendor, deque(maxlen=MOST_LEVELS)).append(came_pct)
            used = self._used.setdefault(vendor, {})
            used[charger] = used.get(charger, 0) + 1
            self._shares.pop(vendor, None)

    def chargers_of(self, vendor: str) -> frozenset[str]:
        """The chargers at which robots of a vendor were charged."""
        return frozenset(self._used.get(vendor, ()))

    def share_below(self, vendor: str) -> Floats:
        """(len(LEVELS_PCT),) the share of a vendor's robots that come to a charger at that level or below it."""
        if vendor not in self._shares:
            levels_pct = np.array([*self._levels_pct.get(vendor, ()), *PRIOR_LEVELS_PCT])
            reached = (LEVELS_PCT[:, None] - levels_pct + LEVEL_SPREAD_PCT) / (2 * LEVEL_SPREAD_PCT)
            self._shares[vendor] = reached.clip(0.0, 1.0).mean(axis=1)
        return self._shares[vendor]

    def highest_pct(self, vendor: str) -> float:
        """The highest level at which robots of a vendor come to a charger."""
        lower = LEVELS_PCT[self.share_below(vendor) < 1.0 - ROUNDING]
        return float(lower.max(initial=0.0)) + LEVEL_STEP_PCT

    def drains(self, slots: Ints, vendors: Iterable[str]) -> Floats:
        """(n,) per cent a second: by a robot's own levels, those of its vendor, its reported run time, or the prior."""
        records = self.records[slots]
        with np.errstate(divide="ignore", invalid="ignore"):
            by_run_time = records["level_pct"] / records["run_time_left_s"]
        reported = np.where(records["run_time_left_s"] > 0.0, by_run_time, np.nan)
        usual = np.array([self._usual_drain(vendor) for vendor in vendors])
        drains: Floats = records["drain_pct_per_s"].copy()
        for instead in (usual, reported, PRIOR_DRAIN_PCT_PER_S):
            drains = np.where(np.isnan(drains), instead, drains)
        return drains

    def _usual_drain(self, vendor: str) -> float:
        known = self._drains.get(vendor, ())
        return float(np.median(known)) if len(known) >= FEWEST_DRAINS else np.nan

    def learned(self) -> Part:
        """By vendor, the newest values last."""
        vendors = sorted(self._levels_pct.keys() | self._drains.keys())
        levels_pct = {vendor: list(self._levels_pct.get(vendor, ())) for vendor in vendors}
        drains = {vendor: list(self._drains.get(vendor, ())) for vendor in vendors}
        used = {vendor: dict(self._used.get(vendor, {})) for vendor in vendors}
        return FORM.part({"levels_pct": levels_pct, "drains": drains, "used": used})

    def resume(self, part: Part) -> None:
        """Continue from what `learned` gave. Raises `UnreadableError`."""
        state = FORM.checked(part)
        for vendor, levels_pct in state["levels_pct"].items():
            self._levels_pct[vendor] = deque(levels_pct, maxlen=MOST_LEVELS)
        for vendor, drains in state["drains"].items():
            self._drains[vendor] = deque(drains, maxlen=MOST_DRAINS)
        self._used |= state["used"]
        self._shares.clear()
