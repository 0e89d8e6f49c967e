"""Where robots go, as they say it in a batch: all destinations at once."""

from math import hypot
from typing import NamedTuple

import numba
import numpy as np

from deconflict.contention.ahead import Ahead
from deconflict.contention.promises import ARRIVED_M
from deconflict.contention.records import STOP, Drawn, Stops
from deconflict.motion import Bools
from ingest.compiled import kernel, ready
from ingest.seam import Destinations, Floats, Ints

QUICKEST_MPS = 2.0
"""Nobody is expected to be anywhere sooner than at this speed in a straight line."""

_STOPS = numba.types.Array(numba.from_dtype(STOP), 2, "C")
_FLOATS, _INTS = (numba.types.Array(kind, 1, "C", readonly=True) for kind in (numba.float64, numba.int64))
_TABLE, _INT_TABLE = (numba.types.Array(kind, 2, "C", readonly=True) for kind in (numba.float64, numba.int64))


class Stop(NamedTuple):
    """One destination ahead."""

    t_s: float
    """When the robot comes, corrected by how wrong its vendor has been."""
    spread_s: float
    datum: str
    x_m: float
    y_m: float
    resource: str | None


def set_out(
    stops: Stops,
    slots: Ints,
    numbers: Ints,
    told: Destinations,
    now_s: Floats,
    view: Ahead,
    rates: Floats,
    drawn: Drawn,
) -> tuple[Ints, Bools]:
    """Write where n robots go into `stops`: (n,) how many there are of each, and whether one may be in a resource.

    Those at the head that a robot is at already are left out; resources are not told yet. `view` is of `now_s` (n,) on;
    `rates` (n, 3) are the quantiles of their vendors, `drawn` the
    resources, and `numbers` those of the floors of `told`.
    """
    return _set_out(
        stops,
        slots,
        numbers,
        ready(told.start, np.int64),
        ready(told.floor, np.int64),
        *(ready(told.t_s), ready(told.x_m), ready(told.y_m), now_s),
        *(view.floor, view.x_m, view.y_m),
        rates,
        *drawn,
        ARRIVED_M,
    )


@kernel(
    numba.types.Tuple((numba.int64[::1], numba.boolean[::1]))(  # type: ignore[no-untyped-call]
        _STOPS, *[_INTS] * 4, *[_FLOATS] * 4, _INT_TABLE, *[_TABLE] * 3, _INTS, _TABLE, numba.float64
    )
)
def _set_out(
    stops: Stops,
    slots: Ints,
    numbers: Ints,
    start: Ints,
    floor: Ints,
    t_s: Floats,
    x_m: Floats,
    y_m: Floats,
    now_s: Floats,
    at_floor: Ints,
    at_x_m: Floats,
    at_y_m: Floats,
    rates: Floats,
    resource_floors: Ints,
    resources_m: Floats,
    arrived_m: float,
) -> tuple[Ints, Bools]:
    counts, bound = np.zeros(len(slots), np.int64), np.zeros(len(slots), np.bool_)
    for row in range(len(slots)):
        at = numbers[at_floor[row, 0]] if at_floor[row, 0] >= 0 else -1
        low, middle, high = rates[row]
        for k in range(start[row], start[row + 1]):
            on = numbers[floor[k]] if floor[k] >= 0 else -1
            away_m = hypot(x_m[k] - at_x_m[row, 0], y_m[k] - at_y_m[row, 0]) if on == at else 0.0
            if counts[row] == 0 and on == at and away_m <= arrived_m:
                continue
            ahead_s = max(t_s[k] - now_s[row], 0.0)
            stop = stops[slots[row], counts[row]]
            stop.t_s = max(now_s[row] + middle * ahead_s, now_s[row] + away_m / QUICKEST_MPS)
            stop.spread_s = (high - low) / 2 * ahead_s
            stop.x_m, stop.y_m, stop.floor, stop.resource = x_m[k], y_m[k], on, -1
            counts[row] += 1
            for place in range(len(resource_floors)):
                if resource_floors[place] == on:
                    west, south, east, north = resources_m[place]
                    bound[row] |= west <= x_m[k] <= east and south <= y_m[k] <= north
    return counts, bound
