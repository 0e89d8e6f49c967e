"""Forecasts cut into segments: straight, evenly turning pieces of motion, none longer than a slab.

A slab is one whole second of absolute time. Cutting a linear motion at a slab's edge or at a knot is exact, so
segments say just what the forecast said. Times within a segment count from the start of its slab: small numbers that
keep their digits, whatever the date.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ingest.seam import Floats, Forecasts, Ints

Bools = NDArray[np.bool_]

FARTHEST_M, LATEST_S, MOST_TURNED_RAD = 1e8, 1e11, 1e6
"""Numbers beyond these are no places, times or headings, and their differences would lose their digits."""
ROW_SPAN = 1 << 14
"""Seconds that separate one robot's times from the next one's in a sort key."""


@dataclass(frozen=True, slots=True, eq=False)
class Segments:
    """n pieces of motion, ordered by robot and time. Arrays are (n,)."""

    robot: Ints
    """Row of the robot."""
    slab: Ints
    """Whole seconds since the epoch."""
    t0: Floats
    """Start and end, seconds into the slab."""
    t1: Floats
    x: Floats
    """Centre at t0."""
    y: Floats
    yaw: Floats
    vx: Floats
    """Rates a second."""
    vy: Floats
    turn: Floats
    floor: Ints

    def __len__(self) -> int:
        return len(self.robot)

    def take(self, rows: Ints) -> "Segments":
        return Segments(*(getattr(self, name).take(rows) for name in self.__slots__))


def faults(forecasts: Forecasts) -> dict[int, str]:
    """Row to the reason why that robot can't be swept. The others may be."""
    found: dict[int, str] = {}
    sizes = np.column_stack([forecasts.length_m, forecasts.width_m])
    heights_wrong = np.isnan(forecasts.bottom_m) | np.isnan(forecasts.top_m) | (forecasts.bottom_m > forecasts.top_m)
    counts = np.diff(forecasts.start)
    finite = np.isfinite(forecasts.t_s) & np.isfinite(forecasts.x_m)
    finite &= np.isfinite(forecasts.y_m) & np.isfinite(forecasts.yaw_rad)
    near = (np.abs(forecasts.x_m) <= FARTHEST_M) & (np.abs(forecasts.y_m) <= FARTHEST_M)
    near &= (np.abs(forecasts.t_s) <= LATEST_S) & (np.abs(forecasts.yaw_rad) <= MOST_TURNED_RAD)
    owner = np.repeat(np.arange(len(forecasts)), counts)
    later = np.ones(len(owner), bool)
    later[1:] = (forecasts.t_s[1:] > forecasts.t_s[:-1]) | (owner[1:] != owner[:-1])
    for rows, reason in (
        (np.flatnonzero(heights_wrong), "heights-not-ordered"),
        (np.unique(owner[~later]), "times-not-increasing"),
        (np.flatnonzero((sizes > FARTHEST_M).any(axis=1)), "out-of-range"),
        (np.unique(owner[~near]), "out-of-range"),
        (np.unique(owner[~finite]), "not-finite"),
        (np.flatnonzero(~(sizes > 0).all(axis=1)), "size-not-positive"),
        (np.flatnonzero(~np.isfinite(sizes).all(axis=1)), "size-not-finite"),
        (np.flatnonzero(counts < 1), "no-knots"),
    ):
        found |= dict.fromkeys(rows.tolist(), reason)
    return found


def segments(forecasts: Forecasts, first_slab: int, slabs: int) -> Segments:
    """Valid forecasts cut for slabs `first_slab` to `first_slab + slabs - 1`; floor -1 is left out."""
    n, counts = len(forecasts), np.diff(forecasts.start)
    owner = np.repeat(np.arange(n), counts)
    since = np.clip(forecasts.t_s - first_slab, -ROW_SPAN / 4, ROW_SPAN / 4)
    edges = np.tile(np.arange(slabs + 1, dtype=np.float64), n)
    edge_owner = np.repeat(np.arange(n), slabs + 1)
    keys = np.concatenate([owner * float(ROW_SPAN) + since, edge_owner * float(ROW_SPAN) + edges])
    order = np.argsort(keys, kind="stable")
    is_knot = order < len(owner)
    robot = np.concatenate([owner, edge_owner])[order]
    t = np.concatenate([forecasts.t_s - first_slab, edges])[order]
    knot = np.cumsum(is_knot) - 1
    begins = (robot[1:] == robot[:-1]) & (t[1:] > t[:-1]) & (t[:-1] >= 0) & (t[1:] <= slabs)
    begins &= knot[:-1] >= forecasts.start[robot[:-1]]
    at = np.flatnonzero(begins)
    at = at[forecasts.floor[knot[at]] >= 0]
    return _moving(forecasts, first_slab, robot[at], t[at], t[at + 1], knot[at])


def _moving(forecasts: Forecasts, first_slab: int, robot: Ints, begin: Floats, end: Floats, knot: Ints) -> Segments:
    """Segments from `begin` to `end`, seconds since `first_slab`, each after knot `knot`."""
    vx, vy, turn = (rate.take(knot) for rate in _rates(forecasts))
    into = begin - (forecasts.t_s.take(knot) - first_slab)
    slab = np.floor(begin)
    return Segments(
        robot,
        slab.astype(np.int64) + first_slab,
        begin - slab,
        end - slab,
        forecasts.x_m.take(knot) + vx * into,
        forecasts.y_m.take(knot) + vy * into,
        _wrapped(forecasts.yaw_rad).take(knot) + turn * into,
        vx,
        vy,
        turn,
        forecasts.floor.take(knot),
    )


def _rates(forecasts: Forecasts) -> list[Floats]:
    """(k,) metres and radians a second along x, y and yaw, from each knot to the next; 0 where it stands."""
    goes_on = np.zeros(len(forecasts.t_s), bool)
    goes_on[:-1] = forecasts.floor[1:] == forecasts.floor[:-1]
    goes_on[forecasts.start[1:] - 1] = False
    span = np.where(goes_on, np.diff(forecasts.t_s, append=np.inf), 1.0)
    changes = [np.diff(column, append=0.0) for column in (forecasts.x_m, forecasts.y_m, forecasts.yaw_rad)]
    changes[2] = _wrapped(changes[2])
    return [np.where(goes_on, change, 0.0) / span for change in changes]


def _wrapped(yaw_rad: Floats) -> Floats:
    """The same heading within [-pi, pi): numpy's sine of a large angle may differ with what stands beside it."""
    wrapped: Floats = (yaw_rad + np.pi) % (2 * np.pi) - np.pi
    return wrapped
