"""The places where silent robots are believed to stand, and which robots have driven through such a place."""

from math import ceil, hypot, inf, sqrt
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from deconflict.foresight.motion_assumptions import JOINED_S
from deconflict.foresight.presence.report_intervals import Legs
from deconflict.sweep.geometry.envelope_distances import signed_gap
from deconflict.sweep.geometry.heights import heights_overlap
from deconflict.sweep.geometry.pose import Pose
from deconflict.sweep.pair_choice import nearest_of_each
from deconflict.sweep.robot_slots import lengthened
from ingest.batch import Batch, Bools, Floats, Forecasts, Ints
from ingest.frames.angles import turn_between

INNER = 0.5
"""A robot has driven through a place if the two outlines overlap when both are scaled down to this: more than a
touch."""
MOVED_M = 0.1
"""A robot that has moved less has driven through nothing."""
STEP_M = 0.2
"""Distance between two samples of a leg."""
NONE: Ints = np.empty(0, np.int64)
MOST_STEPS = 64
"""Most samples of a leg."""
MOST_NEAR = 128
"""Places that one leg may come near: far more than have room there. The nearest count."""
LEAST_ROWS = 32
"""Room for so many places is made at once. Fewer changes build no tree anew."""
CHANGED = -1
"""Instead of a row: the place has changed."""


class BelievedPlace(NamedTuple):
    """The outline of a robot on a floor, in the floor's frame."""

    x_m: float
    """Centre of the envelope."""
    y_m: float
    yaw_rad: float
    """Heading, anticlockwise from x."""
    floor: int
    """Index of the floor."""
    half_length_m: float
    """Half of the envelope, along the heading."""
    half_width_m: float
    """Half of the envelope, across the heading."""
    bottom_m: float
    """Lowest height of the robot, -inf if unknown."""
    top_m: float
    """Highest height of the robot, inf if unknown."""
    doubt_m: float
    """Uncertainty of the position."""


def place_of(forecast: Forecasts, pose: Pose, doubt_m: float = 0.0) -> BelievedPlace:
    """The outline of a robot at a pose. Its sizes and heights are those of its forecast."""
    halves_m = float(forecast.length_m[0]) / 2, float(forecast.width_m[0]) / 2
    heights_m = float(forecast.bottom_m[0]), float(forecast.top_m[0])
    return BelievedPlace(pose.x_m, pose.y_m, pose.yaw_rad, pose.floor, *halves_m, *heights_m, doubt_m)


class Approach(NamedTuple):
    """A robot has come near the place of a silent one."""

    silent: str
    """UUID of the silent robot."""
    other: str
    """UUID of the robot that came near."""
    at_s: float
    """When it first came near, seconds since the epoch."""


class PlaceTree(NamedTuple):
    """Finds places by position."""

    tree: shapely.STRtree
    """The centres of n places."""
    rows: Ints
    """(n,) the row of each place; `CHANGED` for a place that has changed since the tree was built."""

    def within(self, points: NDArray[np.object_], reach_m: Floats) -> Ints:
        """(2, m) which of n points, and the rows of the places that are within the reach (n,) of these."""
        near, number = self.tree.query(points, "dwithin", reach_m)
        rows = self.rows[number]
        return np.stack([near, rows])[:, rows != CHANGED]


def _tree_of(columns: Floats, rows: Ints) -> PlaceTree:
    """The tree of these rows of the columns of places, of which the first two are x and y."""
    return PlaceTree(shapely.STRtree(shapely.points(columns[:2, rows].T)), rows)


