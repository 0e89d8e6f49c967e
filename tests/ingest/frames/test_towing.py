from math import atan2, cos, hypot, sin

import pytest

from ingest.frames.towing import axle_at, poses_behind, towed_along, towed_yaw


def drawn(yaw_rad: float, hitch_m: float, dx_m: float, dy_m: float, steps: int = 20_000) -> float:
    """The heading after many small steps, in each of which the axle keeps its distance to the axle ahead."""
    x, y, ahead_x, ahead_y = -hitch_m * cos(yaw_rad), -hitch_m * sin(yaw_rad), 0.0, 0.0
    for _ in range(steps):
        ahead_x, ahead_y = ahead_x + dx_m / steps, ahead_y + dy_m / steps
        away = hypot(ahead_x - x, ahead_y - y)
        x, y = ahead_x - hitch_m * (ahead_x - x) / away, ahead_y - hitch_m * (ahead_y - y) / away
    return atan2(ahead_y - y, ahead_x - x)


@pytest.mark.parametrize(("yaw_rad", "way"), [(0.0, (1, 0)), (1.0, (2, 0)), (-2.0, (0.5, 1.5)), (3.0, (-1, -1))])
def test_a_trailer_is_drawn_along(yaw_rad: float, way: tuple[float, float]) -> None:
    found, expected = towed_yaw(yaw_rad, 1.4, *way), drawn(yaw_rad, 1.4, *way)
    assert (cos(found), sin(found)) == pytest.approx((cos(expected), sin(expected)), abs=1e-3)


def test_a_trailer_keeps_its_distance_and_comes_into_line() -> None:
    yaws = towed_along([0.0, 0.0, 0.0], [1.5, 1.5, 1.5], 0.0, 30.0)
    assert yaws == pytest.approx([1.5708] * 3, abs=1e-3)
    assert poses_behind((0.0, 30.0), yaws, [1.5, 1.5, 1.5])[-1][:2] == pytest.approx((0.0, 25.5), abs=0.02)


def test_each_trailer_turns_later_than_the_one_ahead() -> None:
    first, second, third = towed_along([0.0, 0.0, 0.0], [1.5, 1.5, 1.5], 0.0, 1.0)
    assert first > second > third > 0.0


def test_a_train_that_stands_does_not_move() -> None:
    assert towed_along([0.3, 0.7], [1.0, 1.0], 0.0, 0.0) == [0.3, 0.7]


def test_the_axle_turns_with_the_robot() -> None:
    assert axle_at(1.0, 2.0, 1.5707963, (-0.5, 0.1)) == pytest.approx((0.9, 1.5))
