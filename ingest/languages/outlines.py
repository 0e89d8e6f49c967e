"""The outline of a robot as a polygon in its own frame."""

from collections.abc import Sequence
from typing import NamedTuple

from ingest.shapes import Corner, Shape, outline_fault


class Outline(NamedTuple):
    """The rectangle about a robot, and its outline if that is another."""

    length_m: float
    width_m: float
    offset_m: tuple[float, float] = (0.0, 0.0)
    outline: Shape | None = None
    is_simplified: bool = False
    """Whether the outline itself can't be used, so that the rectangle stands for it."""

    def differs_m(self, length_m: float, width_m: float) -> float:
        """How far its size is from a stated one."""
        return abs(self.length_m - length_m) + abs(self.width_m - width_m)


def outline_of(corners: Sequence[Corner]) -> Outline:
    """A polygon, and the rectangle about it along the axes of the robot's frame."""
    if corners[0] == corners[-1]:
        corners = corners[:-1]
    xs, ys = zip(*corners, strict=True)
    west, east, south, north = min(xs), max(xs), min(ys), max(ys)
    is_rectangle = set(corners) == {(west, south), (west, north), (east, south), (east, north)}
    is_faulty = not is_rectangle and outline_fault(corners) is not None
    outline = None if is_rectangle or is_faulty else Shape.polygon(corners)
    return Outline(east - west, north - south, ((west + east) / 2, (south + north) / 2), outline, is_faulty)
