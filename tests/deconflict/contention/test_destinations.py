"""Where the robots of a batch go: what they are at, and when they can be at the rest."""

import numpy as np
import pytest

from deconflict.contention.ahead import ahead
from deconflict.contention.destinations import QUICKEST_MPS, UNTOLD, Destinations
from deconflict.contention.geometry import Geometry
from tests.deconflict.contention.scenes import LINE, NOW_S, Scene, Script, Spot, resource, site

BELIEVED = (0.9, 1.0, 1.3)
DOCK = resource("d1", 40, 0)


def told(at: Spot, *stops: tuple[float, float, float], here: str | None = None) -> Destinations:
    """By one robot that stands at `at`, and one after it that tells nothing."""
    scene = Scene(site(DOCK), {"a": Script([(0, *at)], stops), "b": Script([(0, 90, 90)])})
    for name, one in scene.robots.items():
        scene.fleet.receive(one.says(name, 0.0), NOW_S, LINE)
    batch = scene.fleet.cut(NOW_S)
    now_s = np.full(2, NOW_S)
    return Destinations(batch, ahead(batch.forecasts, now_s), now_s, [here, None], Geometry([DOCK], ()))


def test_what_a_robot_is_at_already_is_not_ahead_of_it() -> None:
    destinations = told((0, 0), (5, 0.6, 0), (60, 40, 0), (90, 9, 0))
    assert destinations.spans == [(0, 3), (3, 3)]
    assert destinations.first == [1, 3]


def test_nor_is_the_resource_that_it_has_however_far_from_its_middle() -> None:
    assert told((39.1, 0), (5, 40.9, 0), (60, 9, 0), here="d1").first[0] == 1
    assert told((39.1, 0), (5, 40.9, 0), (60, 9, 0)).first[0] == 0


def test_a_stop_is_expected_as_told_but_no_sooner_than_the_robot_can_be_there() -> None:
    late, soon = told((0, 0), (60, 40, 0), (61, 300, 0)).stops([BELIEVED, UNTOLD])
    assert (late.t_s, late.resource) == (NOW_S + 60, "d1")
    assert late.spread_s == pytest.approx(12.0)
    assert soon.t_s == pytest.approx(NOW_S + 300 / QUICKEST_MPS)
    assert soon.resource is None


def test_where_nobody_tells_anything_there_is_nowhere_to_go() -> None:
    destinations = told((0, 0))
    assert destinations.first == [0, 0]
    assert destinations.stops([UNTOLD, UNTOLD]) == []
