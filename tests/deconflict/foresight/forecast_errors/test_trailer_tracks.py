"""Trailers in probabilities: what they are near to, and what comes near them, counts for the robot that pulls them."""

from math import pi

import pytest

from ingest.shapes import Trailer
from tests.deconflict.foresight.probability.made_stage import Stage, Walk

PAIR = ("other", "train")
MEETS_AT_S = 12
TRAILERS = (Trailer(1.0, 0.8, 1.5, 0.0),) * 4


def stage(trailers: tuple[Trailer, ...], other_m: float = 5.0) -> Stage:
    """A train goes east. The other one goes north and is on its way after 12 s, when the train is 5 m further."""
    other = Walk((MEETS_AT_S - other_m, -float(MEETS_AT_S)), (0.0, 1.0))
    return Stage({"train": Walk((0.0, 0.0), (1.0, 0.0), trailers=trailers), "other": other})


@pytest.mark.parametrize("trailers", [(), TRAILERS])
def test_a_pair_that_only_a_trailer_brings_together_is_likely_to_meet_and_meets(trailers: tuple[Trailer, ...]) -> None:
    seconds = stage(trailers).run(20)
    assert (max(each.get(PAIR, 0.0) for each in seconds[:MEETS_AT_S]) > 0.5) == bool(trailers)
    is_open = [PAIR in each for each in seconds[MEETS_AT_S - 4 : MEETS_AT_S + 4]]
    assert is_open == ([True, True, True, False, False, False, True, True] if trailers else [False] * 8)


def test_the_headings_of_trailers_count() -> None:
    folded = tuple(trailer._replace(yaw_rad=pi / 2) for trailer in TRAILERS)
    walks = {"train": Walk((0.0, 0.0), (0.0, 0.0), trailers=folded), "other": Walk((0.0, -4.5), (0.0, 0.0))}
    assert stage_of(walks) == {}
    walks["train"] = Walk((0.0, 0.0), (0.0, 0.0), trailers=TRAILERS)
    assert stage_of(walks)[PAIR] < 0.5


def stage_of(walks: dict[str, Walk]) -> dict[tuple[str, str], float]:
    return Stage(walks).run(3)[-1]


def test_a_robot_that_gives_its_trailers_away_has_none() -> None:
    made = stage(TRAILERS)
    made.run(MEETS_AT_S - 4)
    made.walks["train"].trailers = ()
    seconds = [made.second(t_s) for t_s in range(MEETS_AT_S - 4, 20)]
    assert all(PAIR not in each for each in seconds)
