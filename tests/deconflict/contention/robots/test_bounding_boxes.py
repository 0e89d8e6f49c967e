"""Which boxes touch, against all of them looked at."""

import numpy as np
import pytest

from deconflict.contention.robots.bounding_boxes import ROUNDING_M, enlarged, touching_boxes


@pytest.mark.parametrize(("n", "m"), [(0, 0), (0, 3), (3, 0), (1, 1), (40, 30), (5, 200)])
def test_all_boxes_that_touch_are_found_and_no_others(n: int, m: int) -> None:
    rng = np.random.default_rng(n + m)
    boxes, others = (_around(rng.uniform(0, 8, (k, 2)).round(1), rng.choice([0.0, 0.5, 6.0], (k, 2))) for k in (n, m))
    every = np.all((boxes[:, None, :2] <= others[:, 2:]) & (others[:, :2] <= boxes[:, None, 2:]), axis=2)
    found = touching_boxes(boxes, others)
    assert sorted(map(tuple, found.tolist())) == list(map(tuple, np.argwhere(every).tolist()))
    assert np.all(np.diff(found[:, 0]) >= 0)


def test_an_enlarged_box_is_wider_on_every_side() -> None:
    by_m = np.array([0.0, 1.0])
    west, south, east, north = enlarged(np.array([[0.0, 1.0, 2.0, 3.0]] * 2), by_m).T
    assert west == pytest.approx(-by_m - ROUNDING_M, abs=1e-9)
    assert south == pytest.approx(1 - by_m - ROUNDING_M, abs=1e-9)
    assert east == pytest.approx(2 + by_m + ROUNDING_M, abs=1e-9)
    assert north == pytest.approx(3 + by_m + ROUNDING_M, abs=1e-9)


def _around(middle: np.ndarray, half: np.ndarray) -> np.ndarray:
    return np.concatenate([middle - half, middle + half], axis=1)
