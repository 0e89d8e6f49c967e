"""What happened between robots at different heights."""

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
