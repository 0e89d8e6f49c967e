"""The planned order of a fleet's robots at crossings, and how long each robot will wait for it."""

from dataclasses import dataclass

import numpy as np

from deconflict.simulation.driving.crossings import CrossingPassage
from deconflict.simulation.driving.motion import Activity
from deconflict.simulation.driving.traffic import World

AHEAD_M = 18.0
"""Crossings are planned up to this distance ahead."""
START_S = 0.8
"""Time that a standing robot loses until it reaches its speed."""


@dataclass(frozen=True, slots=True)
class CrossingArrival:
    """One robot at one crossing, as its fleet plans it."""

    robot: int
    """Row of the robot."""
    passage: CrossingPassage
    enter_s: float
    """When it enters, seconds from now."""
    leave_s: float
    """When it has left, seconds from now."""


class CrossingSchedule:
    """The plans of every fleet for its crossings, at one moment."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._by_robot: dict[int, list[CrossingArrival]] = {}
        self._by_place: dict[tuple[int, int], list[CrossingArrival]] = {}
        """By fleet and crossing."""
        rows = np.flatnonzero((world.doing == Activity.DRIVING) & ~world.person)
        until_m = world.progress_m + AHEAD_M
        every = [
            (row, passage)
            for row, end_m in zip(rows.tolist(), until_m[rows].tolist(), strict=True)
            for passage in world.crossings.ahead[row]
            if passage.enter_m < end_m
        ]
        if not every:
            return
        robots = np.array([row for row, _ in every])
        now_s = world.tracks.seconds(robots, world.progress_m[robots]) - START_S * (world.speed_mps[robots] < 0.3)
        enter_s, leave_s = (
            (world.tracks.seconds(robots, np.array(at_m)) - now_s).tolist()
            for at_m in ([passage.enter_m for _, passage in every], [passage.leave_m for _, passage in every])
        )
        for (row, passage), in_s, out_s in zip(every, enter_s, leave_s, strict=True):
            due = CrossingArrival(row, passage, in_s, out_s)
            self._by_robot.setdefault(row, []).append(due)
            self._by_place.setdefault((int(world.fleet[row]), passage.node), []).append(due)

    def waits(self, robot: int) -> list[tuple[float, float]]:
        """Where a robot will wait for others of its fleet: progress in metres, and duration in seconds."""
        found, late_s = list[tuple[float, float]](), 0.0
        mine = self._by_robot.get(robot, [])
        if mine and self._world.crossings.is_inside(robot):
            mine = mine[1:]
        for due in mine:
            others = self._by_place[int(self._world.fleet[robot]), due.passage.node]
            free_s = max((other.leave_s for other in others if self._goes_first(other, due)), default=0.0)
            wait_s = free_s - (due.enter_s + late_s)
            if wait_s > 0:
                found.append((due.passage.enter_m, wait_s))
                late_s += wait_s
        return found

    def _goes_first(self, due: CrossingArrival, other: CrossingArrival) -> bool:
        if due.robot == other.robot or not due.passage.meets(other.passage):
            return False
        first = self._world.crossings.ahead[due.robot][0] is due.passage
        return (first and self._world.crossings.is_inside(due.robot)) or due.enter_s < other.enter_s
