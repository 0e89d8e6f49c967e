"""How long messages wait from their arrival until the engine has decided on them."""

from collections.abc import Mapping

import numpy as np

from ingest.batch import Batch, Floats
from ingest.measures.measures import Measures

LEARNED_EVERY_S = 60.0
"""What was learned is handed to the operator face so often, and at the end."""


STEPPED_S = 30.0
"""A batch is never so old: the host's clock has been set, and the service's goes on."""


def arrivals_s(batch: Batch, host_s: float) -> dict[str, Floats]:
    """When each message that the batch reflects arrived, by vendor, by the host's clock, which says `host_s` now.

    Those that a newer one of the same robot has replaced count as long as the first of them; a robot that is only told
    again counts nothing.
    """
    by_vendor = {}
    ahead_s = host_s - batch.now_s
    ahead_s = ahead_s if abs(ahead_s) > STEPPED_S else 0.0
    newest_s, first_s = batch.arrival_s, batch.first_arrival_s
    numbers = {vendor: number for number, vendor in enumerate(dict.fromkeys(batch.vendors))}
    said_by = np.fromiter(map(numbers.__getitem__, batch.vendors), np.int64, len(batch))
    for vendor, number in numbers.items():
        rows = np.flatnonzero((said_by == number) & (batch.statuses > 0))
        arrived_s = np.concatenate([newest_s[rows], np.repeat(first_s[rows], batch.statuses[rows] - 1)])
        by_vendor[vendor] = arrived_s + ahead_s
    return by_vendor


def note_waits(measures: Measures, arrivals_s: Mapping[str, Floats], now_s: float) -> None:
    """How long messages that arrived then, by vendor, took until what they led to is told."""
    for vendor, arrived_s in arrivals_s.items():
        measures.observe("deconflict_message_to_advisory_seconds", (now_s - arrived_s).clip(0), vendor)
