"""The usual times of a model by cell and direction."""

from math import isnan

import numpy as np
import pytest

from deconflict.foresight.losses.usual_times import CELL_M, ENTRIES, UsualTimes, learn_pass, no_usual_times, usual_s
from ingest.batch import Floats

KIND, FLOOR = 3, 0.0


def pose(x_m: float, y_m: float = 0.5) -> Floats:
    return np.array([x_m, y_m, 0.0])


def learned(speed_mps: float = 0.5, passes: int = 3, to_x_m: float = 8.0) -> UsualTimes:
    """From x = 0 to `to_x_m`."""
    usual = no_usual_times()
    for _ in range(passes):
        learn_pass(usual, KIND, FLOOR, pose(0.0), pose(to_x_m), to_x_m / speed_mps)
    return usual


def test_the_usual_time_is_that_of_earlier_passes_in_the_same_direction() -> None:
    usual = learned()
    assert usual_s(usual, KIND, FLOOR, pose(1.0), pose(4.0)) == pytest.approx(6.0)
    assert isnan(usual_s(usual, KIND, FLOOR, pose(4.0), pose(1.0)))
    assert isnan(usual_s(usual, KIND, FLOOR, pose(1.0), pose(1.0, 3.5)))


def test_models_floors_and_cells_are_kept_apart_and_too_few_passes_are_not_enough() -> None:
    usual = learned()
    assert isnan(usual_s(usual, KIND + 1, FLOOR, pose(1.0), pose(4.0)))
    assert isnan(usual_s(usual, KIND, FLOOR + 1.0, pose(1.0), pose(4.0)))
    assert isnan(usual_s(usual, KIND, FLOOR, pose(6.0), pose(10.0)))
    assert isnan(usual_s(learned(passes=1), KIND, FLOOR, pose(1.0), pose(4.0)))


def test_the_usual_time_follows_a_change() -> None:
    usual = learned(0.5, passes=50)
    for _ in range(200):
        learn_pass(usual, KIND, FLOOR, pose(0.0), pose(8.0), 8.0)
    assert usual_s(usual, KIND, FLOOR, pose(1.0), pose(4.0)) == pytest.approx(3.0, rel=0.05)


def test_a_full_table_forgets_the_least_driven_cell() -> None:
    usual = learned(passes=200)
    for cell in range(2 * ENTRIES):
        row, column = divmod(cell, 300)
        x_m, y_m = CELL_M * column, CELL_M * row
        learn_pass(usual, KIND + 1, FLOOR, pose(x_m, y_m), pose(x_m + 0.1, y_m), 1.0)
    assert (usual.key != 0).mean() > 0.9
    assert usual_s(usual, KIND, FLOOR, pose(1.0), pose(4.0)) == pytest.approx(6.0)
