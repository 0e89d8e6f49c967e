"""The seam: what the receiving half hands to the engine, as one numpy layout.

A `Batch` holds every robot that changed since the last one, its forecast normalised to timed poses in the frame
of its floor. Nothing else passes from the vendors' sockets to the engine.
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Basis(IntEnum):
    """What a forecast rests on."""

    STATIONARY = 0
    PATH = 1
    VELOCITY = 2
    DESTINATION = 3


@dataclass(frozen=True, slots=True, eq=False)
class Forecasts:
    """Timed poses of n robots, k knots in all; knots of robot i are rows `start[i]:start[i + 1]`.

    Between two knots x, y and yaw are linear in time, yaw along the shorter arc. Before its first knot a robot
    is not there; after its last it stands where that knot left it. A robot is on a knot's floor from that knot to
    the next; where the next knot lies on another floor it stands at the first knot's pose until then. Floor -1
    is a frame that is compared with nothing.
    """

    start: Ints
    """(n + 1,) first knot of each robot, and k."""
    t_s: Floats
    """(k,) seconds since the epoch, increasing within a robot."""
    x_m: Floats
    """(k,) envelope centre in the floor's frame."""
    y_m: Floats
    """(k,)"""
    yaw_rad: Floats
    """(k,) anticlockwise from x."""
    floor: Ints
    """(k,) index into the batch's floors."""
    length_m: Floats
    """(n,) envelope along the heading."""
    width_m: Floats
    """(n,) envelope across the heading."""
    bottom_m: Floats
    """(n,) height range of the robot; -inf and inf where the height is unknown."""
    top_m: Floats
    """(n,)"""

    def __len__(self) -> int:
        return len(self.start) - 1


@dataclass(frozen=True, slots=True, eq=False)
class Batch:
    """The robots that changed by the tick at `now_s`. All times are seconds since the epoch, service clock."""

    now_s: float
    floors: tuple[str, ...]
    """Floor ids by index; grows, never reorders."""
    robots: tuple[str, ...]
    """(n,) UUIDs."""
    vendors: tuple[str, ...]
    """(n,)"""
    names: tuple[str, ...]
    """(n,) what a person calls the robot."""
    states: tuple[str, ...]
    """(n,) operational state as the standard spells it, or the sender's own word."""
    arrival_s: Floats
    """(n,) when the newest status arrived."""
    event_s: Floats
    """(n,) when the newest pose was true, by the sender's corrected clock."""
    basis: Ints
    """(n,) `Basis` of each forecast."""
    doubt_m: Floats
    """(n,) how far off the position may be as reported."""
    forecasts: Forecasts
    """n robots, in the same order."""
    gone: tuple[str, ...]
    """UUIDs of robots that were forgotten."""
