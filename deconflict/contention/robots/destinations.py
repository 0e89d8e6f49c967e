"""Where robots go, as they say it in a batch: all destinations at once."""

from math import hypot
from typing import NamedTuple

import numba
import numpy as np

from deconflict.contention.robots.announced_arrivals import ARRIVED_M
from deconflict.contention.robots.arrival_forecast import Corrections
from deconflict.contention.robots.lookahead import STEP_S, STEPS, Ahead
from deconflict.contention.robots.overdue_times import OVERDUE_S
from deconflict.contention.robots.record_kernels import ROBOT, STOP, Drawn, Records, Stops
from ingest.batch import Bools, Destinations, Floats, Ints
from ingest.kernels import inner, kernel, ready

QUICKEST_MPS = 2.0
"""Nobody is expected to be anywhere sooner than at this speed in a straight line."""

_STOPS = numba.types.Array(numba.from_dtype(STOP), 2, "C")
_FLOATS, _INTS = (numba.types.Array(kind, 1, "C", readonly=True) for kind in (numba.float64, numba.int64))
_TABLE, _INT_TABLE = (numba.types.Array(kind, 2, "C", readonly=True) for kind in (numba.float64, numba.int64))
_RECORDS = numba.types.Array(numba.from_dtype(ROBOT), 1, "C")
_STACK = numba.types.Array(numba.float64, 3, "C", readonly=True)


class Stop(NamedTuple):
    """One destination ahead."""

    told_s: float
    """When the robot says that it comes; where its path ends, as forecast."""
    t_s: float
    """When it means to come and can, corrected by how wrong its vendor has been; now where that is past."""
    expected_s: float
    """When it is expected: later than that where it is overdue."""
    spread_s: float
    """Half the width of the middle 80 % of that."""
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
    corrections: Corrections,
    drawn: Drawn,
) -> tuple[Ints, Bools]:
    """Write where n robots go into `stops`: (n,) how many there are of each, and whether one may be in a resource.

    Those at the head that a robot is at already are left out; resources are not told yet. `view` is of `now_s` (n,) on,
    `drawn` are the resources, and `numbers` those of the floors of `told`.
    """
    return _set_out(
        stops,
        slots,
        numbers,
        ready(told.start, np.int64),
        ready(told.floor, np.int64),
        *(ready(told.t_s), ready(told.x_m), ready(told.y_m), now_s),
        *(view.floor, view.x_m, view.y_m),
        corrections.row,
        corrections.rates,
        *drawn,
        ARRIVED_M,
    )


@kernel(
    numba.types.Tuple((numba.int64[::1], numba.boolean[::1]))(  # type: ignore[no-untyped-call]
        _STOPS, *[_INTS] * 4, *[_FLOATS] * 4, _INT_TABLE, *[_TABLE] * 2, *[_INTS, _TABLE] * 2, numba.float64
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
    correction: Ints,
    rates: Floats,
    resource_floors: Ints,
    resources_m: Floats,
    arrived_m: float,
) -> tuple[Ints, Bools]:
    counts, bound = np.zeros(len(slots), np.int64), np.zeros(len(slots), np.bool_)
    for row in range(len(slots)):
        at = numbers[at_floor[row, 0]] if at_floor[row, 0] >= 0 else -1
        low, middle, high = rates[correction[row]]
        for k in range(start[row], start[row + 1]):
            on = numbers[floor[k]] if floor[k] >= 0 else -1
            away_m = hypot(x_m[k] - at_x_m[row, 0], y_m[k] - at_y_m[row, 0]) if on == at else 0.0
            if counts[row] == 0 and on == at and away_m <= arrived_m:
                continue
            ahead_s = max(t_s[k] - now_s[row], 0.0)
            stop = stops[slots[row], counts[row]]
            stop.told_s = t_s[k]
            stop.t_s = stop.expected_s = max(now_s[row] + middle * ahead_s, now_s[row] + away_m / QUICKEST_MPS)
            stop.spread_s = (high - low) / 2 * ahead_s
            stop.x_m, stop.y_m, stop.floor, stop.resource = x_m[k], y_m[k], on, -1
            counts[row] += 1
            for place in range(len(resource_floors)):
                if resource_floors[place] == on:
                    west, south, east, north = resources_m[place]
                    bound[row] |= west <= x_m[k] <= east and south <= y_m[k] <= north
    return counts, bound


def expect(robots: Records, stops: Stops, slots: Ints, now_s: Floats, corrections: Corrections) -> None:
    """Put off when robots (n,) that are past the time which they told of their next stop are expected, by `now_s` (n,).

    One that drives comes at its pace. One that stands takes as long as others of its vendor did. It comes to the stops
    after that as much later as it told.
    """
    _expect(robots, stops, slots, now_s, corrections.row, corrections.left_s, OVERDUE_S, STEPS * STEP_S)


@inner
def _left(left_s: Floats, overdue_s: Floats, late_s: float) -> tuple[float, float, float]:
    """The quantiles of what is left to a robot so late: between two rows of the table, or in line with the last two."""
    after = 1
    while after < len(overdue_s) - 1 and overdue_s[after] < late_s:
        after += 1
    share = (late_s - overdue_s[after - 1]) / (overdue_s[after] - overdue_s[after - 1])
    low, middle, high = left_s[after - 1] + share * (left_s[after] - left_s[after - 1])
    return low, middle, high


@kernel(numba.void(_RECORDS, _STOPS, _INTS, _FLOATS, _INTS, _STACK, _FLOATS, numba.float64))
def _expect(
    robots: Records,
    stops: Stops,
    slots: Ints,
    now_s: Floats,
    correction: Ints,
    left_s: Floats,
    overdue_s: Floats,
    way_lasts_s: float,
) -> None:
    for row in range(len(slots)):
        one, now = robots[slots[row]], now_s[row]
        if one.stops == 0 or stops[slots[row], 0].told_s >= now:
            continue
        first = stops[slots[row], 0]
        away_m = hypot(first.x_m - one.x_m, first.y_m - one.y_m) if first.floor == one.floor else 0.0
        if one.goes and not one.stands:
            first.expected_s = max(first.t_s, now + away_m * way_lasts_s / one.way_m)
        else:
            low, middle, high = _left(left_s[correction[row]], overdue_s, now - first.told_s)
            first.expected_s, first.spread_s = max(first.t_s, now + middle), (high - low) / 2
        for k in range(1, one.stops):
            stop, before = stops[slots[row], k], stops[slots[row], k - 1]
            stop.expected_s = max(stop.t_s, before.expected_s + stop.told_s - before.told_s)
            stop.spread_s = max(stop.spread_s, before.spread_s)
