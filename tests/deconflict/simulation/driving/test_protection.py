"""The protective stop: what is in whose way."""

import numpy as np
import pytest
import shapely

from deconflict.simulation.cast import ALDER, Make
from deconflict.simulation.driving.protection import Traffic, free_way, gaps
from deconflict.simulation.driving.routes import drive
from deconflict.simulation.driving.tracks import Tracks
from deconflict.simulation.layout import Place
from deconflict.simulation.truth import corners

Way = tuple[Place, Place]


def traffic(ways: list[Way], progress_m: list[float], speed_mps: list[float], make: Make = ALDER) -> Traffic:
    """Robots of one make on straight ways, the first of highest rank."""
    tracks = Tracks(len(ways))
    for row, (start, end) in enumerate(ways):
        yaw = float(np.arctan2(end[1] - start[1], end[0] - start[0]))
        tracks.put(row, drive([start, end], yaw, make))
    n = len(ways)
    return Traffic(
        tracks=tracks,
        progress_m=np.array(progress_m),
        speed_mps=np.array(speed_mps),
        backing=np.zeros(n, np.bool_),
        aside_m=np.zeros(n),
        floor=np.zeros(n, np.int64),
        length_m=np.full(n, make.body.length_m),
        width_m=np.full(n, make.body.width_m),
        ahead_m=np.zeros(n),
        rank=np.arange(n),
    )


def test_gaps_tell_overlap_and_never_more_than_the_distance() -> None:
    rng = np.random.default_rng(5)
    n = 2000
    a, b = (np.stack([*rng.uniform(-2, 2, (2, n)), rng.uniform(-4, 4, n)]) for _ in range(2))
    size_a, size_b = (tuple(rng.uniform(0.3, 2.0, (2, n))) for _ in range(2))
    found = gaps(a, b, (size_a[0], size_a[1]), (size_b[0], size_b[1]))
    shapes_a, shapes_b = (
        shapely.polygons(corners(np.column_stack([*pose, *size]))) for pose, size in ((a, size_a), (b, size_b))
    )
    distance_m = shapely.distance(shapes_a, shapes_b)
    assert np.array_equal(found > 0, distance_m > 0)
    assert np.all(found <= distance_m + 1e-9)
    assert 100 < np.sum(found > 0) < n - 100


def test_a_robot_sees_the_one_that_stands_in_its_way() -> None:
    ahead: list[Way] = [((0.0, 0.0), (20.0, 0.0)), ((2.5, 0.0), (2.5, 9.0))]
    free_m, by = free_way(traffic(ahead, [0.0, 0.0], [1.0, 0.0]))
    gap_m = 2.5 - ALDER.body.length_m / 2 - ALDER.body.width_m / 2
    assert by.tolist() == [1, -1]
    assert gap_m - 0.45 <= free_m[0] <= gap_m
    assert free_m[1] == np.inf


def test_robots_that_pass_in_their_lanes_are_in_nobodys_way() -> None:
    passing: list[Way] = [((0.0, -0.47), (20.0, -0.47)), ((20.0, 0.47), (0.0, 0.47))]
    free_m, _ = free_way(traffic(passing, [9.0, 10.5], [1.4, 1.4]))
    assert free_m.tolist() == [np.inf, np.inf]


def test_of_two_that_cross_the_later_rank_keeps_clear_of_the_other() -> None:
    crossing: list[Way] = [((0.0, 0.0), (20.0, 0.0)), ((10.0, -10.0), (10.0, 10.0))]
    free_m, by = free_way(traffic(crossing, [7.8, 8.2], [1.4, 1.2]))
    assert by.tolist() == [-1, 0]
    assert free_m[1] < 1.5


def test_a_robot_may_leave_one_that_it_is_too_near_to() -> None:
    near: list[Way] = [((0.0, 0.0), (20.0, 0.0)), ((-1.01, 0.0), (-9.0, 0.0))]
    free_m, _ = free_way(traffic(near, [0.0, 0.0], [0.0, 0.0]))
    assert free_m.tolist() == [np.inf, np.inf]


@pytest.mark.parametrize("floors", [[0, 0], [0, 1]])
def test_floors_are_apart(floors: list[int]) -> None:
    ahead: list[Way] = [((0.0, 0.0), (20.0, 0.0)), ((2.5, 0.0), (2.5, 9.0))]
    seen = traffic(ahead, [0.0, 0.0], [1.0, 0.0])
    seen.floor[:] = floors
    assert np.isfinite(free_way(seen)[0][0]) == (floors == [0, 0])
