"""In which order a fleet means to let its robots through crossings, and how long that makes each of them wait."""

from dataclasses import dataclass

import numpy as np

from deconflict.simulation.driving.crossings import Passage
from deconflict.simulation.driving.traffic import Doing, World

AHEAD_M = 18.0
"""Crossings are planned so far ahead."""
START_S = 0.8
"""What a robot that stands loses until it is at its pace."""


@dataclass(frozen=True, slots=True)
class Due:
    """One robot at one crossing, in seconds from now."""

    robot: int
    passage: Passage
    enter_s: float
    leave_s: float


class Schedule:
    """What every fleet has planned at a moment."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._by_robot: dict[int, list[Due]] = {}
        self._by_place: dict[tuple[int, int], list[Due]] = {}
        """By fleet and crossing."""
        rows = np.flatnonzero((world.doing == Doing.DRIVING) & ~world.person)
        until_m = world.progress_m + AHEAD_M
        every = [
            (row, one)
            for row, end_m in zip(rows.tolist(), until_m[rows].tolist(), strict=True)
            for one in world.crossings.ahead(row)
            if one.enter_m < end_m
        ]
        if not every:
            return
        robots = np.array([row for row, _ in every])
        now_s = world.tracks.seconds(robots, world.progress_m[robots]) - START_S * (world.speed_mps[robots] < 0.3)
        enter_s, leave_s = (
            (world.tracks.seconds(robots, np.array(at_m)) - now_s).tolist()
            for at_m in ([one.enter_m for _, one in every], [one.leave_m for _, one in every])
        )
        for (row, passage), in_s, out_s in zip(every, enter_s, leave_s, strict=True):
            due = Due(row, passage, in_s, out_s)
            self._by_robot.setdefault(row, []).append(due)
            self._by_place.setdefault((int(world.fleet[row]), passage.node), []).append(due)

    def waits(self, robot: int) -> list[tuple[float, float]]:
        """Where a robot means to wait for others of its fleet: progress in metres, and for how many seconds."""
        found, late_s = list[tuple[float, float]](), 0.0
        mine = self._by_robot.get(robot, [])
        if mine and self._world.crossings.is_inside(robot):
            mine = mine[1:]
        for due in mine:
            others = self._by_place[int(self._world.fleet[robot]), due.passage.node]
            free_s = max((one.leave_s for one in others if self._goes_first(one, due)), default=0.0)
            wait_s = free_s - (due.enter_s + late_s)
            if wait_s > 0:
                found.append((due.passage.enter_m, wait_s))
                late_s += wait_s
        return found

    def _goes_first(self, one: Due, other: Due) -> bool:
        if one.robot == other.robot or not one.passage.meets(other.passage):
            return False
        first = self._world.crossings.ahead(one.robot)[0] is one.passage
        return (first and self._world.crossings.is_inside(one.robot)) or one.enter_s < other.enter_s
