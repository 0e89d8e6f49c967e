"""How many messages a second each vendor sends, over the last minute."""

from collections import deque
from collections.abc import Mapping
from math import inf

from ingest.measures.measures import Labels

LOOK_S = 5.0
LOOKS = 13
"""Kept, the oldest a minute old."""


class MessageRates:
    """Looks at what has been counted, now and then."""

    def __init__(self) -> None:
        self._looks: deque[tuple[float, dict[str, float]]] = deque(maxlen=LOOKS)

    def look(self, now_s: float, counted: Mapping[Labels, float]) -> None:
        """Take in the messages counted by now, by vendor and result, if a look is due."""
        looked_s = self._looks[-1][0] if self._looks else -inf
        if now_s < looked_s:
            self._looks.clear()
            looked_s = -inf
        if now_s - looked_s >= LOOK_S:
            totals: dict[str, float] = {}
            for (vendor, _), count in counted.items():
                totals[vendor] = totals.get(vendor, 0.0) + count
            self._looks.append((now_s, totals))

    def per_s(self) -> dict[Labels, float]:
        """By vendor; nothing before there were two looks."""
        if len(self._looks) < 2:
            return {}
        (from_s, before), (to_s, now) = self._looks[0], self._looks[-1]
        return {(vendor,): (count - before.get(vendor, 0.0)) / (to_s - from_s) for vendor, count in now.items()}
