"""Robots near each other, from their forecasts."""

from collections.abc import Mapping, Sequence
from math import inf, pi
from typing import NamedTuple

from deconflict.advice.holds.hold_planner import plan_holds
from deconflict.advice.holds.hold_windows import STEP_S, HoldWindow, NearbyRobots, PlannedRobot
from deconflict.advice.priorities import WEIGHT
from deconflict.settings.site import USUAL_ADVICE, Advice
from deconflict.sweep.incremental import Sweeper
from deconflict_client.advisory import ConflictAdvisory, Hold, Recommendation
from ingest.batch import Forecasts, Pair
from tests.deconflict.engine import made_engine
from tests.deconflict.engine.made_engine import Floor
from tests.helpers.made_encounters import NOW_S, robot

WINDOW = HoldWindow(NOW_S, 10.0, 0.3, 6.0)


class SeenRobot(NamedTuple):
    """One robot and its forecast."""

    robot: str
    forecast: Forecasts
    vendor: str = "acme"
    holdable: bool = True
    priority: float = 1.0
    waited_s: float = -inf


def near(robots: Sequence[SeenRobot]) -> NearbyRobots:
    """Of robots in any order."""
    robots = sorted(robots, key=lambda robot: robot.robot)
    uuids, sweeper = [robot.robot for robot in robots], Sweeper(clearance_m=0.3)
    sweeper.update(uuids, Forecasts.joined(robot.forecast for robot in robots))
    planned = [PlannedRobot(robot.robot, robot.vendor, *robot[3:]) for robot in robots]
    return NearbyRobots(uuids, [robot.vendor for robot in robots], *sweeper.copied(uuids), planned.__getitem__)


def until_advised(floor: Floor) -> tuple[ConflictAdvisory, float]:
    """The first revision with advice, and when it came."""
    for quarter in range(200):
        for revision in floor.run((quarter + 1) / 4, quarter / 4):
            if revision.recommendation:
                return revision, revision.updated_at.timestamp() - made_engine.NOW_S
    raise AssertionError("nothing was advised")


def group_plan(
    near: NearbyRobots,
    conflicts: Sequence[Pair],
    window: HoldWindow,
    *,
    burdens_s: Mapping[str, float] | None = None,
    standing: Recommendation | None = None,
    settings: Advice = USUAL_ADVICE,
) -> Recommendation:
    """The plan of a whole group of conflicts; its note names the pairs that have none."""
    held = frozenset(hold.robot for hold in standing.holds) if standing else frozenset()
    problem, found, first_come, unplanned = plan_holds(
        near, conflicts, window, burdens_s=burdens_s, held_before=held, settings=settings
    )
    cost_s, per_s = problem.cost(found.plan) * STEP_S / WEIGHT, STEP_S / WEIGHT
    return Recommendation(
        holds=tuple(Hold(robot=robot, hold_s=steps * STEP_S) for robot, steps in sorted(found.plan.items()) if steps),
        cost_s=cost_s,
        bound_s=found.bound * per_s,
        first_come_cost_s=None if first_come is None else problem.cost(first_come) * per_s,
        proven_optimal=found.bound == problem.cost(found.plan),
        note=", ".join(" and ".join(pair) for pair in sorted(unplanned)),
    )


def eastward(
    name: str, x_m: float, *, y_m: float = 0.0, holdable: bool = True, speed_mps: float = 1.0, size_m: float = 1.0
) -> SeenRobot:
    ends_m = x_m + 10 * speed_mps
    return SeenRobot(name, robot([0, 10], [x_m, ends_m], [y_m, y_m], 0.0, (size_m, 0.6)), holdable=holdable)


def northward(name: str, y_m: float, *, x_m: float = 0.0, priority: float = 1.0) -> SeenRobot:
    forecast = robot([0, 10], [x_m, x_m], [y_m, y_m + 10], pi / 2, (1.0, 0.6))
    return SeenRobot(name, forecast, priority=priority)


def held_s(advice: Recommendation) -> dict[str, float]:
    return {hold.robot: hold.hold_s for hold in advice.holds}
