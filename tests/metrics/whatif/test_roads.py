"""Ways along roads that robots have shown."""

import numpy as np

from ingest.batch import Bools, Floats
from metrics.whatif.roads import Roads, sampled_way

EAST = ((0.0, 0.0), (20.0, 0.0))
WEST = ((20.0, 10.0), (0.0, 10.0))
SIDES = (((0.0, 10.0), (0.0, 0.0)), ((20.0, 0.0), (20.0, 10.0)))


def length_m(way: tuple[tuple[float, float], ...]) -> float:
    return float(np.hypot(*np.diff(np.array(way), axis=0).T).sum())


def test_a_way_leads_along_the_roads() -> None:
    way = Roads([EAST, WEST, *SIDES], None).way((0.0, 0.0), (20.0, 0.0))
    assert way is not None
    assert length_m(way) < 21.0


def test_a_way_keeps_to_directions_that_were_seen() -> None:
    """Back along the other side of the ring, unless that is three times as far."""
    way = Roads([EAST, WEST, *SIDES], None).way((18.0, 0.0), (0.0, 4.0))
    assert way is not None
    assert sampled_way(np.array(way))[:, 1].max() > 9.0


def test_nobody_drives_where_it_is_forbidden() -> None:
    def is_east(x_m: Floats, _y_m: Floats, heading: Floats) -> Bools:
        forbidden: Bools = (heading[:, 0] > 0.5) & (x_m > 5.0) & (x_m < 15.0)
        return forbidden

    ring = [EAST, EAST[::-1], WEST, *SIDES]
    assert Roads(ring, is_east).way((0.0, 0.0), (20.0, 0.0)) is None
    back = Roads(ring, is_east).way((20.0, 0.0), (0.0, 0.0))
    assert back is not None


def test_there_is_no_way_to_where_nobody_drove() -> None:
    assert Roads([EAST, ((0.0, 30.0), (20.0, 30.0))], None).way((0.0, 0.0), (20.0, 30.0)) is None
