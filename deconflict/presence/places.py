"""Where silent robots are believed to stand, and who has driven through such a place."""

from math import ceil
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from deconflict.motion import Bools
from deconflict.presence.heard import Legs
from deconflict.rectangles import signed_gap
from ingest.angles import turn_between
from ingest.seam import Batch, Floats, Ints

INNER = 0.5
"""A robot has driven through a place where the two outlines, scaled down to this, overlap: that is no mere touch."""
MOVED_M = 0.1
"""One that has moved less has driven through nothing."""
JOINED_S = 2.1
"""Between reports further apart the way is not known; only where the robot is in the end."""
STEP_M = 0.2
MOST_STEPS = 64
"""A leg is looked at in steps of this, but no more of them."""


class Place(NamedTuple):
    """An outline on a floor."""

    x_m: float
    y_m: float
    yaw_rad: float
    floor: int
    half_length_m: float
    half_width_m: float
    bottom_m: float
    top_m: float
    doubt_m: float
    """How far off its position may be."""


class Places:
    """By robot. What is asked costs nothing where there are none."""

    def __init__(self) -> None:
        self._places: dict[str, Place] = {}
        self._names: list[str] = []
        self._columns: Floats = np.empty((9, 0))
        """(9, n) of the places, in the order of their names."""
        self._tree: cKDTree | None = None

    def __len__(self) -> int:
        return len(self._places)

    def put(self, uuid: str, place: Place) -> None:
        self._places[uuid], self._tree = place, None

    def discard(self, uuid: str) -> None:
        if self._places.pop(uuid, None):
            self._tree = None

    def driven_through(self, batch: Batch, legs: Legs) -> dict[str, int]:
        """The robots through whose places others of the batch have driven, and the row of who did so first."""
        if not self._places or not len(legs.rows):
            return {}
        reaches, names = self._reaching(batch, legs)
        through = self._is_through(batch, legs, *reaches)
        found: dict[str, int] = {}
        for leg, place in zip(*(one[through].tolist() for one in reaches), strict=True):
            if self._names[place] != batch.robots[int(legs.rows[leg])]:
                found.setdefault(names[place], int(legs.rows[leg]))
        return found

    def _reaching(self, batch: Batch, legs: Legs) -> tuple[tuple[Ints, Ints], list[str]]:
        """Legs and places that may meet: (n,) of each. And whose the places are."""
        tree = self._indexed()
        radius_m = float(np.hypot(self._columns[4], self._columns[5]).max())
        long_m = np.hypot(*(np.diff(column)[:, 0] for column in (legs.x_m, legs.y_m)))
        moving = np.flatnonzero((long_m > MOVED_M) & np.isfinite(legs.took_s))
        is_joined = _is_joined(legs)[moving]
        from_m = np.where(is_joined, long_m[moving] / 2, 0.0)
        rows = legs.rows[moving]
        own_m = np.hypot(batch.forecasts.length_m[rows], batch.forecasts.width_m[rows]) / 2
        ends = np.stack([legs.x_m[moving, 1], legs.y_m[moving, 1]], axis=1)
        middles = np.stack([legs.x_m[moving].mean(axis=1), legs.y_m[moving].mean(axis=1)], axis=1)
        middles = np.where(is_joined[:, None], middles, ends)
        near = tree.query_ball_point(middles, from_m + own_m + radius_m)
        leg = np.repeat(moving, [len(one) for one in near])
        place = np.array([one for some in near for one in some], np.int64)
        same = legs.floor[leg, 1] == self._columns[3][place]
        return (leg[same], place[same]), self._names

    def _is_through(self, batch: Batch, legs: Legs, leg: Ints, place: Ints) -> Bools:
        """(n,) whether robots drove through places: on one floor, at one height, and well into the outline."""
        if not len(leg):
            return np.zeros(0, np.bool_)
        told, rows = batch.forecasts, legs.rows[leg]
        x_m, y_m, yaw_rad, _, half_length_m, half_width_m, bottom_m, top_m, doubt_m = self._columns[:, place]
        doubt_m = doubt_m + batch.doubt_m[rows]
        own = INNER * np.stack([told.length_m[rows], told.width_m[rows]]) / 2
        others = INNER * np.stack([half_length_m, half_width_m]) - doubt_m
        at_x_m, at_y_m, at_yaw_rad = _sampled(legs, leg)
        apart_m = signed_gap(
            x_m[:, None] - at_x_m, y_m[:, None] - at_y_m, at_yaw_rad, _like(yaw_rad, at_yaw_rad), own, others.clip(0.0)
        )
        at_one_height = (told.bottom_m[rows] < top_m) & (told.top_m[rows] > bottom_m)
        through: Bools = (apart_m.min(axis=1) < 0.0) & at_one_height & (others > 0.0).all(axis=0)
        return through

    def _indexed(self) -> cKDTree:
        if self._tree is None:
            self._names = list(self._places)
            self._columns = np.array(list(self._places.values()), np.float64).T
            self._tree = cKDTree(self._columns[:2].T)
        return self._tree


def _is_joined(legs: Legs) -> Bools:
    joined: Bools = (legs.took_s <= JOINED_S) & (legs.floor[:, 0] == legs.floor[:, 1])
    return joined


def _sampled(legs: Legs, leg: Ints) -> tuple[Floats, Floats, Floats]:
    """(n, m) poses along legs; all at the end of one whose way is not known."""
    x_m, y_m, yaw_rad = legs.x_m[leg], legs.y_m[leg], legs.yaw_rad[leg]
    is_joined = _is_joined(legs)[leg][:, None]
    longest_m = float(np.where(is_joined, np.hypot(np.diff(x_m), np.diff(y_m)), 0.0).max())
    shares = np.linspace(0.0, 1.0, min(ceil(longest_m / STEP_M), MOST_STEPS - 1) + 1)
    shares = np.where(is_joined, shares, 1.0)
    turns = np.array([turn_between(*one) for one in yaw_rad.tolist()])
    at = [column[:, :1] + shares * np.diff(column) for column in (x_m, y_m)]
    return at[0], at[1], yaw_rad[:, :1] + shares * turns[:, None]


def _like(values: Floats, table: Floats) -> Floats:
    """(n, m) each of n values m times."""
    return np.broadcast_to(values[:, None], table.shape)
