from dataclasses import replace
from math import inf, nan

import numpy as np
import pytest

from ingest.batch import Forecasts
from ingest.shapes import Corner, Shape, ShapePart, Trailer, is_sound, joined_shapes, outline_fault, shapes_of


@pytest.mark.parametrize(
    ("corners", "fault"),
    [
        ([(0, 0), (1, 0), (0, 1), (1, 1)], "crosses itself"),
        ([(0, 0), (2, 0), (2, 2), (1, -1)], "crosses itself"),
        ([(0, 0), (2, 0), (1, 0), (1, 2)], "crosses itself"),
        ([(0, 0), (2, 0), (2, 2), (0, 0), (-1, 1)], "crosses itself"),
        ([(0, 0), (1, 0), (2, 0)], "no area"),
        ([(0, 0), (1, 0)], "3 to 32 corners, not 2"),
        ([(np.cos(at), np.sin(at)) for at in np.arange(33) * 2 * np.pi / 33], "3 to 32 corners, not 33"),
    ],
)
def test_a_bad_outline_is_named(corners: list[Corner], fault: str) -> None:
    assert fault in (outline_fault(corners) or "")


@pytest.mark.parametrize(
    "corners",
    [
        [(0, 0), (1, 0), (0, 1)],
        [(0, 0), (0, 1), (1, 0)],
        [(1.2, 0.3), (0.2, 0.6), (-0.9, 0.6), (-0.3, 0), (-0.9, -0.6), (1.2, -0.3)],
        [(0, 0), (1, 0), (2, 0), (2, 1), (0, 1)],
        [(0.2, 0.30000000000000004), (0.1, 0.3), (0.1, 0.4), (0, 0.5), (0.4, 0.5), (0.5, 0.4), (0.5, 0), (0.4, 0.1)],
    ],
)
def test_a_good_outline_has_no_fault(corners: list[Corner]) -> None:
    assert outline_fault(corners) is None
    assert outline_fault([(x + 100, y - 5) for x, y in corners[::-1]]) is None


SQUARE = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))


@pytest.mark.parametrize(
    "shape",
    [
        Shape.circle(0.0),
        Shape.circle(-1.0),
        Shape.circle(nan),
        Shape.polygon([]),
        Shape.polygon([(0, 0), (1, 0)]),
        Shape.polygon([(0, 0), (1, 0), (2, 0)]),
        Shape.polygon([(0, 0), (1, 1), (1, 0), (0, 1)]),
        Shape.polygon([(0, 0), (1, nan), (1, 0)]),
        Shape.polygon([(np.cos(at), np.sin(at)) for at in np.arange(33) * 2 * np.pi / 33]),
        Shape((ShapePart(SQUARE, 0.5),)),
        Shape((ShapePart(SQUARE, 0.0, 1.0, 0.5),)),
        Shape((ShapePart(SQUARE, 0.0, -1.0, 0.5),)),
        Shape((ShapePart(SQUARE, 0.0, 1.0),)),
        Shape((), (0.0, 0.0), (Trailer(1.0, 1.0, 0.0),)),
        Shape((), (0.0, 0.0), (Trailer(0.0, 1.0, 1.0),)),
        Shape((), (nan, 0.0), (Trailer(1.0, 1.0, 1.0),)),
    ],
)
def test_what_cannot_be_swept_is_not_sound(shape: Shape) -> None:
    assert not is_sound(shape)


def test_large_and_small_loads_are_sound() -> None:
    for size_m in (1e-3, 200.0):
        assert is_sound(Shape((ShapePart.box((5.0, 0.0), size_m, 1e-3, 0.0, 1.0),)))
    assert is_sound(Shape((), (0.0, 0.0), (Trailer(1.0, 1.0, 1.0),)))


def test_a_ring_that_is_closed_is_the_same_polygon() -> None:
    assert Shape.polygon([*SQUARE, SQUARE[0]]) == Shape.polygon(SQUARE)


def test_sizes_are_of_the_rectangle_and_the_circle_around_the_centre() -> None:
    shape = Shape((ShapePart(((0.5, 0.0),), 0.25), ShapePart(((-0.2, -0.6), (0.2, -0.6), (0.0, 0.1)))))
    assert shape.bounds_m == (-0.2, -0.6, 0.75, 0.25)
    assert shape.size_m == (1.5, 1.2)
    assert shape.reach_m() == 0.75
    assert shape.moved(1.0, 0.0).bounds_m == (0.8, -0.6, 1.75, 0.25)


def test_shapes_go_with_their_robots() -> None:
    circle, square = Shape.circle(1.0), Shape.polygon([(0, 0), (1, 0), (1, 1), (0, 1)])
    ones, n = np.ones(3), 3
    made = Forecasts(np.arange(n + 1), ones, ones, ones, ones, np.zeros(n, np.int64), ones, ones, ones, ones)
    shaped = replace(made, shapes=shapes_of([circle, None, square]))
    assert [shaped.take([2, 0]).shape(row) for row in range(2)] == [square, circle]
    assert shaped.single(2).shape(0) == square
    both = Forecasts.joined([made, shaped])
    assert [both.shape(row) for row in range(6)] == [None, None, None, circle, None, square]
    assert shapes_of([None, None]) is joined_shapes([(None, 2), (None, 1)]) is None


def test_a_part_without_heights_is_as_high_as_the_robot() -> None:
    (part,) = Shape.circle(2.0).parts
    assert (part.bottom_m, part.top_m) == (-inf, inf)
