"""Random shapes of each kind."""

from collections.abc import Callable

import numpy as np
from numpy.random import Generator

from ingest.shapes import Shape, ShapePart, Trailer


def octagon(rng: Generator) -> Shape:
    angle, (long, wide) = np.arange(8) * np.pi / 4, rng.uniform(0.3, 1.2, 2)
    return Shape.polygon(zip(long * np.cos(angle), wide * np.sin(angle), strict=True))


def star(rng: Generator) -> Shape:
    """A polygon with corners that point inward."""
    corners = int(rng.integers(3, 8)) * 2
    angle, reach = np.arange(corners) * 2 * np.pi / corners, rng.uniform(0.6, 1.2, corners)
    reach[::2] *= rng.uniform(0.2, 0.6)
    return Shape.polygon(zip(reach * np.cos(angle), reach * np.sin(angle), strict=True))


def truck(rng: Generator) -> Shape:
    """A body with a mast ahead and a load above."""
    body = ((0.8, 0.4), (-0.8, 0.4), (-0.8, -0.4), (0.8, -0.4))
    load = ((1.5, 0.6), (0.5, 0.6), (0.5, -0.6), (1.5, -0.6))
    return Shape(
        (ShapePart(body, 0.0, 0.0, 0.5), ShapePart(((0.9, 0.0),), 0.2, 0.0, 2.0), ShapePart(load, 0.0, 1.2, 2.0))
    )


def train(rng: Generator) -> Shape:
    """A round tug with two trailers."""
    trailer = Trailer(rng.uniform(0.4, 1.0), rng.uniform(0.3, 0.8), 1.1, rng.uniform(-3.0, 3.0))
    return Shape(Shape.circle(0.8).parts, (-0.2, 0.0), (trailer, trailer))


KINDS: dict[str, Callable[[Generator], Shape | None]] = {
    "rectangle": lambda _: None,
    "circle": lambda rng: Shape.circle(rng.uniform(0.4, 2.0)),
    "polygon": octagon,
    "star": star,
    "parts": truck,
    "train": train,
}
