"""The service beside simulated robots."""

import numpy as np

from deconflict.settings.site import DEFAULT
from deconflict.simulation.driving.motion import Activity
from metrics.whatif.change import ROOM_M, Change
from metrics.whatif.demand import demand_of
from metrics.whatif.recorded_tracks import RecordedFloor
from metrics.whatif.simulated.model_runs import STEP_S, SimulatedService, model_figures
from metrics.whatif.simulated.replayed_floor import ReplayedFloor
from metrics.whatif.simulated.simulated_plan import Planner
from tests.metrics.whatif.made_floors import recorded, track

ADVISED = Change("robots follow advice", advised_by=DEFAULT)


def head_on() -> RecordedFloor:
    """Two robots that meet in the middle of one lane."""
    return recorded(
        track("A", [((-25.0, 0.0), 5.0), ((25.0, 0.0), 20.0)], "Alder"),
        track("B", [((25.0, 0.0), 5.0), ((-25.0, 0.0), 20.0)], "Birch"),
    )


def test_robots_do_what_the_service_asks_for() -> None:
    plan = Planner(demand_of(head_on())).plan(ADVISED)
    world = ReplayedFloor(plan.robots, plan.crossings, np.random.default_rng(1), ROOM_M)
    service, was_instructed = SimulatedService(world, DEFAULT, plan.floors), False
    while world.t_s < 60.0:
        world.step(STEP_S)
        service.step()
        was_instructed |= bool(np.isfinite(world.instructions.top_mps(world.t_s)).any())
        was_instructed |= bool((world.doing == Activity.BACKING).any())
    assert was_instructed


def test_the_same_seed_gives_the_same_figures_with_the_service() -> None:
    plan = Planner(demand_of(head_on())).plan(ADVISED)
    assert np.array_equal(model_figures(plan, 1, 40.0), model_figures(plan, 1, 40.0))
