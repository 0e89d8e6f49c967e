"""The question of one group of conflicts: its robots, and at which differences of holds each pair keeps apart."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from deconflict.advice.hold_windows import DelayWindows, HoldWindow, NearbyRobots, PlannedRobot
from deconflict.advice.priorities import WEIGHT
from ingest.batch import Bools, Pair

Plan = dict[str, int]
"""By robot, its hold in units of `STEP_S`."""


class PlannedRobots(dict[str, PlannedRobot]):
    """By UUID, those of the robots near each other that were asked for: most never are."""

    def __init__(self, near: NearbyRobots) -> None:
        self._near = near

    def __missing__(self, uuid: str) -> PlannedRobot:
        robot = self[uuid] = self._near.planned(self._near.uuids.index(uuid))
        return robot


@dataclass(slots=True)
class HoldProblem:
    """A connected group of conflicts, and the differences of holds at which each pair keeps apart."""

    planned: PlannedRobots
    window: HoldWindow
    delays: DelayWindows
    allowed: dict[Pair, Bools] = field(default_factory=dict)
    """(2 steps + 1,) by pair, for each difference of holds in ascending order."""
    hopeless: list[Pair] = field(default_factory=list)
    """Pairs that no hold keeps apart."""
    without_holds_s: dict[Pair, float] = field(default_factory=dict)
    """When the pairs of the robots in `allowed` first come together if nobody is held."""
    _examined: set[str] = field(default_factory=set)
    """Robots whose pairs are in `without_holds_s`."""

    def constrain(self, pairs: Sequence[Pair]) -> None:
        """Add pairs that holds must keep apart."""
        steps = self.window.steps
        for pair, allowed in zip(pairs, self.delays.allowed(pairs) if pairs else (), strict=True):
            first, second = (self.planned[robot].holdable for robot in pair)
            if not first:
                allowed[steps + 1 :] = False
            if not second:
                allowed[:steps] = False
            self._set_allowed(pair, allowed)
        if new := set(self.robots()) - self._examined:
            self.without_holds_s |= self.delays.contacts_s({}, new)
            self._examined |= new

    def forbid(self, pair: Pair, difference: int) -> None:
        """Forbid one difference of holds of a pair."""
        self.allowed[pair][difference + self.window.steps] = False
        self._set_allowed(pair, self.allowed[pair])

    def _set_allowed(self, pair: Pair, allowed: Bools) -> None:
        self.allowed[pair] = allowed
        if not allowed.any():
            del self.allowed[pair]
            self.hopeless.append(pair)

    def robots(self) -> list[str]:
        return sorted({robot for pair in self.allowed for robot in pair})

    def weight(self, robot: str) -> int:
        """The cost of one step of a robot's hold."""
        return max(round(self.planned[robot].priority * WEIGHT), 1)

    def cost(self, plan: Plan) -> int:
        """In hundredths of `STEP_S`, weighted by priority."""
        return sum(self.weight(robot) * hold for robot, hold in plan.items())
