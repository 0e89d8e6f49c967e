"""Which standing robots are in the way of others."""

from typing import Any

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from deconflict.contention.waiting.wait_graph import NearbyBoxes, hindrances
from tests.deconflict.contention.scenes import NOW_S, Scene, Script, site

LEVELS, ROBOTS = 12, 6
Shapes = NDArray[np.object_]


def test_only_ways_and_bodies_at_one_height_are_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    """On each of many levels robots stand one behind the other in one place, and mean to drive on."""
    robots = {
        f"{level}-{at}": Script([(0, 2.0 * at, 0)], means=[(0, 2.0 * at, 0), (20, 2.0 * at + 20, 0)], z_m=3.0 * level)
        for level in range(LEVELS)
        for at in range(ROBOTS)
    }
    scene = Scene(site(), robots)
    scene.run(4)
    table = scene.engine._shared.contention.robots
    measured = list[int]()
    dwithin, query = shapely.dwithin, shapely.STRtree.query

    def counted(a: Shapes, b: Shapes, *args: Any) -> Any:
        measured.append(np.broadcast(a, b).size)
        return dwithin(a, b, *args)

    def counted_query(self: shapely.STRtree, geometry: Shapes, *args: Any, **named: Any) -> Any:
        measured.append(len(self) * len(geometry))
        return query(self, geometry, *args, **named)

    monkeypatch.setattr(shapely, "dwithin", counted)
    monkeypatch.setattr(shapely.STRtree, "query", counted_query)
    found = hindrances(table, NearbyBoxes.of(table, {}), NOW_S + 4)
    assert len(found) >= LEVELS * (ROBOTS - 1)
    assert sum(measured) <= LEVELS * ROBOTS**2
