"""Right of way at crossings within a fleet: its manager admits robots together only if their paths do not touch.

Otherwise queues from four sides block each other. Fleets do not know of each other.

A robot looks before it enters a crossing: who is in it, and whether there is room beyond. It waits at the line for a
robot of another fleet that stands in the crossing or drives across it, and while a robot stands where it would leave
the crossing. Two robots that reach their lines at the same time do not see each other.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from deconflict.simulation.driving.protection import FLOOR_M, NOBODY, Traffic, centres
from deconflict.simulation.driving.routes import Drive
from deconflict.simulation.floor_layout import Layout, Place
from ingest.batch import Bools, Floats, Ints

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


BOX_M = 1.9
"""Half side of the square that counts as the crossing."""
EXIT_M, NEAR_EXIT_M = 0.7, 1.1
"""How far beyond the crossing a robot needs room, and the radius there in which nobody may stand."""
LOOKS_FROM_M, LOOKS_TO_M = 1.4, -0.05
"""Range of the distance to its line in which a robot checks."""
AROUND_M = 5.0
"""Robots in a crossing, or where another leaves it, are within this distance of its middle."""
STANDING_MPS = 0.15
ALONG_COS = 0.8
"""A robot that drives in the same or the opposite direction is not in the way."""
LONGEST_S = 12.0
"""A robot that has waited at its line for this long enters."""


class CrossingEntry:
    """The lines at which robots wait before crossings."""

    def __init__(self, crossings: Crossings, places: Sequence[Place], robots: int) -> None:
        """`places` are the middles of the crossings, by the number of their node."""
        self._crossings, self._places = crossings, np.array(places).reshape(-1, 2)
        self._passed_m = np.full(robots, -np.inf)
        """(n,) progress of the line at which each has waited for long enough."""

    def limits(self, seen: Traffic, driving: Bools, waited_s: Floats) -> tuple[Floats, Ints]:
        """(n,) how far each may drive, inf if its crossing is clear, and (n,) for whom it waits."""
        line_m, waits_for = np.full(len(driving), np.inf), np.full(len(driving), NOBODY)
        to_line_m = self._crossings.enter_m - seen.progress_m
        asks = driving & (to_line_m <= LOOKS_FROM_M) & (to_line_m >= LOOKS_TO_M)
        asks &= self._passed_m != self._crossings.enter_m
        rows = np.flatnonzero(asks)
        if not len(rows):
            return line_m, waits_for
        who, whom = self._in_way(seen, rows)
        tired = waited_s[who] > LONGEST_S
        self._passed_m[who[tired]] = self._crossings.enter_m[who[tired]]
        waits_for[who[~tired]] = whom[~tired]
        line_m[who[~tired]] = np.maximum(to_line_m[who[~tired]], 0.0)
        return line_m, waits_for

    def reset(self, robot: int) -> None:
        """Forget the line of a robot that starts another drive."""
        self._passed_m[robot] = -np.inf

    def _in_way(self, seen: Traffic, rows: Ints) -> tuple[Ints, Ints]:
        """(p,) robots at their lines, and (p,) the others for which they wait."""
        ahead = [self._crossings.ahead[robot][0] for robot in rows.tolist()]
        middle = self._places[[passage.node for passage in ahead]].T
        out = seen.tracks.poses(rows, np.array([passage.leave_m for passage in ahead]) + EXIT_M)[:2]
        here = centres(seen, np.arange(len(seen.floor)), seen.progress_m)
        points = np.column_stack([here[0] + FLOOR_M * seen.floor, here[1]])
        asked = np.column_stack([middle[0] + FLOOR_M * seen.floor[rows], middle[1]])
        found = cKDTree(asked).query_ball_tree(cKDTree(points), AROUND_M)
        which = np.repeat(np.arange(len(rows)), [len(near) for near in found])
        whom = np.array([other for near in found for other in near], np.int64)
        who = rows[which]
        standing = np.abs(seen.speed_mps[whom]) < STANDING_MPS
        along = np.abs(np.cos(here[2, whom] - here[2, who])) > ALONG_COS
        dx_m, dy_m = here[:2, whom] - middle[:, which]
        inside = (np.maximum(np.abs(dx_m), np.abs(dy_m)) < BOX_M) & (standing | ~along)
        beyond = standing & (np.hypot(*(here[:2, whom] - out[:, which])) < NEAR_EXIT_M)
        in_way = ((inside & (seen.fleet[whom] != seen.fleet[who])) | beyond) & (who != whom)
        return who[in_way], whom[in_way]
