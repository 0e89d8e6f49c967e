"""The halls with a one-way aisle."""

import numpy as np

from benchmarks.whatif.changed_halls import with_one_way
from deconflict.simulation.floor_layout import GROUND, layout_for

AISLE_X_M = 38.5


def test_nobody_drives_against_a_one_way_aisle_and_every_bay_stays_in_reach() -> None:
    layout = with_one_way(layout_for(40), AISLE_X_M, -1.0)
    along = [
        layout.places[after][1] - layout.places[node][1]
        for node, onward in enumerate(layout.onward)
        for after in onward
        if layout.floors[node] == GROUND and layout.places[node][0] == layout.places[after][0] == AISLE_X_M
    ]
    assert along
    assert max(along) < 0
    start, *goals = [bay.node for bay in layout.bays if bay.floor == GROUND]
    detours = np.ones(len(layout.places))
    assert all(layout.route(start, goal, detours)[-1] == goal for goal in goals)
    assert all(layout.route(goal, start, detours)[-1] == start for goal in goals)
