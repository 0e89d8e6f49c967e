"""The places where losses begin."""

import pytest

from deconflict.foresight.losses.loss_places import LossPlaces

HALL = ("ground", "Hall", ((0.0, 0.0), (20.0, 0.0), (20.0, 20.0), (0.0, 20.0)))
AISLE = ("ground", "Aisle 3", ((2.0, 2.0), (5.0, 2.0), (5.0, 18.0), (2.0, 18.0)))


@pytest.mark.parametrize(
    ("datum", "at", "name"),
    [
        ("ground", (3.0, 3.0), "Aisle 3"),
        ("ground", (10.0, 10.0), "Hall"),
        ("ground", (30.0, 10.0), ""),
        ("upper", (3.0, 3.0), ""),
    ],
)
def test_the_smallest_place_that_holds_the_point_counts(datum: str, at: tuple[float, float], name: str) -> None:
    assert LossPlaces((HALL, AISLE)).place_at(datum, *at) == name
