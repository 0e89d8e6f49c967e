"""At most about one new advice for people a minute, over the whole floor: the most severe first, then the oldest.

Pure.
"""

from math import inf

from deconflict.advisories.severity import SEVERITIES
from deconflict_client.advisory import Severity

BETWEEN_S = 60.0
"""People are asked for something new so long after the last time."""
WAITS_S = 2.5
"""A situation that has not asked for a turn for so long does not wait for one any more."""
Rank = tuple[int, float]


class PeopleTurns:
    """Which situation may ask people for something new. What stands may change without a turn."""

    def __init__(self) -> None:
        self._asked_s = -inf
        """When people were last asked for something new."""
        self._waiting: dict[str, tuple[Rank, float]] = {}
        """By id of a situation that waits: its rank, the highest is next, and when it last asked for a turn."""

    def take(self, situation_id: str, severity: Severity, raised_s: float, now_s: float) -> bool:
        """Whether a situation may ask people now. It asks again at each look until it may."""
        self._waiting[situation_id] = (SEVERITIES.index(severity), -raised_s), now_s
        self._waiting = {name: each for name, each in self._waiting.items() if abs(now_s - each[1]) < WAITS_S}
        is_next = max(self._waiting, key=lambda name: self._waiting[name][0]) == situation_id
        if not is_next or 0.0 <= now_s - self._asked_s < BETWEEN_S:
            return False
        self._asked_s = now_s
        del self._waiting[situation_id]
        return True
