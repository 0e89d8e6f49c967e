"""Heights: if one robot passes above another one, they are not in each other's way.

Heights are a bottom and a top in metres. They are -inf and inf if unknown: such a robot overlaps all others in height.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from typing import Any, Protocol, TypeVar

from ingest.batch import Floats


class HasHeights(Protocol):
    """An object with a bottom and a top."""

    @property
    def bottom_m(self) -> float: ...
    @property
    def top_m(self) -> float: ...


T = TypeVar("T", bound=HasHeights)


def heights_overlap(
    bottom_m: Floats | float, top_m: Floats | float, other_bottom_m: Floats | float, other_top_m: Floats | float
) -> Any:
    """Whether neither robot passes above the other. Heights that touch overlap. Arrays give an array."""
    return (bottom_m <= other_top_m) & (other_bottom_m <= top_m)


def at_one_height(robot: HasHeights, other: HasHeights) -> bool:
    """Whether the heights of two objects overlap."""
    return bool(heights_overlap(robot.bottom_m, robot.top_m, other.bottom_m, other.top_m))


def largest_group_at_one_height(robots: Sequence[T]) -> list[T]:
    """The largest group of robots that all reach one common height, in the order given; the lowest of equal groups."""
    bottoms_m, tops_m = sorted(robot.bottom_m for robot in robots), sorted(robot.top_m for robot in robots)

    def reach(height_m: float) -> int:
        return bisect_right(bottoms_m, height_m) - bisect_left(tops_m, height_m)

    common_m = max(bottoms_m, key=reach, default=0.0)
    return [robot for robot in robots if robot.bottom_m <= common_m <= robot.top_m]
