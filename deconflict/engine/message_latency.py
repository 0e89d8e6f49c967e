"""Metric: the time from a message's arrival until its advisories are published."""

from collections.abc import Mapping

import numpy as np

from ingest.batch import Batch, Floats
from ingest.measures.measures import Measures

LEARNED_EVERY_S = 60.0
"""Interval at which the engine passes what it has learned to the operator face. It also does so when it ends."""


STEPPED_S = 30.0
"""A difference of clocks larger than this means that the host's clock was set: no batch is so old."""


def arrivals_s(batch: Batch, host_s: float) -> dict[str, Floats]:
    """By vendor, when each message that a batch reflects arrived, by the host's clock, which is at `host_s` now.

    Messages that a newer one of the same robot replaced count as arrived with the first of them. A robot that is only
    repeated counts nothing.
    """
    by_vendor = {}
    ahead_s = host_s - batch.now_s
    ahead_s = ahead_s if abs(ahead_s) > STEPPED_S else 0.0
    newest_s, first_s = batch.arrival_s, batch.first_arrival_s
    numbers = {vendor: number for number, vendor in enumerate(dict.fromkeys(batch.vendors))}
    vendor_number = np.fromiter(map(numbers.__getitem__, batch.vendors), np.int64, len(batch))
    for vendor, number in numbers.items():
        rows = np.flatnonzero((vendor_number == number) & (batch.statuses > 0))
        arrived_s = np.concatenate([newest_s[rows], np.repeat(first_s[rows], batch.statuses[rows] - 1)])
        by_vendor[vendor] = arrived_s + ahead_s
    return by_vendor


def observe_latency(measures: Measures, arrivals_s: Mapping[str, Floats], now_s: float) -> None:
    """Observe the latency of messages, by vendor, whose advisories are published at `now_s`."""
    for vendor, arrived_s in arrivals_s.items():
        measures.observe("deconflict_message_to_advisory_seconds", (now_s - arrived_s).clip(0), vendor)
