"""How many messages a second each vendor sends, over the last minute."""

from collections import deque
from collections.abc import Mapping
from math import inf

from ingest.measures.measures import Labels

OBSERVE_EVERY_S = 5.0
KEPT = 13
"""Observations that are kept. The oldest is a minute old."""


class MessageRates:
    """Observes the counted messages every five seconds."""

    def __init__(self) -> None:
        self._observations: deque[tuple[float, dict[str, float]]] = deque(maxlen=KEPT)
        """Times, and the messages of each vendor by then."""

    def observe(self, now_s: float, counted: Mapping[Labels, float]) -> None:
        """Add the messages counted by now, by vendor and result, if five seconds have passed."""
        observed_s = self._observations[-1][0] if self._observations else -inf
        if now_s < observed_s:
            self._observations.clear()
            observed_s = -inf
        if now_s - observed_s >= OBSERVE_EVERY_S:
            totals: dict[str, float] = {}
            for (vendor, _), count in counted.items():
                totals[vendor] = totals.get(vendor, 0.0) + count
            self._observations.append((now_s, totals))

    def per_s(self) -> dict[Labels, float]:
        """Messages a second by vendor. Empty before the second observation."""
        if len(self._observations) < 2:
            return {}
        (from_s, before), (to_s, now) = self._observations[0], self._observations[-1]
        return {(vendor,): (count - before.get(vendor, 0.0)) / (to_s - from_s) for vendor, count in now.items()}
