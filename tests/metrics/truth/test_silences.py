"""Robots that fall silent: what that says of what came of their pairs."""

from math import inf

import numpy as np
import pytest

from metrics.scoring.warnings.outcomes_by_moment import HORIZON_S, InteractionOutcomes
from metrics.truth.encounters import EncounterFinder
from metrics.truth.interactions import Interactions
from metrics.truth.pair_outcomes import AllPairOutcomes, Verdict
from tests.metrics.truth.made_motion import reported

SILENT_FROM_S, PASSES_AT_S = 10, 20
PAIR = ("other", "silent")


def floor(passes_m: float, silent_from_s: int = SILENT_FROM_S) -> EncounterFinder:
    """One stands at the origin and is silent from then on; another one drives by at 1 m/s and ends `passes_m` short of
    where it stood, or beyond."""
    truth = EncounterFinder([0.3], 0.1)
    for second in range(60):
        t_s = float(second)
        robots = [("other", 0, min(t_s - PASSES_AT_S, -passes_m)), ("far", 0, 50.0)]
        robots += [("silent", 0, 0.0)] if second <= silent_from_s else []
        reported(truth, t_s, *robots)
        truth.silences.fallen_silent(t_s)
        truth.advance(t_s)
    truth.finish()
    return truth


@pytest.mark.parametrize(("passes_m", "verdict"), [(-5.0, Verdict.KEPT_APART), (3.0, Verdict.UNKNOWN)])
def test_a_pair_is_kept_apart_if_one_became_silent_and_the_other_drove_through_its_place(
    passes_m: float, verdict: Verdict
) -> None:
    truth, at_s = floor(passes_m), float(SILENT_FROM_S - 1)
    outcomes = AllPairOutcomes(truth, Interactions(), 0.3)
    assert outcomes.of(PAIR).verdict(at_s, outcomes.left_s(PAIR, at_s)) is verdict
    fate = InteractionOutcomes(truth, outcomes).after([PAIR], np.zeros(1, np.int64), np.array([at_s]))
    assert fate.began_s.tolist() == [inf]
    assert (fate.left_s[0] < at_s + HORIZON_S) == (verdict is Verdict.UNKNOWN)


@pytest.mark.parametrize("silent_from_s", range(8, 13))
def test_a_silent_robot_does_not_drive_through_its_own_place(silent_from_s: int) -> None:
    assert floor(3.0, silent_from_s).silences.left_s("silent", 9.0) == silent_from_s
