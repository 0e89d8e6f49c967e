"""Floors of cells with another planner and other protective stops (`benchmarks/planned_floors`), with an aisle that is
really made one-way. What happens is what the service finds in the log."""

from dataclasses import replace

import shapely

from benchmarks.planned_floors.floors.driving.grid import CELL_M
from benchmarks.planned_floors.floors.habits import GridFloor
from benchmarks.planned_floors.floors.kinds import made_of, simulate
from benchmarks.whatif.heard_lines import heard
from metrics.whatif.change import NamedOutline
from metrics.whatif.demand import demand_of
from metrics.whatif.recorded_tracks import RecordedFloor
from metrics.whatif.simulated.model_runs import FloorFigures, log_figures

KINDS = ("blind", "mixed")
ONE_WAY_X = 15, 16
"""Columns of the aisle."""
AISLE = NamedOutline(
    "Aisle", 0, shapely.box((ONE_WAY_X[0] - 0.5) * CELL_M, 2 * CELL_M, (ONE_WAY_X[1] + 0.5) * CELL_M, 27 * CELL_M)
)


def recorded_cells(kind: str, seed: int, seconds: float, *, one_way: bool) -> RecordedFloor:
    """The log of a floor."""
    floor = made_of(kind, seed, seconds)
    if not isinstance(floor, GridFloor):
        raise TypeError(f"{kind} is no floor of cells")
    return heard(simulate(replace(floor, one_way_x=ONE_WAY_X) if one_way else floor).lines)


def cell_figures(kind: str, seed: int, seconds: float, *, one_way: bool) -> FloorFigures:
    """What the log of a floor shows, per hour."""
    recorded = recorded_cells(kind, seed, seconds, one_way=one_way)
    return log_figures(recorded, demand_of(recorded), seconds).per_hour(seconds)
