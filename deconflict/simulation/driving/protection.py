"""The robots' local protective stop: how far each can go before it would touch another.

A robot looks along its own way. Everybody stops for where others are; of two, the one of the later rank also
keeps off the way that the other takes in the next second and a half.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from deconflict.simulation.driving.tracks import Tracks
from ingest.seam import Floats, Ints

LOOK_M = np.arange(0.0, 1.85, 0.2)
"""Places along a robot's way that are tried."""
AHEAD_S = np.array([0.0, 0.4, 0.9, 1.5])
"""When the others' places are looked at."""
MARGIN_M = 0.03
"""Envelopes are not brought nearer than this."""
REACH_M = 4.8
"""Robots whose centres are further apart than this do not matter to each other."""
FLOOR_M = 1e5
"""Apart by this, floors share one tree."""


@dataclass(frozen=True, slots=True, eq=False)
class Traffic:
    """What the protective stop sees of n robots."""

    tracks: Tracks
    progress_m: Floats
    speed_mps: Floats
    """Of progress; negative when backing."""
    backing: NDArray[np.bool_]
    aside_m: Floats
    """To the left of the way."""
    floor: Ints
    length_m: Floats
    width_m: Floats
    ahead_m: Floats
    """Centre of the envelope ahead of the location."""
    rank: Ints
    """The lower of two goes first."""


def centres(traffic: Traffic, robots: Ints, progress_m: Floats) -> Floats:
    """(3, ...) x, y, yaw of the envelopes' centres."""
    x, y, yaw = traffic.tracks.poses(robots, progress_m)
    c, s = np.cos(yaw), np.sin(yaw)
    ahead_m, aside_m = traffic.ahead_m[robots], traffic.aside_m[robots]
    return np.stack([x + c * ahead_m - s * aside_m, y + s * ahead_m + c * aside_m, yaw])


def free_way(traffic: Traffic) -> tuple[Floats, Ints]:
    """(n,) metres of progress free ahead of each robot (behind, when it backs), inf where nothing is near; and
    (n,) who is in the way, -1 for nobody.
    """
    n = len(traffic.progress_m)
    free_m, by = np.full(n, np.inf), np.full(n, -1, np.int64)
    everyone = np.arange(n)
    here = centres(traffic, everyone, traffic.progress_m)
    tree = cKDTree(np.column_stack([here[0] + FLOOR_M * traffic.floor, here[1]]))
    pairs = tree.query_pairs(REACH_M, output_type="ndarray")
    if not len(pairs):
        return free_m, by
    column = everyone[:, None]
    direction = np.where(traffic.backing, -1.0, 1.0)[:, None]
    looks = centres(traffic, column, traffic.progress_m[:, None] + direction * LOOK_M)
    others = centres(traffic, column, traffic.progress_m[:, None] + traffic.speed_mps[:, None] * AHEAD_S)
    in_order = traffic.rank[pairs[:, 0]] < traffic.rank[pairs[:, 1]]
    first, second = np.where(in_order, pairs.T, pairs.T[::-1])
    for who, whom, moments in ((first, second, 2), (second, first, len(AHEAD_S))):
        way_m = _way(traffic, who, whom, looks, others[:, :, :moments])
        order = np.lexsort((whom, way_m, who))
        nearest = order[np.unique(who[order], return_index=True)[1]]
        rows, way_m = who[nearest], way_m[nearest]
        nearer = way_m < free_m[rows]
        free_m[rows[nearer]], by[rows[nearer]] = way_m[nearer], whom[nearest][nearer]
    return free_m, by


def _way(traffic: Traffic, who: Ints, whom: Ints, looks: Floats, others: Floats) -> Floats:
    """(p,) progress that `who` has before it would come within the margin of `whom`, and nearer than it is."""
    gap_m = gaps(
        looks[:, who, :, None],
        others[:, whom, None, :],
        (traffic.length_m[who, None, None], traffic.width_m[who, None, None]),
        (traffic.length_m[whom, None, None], traffic.width_m[whom, None, None]),
    )
    nearer: NDArray[np.bool_] = (gap_m < MARGIN_M) & (gap_m < gap_m[:, :1] - 0.01)
    blocked: NDArray[np.bool_] = np.any(nearer, axis=2)
    reached = np.argmax(blocked, axis=1)
    return np.where(np.any(blocked, axis=1), LOOK_M[np.maximum(reached - 1, 0)], np.inf)


def gaps(a: Floats, b: Floats, size_a: tuple[Floats, Floats], size_b: tuple[Floats, Floats]) -> Floats:
    """Largest separation of rectangles along the directions of their sides: negative where they overlap,
    else at most their distance (separating axes). `a` and `b` are (3, ...) x, y, yaw of the centres.
    """
    dx, dy, turn = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    c, s = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    found = []
    for yaw, (long, wide), (other_long, other_wide) in ((a[2], size_a, size_b), (b[2], size_b, size_a)):
        cy, sy = np.cos(yaw), np.sin(yaw)
        found.append(np.abs(dx * cy + dy * sy) - (long + c * other_long + s * other_wide) / 2)
        found.append(np.abs(dy * cy - dx * sy) - (wide + s * other_long + c * other_wide) / 2)
    largest: Floats = np.maximum(np.maximum(found[0], found[1]), np.maximum(found[2], found[3]))
    return largest
