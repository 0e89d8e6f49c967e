"""Maps found from driving: right where enough is driven in common, and none where it is not."""

from functools import cache

import numpy as np
import pytest

from ingest.batch import Floats
from ingest.frames.driven.line_fit import rotation
from ingest.frames.driven.map_search import Doubt, DrivenFrame, FoundMap, found_map
from tests.helpers.made_driving import ROUND, followed, frame_of

TURN_RAD, SHIFT_M = 2.1, np.array([120.0, -45.0])
SECONDS, ROBOTS = 900, 12


@cache
def driven(seed: int = 1) -> Floats:
    return followed(ROUND, ROBOTS, SECONDS, seed)


def known(points_m: Floats) -> DrivenFrame:
    return frame_of(points_m, seed=7)


def found(own_m: Floats, others: DrivenFrame, matrix: Floats | None = None) -> FoundMap:
    turned = rotation(TURN_RAD) if matrix is None else rotation(TURN_RAD) @ matrix
    return found_map(frame_of(own_m @ turned.T + SHIFT_M, seed=8), others)


def test_a_frame_is_found_from_the_lanes_that_others_drive_too() -> None:
    own_m = driven()[:, ::2]
    answer = found(own_m, known(driven()[:, 1::2]))
    assert answer.doubt is None
    assert answer.fit
    off_m = (own_m.reshape(-1, 2) @ rotation(TURN_RAD).T + SHIFT_M) @ answer.fit.matrix.T + answer.fit.shift_m
    off_m -= own_m.reshape(-1, 2)
    assert np.hypot(*off_m.T).max() < answer.fit.error_m(answer.fit.reach_m) < 0.2
    assert abs(np.degrees(answer.fit.turn_rad + TURN_RAD)) < 1.0
    assert answer.fit.common_m > 1000.0


def test_two_equal_halls_side_by_side_are_not_taken_for_one() -> None:
    """Only that its robots would have stood in the others shows that they are in another hall."""
    answer = found(driven()[:, ::2] + (100.0, 0.0), known(driven(seed=2)[:, 1::2]))
    assert answer.doubt is Doubt.APART
    assert answer.overlaps
    assert answer.overlaps.found > 5


def test_a_single_aisle_leaves_open_where_along_it() -> None:
    aisle = ((0.0, 0.0), (60.0, 0.0), (60.0, 1.5), (0.0, 1.5), (0.0, 0.0))
    both = followed(aisle, 8, SECONDS, 3)
    assert found(both[:, ::2], known(both[:, 1::2])).doubt is Doubt.OPEN


@pytest.mark.parametrize(
    ("matrix", "doubt"),
    [(np.diag([1.0, -1.0]), Doubt.MIRRORED), (1.01 * np.eye(2), Doubt.STRETCHED)],
    ids=["mirrored", "stretched"],
)
def test_a_map_that_no_turn_and_shift_put_right_is_not_proposed(matrix: Floats, doubt: Doubt) -> None:
    assert found(driven()[:, ::2], known(driven()[:, 1::2]), matrix).doubt is doubt


def test_a_vendor_that_drives_alone_has_no_map() -> None:
    nobody = frame_of(np.zeros((0, 0, 2)), seed=1)
    assert found(driven()[:, ::2], nobody).doubt is Doubt.LITTLE
