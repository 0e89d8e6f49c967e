"""The true distances between two robots, by a method that shares only the layout of its input with the engine.

Each interval between two knots is sampled, and halved if its ends leave room for a smaller distance: nothing moves
faster than L = |v| + |wA| rA + |wB| rB, so over an interval of length h the distance stays above (f0 + f1 - L h) / 2.
For each touch there is a witness: a time at which the robots are that close.

The distances of the samples are `rectangle_distance`, which a test compares with the distances of GEOS polygons
(through shapely). The closest distance of each pair, and each distance at a given time, is one of GEOS polygons.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from ingest.batch import Forecasts

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

RESOLUTION_M = 4e-4
FIRST_SAMPLES = 4
Distance = Callable[[Floats, Floats, Floats, Floats], Floats]
GOLDEN = (5**0.5 - 1) / 2
ALONG, ACROSS = np.array([[1.0], [1.0], [-1.0], [-1.0]]), np.array([[1.0], [-1.0], [1.0], [-1.0]])
"""On which side of the centre each corner of a rectangle is. (4, 1)"""


@dataclass(frozen=True)
class Truth:
    """The results for c pairs. Arrays are (c,): inf if the robots never share a floor, or never come so close."""

    closest_m: Floats
    """A distance that is reached. Near the clearance, no distance is smaller by more than `RESOLUTION_M`."""
    touch_s: Floats
    """The first witness of a distance within the clearance, since `now_s`. A dip of less than `RESOLUTION_M` below the
    clearance may come earlier."""


def rectangle_distance(pose_a: Floats, pose_b: Floats, size_a: Floats, size_b: Floats) -> Floats:
    """(n,) distances of rectangles at poses (n, 3) with sizes (n, 2).

    They overlap unless one of their four axes separates them. Apart, they are closest at a corner of one of them.
    """
    from_a, separated_a = _corners_from(pose_a, size_a, pose_b, size_b)
    from_b, separated_b = _corners_from(pose_b, size_b, pose_a, size_a)
    return np.where(separated_a | separated_b, np.minimum(from_a, from_b), 0.0)


def _corners_from(pose: Floats, size: Floats, other: Floats, other_size: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """How far the nearest corner of the other rectangle is, and whether an axis of this one separates them."""
    (dx, dy), yaw = (other[:, :2] - pose[:, :2]).T, pose[:, 2]
    turn, along, across = other[:, 2] - yaw, ALONG * other_size[:, 0] / 2, ACROSS * other_size[:, 1] / 2
    x = np.cos(yaw) * dx + np.sin(yaw) * dy + along * np.cos(turn) - across * np.sin(turn)
    y = np.cos(yaw) * dy - np.sin(yaw) * dx + along * np.sin(turn) + across * np.cos(turn)
    length, width = size.T / 2
    distance = np.hypot(np.maximum(np.abs(x) - length, 0.0), np.maximum(np.abs(y) - width, 0.0)).min(axis=0)
    beside = (x.min(axis=0) > length) | (x.max(axis=0) < -length)
    return distance, beside | (y.min(axis=0) > width) | (y.max(axis=0) < -width)


def polygon_distance(pose_a: Floats, pose_b: Floats, size_a: Floats, size_b: Floats) -> Floats:
    """As `rectangle_distance`, by GEOS. A is moved to the origin, to lose no digits."""
    placed = pose_b[:, :2] - pose_a[:, :2]
    distance = shapely.distance(
        _polygons(np.zeros_like(placed), pose_a[:, 2], size_a), _polygons(placed, pose_b[:, 2], size_b)
    )
    return np.asarray(distance, np.float64)


def _polygons(centre: Floats, yaw: Floats, size: Floats) -> NDArray[np.object_]:
    along = np.stack([np.cos(yaw), np.sin(yaw)], -1) * size[:, :1] / 2
    across = np.stack([-np.sin(yaw), np.cos(yaw)], -1) * size[:, 1:] / 2
    ring = [along + across, across - along, -along - across, along - across, along + across]
    return np.asarray(shapely.polygons(centre[:, None] + np.stack(ring, 1)), np.object_)


@dataclass(frozen=True)
class Stretches:
    """n intervals in which both robots move evenly on one floor. Poses are (n, 2 robots, 3): x, y, yaw."""

    pair: Ints
    begin: Floats
    """Seconds since `now_s`."""
    end: Floats
    pose0: Floats
    pose1: Floats
    size: Floats
    """(n, 2, 2): length, width of each robot."""

    def distance(self, rows: Ints, t: Floats, measured: Distance = rectangle_distance) -> Floats:
        u = ((t - self.begin[rows]) / (self.end[rows] - self.begin[rows]))[:, None, None]
        pose = self.pose0[rows] * (1 - u) + self.pose1[rows] * u
        return measured(pose[:, 0], pose[:, 1], self.size[rows, 0], self.size[rows, 1])

    def fastest(self) -> Floats:
        """The greatest change of a distance in a second."""
        rate = (self.pose1 - self.pose0) / (self.end - self.begin)[:, None, None]
        speed = np.hypot(*(rate[:, 1, :2] - rate[:, 0, :2]).T)
        return np.asarray(speed + (np.abs(rate[:, :, 2]) * np.hypot(*np.moveaxis(self.size, -1, 0)) / 2).sum(axis=1))


class Track:
    """The motion of one robot, as the docstring of `Forecasts` defines it."""

    def __init__(self, forecasts: Forecasts, row: int) -> None:
        knots = slice(forecasts.start[row], forecasts.start[row + 1])
        self.t, self.floor = forecasts.t_s[knots], forecasts.floor[knots]
        self.pose = np.stack([forecasts.x_m[knots], forecasts.y_m[knots], np.unwrap(forecasts.yaw_rad[knots])], -1)
        self.size = np.array([forecasts.length_m[row], forecasts.width_m[row]])
        self.height = forecasts.bottom_m[row], forecasts.top_m[row]

    def between(self, begin: Floats, end: Floats) -> tuple[Ints, Floats, Floats]:
        """Floor, and poses at both ends, of intervals without a knot inside. Floor -1 before the first knot."""
        knot = np.searchsorted(self.t, begin, "right") - 1
        floor = np.where(knot < 0, -1, self.floor[knot])
        knot = np.maximum(knot, 0)
        after = np.minimum(knot + 1, len(self.t) - 1)
        moves = (after > knot) & (self.floor[after] == self.floor[knot])
        span = np.where(moves, self.t[after] - self.t[knot], 1.0)
        rate = np.where(moves, 1.0, 0.0)[:, None] * (self.pose[after] - self.pose[knot]) / span[:, None]
        at = [self.pose[knot] + rate * (t - self.t[knot])[:, None] for t in (begin, end)]
        return floor, at[0], at[1]


def stretches(forecasts: Forecasts, pairs: Sequence[tuple[int, int]], now_s: float, horizon_s: float) -> Stretches:
    parts: list[tuple[Floats, ...]] = []
    for number, (a, b) in enumerate(pairs):
        tracks = Track(forecasts, a), Track(forecasts, b)
        if tracks[0].height[0] > tracks[1].height[1] or tracks[1].height[0] > tracks[0].height[1]:
            continue
        cuts = np.unique(np.clip(np.concatenate([tracks[0].t, tracks[1].t]), now_s, now_s + horizon_s))
        cuts = np.unique(np.concatenate([[now_s], cuts, [now_s + horizon_s]]))
        begin, end = cuts[:-1], cuts[1:]
        floor_a, a0, a1 = tracks[0].between(begin, end)
        floor_b, b0, b1 = tracks[1].between(begin, end)
        shared = (floor_a == floor_b) & (floor_a >= 0)
        size = np.broadcast_to(np.stack([tracks[0].size, tracks[1].size]), (len(begin), 2, 2))
        columns = (
            np.full(len(begin), number),
            begin - now_s,
            end - now_s,
            np.stack([a0, b0], 1),
            np.stack([a1, b1], 1),
        )
        parts.append(tuple(column[shared] for column in (*columns, size)))
    if not parts:
        return Stretches(np.empty(0, np.int64), np.empty(0), np.empty(0), *(np.empty((0, 2, k)) for k in (3, 3, 2)))
    return Stretches(*(np.concatenate([part[column] for part in parts]) for column in range(6)))


def truth(
    forecasts: Forecasts, pairs: Sequence[tuple[int, int]], *, now_s: float, horizon_s: float, clearance_m: float
) -> Truth:
    """The truth for the rows of `pairs` in [`now_s`, `now_s + horizon_s`]."""
    s = stretches(forecasts, pairs, now_s, horizon_s)
    search = _Search(s, len(pairs), clearance_m)
    search.run()
    met = np.isfinite(search.closest)
    interval, at_s = search.nearest[met, 0].astype(np.int64), search.nearest[met, 1]
    search.closest[met] = s.distance(interval, at_s, polygon_distance)
    return Truth(search.closest, search.touch)


class _Search:
    def __init__(self, s: Stretches, pairs: int, clearance_m: float) -> None:
        self.s, self.clearance_m, self.fastest = s, clearance_m, s.fastest()
        self.closest, self.touch = np.full(pairs, np.inf), np.full(pairs, np.inf)
        self.nearest = np.full((pairs, 3), np.nan)
        """The closest sample of each pair: interval, time, and distance in time to the next samples."""

    def run(self) -> None:
        count = len(self.s.pair)
        row = np.repeat(np.arange(count), FIRST_SAMPLES)
        u = np.tile(np.arange(FIRST_SAMPLES) / FIRST_SAMPLES, count)
        span = (self.s.end - self.s.begin)[row]
        low = self.s.begin[row] + u * span
        high = np.minimum(low + span / FIRST_SAMPLES, self.s.end[row])
        f0, f1 = self.s.distance(row, low), self.s.distance(row, high)
        self._note(row, low, f0, low, high)
        self._note(row, high, f1, low, high)
        while len(row):
            open_ = self._open(row, low, high, f0, f1)
            row, low, high, f0, f1 = row[open_], low[open_], high[open_], f0[open_], f1[open_]
            middle = (low + high) / 2
            f = self.s.distance(row, middle)
            self._note(row, middle, f, low, high)
            row, low, high = np.tile(row, 2), np.concatenate([low, middle]), np.concatenate([middle, high])
            f0, f1 = np.concatenate([f0, f]), np.concatenate([f, f1])
        self._polish()

    def _open(self, row: Ints, low: Floats, high: Floats, f0: Floats, f1: Floats) -> NDArray[np.bool_]:
        """Whether a part of an interval may have a smaller distance or an earlier touch."""
        pair, room = self.s.pair[row], self.fastest[row] * (high - low)
        bound = (f0 + f1 - room) / 2
        worth = bound < np.minimum(self.closest[pair] - RESOLUTION_M, self.clearance_m + 0.005)
        worth &= self.closest[pair] > 0
        earlier = (bound <= self.clearance_m) & (low < self.touch[pair]) & (f0 > self.clearance_m)
        first = (f0 > self.clearance_m) & (f1 <= self.clearance_m) & (high <= self.touch[pair]) & (high - low > 1e-6)
        return np.asarray(((worth | earlier) & (room > 2 * RESOLUTION_M)) | first)

    def _note(self, row: Ints, t: Floats, f: Floats, low: Floats, high: Floats) -> None:
        pair = self.s.pair[row]
        touching = f <= self.clearance_m
        np.minimum.at(self.touch, pair[touching], t[touching])
        order = np.argsort(f, kind="stable")[::-1]
        order = order[f[order] < self.closest[pair[order]]]
        self.closest[pair[order]] = f[order]
        self.nearest[pair[order]] = np.stack([row, t, high - low], -1)[order]

    def _polish(self) -> None:
        """Golden-section search around each pair's closest sample, to find dips that halving does not reach."""
        pair = np.flatnonzero(np.isfinite(self.closest) & (self.closest > 0))
        row, at, room = self.nearest[pair, 0].astype(np.int64), self.nearest[pair, 1], self.nearest[pair, 2]
        low, high = np.maximum(at - room, self.s.begin[row]), np.minimum(at + room, self.s.end[row])
        for _ in range(32):
            left, right = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
            f_left, f_right = self.s.distance(row, left), self.s.distance(row, right)
            self._note(row, left, f_left, low, high)
            self._note(row, right, f_right, low, high)
            lower = f_left <= f_right
            low, high = np.where(lower, low, left), np.where(lower, right, high)


def distances_at(forecasts: Forecasts, pairs: Sequence[tuple[int, int]], t_s: Floats) -> Floats:
    """The distances of c pairs at `t_s` (c, k), without regard to heights. inf where they are on different floors."""
    shared, poses, sizes = np.empty(t_s.shape, np.bool_), np.empty((2, *t_s.shape, 3)), np.empty((2, *t_s.shape, 2))
    for number, (pair, at) in enumerate(zip(pairs, t_s, strict=True)):
        floors = []
        for side, row in enumerate(pair):
            track = Track(forecasts, row)
            floor, poses[side, number], _ = track.between(at, at)
            sizes[side, number] = track.size
            floors.append(floor)
        shared[number] = (floors[0] == floors[1]) & (floors[0] >= 0)
    distance = np.full(t_s.shape, np.inf)
    distance[shared] = polygon_distance(*poses[:, shared], *sizes[:, shared])
    return distance


def distance_at(forecasts: Forecasts, pair: tuple[int, int], t_s: float) -> float:
    return float(distances_at(forecasts, [pair], np.array([[t_s]]))[0, 0])
