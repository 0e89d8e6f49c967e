"""One more dock: robots that queued for one use two."""

import pytest
import shapely

from deconflict.foresight.losses.loss import Loss, LossKind
from metrics.whatif.change import ChangeError, NamedOutline
from metrics.whatif.demand import Demand, demand_of
from metrics.whatif.more_docks import more_docks
from metrics.whatif.recorded_tracks import RecordedFloor
from metrics.whatif.simulated.model_runs import model_figures
from metrics.whatif.simulated.simulated_plan import Planner
from tests.metrics.whatif.made_floors import Leg, recorded, track

DOCK = NamedOutline("Dock", 0, shapely.box(28.5, -1, 31.5, 1))
QUEUE_S = 15.0


def queue(robots: int = 4) -> Demand:
    """Robots that come one after the other from the west, wait behind the dock, and leave to the east."""
    tracks, losses = [], list[Loss]()
    for number in range(robots):
        start_s = 25.0 * number
        waits = [((26.0, 0.0), QUEUE_S)] if number else []
        legs: list[Leg] = [((0.0, 3.0 * number), 5.0 + start_s), ((15.0, 0.0), 0.0), *waits, ((30.0, 0.0), 30.0)]
        tracks.append(track(f"R{number}", [*legs, ((45.0, 3.0 * number), 10.0)]))
        from_s = start_s + 33.0
        if number:
            by = f"R{number - 1}"
            vendors, place = ("Alder", "", "Alder", "Alder"), (0, 26.0, 0.0)
            times = from_s, from_s + QUEUE_S, QUEUE_S, QUEUE_S
            losses.append(Loss(f"R{number}", by, by, *vendors, LossKind.BLOCKAGE, *times, True, *place))
    floor = recorded(*tracks)
    return demand_of(RecordedFloor(floor.tracks, losses, floor.floors, floor.span_s))


def lost_s(demand: Demand) -> float:
    return float(model_figures(Planner(demand).plan(), 1, 200.0)[:, 0].sum())


def test_one_more_dock_ends_a_queue() -> None:
    demand = queue()
    change = more_docks([DOCK], demand)
    assert lost_s(demand) > 15.0
    assert lost_s(change.demand(demand)) < 0.5 * lost_s(demand)


def test_a_dock_that_hardly_anybody_uses_needs_no_second() -> None:
    with pytest.raises(ChangeError, match="robots stop 2 times at Dock in the log: 4 are needed"):
        more_docks([DOCK], queue(2))
