"""Where a robot is sent by what it is asked: on its way, or aside, off the way of the robot that it lets through."""

from collections.abc import Collection, Iterable
from math import cos, inf, pi, sin
from typing import NamedTuple

import numpy as np

from deconflict.adviser.asked import Option
from deconflict.adviser.ground.seen_ground import SeenGround, size_of
from deconflict.adviser.ground.tracks import ROOM_M, BarredGround, Tracks, other_bodies
from deconflict.adviser.ways import BESIDE_M, Boxes, Point, Ways, touch_any, wanted_ways
from deconflict.contention.robots.lookahead import STEP_S, STEPS
from deconflict.contention.robots.robot_table import RobotTable
from deconflict.settings.site import Site
from deconflict_client.verbs import Side, Verb
from ingest.batch import Floats

STEP_M, FARTHEST_M = 0.25, 4.0
DIRECTIONS = 16
BEHIND_RAD = 0.6
"""Nobody steps aside more nearly backwards: that is backing out."""


def aside_m(
    robots: RobotTable, robot: str, passing: Ways, others: Boxes, barred: BarredGround, seen: SeenGround
) -> Point | None:
    """The nearest place, to its right if two are as near, to which a robot can move as it stands now, without turning:
    past no body of `others` (m,), only over ground where a body as large was seen and that is not barred, and to where
    it touches none of the ways of those that are to pass. None if there is none."""
    size, (x_m, y_m, yaw_rad) = robots[robot], robots.reported_pose(robot)
    directions_rad = yaw_rad + _directions_rad()
    away_m = np.arange(1, round(FARTHEST_M / STEP_M) + 1) * STEP_M
    to_x_m, to_y_m = (at_m + turn(directions_rad)[:, None] * away_m for at_m, turn in ((x_m, np.cos), (y_m, np.sin)))
    shape = to_x_m.shape
    poses = np.column_stack([to_x_m.ravel(), to_y_m.ravel(), np.full(to_x_m.size, yaw_rad)])
    body = _boxes(poses, size.length_m, size.width_m, 0.0)
    is_free = ~touch_any(_boxes(poses, size.length_m, size.width_m, BESIDE_M), others)
    is_free &= ~barred.bars_driving(size.datum, body) & seen.holds(size.datum, size_of(robots, robot), body)
    reachable = np.logical_and.accumulate(is_free.reshape(shape), axis=1)
    ways = Boxes._make(column.reshape(-1) for column in passing.boxes)
    is_off = ~touch_any(_boxes(poses, size.length_m, size.width_m, ROOM_M), ways)
    is_off &= ~barred.bars_standing(size.datum, body)
    found = np.flatnonzero((reachable & is_off.reshape(shape)).T)
    if not len(found):
        return None
    step, direction = divmod(int(found[0]), len(directions_rad))
    return round(float(to_x_m[direction, step]), 2), round(float(to_y_m[direction, step]), 2)


def _directions_rad() -> Floats:
    """Off the heading; those straight across first."""
    all_rad = np.arange(DIRECTIONS) * 2 * pi / DIRECTIONS - pi
    ahead_rad = all_rad[np.abs(all_rad) < pi - BEHIND_RAD]
    return ahead_rad[np.lexsort((ahead_rad, np.abs(np.abs(ahead_rad) - pi / 2).round(6)))]


def _boxes(poses: Floats, length_m: float, width_m: float, room_m: float) -> Boxes:
    halves = (np.full(len(poses), size_m / 2 + room_m) for size_m in (length_m, width_m))
    return Boxes(*poses.T, *halves)


SEARCHED: tuple[Verb, ...] = ("back_out", "step_aside")
"""Verbs for which a place is searched for."""
SEARCHED_S, SEARCHES = 2.0, 6
"""Where no place was found, it is not searched again for this time; and so many searches in a step."""
FINDS = 100
"""So many places, of any verb, are looked for in a step."""
WHOLE_WAY_M = 20.0
"""A robot makes room where the other, which passes, will not come on the next metres of its way."""
SIDES: tuple[Side, Side] = ("right", "left")
"""If both are free and as near, robots keep right, so that two that do so do not meet again."""


class Goal(NamedTuple):
    at_m: Point | None = None
    """Where to go, or what not to pass; None if there is no such place."""
    side: Side | None = None
    """On which side of the other, seen along the way of the robot; None if that is left to the robot."""
    beside_m: Point | None = None
    """The point beside the other on this side that it drives over."""


