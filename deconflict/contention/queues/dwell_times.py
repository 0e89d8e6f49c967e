"""How long robots keep each resource: learned from what is seen, from a prior on."""

from collections import deque
from collections.abc import Iterable

from deconflict.settings.shared_places import PRIOR_SERVICE_S, Resource

MOST_DWELLS = 50
"""Kept of one resource; older ones are forgotten."""
SHORTEST_S = 3.0
"""A robot that is inside for less than this only passed through."""
PRIOR_WEIGHT = 3
"""The prior counts as so many dwells."""


class Dwells:
    """Of one resource."""

    def __init__(self, resource: Resource) -> None:
        self._given_s = resource.service_s
        self._prior_s = PRIOR_SERVICE_S[resource.kind]
        self._seen_s: deque[float] = deque(maxlen=MOST_DWELLS)

    def left_after(self, dwell_s: float) -> None:
        """A robot has left that was inside for so long."""
        if dwell_s >= SHORTEST_S:
            self._seen_s.append(dwell_s)

    def learned(self) -> list[float]:
        """Stays seen, oldest first."""
        return list(self._seen_s)

    def resume(self, seen_s: Iterable[float]) -> None:
        """Go on with stays that were seen before."""
        self._seen_s.extend(seen_s)

    @property
    def service_s(self) -> float:
        """The middle of how long robots stay."""
        known = self._known_s()
        return known[len(known) // 2]

    def remaining_s(self, elapsed_s: float) -> float:
        """How much longer a robot stays that has been inside for so long: the middle of those dwells that were longer.

        One that has outstayed them all is expected to go on for a quarter of a usual stay.
        """
        longer = [dwell_s for dwell_s in self._known_s() if dwell_s > elapsed_s]
        return longer[len(longer) // 2] - elapsed_s if longer else max(self.service_s / 4, SHORTEST_S)

    def _known_s(self) -> list[float]:
        if self._given_s is not None:
            return [self._given_s]
        return sorted([*self._seen_s, *(self._prior_s,) * PRIOR_WEIGHT])
