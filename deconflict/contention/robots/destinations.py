"""The stops of robots, from the destinations they announce: for all robots of a batch at once."""

from math import hypot
from typing import NamedTuple

import numba
import numpy as np

from deconflict.contention.robots.announced_arrivals import ARRIVED_M
from deconflict.contention.robots.arrival_forecast import ArrivalCorrections
from deconflict.contention.robots.lookahead import LOOKAHEAD, STEP_S, STEPS, Lookahead
from deconflict.contention.robots.overdue_times import OVERDUE_S
from deconflict.contention.robots.record_kernels import OUTLINES, ROBOT, STOP, Outlines, Records, Stops
from ingest.batch import Bools, Destinations, Floats, Ints
from ingest.kernels import FLOAT, READ_CUBE, READ_FLOATS, READ_INTS, READ_MATRIX, inner, kernel, ready

MOST_STOPS = 20
"""So many stops of a robot are looked at, the first. The standard allows ten."""
FASTEST_MPS = 2.0
"""No robot is expected anywhere sooner than at this speed in a straight line."""
FIRST_WAY_M = 10.0
"""So much of the way to its first stop is taken of a robot that is met standing."""

_STOPS = numba.types.Array(numba.from_dtype(STOP), 2, "C")
_RECORDS = numba.types.Array(numba.from_dtype(ROBOT), 1, "C")


class PlannedStop(NamedTuple):
    """One stop ahead."""

    announced_s: float
    """When the robot announces to be there; if the stop is its path's end, as forecast."""
    t_s: float
    """That time, or now if it is past, corrected by its vendor's past errors."""
    expected_s: float
    """When it is expected: later than that if it is overdue."""
    spread_s: float
    """Half the width of the interval that holds its arrival with 80 %."""
    datum: str
    """Datum of its floor."""
    x_m: float
    """Where it is, in the floor's frame."""
    y_m: float
    resource: str | None
    """The resource that it is in; None if it is in none."""


def write_stops(
    stops: Stops,
    slots: Ints,
    floor_numbers: Ints,
    destinations: Destinations,
    now_s: float,
    view: Lookahead,
    corrections: ArrivalCorrections,
    resources: Outlines,
) -> tuple[Stops, Ints, Bools]:
    """Write where n robots go into `stops`, which are lengthened if need be. Returns them; (n,) how many stops each
    robot has, and whether any may be in a resource.

    The first stops that a robot is at already are left out. `STOP.resource` is not set yet. `view` begins at `now_s`.
    `floor_numbers` are the table's numbers of the floors of `destinations`.
    """
    missing = min(int(np.diff(destinations.start).max()), MOST_STOPS) - stops.shape[1]
    stops = np.pad(stops, ((0, 0), (0, missing))) if missing > 0 else stops
    counts, bound = _write_stops(
        stops,
        slots,
        floor_numbers,
        ready(destinations.start, np.int64),
        ready(destinations.floor, np.int64),
        *(ready(destinations.t_s), ready(destinations.x_m), ready(destinations.y_m)),
        now_s,
        view,
        corrections.row,
        corrections.rates,
        resources,
        ARRIVED_M,
    )
    return stops, counts, bound


@kernel((_STOPS, *[READ_INTS] * 4, *[READ_FLOATS] * 3, FLOAT, LOOKAHEAD, READ_INTS, READ_MATRIX, OUTLINES, FLOAT))
def _write_stops(
    stops: Stops,
    slots: Ints,
    floor_numbers: Ints,
    start: Ints,
    floor: Ints,
    t_s: Floats,
    x_m: Floats,
    y_m: Floats,
    now_s: float,
    view: Lookahead,
    correction: Ints,
    rates: Floats,
    resources: Outlines,
    arrived_m: float,
) -> tuple[Ints, Bools]:
    counts, bound = np.zeros(len(slots), np.int64), np.zeros(len(slots), np.bool_)
    for row in range(len(slots)):
        at = floor_numbers[view.floor[row, 0]] if view.floor[row, 0] >= 0 else -1
        low, middle, high = rates[correction[row]]
        for k in range(start[row], start[row + 1]):
            on = floor_numbers[floor[k]] if floor[k] >= 0 else -1
            away_m = hypot(x_m[k] - view.x_m[row, 0], y_m[k] - view.y_m[row, 0]) if on == at else 0.0
            if counts[row] == 0 and on == at and away_m <= arrived_m:
                continue
            if counts[row] == MOST_STOPS:
                break
            ahead_s = max(t_s[k] - now_s, 0.0)
            stop = stops[slots[row], counts[row]]
            stop.announced_s = t_s[k]
            stop.t_s = stop.expected_s = max(now_s + middle * ahead_s, now_s + away_m / FASTEST_MPS)
            stop.spread_s = (high - low) / 2 * ahead_s
            stop.x_m, stop.y_m, stop.floor, stop.resource = x_m[k], y_m[k], on, -1
            counts[row] += 1
            for place in range(len(resources.floors)):
                if resources.floors[place] == on:
                    west, south, east, north = resources.boxes_m[place]
                    bound[row] |= west <= x_m[k] <= east and south <= y_m[k] <= north
    return counts, bound


