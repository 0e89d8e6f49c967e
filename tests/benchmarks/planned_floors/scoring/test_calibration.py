"""What is said of probabilities, where what they are worth is known by construction."""

from typing import Any

import numpy as np
import pytest

from benchmarks.planned_floors.scoring.calibration import calibration
from benchmarks.planned_floors.scoring.judged_cases import Cases, Verdict
from ingest.batch import Floats

GROUPS, EACH = 20, 50


def cases(probabilities: Floats, two_s_ahead: list[float] | None = None) -> Cases:
    """Of probabilities (n, 3) alone."""
    nothing = np.empty((0, 1))
    return Cases(
        stops=np.empty((0, 5)),
        encounters=np.empty((0, 5)),
        outcomes=np.empty((0, 5)),
        silent=np.empty((0, 5)),
        standing=np.empty((0, 5)),
        silent_seconds=np.empty((0, 2)),
        passes=nothing,
        verdicts=nothing,
        seconds=np.empty((0, len(Verdict))),
        gone=nothing,
        minutes=np.empty((0, 3)),
        probabilities=probabilities,
        two_s_ahead=np.array(two_s_ahead or [])[:, None],
    )


def stated(shift: float = 0.0) -> dict[str, Any]:
    """The figures where a half of each of 20 groups of pairs has 0.2 and the other 0.8, and that share comes true."""
    half = EACH // 2
    probability = np.tile(np.repeat([0.2, 0.8], half), GROUPS)
    came_true = np.tile(np.concatenate([np.arange(half) < 0.2 * half, np.arange(half) < 0.8 * half]), GROUPS)
    group = np.repeat(np.arange(GROUPS), EACH)
    return calibration(cases(np.column_stack([probability + shift, came_true, group]), [0.5, 0.49, 0.0, 0.9]))


def test_correct_probabilities_have_a_small_calibration_error() -> None:
    found = stated()
    assert found["Brier skill"]["value"] == pytest.approx(1 - 0.16 / 0.25)
    assert found["above 0.5, pair-seconds"]["value"] == GROUPS * EACH / 2
    assert found["above 0.5, stated"]["value"] == pytest.approx(0.8)
    assert found["above 0.5, came true"]["value"] == pytest.approx(0.8)
    assert found["outcomes above 0.5 at 2 s"]["value"] == 0.5


def test_probabilities_too_high_by_a_tenth_have_that_calibration_error() -> None:
    assert stated(0.1)["calibration error"]["value"] == pytest.approx(0.1, abs=0.05)
    assert stated(0.1)["Brier skill"]["value"] < stated()["Brier skill"]["value"]


def test_seconds_of_one_pair_are_drawn_together() -> None:
    """Where all seconds of a group come to the same, a thousand of them are as sure as twenty cases."""
    rng = np.random.default_rng(1)
    group = np.repeat(np.arange(20), 50)
    alike = np.repeat(rng.random(20) < 0.7, 50)
    each = rng.permutation(alike)
    probability = np.full(1000, 0.7)
    widths = []
    for came_true in (alike, each):
        found = calibration(cases(np.column_stack([probability, came_true, group])))
        low, high = found["above 0.5, came true"]["interval"]
        widths.append(high - low)
    assert widths[0] > 4 * widths[1]


@pytest.mark.parametrize("name", ["calibration error", "Brier skill", "above 0.5, stated", "above 0.5, came true"])
def test_figures_of_probabilities_come_with_intervals(name: str) -> None:
    rng = np.random.default_rng(2)
    probability = rng.random(600)
    rows = np.column_stack([probability, rng.random(600) < probability, rng.integers(0, 30, 600)])
    figure = calibration(cases(rows))[name]
    low, high = figure["interval"]
    assert low < figure["value"] < high


def test_without_probabilities_there_are_no_figures() -> None:
    found = calibration(cases(np.empty((0, 3))))
    assert {figure["value"] for figure in found.values()} == {None}
