"""The shape of a situation on the map, and the places that its sentence counts."""

import numpy as np
import pytest
import shapely
from scipy.sparse.csgraph import connected_components

from deconflict.advisories.situations.situation_fields import MOST_LINKED, SPOT_M, _linked, spot_numbers, spots
from deconflict_client.situations import MOST_CORNERS
from tests.deconflict.advisories.situations.made_situations import conflict, raised


def test_places_near_each_other_are_one_spot() -> None:
    situation = raised([conflict("ab"), conflict("bc", x_m=4.0)])
    assert "3 robots get in each other's way in" in situation.summary
    assert shapely.Polygon(situation.outline).covers(shapely.Point(2.0, 1.0))


def test_places_apart_are_spots_with_a_thin_link() -> None:
    situation = raised([conflict("ab"), conflict("bc", x_m=15.0)])
    assert "3 robots get in each other's way at 2 places in" in situation.summary
    assert situation.summary.endswith(", the worst in Aisle 3")
    area = shapely.Polygon(situation.outline)
    assert area.is_valid
    assert all(area.covers(shapely.Point(x_m, 1.0)) for x_m in (0.0, 15.0))
    assert area.covers(shapely.Point(8.0, 0.0))
    assert not area.covers(shapely.Point(8.0, 0.5))


def test_an_outline_of_many_spots_has_few_corners() -> None:
    ring = [conflict(pair, x_m=6.5 * index) for index, pair in enumerate(["ab", "bc", "cd", "de"])]
    assert len(raised(ring).outline) <= MOST_CORNERS


def test_more_spots_than_are_linked_have_too_many_corners() -> None:
    in_line = [(SPOT_M * 1.01 * index, 0.0) for index in range(MOST_LINKED + 1)]
    assert shapely.get_num_coordinates(_linked(spots(in_line))) > MOST_CORNERS + 1


@pytest.mark.parametrize("seed", range(20))
def test_spots_are_places_that_are_near_each_other_or_through_others(seed: int) -> None:
    rng = np.random.default_rng(seed)
    at_m = rng.uniform(0, 60, (rng.integers(1, 60), 2))
    is_near = np.hypot(*(at_m[:, None] - at_m).T) <= SPOT_M
    _, island = connected_components(is_near, directed=False)
    assert spot_numbers([(x_m, y_m) for x_m, y_m in at_m.tolist()]) == island.tolist()
