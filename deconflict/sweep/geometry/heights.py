"""Heights: robots of which one passes above the other are not in each other's way.

Heights are a bottom and a top in metres, -inf and inf where they are unknown: such a robot is beside every other.
"""

from collections.abc import Sequence
from typing import Protocol, TypeVar

from ingest.batch import Bools, Floats


class HasHeights(Protocol):
    """What reaches from one height to another."""

    @property
    def bottom_m(self) -> float: ...
    @property
    def top_m(self) -> float: ...


T = TypeVar("T", bound=HasHeights)


def heights_overlap(one: HasHeights, other: HasHeights) -> bool:
    """Whether neither passes above the other, as the sweep decides it."""
    return one.bottom_m <= other.top_m and other.bottom_m <= one.top_m


def heights_overlap_each(bottom_m: Floats, top_m: Floats, other_bottom_m: Floats, other_top_m: Floats) -> Bools:
    """(n,) the same of n pairs."""
    found: Bools = (bottom_m <= other_top_m) & (other_bottom_m <= top_m)
    return found


def largest_group_at_one_height(robots: Sequence[T]) -> list[T]:
    """The most of them that all reach a common height, in the order given; the lowest such group where several are."""
    bottoms_m = sorted({one.bottom_m for one in robots})
    groups = [[one for one in robots if one.bottom_m <= height_m <= one.top_m] for height_m in bottoms_m]
    return max(groups, key=len, default=[])
