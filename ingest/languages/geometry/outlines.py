"""The outline of a robot as a polygon in its own frame."""

from collections.abc import Sequence
from sys import float_info
from typing import NamedTuple

from ingest.settings import MOST_BODY_M
from ingest.shapes import Corner, Shape, outline_fault
from ingest.sizes.size_limit import UNITS


class Outline(NamedTuple):
    """The rectangle about a robot, and its outline if that is another."""

    length_m: float
    width_m: float
    offset_m: tuple[float, float] = (0.0, 0.0)
    outline: Shape | None = None
    is_simplified: bool = False
    """Whether the outline itself can't be used, so that the rectangle stands for it."""

    def differs_m(self, length_m: float, width_m: float) -> float:
        """How far its size is from a stated one. A size that is no robot's may be in another unit."""
        apart_m = abs(self.length_m - length_m) + abs(self.width_m - width_m)
        if max(self.length_m, self.width_m, length_m, width_m) <= MOST_BODY_M:
            return apart_m
        for _, per_m in UNITS:
            for by, other_by in ((per_m, 1.0), (1.0, per_m)):
                sides_m = abs(self.length_m / by - length_m / other_by), abs(self.width_m / by - width_m / other_by)
                apart_m = min(apart_m, sum(sides_m))
        return apart_m


def outline_of(corners: Sequence[Corner]) -> Outline:
    """A polygon, and the rectangle about it along the axes of the robot's frame."""
    if corners[0] == corners[-1]:
        corners = corners[:-1]
    xs, ys = zip(*corners, strict=True)
    west, east, south, north = min(xs), max(xs), min(ys), max(ys)
    is_rectangle = set(corners) == {(west, south), (west, north), (east, south), (east, north)}
    is_faulty = not is_rectangle and outline_fault(corners) is not None
    outline = None if is_rectangle or is_faulty else Shape.polygon(corners)
    length_m, width_m = min(east - west, float_info.max), min(north - south, float_info.max)
    return Outline(length_m, width_m, (west / 2 + east / 2, south / 2 + north / 2), outline, is_faulty)
