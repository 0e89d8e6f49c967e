"""Which vendors' clocks have changed, and how changes of every kind are published in the measures."""

from collections.abc import Iterable, Mapping
from math import inf

from ingest.clocks import SenderClock, vendor_offset
from ingest.measures.change_detection import ChangeDetector, ChangeLimits, LevelChange
from ingest.measures.measures import Labels, Measures

OBSERVE_EVERY_S = 10.0
CLOCK = ChangeLimits(least_spread=0.1, least_change=0.3)
"""Seconds."""
SINCE = "deconflict_changed_since_timestamp_seconds"
AMOUNTS = {
    "forecast": "deconflict_forecast_change_metres",
    "datum": "deconflict_datum_change_metres",
    "clock": "deconflict_clock_change_seconds",
}
"""By kind of change, the metric of its size."""


class ClockChanges:
    """Detects changes of the offset of each vendor's clocks, every ten seconds."""

    def __init__(self) -> None:
        self._detectors: dict[str, ChangeDetector] = {}
        self._observed_s = -inf

    def observe(self, now_s: float, clocks: Iterable[tuple[str, SenderClock]]) -> None:
        """Add the present offsets of clocks, each given with its vendor, if ten seconds have passed."""
        if 0 <= now_s - self._observed_s < OBSERVE_EVERY_S:
            return
        self._observed_s = now_s
        by_vendor: dict[str, list[SenderClock]] = {}
        for vendor, clock in clocks:
            by_vendor.setdefault(vendor, []).append(clock)
        for vendor, group in by_vendor.items():
            self._detectors.setdefault(vendor, ChangeDetector(CLOCK)).add(vendor_offset(group), now_s)

    def changed(self) -> dict[str, LevelChange]:
        """By vendor whose clocks have changed: how many seconds more its stamps are now behind service time."""
        return {vendor: detector.change for vendor, detector in self._detectors.items() if detector.change}


def publish(measures: Measures, changes: Mapping[str, Mapping[str, LevelChange]]) -> None:
    """Set the levels that say which vendors have changed, by kind of change."""
    since: dict[Labels, float] = {}
    for kind, by_vendor in changes.items():
        measures.level(AMOUNTS[kind], {(vendor,): change.by for vendor, change in by_vendor.items()})
        since |= {(vendor, kind): change.since_s for vendor, change in by_vendor.items()}
    measures.level(SINCE, since)
