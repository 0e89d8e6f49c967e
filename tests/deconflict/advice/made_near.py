"""Robots that are near each other, by what they say."""

from collections.abc import Sequence
from typing import NamedTuple

from deconflict.advice.delay_windows import Mover, Near
from deconflict.advisory import ConflictAdvisory
from deconflict.sweep.incremental import Sweeper
from ingest.batch import Forecasts
from tests.deconflict.engine.made_engine import NOW_S, Floor


class Seen(NamedTuple):
    """One robot and its forecast."""

    robot: str
    forecast: Forecasts
    vendor: str = "acme"
    holdable: bool = True
    priority: float = 1.0


def near(robots: Sequence[Seen]) -> Near:
    """Of robots in any order."""
    robots = sorted(robots, key=lambda one: one.robot)
    uuids, sweeper = [one.robot for one in robots], Sweeper(clearance_m=0.3)
    sweeper.update(uuids, Forecasts.joined(one.forecast for one in robots))
    movers = [Mover(one.robot, one.vendor, one.holdable, one.priority) for one in robots]
    return Near(uuids, [one.vendor for one in robots], *sweeper.copied(uuids), movers.__getitem__)


def until_advised(floor: Floor) -> tuple[ConflictAdvisory, float]:
    """The first revision with advice, and when it came."""
    for quarter in range(200):
        for one in floor.run((quarter + 1) / 4, quarter / 4):
            if one.recommendation:
                return one, one.updated_at.timestamp() - NOW_S
    raise AssertionError("nothing was advised")