def postpone_overdue(robots: Records, stops: Stops, slots: Ints, now_s: float, corrections: ArrivalCorrections) -> None:
    """Postpone the expected arrivals of robots (n,) that are overdue at their next stop.

    A robot that drives comes at its speed. One that stands takes as long as others of its vendor did. The times between
    its stops stay as announced.
    """
    _postpone(robots, stops, slots, now_s, corrections.row, corrections.left_s, OVERDUE_S, STEPS * STEP_S)


@inner
def _time_left_s(left_s: Floats, overdue_s: Floats, late_s: float) -> tuple[float, float, float]:
    """Quantiles of the time left to a robot that is `late_s` late: interpolated, extrapolated after the last row."""
    after = 1
    while after < len(overdue_s) - 1 and overdue_s[after] < late_s:
        after += 1
    share = (late_s - overdue_s[after - 1]) / (overdue_s[after] - overdue_s[after - 1])
    low, middle, high = left_s[after - 1] + share * (left_s[after] - left_s[after - 1])
    return low, middle, high


@kernel(numba.void(_RECORDS, _STOPS, READ_INTS, FLOAT, READ_INTS, READ_CUBE, READ_FLOATS, FLOAT))
def _postpone(
    robots: Records,
    stops: Stops,
    slots: Ints,
    now_s: float,
    correction: Ints,
    left_s: Floats,
    overdue_s: Floats,
    lookahead_s: float,
) -> None:
    for row in range(len(slots)):
        robot = robots[slots[row]]
        if robot.stops == 0 or stops[slots[row], 0].announced_s >= now_s:
            continue
        first = stops[slots[row], 0]
        away_m = hypot(first.x_m - robot.x_m, first.y_m - robot.y_m) if first.floor == robot.floor else 0.0
        if robot.goes and not robot.stands:
            first.expected_s = max(first.t_s, now_s + away_m * lookahead_s / robot.way_m)
        else:
            low, middle, high = _time_left_s(left_s[correction[row]], overdue_s, now_s - first.announced_s)
            first.expected_s, first.spread_s = max(first.t_s, now_s + middle), (high - low) / 2
        for k in range(1, robot.stops):
            stop, before = stops[slots[row], k], stops[slots[row], k - 1]
            stop.expected_s = max(stop.t_s, before.expected_s + stop.announced_s - before.announced_s)
            stop.spread_s = max(stop.spread_s, before.spread_s)


def begin_ways(records: Records, steps_m: Floats, stops: Stops, slots: Ints, here_m: Floats) -> None:
    """Write the ways of n new robots: straight to their first stops, as if they had been seen to go there.

    A process that has just started meets robots that stand on their ways. `here_m` (n, 2) is where they are.
    """
    for slot, here in zip(slots.tolist(), here_m, strict=True):
        stop = stops[slot, 0]
        way_m = np.array([stop["x_m"], stop["y_m"]]) - here
        share = min(FIRST_WAY_M / max(float(np.hypot(*way_m)), FIRST_WAY_M), 1.0)
        steps_m[slot] = here + np.linspace(0.0, share, steps_m.shape[1])[:, None] * way_m
        ends_m = np.array([here, steps_m[slot, -1]])
        record = records[slot]
        record["west_m"], record["south_m"] = ends_m.min(axis=0)
        record["east_m"], record["north_m"] = ends_m.max(axis=0)
        record["goes"], record["floor"] = True, stop["floor"]


def is_at(robot: np.void, stop: np.void) -> bool:
    """Whether a robot of the table is at a stop."""
    away_m = np.hypot(stop["x_m"] - robot["x_m"], stop["y_m"] - robot["y_m"])
    return bool(stop["floor"] == robot["floor"] and away_m <= ARRIVED_M)
