"""Which robots come into question as the cause of a loss."""

import numpy as np

from deconflict.foresight.losses.losing import MOST_NEAR, KnownRobots, nearest_rows


def test_of_a_heap_the_nearest_on_the_floor_and_at_one_height_are_looked_at() -> None:
    rows, reports = 3 * MOST_NEAR, np.zeros(3 * MOST_NEAR, np.int64)
    reports[1:] = 1
    tracks = np.zeros((rows, 1, 2, 3))
    tracks[:, 0, 0, 0] = np.arange(rows, 0, -1) / rows
    floor = np.zeros((rows, 1))
    floor[-1] = 1.0
    levels_m = np.zeros((2, rows))
    levels_m[:, -2] = 3.0
    robots = KnownRobots(
        newest=np.zeros(rows, np.int64),
        reports=reports,
        t_s=np.zeros((rows, 1)),
        tracks=tracks,
        floor=floor,
        half_m=np.ones((2, rows)),
        levels_m=levels_m,
        vendor=np.zeros(rows, np.int64),
        ways=np.zeros((rows, 2, 3)),
        has_way=np.zeros(rows, np.bool_),
    )
    nearest = [row for row in range(rows - 3, 0, -1) if row != 5][:MOST_NEAR]
    found = getattr(nearest_rows, "py_func")  # noqa: B009 - the compiled one would be compiled for this test alone
    assert found(robots, 5, 0.0, 0.0, 2.0).tolist() == nearest
    assert found(robots, 5, 0.0, 0.0, 5.5 / rows).tolist() == nearest[:3]
