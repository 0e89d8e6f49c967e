"""Congestion: flow and density of each zone, and how near the zone is to saturation."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from math import exp

from deconflict.contention.robots.robot_view import RobotView
from deconflict.sweep.geometry.heights import largest_group_at_one_height

MEMORY_S = 300.0
"""Flow and density are means over about this time."""
ENOUGH_S = 60.0
"""The flow of a density is known once it was seen for this long."""


@dataclass(slots=True)
class ZoneFlow:
    """Flow and density of one zone."""

    capacity: int
    robots: float = 0.0
    """Mean number of robots inside."""
    flow_per_s: float = 0.0
    """Mean number of robots that leave in a second."""
    by_density: dict[int, tuple[float, float]] = field(default_factory=dict)
    """By number of robots inside: how long there were that many, and how many left meanwhile. Both decay."""

    def add_interval(self, dt_s: float, inside: int, left: int) -> None:
        """Add `dt_s` seconds in which `inside` robots were inside and `left` robots left."""
        keep = exp(-dt_s / MEMORY_S)
        self.robots = keep * self.robots + (1 - keep) * inside
        self.flow_per_s = keep * self.flow_per_s + (1 - keep) * left / dt_s
        time_s, gone = self.by_density.get(inside, (0.0, 0.0))
        slowly = exp(-dt_s / (20 * MEMORY_S))
        self.by_density[inside] = slowly * time_s + dt_s, slowly * gone + left

    @property
    def saturation(self) -> float:
        """Mean number inside, divided by the number at which flow is greatest: above 1, more robots mean no more flow.

        Until that number is known, it is the zone's capacity.
        """
        flows = {k: gone / time_s for k, (time_s, gone) in self.by_density.items() if k and time_s >= ENOUGH_S}
        best = max(flows, key=lambda k: (flows[k], -k)) if len(flows) > 1 else self.capacity
        return self.robots / max(best, 1)


class ZoneFlows:
    """The flow of every zone, from the robots' passages."""

    def __init__(self, capacities: Mapping[str, int]) -> None:
        """`capacities` are the capacities of the zones, by id."""
        self.by_zone = {zone: ZoneFlow(capacity) for zone, capacity in capacities.items()}
        self._inside: dict[str, set[str]] = {zone: set() for zone in capacities}
        """By zone, the robots inside at the last look."""
        self._groups: dict[str, set[str]] = {zone: set() for zone in capacities}
        """By zone, the largest group of them at one height."""

    def is_inside(self, uuid: str, zone: str) -> bool:
        """Whether a robot was in a zone at the last look."""
        return uuid in self._inside[zone]

    def update(self, passing: Iterable[RobotView], now_s: float, dt_s: float) -> None:
        """Add the `dt_s` seconds since the last look; `passing` are all robots with a zone on their way."""
        inside: dict[str, list[RobotView]] = {zone: [] for zone in self.by_zone}
        for robot in passing:
            for zone, passage in robot.passages.items():
                if passage.is_inside(now_s):
                    inside[zone].append(robot)
        for zone, flow in self.by_zone.items():
            group = largest_group_at_one_height(inside[zone])
            self._inside[zone] = {robot.uuid for robot in inside[zone]}
            flow.add_interval(dt_s, len(group), len(self._groups[zone] - self._inside[zone]))
            self._groups[zone] = {robot.uuid for robot in group}
