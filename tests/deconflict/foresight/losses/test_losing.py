"""Which robots come into question as the cause of a loss."""

from typing import Any, Self

import numpy as np

from deconflict.foresight.losses.losing import MOST_NEAR, KnownRobots, nearest_rows, squares
from ingest.batch import Floats, Ints


def known(tracks: Floats, floor: Floats, reports: Ints, levels_m: Floats) -> KnownRobots:
    rows, newest = len(tracks), np.zeros(len(tracks), np.int64)
    cell = squares(newest, tracks, floor)
    return KnownRobots(
        newest=newest,
        reports=reports,
        t_s=np.zeros((rows, 1)),
        tracks=tracks,
        floor=floor,
        half_m=np.ones((2, rows)),
        levels_m=levels_m,
        vendor=np.zeros(rows, np.int64),
        ways=np.zeros((rows, 2, 3)),
        has_way=np.zeros(rows, np.bool_),
        cell=np.sort(cell),
        by_cell=np.argsort(cell, kind="stable"),
    )


FOUND = getattr(nearest_rows, "py_func")  # noqa: B009 - the compiled one would be compiled for these tests alone


def test_of_a_heap_the_nearest_on_the_floor_and_at_one_height_are_looked_at() -> None:
    rows, reports = 3 * MOST_NEAR, np.zeros(3 * MOST_NEAR, np.int64)
    reports[1:] = 1
    tracks = np.zeros((rows, 1, 2, 3))
    tracks[:, 0, 0, 0] = np.arange(rows, 0, -1) / rows
    floor = np.zeros((rows, 1))
    floor[-1] = 1.0
    levels_m = np.zeros((2, rows))
    levels_m[:, -2] = 3.0
    robots = known(tracks, floor, reports, levels_m)
    nearest = [row for row in range(rows - 3, 0, -1) if row != 5][:MOST_NEAR]
    assert FOUND(robots, 5, 0.0, 0.0, 2.0).tolist() == nearest
    assert FOUND(robots, 5, 0.0, 0.0, 5.5 / rows).tolist() == nearest[:3]


class Looked(np.ndarray[Any, Any]):
    """Ones, and how often they were looked at."""

    times = 0

    def __new__(cls, kind: type, rows: int) -> Self:
        return np.ones(rows, kind).view(cls)

    def __getitem__(self, key: Any) -> Any:
        self.times += 1
        return super().__getitem__(key)


def test_robots_on_the_whole_floor_are_found_where_they_are_near() -> None:
    random, rows = np.random.default_rng(3), 1500
    tracks, floor = np.zeros((rows, 1, 2, 3)), random.integers(0, 2, (rows, 1)).astype(np.float64)
    x_m, y_m = random.uniform(-70.0, 70.0, (2, rows))
    tracks[:, 0, 0, :2] = np.column_stack([x_m, y_m])
    looked = Looked(np.int64, rows)
    robots = known(tracks, floor, looked, np.zeros((2, rows)))
    for row in range(0, rows, 50):
        there = (np.abs(x_m - x_m[row]) <= 9.0) & (np.abs(y_m - y_m[row]) <= 9.0) & (floor[:, 0] == floor[row, 0])
        there[row] = False
        assert sorted(FOUND(robots, row, x_m[row], y_m[row], 9.0).tolist()) == np.flatnonzero(there).tolist()
    assert looked.times < rows / 50 * rows / 5
