"""Which vendors' clocks have changed, and how changes of every kind are told in the measures."""

from collections.abc import Iterable, Mapping
from math import inf

from ingest.clocks import SenderClock, vendor_offset
from ingest.measures.change_detection import Change, Level, Limits
from ingest.measures.measures import Labels, Measures

LOOK_S = 10.0
CLOCK = Limits(least_spread=0.1, least_change=0.3)
"""Seconds."""
SINCE = "deconflict_changed_since_timestamp_seconds"
AMOUNTS = {
    "forecast": "deconflict_forecast_change_metres",
    "datum": "deconflict_datum_change_metres",
    "clock": "deconflict_clock_change_seconds",
}
"""By how much each kind of thing has changed."""


class ClockChanges:
    """The offset of each vendor's clocks, looked at every ten seconds."""

    def __init__(self) -> None:
        self._levels: dict[str, Level] = {}
        self._looked_s = -inf

    def look(self, now_s: float, clocks: Iterable[tuple[str, SenderClock]]) -> None:
        """Take in how far clocks are off now, each with its vendor, if a look is due."""
        if 0 <= now_s - self._looked_s < LOOK_S:
            return
        self._looked_s = now_s
        of_vendor: dict[str, list[SenderClock]] = {}
        for vendor, clock in clocks:
            of_vendor.setdefault(vendor, []).append(clock)
        for vendor, every in of_vendor.items():
            self._levels.setdefault(vendor, Level(CLOCK)).take(vendor_offset(every), now_s)

    def changed(self) -> dict[str, Change]:
        """By how many seconds more stamps are behind our time than they were, of vendors that changed."""
        return {vendor: level.change for vendor, level in self._levels.items() if level.change}


def tell(measures: Measures, changes: Mapping[str, Mapping[str, Change]]) -> None:
    """Bring up to date which vendors have changed, by what of them."""
    since: dict[Labels, float] = {}
    for what, of_vendors in changes.items():
        measures.level(AMOUNTS[what], {(vendor,): one.by for vendor, one in of_vendors.items()})
        since |= {(vendor, what): one.since_s for vendor, one in of_vendors.items()}
    measures.level(SINCE, since)
