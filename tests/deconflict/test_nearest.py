from math import pi

import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely import Point, Polygon

from deconflict.nearest import Box, nearest

boxes = st.builds(Box, st.floats(-3, 3), st.floats(-3, 3), st.floats(-4, 4), st.floats(0.05, 2), st.floats(0.05, 2))


@given(boxes, boxes)
def test_the_distance_is_that_of_the_polygons_and_the_place_is_midway(a: Box, b: Box) -> None:
    distance_m, place = nearest(a, b)
    one, other = Polygon(a.corners()), Polygon(b.corners())
    assert distance_m == pytest.approx(one.distance(other), abs=1e-6)
    for polygon in (one, other):
        assert polygon.distance(Point(place)) == pytest.approx(distance_m / 2, abs=1e-6)


@given(boxes, boxes)
def test_swapping_the_rectangles_changes_nothing(a: Box, b: Box) -> None:
    (distance_m, place), (swapped_m, swapped) = nearest(a, b), nearest(b, a)
    assert (distance_m, *place) == pytest.approx((swapped_m, *swapped), abs=1e-9)


def test_sides_that_face_each_other_are_nearest_in_their_middle() -> None:
    distance_m, place = nearest(Box(0, 0, 0, 1, 1), Box(5, 0, pi / 2, 1, 1))
    assert (distance_m, *place) == pytest.approx((3.0, 2.5, 0.0))


def test_rectangles_that_cross_without_a_corner_in_the_other_overlap() -> None:
    distance_m, place = nearest(Box(0, 0, 0, 3, 0.5), Box(1.4, 0, pi / 2, 3, 0.5))
    assert (distance_m, *place) == pytest.approx((0.0, 1.4, 0.0))
