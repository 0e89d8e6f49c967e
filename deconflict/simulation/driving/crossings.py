"""Right of way at crossings within a fleet: its manager admits robots together only if their paths do not touch.

Otherwise queues from four sides block each other. Fleets do not know of each other.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from deconflict.simulation.driving.protection import NOBODY
from deconflict.simulation.driving.routes import Drive
from deconflict.simulation.floor_layout import Layout, Place
from ingest.batch import Floats, Ints

BEFORE_M, AFTER_M = 2.6, 2.2
"""Distances from the middle of a crossing at which it is entered and left."""
ASK_M = 2.5
"""A robot requests a crossing at this distance before it."""
ALL = 0
"""Stands for all fleets where their robots keep one order."""

Direction = tuple[int, int]
"""Signs of x and y."""


@dataclass(frozen=True, slots=True)
class CrossingPassage:
    """One crossing on a drive."""

    node: int
    """Number of the crossing's node."""
    enter_m: float
    """Progress along the drive at which the robot enters it."""
    leave_m: float
    """Progress at which it has left it."""
    inward: Direction
    """Direction in which it is entered."""
    left: bool
    """Whether the robot turns left there."""

    def meets(self, other: "CrossingPassage") -> bool:
        """Whether two paths through one crossing touch. Paths from the same side do not, nor opposite ones without left
        turns."""
        ahead = self.inward[0] * other.inward[0] + self.inward[1] * other.inward[1]
        return ahead == 0 or (ahead < 0 and (self.left or other.left))


def passages(layout: Layout, nodes: Sequence[int], drive: Drive) -> list[CrossingPassage]:
    """The crossings on a drive along `nodes`, in order."""
    found, leave = [], 0
    for before, node, after in zip(nodes, nodes[1:], nodes[2:], strict=False):
        if node not in layout.crossings:
            continue
        (ax, ay), (x, y), (bx, by) = (layout.places[number] for number in (before, node, after))
        inward, outward = (_sign(x - ax), _sign(y - ay)), (_sign(bx - x), _sign(by - y))
        enter, leave = _span(drive, (x, y), inward, outward, leave)
        found.append(passage_of(drive, node, (enter, leave), inward, outward))
    return found


def passage_of(
    drive: Drive, node: int, span: tuple[int, int], inward: Direction, outward: Direction
) -> CrossingPassage:
    """One crossing on a drive, which it enters and leaves at these samples and in these directions."""
    left = inward[0] * outward[1] - inward[1] * outward[0] > 0
    return CrossingPassage(node, drive.step_m * span[0], drive.step_m * span[1], inward, left)


def _span(drive: Drive, middle: Place, inward: Direction, outward: Direction, after: int) -> tuple[int, int]:
    """The samples, from `after` on, at which a drive enters and leaves the crossing at `middle`."""
    dx, dy = drive.x_m - middle[0], drive.y_m - middle[1]
    close = np.hypot(dx, dy) < 2 * BEFORE_M
    close[:after] = False
    enter = int(np.argmax(close & (dx * inward[0] + dy * inward[1] > -BEFORE_M)))
    leave = enter + int(np.argmax(close[enter:] & ((dx * outward[0] + dy * outward[1])[enter:] > AFTER_M)))
    return enter, leave


def _sign(value: float) -> int:
    return (value > 0) - (value < 0)


class Crossings:
    """Which robots are in which crossing, and where other robots of their fleet have to stop."""

    def __init__(self, fleet: Ints) -> None:
        """`fleet` (n,) is the fleet of each robot."""
        robots = len(fleet)
        self._fleet = fleet.tolist()
        self.shared: frozenset[int] = frozenset()
        """Crossings with one order for the robots of all fleets."""
        self.ahead: list[list[CrossingPassage]] = [[] for _ in range(robots)]
        """By robot, the crossing that it is in and those still ahead, in order."""
        self._inside: dict[tuple[int, int], dict[int, CrossingPassage]] = {}
        """By fleet and crossing."""
        self.stop_m = np.full(robots, np.inf)
        """(n,) progress at which each has to stop."""
        self.waits_for = np.full(robots, NOBODY)
        """(n,) a robot in the crossing for which each robot waits."""
        self.enter_m = np.full(robots, np.inf)
        """(n,) progress at which each enters the next crossing."""
        self._event_m = np.full(robots, np.inf)
        """(n,) progress from which a decision is due."""
        self.back_to_m = np.zeros(robots)
        """(n,) progress to which a robot may back without entering a crossing that it has left."""

    def set_drive(self, robot: int, ahead: list[CrossingPassage]) -> None:
        """Set the crossings of the drive that a robot starts."""
        self.ahead[robot], self.back_to_m[robot] = ahead, 0.0
        self._close(robot)

    def update(self, progress_m: Floats, going: Ints) -> None:
        """Admit robots to crossings, and remove those that have left. `going` are the rows of driving robots."""
        for robot in going[progress_m[going] >= self._event_m[going]]:
            passage = self.ahead[robot][0]
            inside = self._holders(robot, passage)
            if robot in inside:
                del inside[robot], self.ahead[robot][0]
                self.back_to_m[robot] = passage.leave_m
                self._close(robot)
            elif in_way := [holder for holder, other in inside.items() if passage.meets(other)]:
                self.waits_for[robot] = in_way[0]
            else:
                inside[int(robot)] = passage
                self.stop_m[robot], self.waits_for[robot], self._event_m[robot] = np.inf, NOBODY, passage.leave_m

    def give_way(self, robot: int, progress_m: float) -> None:
        """A robot that has backed out of a crossing must request it again."""
        if self.ahead[robot] and progress_m < self.ahead[robot][0].enter_m:
            self._holders(robot, self.ahead[robot][0]).pop(robot, None)
            self._close(robot)

    def is_inside(self, robot: int) -> bool:
        """Whether its fleet has admitted a robot to the first of them."""
        return bool(self.ahead[robot]) and robot in self._holders(robot, self.ahead[robot][0])

    def _holders(self, robot: int, passage: CrossingPassage) -> dict[int, CrossingPassage]:
        fleet = self._fleet[robot]
        return self._inside.setdefault((ALL if fleet >= 0 and passage.node in self.shared else fleet, passage.node), {})

    def _close(self, robot: int) -> None:
        enter_m = self.ahead[robot][0].enter_m if self.ahead[robot] else np.inf
        self.enter_m[robot] = enter_m
        self.stop_m[robot], self._event_m[robot], self.waits_for[robot] = enter_m, enter_m - ASK_M, NOBODY
