"""Heights: if one robot passes above another one, they are not in each other's way.

Heights are a bottom and a top in metres. They are -inf and inf if unknown: such a robot overlaps all others in height.
"""

from collections.abc import Sequence
from typing import Protocol, TypeVar

from ingest.batch import Bools, Floats


class HasHeights(Protocol):
    """An object with a bottom and a top."""

    @property
    def bottom_m(self) -> float: ...
    @property
    def top_m(self) -> float: ...


T = TypeVar("T", bound=HasHeights)


def heights_overlap(robot: HasHeights, other: HasHeights) -> bool:
    """Whether neither passes above the other, by the rule of the sweep."""
    return robot.bottom_m <= other.top_m and other.bottom_m <= robot.top_m


def heights_overlap_each(bottom_m: Floats, top_m: Floats, other_bottom_m: Floats, other_top_m: Floats) -> Bools:
    """(n,) the same of n pairs."""
    return (bottom_m <= other_top_m) & (other_bottom_m <= top_m)


def largest_group_at_one_height(robots: Sequence[T]) -> list[T]:
    """The largest group of robots that all reach one common height, in the order given; the lowest of equal groups."""
    bottoms_m = sorted({robot.bottom_m for robot in robots})
    groups = [[robot for robot in robots if robot.bottom_m <= height_m <= robot.top_m] for height_m in bottoms_m]
    return max(groups, key=len, default=[])
