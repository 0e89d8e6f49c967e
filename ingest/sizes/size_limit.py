"""What the one limit of size means: `reading.largest_body_m` of the site file, for each side of a body with its load.

A size within the limit is what was stated. A size beyond it is in another unit, if other figures show that; otherwise
the body stands at the limit. No size is the reason to reject a message.
"""

from typing import NamedTuple

UNITS = (("centimetres", 100.0), ("millimetres", 1000.0))
"""Units that senders take for metres, and how many are a metre. Of two that are possible the larger one is used."""
ALIKE = 3.0
"""Robots, their loads and their wheelbases differ by less than this factor. Units differ by more."""
SAME = 1.25
"""Two statements of the same length differ by less than this factor."""
SIZE_IN_OTHER_UNIT, SIZE_OVER_LIMIT = "size-in-other-unit", "size-over-limit"
LOAD_IN_OTHER_UNIT, LOAD_OVER_LIMIT = "load-in-other-unit", "load-over-limit"
"""The rules that all languages count."""


class Rectangle(NamedTuple):
    """A rectangle in the robot's frame: x along the heading, y to its left, from the reported location."""

    back_m: float
    front_m: float
    right_m: float
    left_m: float

    @classmethod
    def about(cls, centre_m: tuple[float, float], length_m: float, width_m: float) -> "Rectangle":
        """The rectangle with this centre."""
        x, y = centre_m
        return cls(x - length_m / 2, x + length_m / 2, y - width_m / 2, y + width_m / 2)

    @property
    def longer_m(self) -> float:
        """Its longer side."""
        return max(self.front_m - self.back_m, self.left_m - self.right_m)

    def is_within(self, largest_m: float) -> bool:
        """Whether it is within the limit, together with the reported location."""
        along_m, across_m = _reach_m(self.back_m, self.front_m), _reach_m(self.right_m, self.left_m)
        return along_m <= largest_m and across_m <= largest_m

    def bounded(self, largest_m: float) -> "Rectangle":
        """The same where it is within the limit. A side beyond it has the limit's length and holds the location."""
        along = _bounded(self.back_m, self.front_m, largest_m)
        return Rectangle(*along, *_bounded(self.right_m, self.left_m, largest_m))

    def is_near(self, x: float, y: float, distance_m: float = 0.0) -> bool:
        """Whether a point is no further from it than this, along each axis."""
        is_along = self.back_m - distance_m <= x <= self.front_m + distance_m
        return is_along and self.right_m - distance_m <= y <= self.left_m + distance_m


def are_within(a: float, b: float, factor: float) -> bool:
    """Whether two lengths differ by less than a factor."""
    return 0.0 < a <= factor * b and b <= factor * a


def size_text(*sides_m: float) -> str:
    return " x ".join(f"{side_m:g}" for side_m in sides_m)


def converted_text(what: str, unit: str, why: str, largest_m: float) -> str:
    """What a person is shown of a size that is in another unit."""
    return f"{what} is beyond reading.largest_body_m = {largest_m:g}; read as {unit}, as {why} shows. Send metres"


def over_limit_text(what: str, largest_m: float) -> str:
    """What a person is shown of a size that stands at the limit."""
    return (
        f"{what} is beyond reading.largest_body_m = {largest_m:g}, and no other figure shows a unit; it counts as "
        f"{largest_m:g} m. Send metres"
    )


def _reach_m(low_m: float, high_m: float) -> float:
    return max(high_m, 0.0) - min(low_m, 0.0)


def _bounded(low_m: float, high_m: float, largest_m: float) -> tuple[float, float]:
    if _reach_m(low_m, high_m) <= largest_m:
        return low_m, high_m
    start_m = min(max(-largest_m / 2, min(low_m, 0.0)), max(high_m, 0.0) - largest_m)
    return start_m, start_m + largest_m
