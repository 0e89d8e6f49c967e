import numpy as np
import pytest
from numpy.random import default_rng

from deconflict.sweep.geometry.pose import pose_at, poses_at
from ingest.batch import Forecasts
from tests.helpers.made_encounters import encounters


@pytest.mark.parametrize("family", ["random", "floor_changes", "full_turns", "late_or_early"])
def test_poses_of_many_robots_equal_those_of_each_alone(family: str) -> None:
    forecasts = encounters(family, 20, seed=5, clearance_m=0.0)
    begin_s = float(forecasts.t_s.min())
    since_s, after_s = default_rng(3).uniform(begin_s - 2, begin_s + 10, len(forecasts)), np.arange(0.0, 10.5, 1.5)
    poses = poses_at(forecasts, since_s, after_s)
    for row in range(len(forecasts)):
        for column, moment_s in enumerate((since_s[row] + after_s).tolist()):
            alone = pose_at(forecasts.single(row), moment_s)
            x_m, y_m, yaw_rad, floor = poses[row, column]
            assert (x_m, y_m) == pytest.approx((alone.x_m, alone.y_m), abs=1e-6)
            assert np.cos(yaw_rad - alone.yaw_rad) == pytest.approx(1)
            assert floor == alone.floor


def test_no_robots_have_no_poses() -> None:
    assert poses_at(Forecasts.empty(), np.empty(0), np.zeros(3)).shape == (0, 3, 4)
