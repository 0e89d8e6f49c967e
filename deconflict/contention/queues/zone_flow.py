"""Congestion: how flow goes with density in each zone, and how near the zone is to saturation."""

from dataclasses import dataclass, field
from math import exp

MEMORY_S = 300.0
"""Flow and density are means over about this time."""
ENOUGH_S = 60.0
"""A density that was seen for less than this says nothing of its flow yet."""


@dataclass(slots=True)
class Flow:
    """One zone. `counts[k]` is for how long k robots were in it, and how many left it meanwhile; both decay."""

    capacity: int
    robots: float = 0.0
    """Mean number of robots inside."""
    flow_per_s: float = 0.0
    """Robots that leave it a second, mean."""
    counts: dict[int, tuple[float, float]] = field(default_factory=dict)

    def step(self, dt_s: float, inside: int, left: int) -> None:
        """So many were inside for `dt_s`, and so many left."""
        keep = exp(-dt_s / MEMORY_S)
        self.robots = keep * self.robots + (1 - keep) * inside
        self.flow_per_s = keep * self.flow_per_s + (1 - keep) * left / dt_s
        time_s, gone = self.counts.get(inside, (0.0, 0.0))
        slowly = exp(-dt_s / (20 * MEMORY_S))
        self.counts[inside] = slowly * time_s + dt_s, slowly * gone + left

    @property
    def saturation(self) -> float:
        """Mean number inside over the number at which flow is greatest: at 1, more robots no longer mean more flow.

        Until that has been seen, the zone's capacity is taken for it.
        """
        flows = {k: gone / time_s for k, (time_s, gone) in self.counts.items() if k and time_s >= ENOUGH_S}
        best = max(flows, key=lambda k: (flows[k], -k)) if len(flows) > 1 else self.capacity
        return self.robots / max(best, 1)