class BelievedPlaces:
    """Places by robot. Queries cost nothing if there are no places. The caller removes the place of a robot that
    reports again.

    Each place has a row. A tree finds the places by position. Places that changed since it was built are in a second,
    small tree, which is built anew after each change. The first is built anew once more have changed than the square
    root of all.
    """

    def __init__(self) -> None:
        self._places: dict[str, BelievedPlace] = {}
        self._rows: dict[str, int] = {}
        """The row of each robot. Rows are in the order in which robots came."""
        self._names: list[str] = []
        """By row: whose place it is, or was."""
        self._columns: Floats = np.zeros((10, 0))
        """(10, rows) fields of the places, and the radius of each; 0 if it was removed. There are more rows than
        names."""
        self._bounds_m: tuple[list[float], list[float]] = ([inf, inf], [-inf, -inf])
        """Least and greatest x and y of the places, including those that were removed since the tree was built."""
        self._tree = _tree_of(self._columns, NONE)
        """The first places by row, as they were when it was built."""
        self._changed: set[int] = set()
        """Rows of the places that are not in the tree."""
        self._changed_tree: PlaceTree | None = None
        """The places of `_changed`; None if any changed since it was built."""
        self._changes = 0
        """How many places were set or removed since the tree was built."""

    def __len__(self) -> int:
        return len(self._places)

    def get(self, uuid: str) -> BelievedPlace | None:
        return self._places.get(uuid)

    def set(self, uuid: str, place: BelievedPlace) -> None:
        if self._places.get(uuid) == place:
            return
        self._places[uuid] = place
        row = self._rows.setdefault(uuid, len(self._names))
        if row == len(self._names):
            self._names.append(uuid)
            if row == self._columns.shape[1]:
                self._columns = lengthened(self._columns, max(row, LEAST_ROWS), axis=1)
        self._columns[:, row] = *place, hypot(place.half_length_m, place.half_width_m)
        (least_m, most_m), at_m = self._bounds_m, (place.x_m, place.y_m)
        self._bounds_m = list(map(min, least_m, at_m)), list(map(max, most_m, at_m))
        self._changed.add(row)
        self._note_change(row)

    def discard(self, uuid: str) -> None:
        if self._places.pop(uuid, None):
            row = self._rows.pop(uuid)
            self._columns[:, row] = 0.0
            self._changed.discard(row)
            self._note_change(row)
            if not self._places:
                self._rebuild()

    def driven_through(self, batch: Batch, legs: Legs) -> dict[str, int]:
        """The robots through whose places others of the batch have driven, and the row of the first robot that did
        so."""
        found: dict[str, int] = {}
        near = self._near(batch, legs, 0.0) if self._places else (NONE, NONE)
        if len(near[0]):
            for leg, place in zip(*(rows[self._is_through(batch, legs, near)].tolist() for rows in near), strict=True):
                found.setdefault(self._names[place], int(legs.rows[leg]))
        return found

    def approached(self, batch: Batch, legs: Legs, within_m: float) -> list[Approach]:
        """The robots of the batch that have come within a distance of a place."""
        if not self._places:
            return []
        leg, place = near = self._near(batch, legs, within_m)
        apart_m, shares = self._apart_m(batch, legs, near, 1.0, beyond_m=within_m)
        is_within = apart_m <= within_m
        found = []
        for row in np.flatnonzero(is_within.any(axis=1)).tolist():
            first, batch_row = int(is_within[row].argmax()), int(legs.rows[leg[row]])
            took_s = float(legs.took_s[leg[row]])
            at_s = float(batch.event_s[batch_row]) - (1.0 - float(shares[row, first])) * took_s
            found.append(Approach(self._names[place[row]], batch.robots[batch_row], at_s))
        return found

    def _near(self, batch: Batch, legs: Legs, beyond_m: float) -> tuple[Ints, Ints]:
        """(n,) legs and (n,) places on one floor and at one height that may come within a distance of each other: of
        each leg the `MOST_NEAR` nearest."""
        trees, (from_x_m, to_x_m), (from_y_m, to_y_m) = self._trees(), legs.x_m.T, legs.y_m.T
        long_m, is_joined = np.hypot(to_x_m - from_x_m, to_y_m - from_y_m), _is_joined(legs)
        own_m = np.hypot(batch.forecasts.length_m[legs.rows], batch.forecasts.width_m[legs.rows]) / 2
        reach_m = np.where(is_joined, long_m / 2, 0.0) + own_m + float(self._columns[9].max()) + beyond_m
        x_m = np.where(is_joined, (from_x_m + to_x_m) / 2, to_x_m)
        y_m = np.where(is_joined, (from_y_m + to_y_m) / 2, to_y_m)
        has_moved = (long_m > MOVED_M) & np.isfinite(legs.took_s)
        some = np.flatnonzero(has_moved & self._are_in_bounds(x_m, y_m, reach_m))
        if not len(some):
            return NONE, NONE
        points = shapely.points(x_m[some], y_m[some])
        near, place = np.concatenate([tree.within(points, reach_m[some]) for tree in trees], axis=1)
        by_leg = np.lexsort((place, near))
        leg, place = some[near[by_leg]], place[by_leg]
        _, away_m = _nearest(legs, leg, *self._columns[:2, place])
        may_be = legs.floor[leg, 1] == self._columns[3][place]
        may_be &= away_m <= own_m[leg] + self._columns[9][place] + beyond_m
        may_be &= self._is_beside(batch, legs, (leg, place))
        leg, place = leg[may_be], place[may_be]
        kept = np.sort(nearest_of_each(leg, away_m[may_be], MOST_NEAR))
        return leg[kept], place[kept]

    def _are_in_bounds(self, x_m: Floats, y_m: Floats, reach_m: Floats) -> Bools:
        """(n,) whether points are as near to the rectangle around all places as they may reach."""
        (west_m, south_m), (east_m, north_m) = self._bounds_m
        within_x = (x_m >= west_m - reach_m) & (x_m <= east_m + reach_m)
        within: Bools = within_x & (y_m >= south_m - reach_m) & (y_m <= north_m + reach_m)
        return within

    def _is_beside(self, batch: Batch, legs: Legs, near: tuple[Ints, Ints]) -> Bools:
        """(n,) whether the heights of robots and places overlap."""
        leg, place = near
        forecasts, rows = batch.forecasts, legs.rows[leg]
        beside: Bools = heights_overlap(forecasts.bottom_m[rows], forecasts.top_m[rows], *self._columns[6:8, place])
        return beside

    def _is_through(self, batch: Batch, legs: Legs, near: tuple[Ints, Ints]) -> Bools:
        """(n,) whether robots drove far enough into the outlines of places."""
        leg, place = near
        halves_m, doubt_m = INNER * self._columns[4:6, place], self._columns[8, place] + batch.doubt_m[legs.rows[leg]]
        apart_m, _ = self._apart_m(batch, legs, near, INNER, doubt_m)
        through: Bools = (apart_m < 0.0).any(axis=1) & (halves_m > doubt_m).all(axis=0)
        return through

    def _apart_m(
        self,
        batch: Batch,
        legs: Legs,
        near: tuple[Ints, Ints],
        scale: float,
        doubt_m: Floats | float = 0.0,
        beyond_m: float = 0.0,
    ) -> tuple[Floats, Floats]:
        """(n, m) distances of the scaled outlines at m samples of each leg, and (n, m) the samples as parts of the leg.
        The outlines of the places are made smaller by `doubt_m`. Each leg is sampled where they may come within
        `beyond_m` of each other."""
        leg, place = near
        if not len(leg):
            return np.empty((0, 1)), np.empty((0, 1))
        forecasts, rows = batch.forecasts, legs.rows[leg]
        x_m, y_m, yaw_rad, _, *half_m = self._columns[:6, place]
        own_m = scale * np.stack([forecasts.length_m[rows], forecasts.width_m[rows]]) / 2
        places_m = np.maximum(scale * np.stack(half_m) - doubt_m, 0.0)
        reach_m = np.hypot(*own_m) + self._columns[9, place] + beyond_m
        shares, at_x_m, at_y_m, at_yaw_rad = _sampled(legs, leg, (x_m, y_m), reach_m)
        yaws_rad = np.broadcast_to(yaw_rad[:, None], at_yaw_rad.shape)
        between_m = x_m[:, None] - at_x_m, y_m[:, None] - at_y_m
        return signed_gap(*between_m, at_yaw_rad, yaws_rad, own_m, places_m), shares

    def _note_change(self, row: int) -> None:
        self._changes += 1
        self._changed_tree = None
        self._tree.rows[row : row + 1] = CHANGED

    def _trees(self) -> tuple[PlaceTree, PlaceTree]:
        """The unchanged and the changed places."""
        if self._changes > max(LEAST_ROWS, sqrt(len(self._places))):
            self._rebuild()
        if self._changed_tree is None:
            self._changed_tree = _tree_of(self._columns, np.array(list(self._changed), np.int64))
        return self._tree, self._changed_tree

    def _rebuild(self) -> None:
        """Build the tree of all places anew. Leaves out the rows of those that were removed."""
        self._columns, self._names = self._columns[:, list(self._rows.values())], list(self._rows)
        self._rows = {name: row for row, name in enumerate(self._names)}
        least_m, most_m = self._columns[:2].min(axis=1, initial=inf), self._columns[:2].max(axis=1, initial=-inf)
        self._bounds_m = least_m.tolist(), most_m.tolist()
        self._tree, self._changed_tree = _tree_of(self._columns, np.arange(len(self._names))), None
        self._changed, self._changes = set(), 0


