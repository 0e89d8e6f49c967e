"""The question of one group of conflicts: its robots, and at which differences of holds each pair keeps apart."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from deconflict.advice.holds.hold_windows import DelayWindows, HoldWindow, NearbyRobots, PlannedRobot
from deconflict.advice.priorities import WEIGHT
from ingest.batch import Bools, Pair

Plan = dict[str, int]
"""By robot, its hold in units of `STEP_S`."""


class PlannedRobots(dict[str, PlannedRobot]):
    """By UUID, those of the robots near each other that were asked for: most never are."""

    def __init__(self, near: NearbyRobots) -> None:
        self.near = near
        self.present = frozenset(near.uuids)

    def __missing__(self, uuid: str) -> PlannedRobot:
        robot = self[uuid] = self.near.planned(self.near.uuids.index(uuid))
        return robot


@dataclass(slots=True)
class HoldProblem:
    """A connected group of conflicts, and the differences of holds at which each pair keeps apart."""

    planned: PlannedRobots
    window: HoldWindow
    delays: DelayWindows
    burdens_s: Mapping[str, float] = field(default_factory=dict)
    """By vendor, how long its robots have waited by advice before."""
    allowed: dict[Pair, Bools] = field(default_factory=dict)
    """(2 steps + 1,) by pair, for each difference of holds in ascending order."""
    hopeless: list[Pair] = field(default_factory=list)
    """Pairs that no hold keeps apart, and those of robots that are left out."""
    without_holds_s: dict[Pair, float] = field(default_factory=dict)
    """When the pairs of the robots in `allowed` first come together if nobody is held."""
    left_out: set[str] = field(default_factory=set)
    """Robots that the plan does not hold, because they need another route."""
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

    def keeps_apart(self, pair: Pair, holds: Plan) -> bool:
        """Whether these holds keep a constrained pair apart, by the grid of differences."""
        return bool(self.allowed[pair][self.window.steps + holds.get(pair[0], 0) - holds.get(pair[1], 0)])

    def forbid(self, pair: Pair, difference: int) -> None:
        """Forbid one difference of holds of a pair."""
        self.allowed[pair][difference + self.window.steps] = False
        self._set_allowed(pair, self.allowed[pair])

    def _set_allowed(self, pair: Pair, allowed: Bools) -> None:
        self.allowed[pair] = allowed
        if not allowed.any():
            del self.allowed[pair]
            self.hopeless.append(pair)

    def leave_out(self, robot: str, ring: Sequence[str]) -> list[Pair]:
        """Plan without holds of a robot, and without the pairs that it has with `ring`; returns these pairs."""
        pairs = [pair for pair in self.allowed if robot in pair and set(ring).issuperset(pair)]
        for pair in pairs:
            del self.allowed[pair]
        for pair, allowed in list(self.allowed.items()):
            if robot in pair:
                allowed[self.window.steps + 1 :] &= pair[0] != robot
                allowed[: self.window.steps] &= pair[1] != robot
                self._set_allowed(pair, allowed)
        self.hopeless += pairs
        self.planned[robot] = self.planned[robot]._replace(holdable=False)
        self.left_out.add(robot)
        return pairs

    def first_to_yield(self, robots: Sequence[str]) -> str | None:
        """Which of some robots should take another route: one that is left out anyway, then the one of the least
        priority, then of the least burdened vendor.

        None if all of them stand.
        """
        movers = [robot for robot in robots if self.planned[robot].holdable or robot in self.left_out]
        return min(movers, key=self.reluctance, default=None)

    def reluctance(self, robot: str) -> tuple[bool, int, float, str]:
        """The order in which robots yield."""
        return (
            robot not in self.left_out,
            self.weight(robot),
            self.burdens_s.get(self.planned[robot].vendor, 0.0),
            robot,
        )

    def pairs_together(self) -> set[Pair]:
        """The pairs that come together whatever the plan does."""
        return self.without_holds_s.keys() | set(self.hopeless)

    def robots(self) -> list[str]:
        return sorted({robot for pair in self.allowed for robot in pair})

    def weight(self, robot: str) -> int:
        """The cost of one step of a robot's hold."""
        return max(round(self.planned[robot].priority * WEIGHT), 1)

    def cost(self, plan: Plan) -> int:
        """In hundredths of `STEP_S`, weighted by priority."""
        return sum(self.weight(robot) * hold for robot, hold in plan.items())
