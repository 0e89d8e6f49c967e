"""Right of way at crossings within a fleet: its manager opens only ways together that do not meet.

Otherwise queues from four sides lock each other in. Fleets do not know of each other.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from deconflict.simulation.driving.routes import Drive
from deconflict.simulation.floor_layout import Layout
from ingest.batch import Floats, Ints

BEFORE_M, AFTER_M = 2.6, 2.2
"""A crossing is entered and left so far from its middle."""
ASK_M = 2.5
"""A robot asks for its way so far ahead of a crossing."""
NOBODY = -1


@dataclass(frozen=True, slots=True)
class Passage:
    """One crossing on a drive."""

    node: int
    enter_m: float
    leave_m: float
    inward: tuple[int, int]
    """Direction in which it is entered, as signs of x and y."""
    left: bool

    def meets(self, other: "Passage") -> bool:
        """Whether two ways through one crossing touch: not those from one side, nor opposite ones but left turns."""
        ahead = self.inward[0] * other.inward[0] + self.inward[1] * other.inward[1]
        return ahead == 0 or (ahead < 0 and (self.left or other.left))


def passages(layout: Layout, nodes: Sequence[int], drive: Drive) -> list[Passage]:
    """The crossings that a drive along `nodes` comes through, in order."""
    found, leave = [], 0
    for before, node, after in zip(nodes, nodes[1:], nodes[2:], strict=False):
        if node not in layout.crossings:
            continue
        (ax, ay), (x, y), (bx, by) = (layout.places[one] for one in (before, node, after))
        inward, outward = (_sign(x - ax), _sign(y - ay)), (_sign(bx - x), _sign(by - y))
        dx, dy = drive.x_m - x, drive.y_m - y
        close = np.hypot(dx, dy) < 2 * BEFORE_M
        close[:leave] = False
        enter = int(np.argmax(close & (dx * inward[0] + dy * inward[1] > -BEFORE_M)))
        leave = enter + int(np.argmax(close[enter:] & ((dx * outward[0] + dy * outward[1])[enter:] > AFTER_M)))
        left = inward[0] * outward[1] - inward[1] * outward[0] > 0
        found.append(Passage(node, drive.step_m * enter, drive.step_m * leave, inward, left))
    return found


def _sign(value: float) -> int:
    return (value > 0) - (value < 0)


class Crossings:
    """Who is in which crossing, and where everybody else of that fleet has to stop."""

    def __init__(self, fleet: Ints) -> None:
        """`fleet` is that of each of n robots."""
        robots = len(fleet)
        self._fleet = fleet.tolist()
        self._ahead: list[list[Passage]] = [[] for _ in range(robots)]
        self._inside: dict[tuple[int, int], dict[int, Passage]] = {}
        """By fleet and crossing."""
        self.stop_m = np.full(robots, np.inf)
        """(n,) progress at which each has to stop."""
        self.waits_for = np.full(robots, NOBODY)
        """(n,) somebody in the crossing that a robot waits for."""
        self.enter_m = np.full(robots, np.inf)
        """(n,) progress at which each comes into the next crossing."""
        self._event_m = np.full(robots, np.inf)
        """(n,) progress from which there is something to decide."""
        self.back_to_m = np.zeros(robots)
        """(n,) progress that a robot may back to without coming into a crossing that it has left."""

    def put(self, robot: int, ahead: list[Passage]) -> None:
        """A robot sets out on a drive with these crossings."""
        self._ahead[robot], self.back_to_m[robot] = ahead, 0.0
        self._close(robot)

    def update(self, progress_m: Floats, going: Ints) -> None:
        """Let robots in and note who is out; `going` are the rows of those that drive."""
        for robot in going[progress_m[going] >= self._event_m[going]]:
            one = self._ahead[robot][0]
            inside = self._holders(robot, one)
            if robot in inside:
                del inside[robot], self._ahead[robot][0]
                self.back_to_m[robot] = one.leave_m
                self._close(robot)
            elif in_way := [holder for holder, other in inside.items() if one.meets(other)]:
                self.waits_for[robot] = in_way[0]
            else:
                inside[int(robot)] = one
                self.stop_m[robot], self.waits_for[robot], self._event_m[robot] = np.inf, NOBODY, one.leave_m

    def give_way(self, robot: int, progress_m: float) -> None:
        """A robot that has backed out of a crossing asks again."""
        if self._ahead[robot] and progress_m < self._ahead[robot][0].enter_m:
            self._holders(robot, self._ahead[robot][0]).pop(robot, None)
            self._close(robot)

    def next(self, robot: int) -> Passage:
        """The crossing that a robot is in or comes to; there is one where `enter_m` is finite."""
        return self._ahead[robot][0]

    def ahead(self, robot: int) -> list[Passage]:
        """The crossings that a robot is in or has still to come through, in order."""
        return self._ahead[robot]

    def is_inside(self, robot: int) -> bool:
        """Whether its fleet has let a robot into the first of them."""
        return bool(self._ahead[robot]) and robot in self._holders(robot, self._ahead[robot][0])

    def _holders(self, robot: int, passage: Passage) -> dict[int, Passage]:
        return self._inside.setdefault((self._fleet[robot], passage.node), {})

    def _close(self, robot: int) -> None:
        enter_m = self._ahead[robot][0].enter_m if self._ahead[robot] else np.inf
        self.enter_m[robot] = enter_m
        self.stop_m[robot], self._event_m[robot], self.waits_for[robot] = enter_m, enter_m - ASK_M, NOBODY
