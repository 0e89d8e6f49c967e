"""Robots near each other, from their forecasts."""

from collections.abc import Sequence
from typing import NamedTuple

from deconflict.advice.hold_windows import NearbyRobots, PlannedRobot
from deconflict.advisory import ConflictAdvisory
from deconflict.sweep.incremental import Sweeper
from ingest.batch import Forecasts
from tests.deconflict.engine.made_engine import NOW_S, Floor


class SeenRobot(NamedTuple):
    """One robot and its forecast."""

    robot: str
    forecast: Forecasts
    vendor: str = "acme"
    holdable: bool = True
    priority: float = 1.0


def near(robots: Sequence[SeenRobot]) -> NearbyRobots:
    """Of robots in any order."""
    robots = sorted(robots, key=lambda robot: robot.robot)
    uuids, sweeper = [robot.robot for robot in robots], Sweeper(clearance_m=0.3)
    sweeper.update(uuids, Forecasts.joined(robot.forecast for robot in robots))
    planned = [PlannedRobot(robot.robot, robot.vendor, robot.holdable, robot.priority) for robot in robots]
    return NearbyRobots(uuids, [robot.vendor for robot in robots], *sweeper.copied(uuids), planned.__getitem__)


def until_advised(floor: Floor) -> tuple[ConflictAdvisory, float]:
    """The first revision with advice, and when it came."""
    for quarter in range(200):
        for revision in floor.run((quarter + 1) / 4, quarter / 4):
            if revision.recommendation:
                return revision, revision.updated_at.timestamp() - NOW_S
    raise AssertionError("nothing was advised")