def _is_joined(legs: Legs) -> Bools:
    return (legs.took_s <= JOINED_S) & (legs.floor[:, 0] == legs.floor[:, 1])


def _nearest(legs: Legs, leg: Ints, x_m: Floats, y_m: Floats) -> tuple[Floats, Floats]:
    """After which part of each leg (n,) the robot is nearest to a point (n,), and how far away it then is. If the way
    of a leg is not known, that is its end."""
    from_x_m, from_y_m = legs.x_m[leg, 0], legs.y_m[leg, 0]
    way_x_m, way_y_m = legs.x_m[leg, 1] - from_x_m, legs.y_m[leg, 1] - from_y_m
    along_m2 = (x_m - from_x_m) * way_x_m + (y_m - from_y_m) * way_y_m
    share = np.clip(along_m2 / np.maximum(way_x_m**2 + way_y_m**2, MOVED_M**2), 0.0, 1.0)
    share = np.where(_is_joined(legs)[leg], share, 1.0)
    return share, np.hypot(from_x_m + share * way_x_m - x_m, from_y_m + share * way_y_m - y_m)


def _sampled(
    legs: Legs, leg: Ints, places_m: tuple[Floats, Floats], reach_m: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """Samples along the parts of the legs that are within `reach_m` (n,) of x and y of a place (n,) each: their parts
    of the leg, x_m, y_m and yaw_rad, each (n, m).

    If the way of a leg is not known, all its samples are at its end.
    """
    x_m, y_m, yaw_rad = legs.x_m[leg], legs.y_m[leg], legs.yaw_rad[leg]
    long_m = np.where(_is_joined(legs)[leg], np.hypot(*np.diff([x_m, y_m])[..., 0]), 0.0)
    nearest, _ = _nearest(legs, leg, *places_m)
    within = reach_m / np.maximum(long_m, MOVED_M) * (long_m > 0.0)
    first, last = np.maximum(nearest - within, 0.0), np.minimum(nearest + within, 1.0)
    longest_m = float(((last - first) * long_m).max())
    steps = np.linspace(0.0, 1.0, min(ceil(longest_m / STEP_M), MOST_STEPS - 1) + 1)
    shares = first[:, None] + steps * (last - first)[:, None]
    of_leg, of_pair = np.unique(leg, return_inverse=True)
    turns = np.array([turn_between(*yaws) for yaws in legs.yaw_rad[of_leg].tolist()])[of_pair]
    at = [column[:, :1] + shares * np.diff(column) for column in (x_m, y_m)]
    return shares, at[0], at[1], yaw_rad[:, :1] + shares * turns[:, None]
