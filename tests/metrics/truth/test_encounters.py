"""What happened between robots at different heights, and how long an encounter goes on."""

from math import inf

import pytest

from tests.metrics.truth.made_motion import driven

PASS = (0.0, 11.0, -1.0)
"""The second robot drives past the first: they come within 0.3 m after 9.7 s, and overlap until 12 s."""


@pytest.mark.parametrize(("above_m", "met"), [(0.0, True), (1.0, True), (1.1, False), (5.0, False), (-inf, True)])
def test_a_robot_that_passes_above_another_has_no_encounter_with_it(above_m: float, met: bool) -> None:
    truth = driven(PASS, until_s=25, above_m=lambda _: above_m)
    assert bool(truth.encounters(0.3)) is met
    assert bool(truth.scenes.finish(truth.motion)) is met


def test_an_encounter_begins_when_one_robot_reaches_the_height_of_the_other() -> None:
    (encounter,) = driven(PASS, until_s=25, above_m=lambda t_s: 5.0 if t_s < 11 else 0.0).encounters(0.3)
    assert encounter.start_s == pytest.approx(11.0, abs=0.11)


@pytest.mark.parametrize(("drawn_apart_m", "encounters"), [(0.1, 2), (0.3, 1)])
def test_an_encounter_goes_on_until_the_pair_has_drawn_apart(drawn_apart_m: float, encounters: int) -> None:
    """The robots are 0.2 m apart, then 0.5 m for a moment, then 0.2 m again."""
    pieces = (0.0, 1.2, 0.0), (3.0, 1.2, 0.1), (6.0, 1.5, -0.1), (9.0, 1.2, 0.0)
    truth = driven(*pieces, until_s=12, drawn_apart_m=drawn_apart_m)
    assert len(truth.encounters(0.3)) == encounters