class Goals:
    """Finds them by where robots are and were, and by the site file."""

    def __init__(self, site: Site) -> None:
        """`site` says onto which ground nobody is sent."""
        self._barred, self.seen = BarredGround(site), SeenGround(site)
        self._tracks = Tracks(self._barred, self.seen)
        self._searched_s: dict[tuple[str, Verb], float] = {}
        """By robot and verb: when a place to go to was searched for."""
        self._searches_left, self._finds_left = SEARCHES, FINDS
        self._left_out: set[str] = set()
        self._first: set[str] = set()
        """The robots for which no place was looked for any more, in this step and in the one before."""

    def begin_step(self) -> None:
        self._searches_left, self._finds_left = SEARCHES, FINDS
        self._first, self._left_out = (self._first & self._left_out) or self._left_out, set()

    def is_spent(self, robots: Iterable[str]) -> bool:
        """Whether no more places are looked for in this step. If so, these robots come first in the next one."""
        if not self._finds_left:
            self._left_out.update(robots)
        return not self._finds_left

    def come_later(self, robots: Iterable[str]) -> bool:
        """Whether none of these robots was left out in the step before."""
        return self._first.isdisjoint(robots)

    def receive(self, robots: RobotTable, updated: Iterable[str]) -> None:
        """Robots were updated."""
        self.seen.add(robots, self._tracks.observe(robots, updated))

    def forget(self, robots: Iterable[str]) -> None:
        """Robots have left."""
        self._tracks.forget(robots)
        for uuid in robots:
            for verb in SEARCHED:
                self._searched_s.pop((uuid, verb), None)

    def turn(self, robots: Collection[str]) -> tuple[bool, float]:
        """Sorts groups of robots: those that were left out come first, then those that wait for a place for longest."""
        searched_s = max(self._searched_s.get((robot, verb), -inf) for robot in robots for verb in SEARCHED)
        return self.come_later(robots), searched_s

    def find(self, option: Option, way_rad: float, robots: RobotTable, now_s: float) -> Goal | None:
        """The place of what a robot could be asked for. None if it cannot be asked because there is none. `way_rad` is
        where its way leads where the other is."""
        if option.verb == "other_way":
            return Goal(robots.reported_pose(option.other)[:2])
        if option.verb != "go_around" and option.verb not in SEARCHED:
            return Goal()
        if self.is_spent((option.robot,)):
            return None
        self._finds_left -= 1
        if option.verb == "go_around":
            return self._beside(option, way_rad, robots)
        at_m = self._room_m(option, robots, now_s)
        return Goal(at_m) if at_m else None

    def _beside(self, option: Option, way_rad: float, robots: RobotTable) -> Goal | None:
        """The side on which nothing is known to be in the way, and a body as large was seen. None if both are barred
        or occupied. Without a side if no such body was seen on either: there its own sensors decide."""
        sides, floor = _sides(robots, option, way_rad), robots[option.robot].datum
        slots = robots.slots.find((option.robot, option.other)).tolist()
        is_open = ~self._barred.bars_driving(floor, sides) & ~touch_any(sides, other_bodies(robots, *slots))
        if not is_open.any():
            return None
        is_known = is_open & self.seen.holds(floor, size_of(robots, option.robot), sides)
        if not is_known.any():
            return Goal()
        row = int(np.where(is_known, _aside_m(robots, option, way_rad, sides), inf).argmin())
        return Goal(side=SIDES[row], beside_m=(round(float(sides.x_m[row]), 1), round(float(sides.y_m[row]), 1)))

    def _room_m(self, option: Option, robots: RobotTable, now_s: float) -> Point | None:
        """Where a robot can back out or step aside to. Not searched again soon, nor often in one step."""
        if not self._searches_left or now_s - self._searched_s.get((option.robot, option.verb), -inf) < SEARCHED_S:
            return None
        self._searches_left -= 1
        self._searched_s[option.robot, option.verb] = now_s
        slot, other = robots.slots.find((option.robot, option.other)).tolist()
        passing = wanted_ways(robots, np.array([other]), WHOLE_WAY_M, STEPS * STEP_S)
        if option.verb == "back_out":
            return self._tracks.refuge_m(robots, option.robot, passing, other_bodies(robots, slot, other))
        return aside_m(robots, option.robot, passing, other_bodies(robots, slot), self._barred, self.seen)


def _sides(robots: RobotTable, option: Option, way_rad: float) -> Boxes:
    """(2,) the strips beside the body of the other, by `SIDES` of a way, as wide as the robot with its room."""
    (x_m, y_m, yaw_rad), body = robots.reported_pose(option.other), robots[option.other]
    along, across = abs(cos(yaw_rad - way_rad)), abs(sin(yaw_rad - way_rad))
    half_along_m = (body.length_m * along + body.width_m * across) / 2
    half_across_m = (body.length_m * across + body.width_m * along) / 2
    half_strip_m = robots[option.robot].width_m / 2 + BESIDE_M
    left_m: Floats = (half_across_m + half_strip_m) * np.array([-1.0, 1.0])
    alike = (np.full(2, value) for value in (way_rad, half_along_m, half_strip_m))
    return Boxes(x_m - left_m * sin(way_rad), y_m + left_m * cos(way_rad), *alike)


def _aside_m(robots: RobotTable, option: Option, way_rad: float, sides: Boxes) -> Floats:
    """(2,) how far across its way a robot has to go for each side, in decimetres."""
    x_m, y_m, _ = robots.reported_pose(option.robot)
    across_m: Floats = (sides.y_m - y_m) * cos(way_rad) - (sides.x_m - x_m) * sin(way_rad)
    return np.abs(across_m).round(1)
