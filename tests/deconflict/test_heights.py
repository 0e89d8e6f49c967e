"""Two robots that cross: all that is said of them at one height, and nothing where one passes above the other."""

from math import inf
from typing import NamedTuple

import pytest

from deconflict.advisory import Recommendation
from deconflict.heights import beside, most_beside
from tests.deconflict.contention.scenes import Scene, Script, site


class Box(NamedTuple):
    bottom_m: float
    top_m: float


def crossing(z_m: float) -> tuple[Scene, list[Recommendation], int]:
    """They cross after 10 s: the advice that was given until then, and how many near misses were noticed."""
    robots = {
        "A": Script([(0, -10, 0), (20, 10, 0)]),
        "B": Script([(0, 0, -10), (20, 0, 10)], vendor="Corvid", z_m=z_m),
    }
    scene = Scene(site(), robots)
    advice, near_misses = list[Recommendation](), 0
    for tick in range(48):
        scene.run((tick + 1) / 4, from_s=tick / 4)
        advice += [one.recommendation for one in scene.engine.conflicts() if one.recommendation]
        near_misses += len(scene.engine.near_misses)
    return scene, advice, near_misses


def test_at_one_height_they_get_advice_and_nearly_collide() -> None:
    _, advice, near_misses = crossing(0.0)
    assert any(one.holds for one in advice)
    assert near_misses == 1


def test_one_above_the_other_neither_should_wait_and_nothing_is_noticed() -> None:
    scene, advice, near_misses = crossing(5.0)
    assert not any(one.holds or one.note for one in advice)
    assert near_misses == 0
    assert scene.told == []


@pytest.mark.parametrize(
    ("other", "together"),
    [(Box(1.0, 2.0), True), (Box(1.01, 2.0), False), (Box(-3.0, -0.01), False), (Box(-inf, inf), True)],
)
def test_neither_is_above_the_other_where_their_heights_touch_or_are_unknown(other: Box, together: bool) -> None:
    one = Box(0.0, 1.0)
    assert beside(one, other) is beside(other, one) is together


def test_the_most_at_one_height_are_those_that_all_reach_it() -> None:
    low, high, tall, unknown = Box(0.0, 1.0), Box(5.0, 6.0), Box(0.0, 6.0), Box(-inf, inf)
    assert most_beside([high, low, unknown]) == [low, unknown]
    assert most_beside([high, low, tall, high]) == [high, tall, high]
    assert most_beside(list[Box]()) == []
