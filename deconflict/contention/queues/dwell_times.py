"""How long robots stay at each resource, learned from past dwells and a prior."""

from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from deconflict.runtime.learned_state import Form, Part, Seconds
from deconflict.settings.shared_places import PRIOR_SERVICE_S, Resource

MOST_DWELLS = 50
"""Kept for one resource; older ones are forgotten."""
SHORTEST_S = 3.0
"""A robot that is inside for less than this only passes through."""
PRIOR_WEIGHT = 3
"""The prior counts as this many dwells."""
FORM = Form("dwells in seconds by resource, the oldest first", {"dwells_s": dict[str, list[Seconds]]})


class DwellTimes:
    """The dwells at one resource."""

    def __init__(self, resource: Resource) -> None:
        self._given_s = resource.service_s
        """The service time that the site gives; None if it gives none."""
        self._prior_s = PRIOR_SERVICE_S[resource.kind]
        self._seen_s: deque[float] = deque(maxlen=MOST_DWELLS)

    def add(self, dwell_s: float) -> None:
        """Add the dwell of a robot that has left."""
        if dwell_s >= SHORTEST_S:
            self._seen_s.append(dwell_s)

    def learned(self) -> list[float]:
        """The dwells, the oldest first."""
        return list(self._seen_s)

    def resume(self, seen_s: Iterable[float]) -> None:
        """Continue from dwells that `learned` gave."""
        self._seen_s.extend(seen_s)

    @property
    def service_s(self) -> float:
        """The median dwell."""
        known = self._known_s()
        return known[len(known) // 2]

    def remaining_s(self, elapsed_s: float) -> float:
        """How much longer a robot stays that has been inside for `elapsed_s`: by the median of the longer dwells.

        A robot that has stayed longer than any before is expected to stay a quarter of a usual dwell more.
        """
        longer = [dwell_s for dwell_s in self._known_s() if dwell_s > elapsed_s]
        return longer[len(longer) // 2] - elapsed_s if longer else max(self.service_s / 4, SHORTEST_S)

    def _known_s(self) -> list[float]:
        if self._given_s is not None:
            return [self._given_s]
        return sorted([*self._seen_s, *(self._prior_s,) * PRIOR_WEIGHT])


@dataclass(frozen=True, slots=True)
class LearnedDwells:
    """The dwells at all resources, as they are kept over a restart."""

    dwells: Mapping[str, DwellTimes]
    """By resource."""

    def learned(self) -> Part:
        return FORM.part({"dwells_s": {resource: dwells.learned() for resource, dwells in self.dwells.items()}})

    def resume(self, part: Part) -> None:
        """Continue from what `learned` gave, but for resources that are no more. Raises `UnreadableError`."""
        seen_s = FORM.checked(part)["dwells_s"]
        for resource in seen_s.keys() & self.dwells.keys():
            self.dwells[resource].resume(seen_s[resource])
