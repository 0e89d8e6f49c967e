"""Two robots that cross: warned of at one height, and not if one passes above the other."""

from math import inf
from typing import NamedTuple

import pytest

from deconflict.sweep.geometry.heights import at_one_height, largest_group_at_one_height
from deconflict_client.advisory import ConflictAdvisory, Recommendation
from tests.deconflict.contention.scenes import Scene, Script, site
from tests.helpers.saying import robot


class Box(NamedTuple):
    bottom_m: float
    top_m: float


class Crossing(NamedTuple):
    """Advisories and near misses until two robots have crossed."""

    scene: Scene
    conflicts: list[ConflictAdvisory]
    """Open advisories of the pair after each step."""
    near_misses: int

    @property
    def advice(self) -> list[Recommendation]:
        return [conflict.recommendation for conflict in self.conflicts if conflict.recommendation]


def crossing(z_m: float) -> Crossing:
    """They cross after 10 s."""
    robots = {
        "A": Script([(0, -10, 0), (20, 10, 0)]),
        "B": Script([(0, 0, -10), (20, 0, 10)], vendor="Corvid", z_m=z_m),
    }
    scene, pair = Scene(site(), robots), {robot(name) for name in robots}
    conflicts, near_misses = list[ConflictAdvisory](), 0
    for tick in range(48):
        scene.run((tick + 1) / 4, from_s=tick / 4)
        conflicts += [conflict for conflict in scene.engine.conflicts() if {*conflict.robots} == pair]
        near_misses += len(scene.engine.near_misses)
    return Crossing(scene, conflicts, near_misses)


def test_robots_at_one_height_get_warnings_advice_and_near_misses() -> None:
    met = crossing(0.0)
    assert met.conflicts != []
    assert any(recommendation.holds for recommendation in met.advice)
    assert met.near_misses == 1


def test_robots_above_one_another_get_no_warning_no_advice_and_no_near_miss() -> None:
    met = crossing(5.0)
    assert met.conflicts == []
    assert met.near_misses == 0
    assert met.scene.advisories == []
    assert met.scene.engine.probabilities() == []


@pytest.mark.parametrize(
    ("other", "together"),
    [(Box(1.0, 2.0), True), (Box(1.01, 2.0), False), (Box(-3.0, -0.01), False), (Box(-inf, inf), True)],
)
def test_heights_overlap_if_they_touch_or_are_unknown(other: Box, together: bool) -> None:
    box = Box(0.0, 1.0)
    assert at_one_height(box, other) is at_one_height(other, box) is together


def test_the_largest_group_at_one_height_all_reaches_that_height() -> None:
    low, high, tall, unknown = Box(0.0, 1.0), Box(5.0, 6.0), Box(0.0, 6.0), Box(-inf, inf)
    assert largest_group_at_one_height([high, low, unknown]) == [low, unknown]
    assert largest_group_at_one_height([high, low, tall, high]) == [high, tall, high]
    assert largest_group_at_one_height(list[Box]()) == []
