"""Forecasts as knots with the rates at which each robot goes on from there: straight, evenly turning motion.

A slab is one whole second of absolute time. What a robot does in a slab follows from its knots and the slab alone,
whichever pass asks. Times within a slab count from its start: small numbers that keep their digits, whatever the date.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ingest.seam import Floats, Forecasts

Bools = NDArray[np.bool_]
Knots = NDArray[Any]
"""Of `KNOT`."""

KNOT = np.dtype(
    [(name, np.float64) for name in ("t", "x", "y", "yaw", "vx", "vy", "turn")] + [("floor", np.int64)], align=True
)
"""Time, envelope centre and heading, rates a second until the next knot, and floor. Rates are 0 after the last."""

FARTHEST_M, LATEST_S, MOST_TURNED_RAD = 1e8, 1e11, 1e6
"""Numbers beyond these are no places, times or headings, and their differences would lose their digits."""


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


def knots_of(forecasts: Forecasts) -> Knots:
    """(k,) the knots of valid forecasts."""
    goes_on = np.zeros(len(forecasts.t_s), bool)
    goes_on[:-1] = forecasts.floor[1:] == forecasts.floor[:-1]
    goes_on[forecasts.start[1:] - 1] = False
    span = np.where(goes_on, np.diff(forecasts.t_s, append=np.inf), 1.0)
    made = np.empty(len(span), KNOT)
    made["t"], made["x"], made["y"], made["floor"] = forecasts.t_s, forecasts.x_m, forecasts.y_m, forecasts.floor
    made["yaw"] = _wrapped(forecasts.yaw_rad)
    for name, column in (("vx", forecasts.x_m), ("vy", forecasts.y_m)):
        made[name] = np.where(goes_on, np.diff(column, append=0.0), 0.0) / span
    made["turn"] = np.where(goes_on, _wrapped(np.diff(forecasts.yaw_rad, append=0.0)), 0.0) / span
    return made


def _wrapped(yaw_rad: Floats) -> Floats:
    """The same heading within [-pi, pi): sines of large angles lose digits."""
    wrapped: Floats = (yaw_rad + np.pi) % (2 * np.pi) - np.pi
    return wrapped
