"""Ways that robots forecast: their places, how far along a robot is, and how much is left to another robot."""

from math import inf, pi

import numpy as np

from deconflict.sweep.geometry.envelope_distances import signed_gap
from ingest.batch import Floats

TOUCHES_M = 0.1
"""A way leads to another robot if the envelopes come this near."""
NEARER_M = 0.05
"""They must also come nearer than they were by this: a robot that stands beside the way is not in it."""
WAY_M = 0.15
"""Distance between two samples of a way."""


def way_from(track: Floats, x_m: float, y_m: float) -> Floats:
    """(k, 4) the way of a forecast `track` (n, 3) from its place nearest to (x_m, y_m) on, every `WAY_M`: x_m, y_m,
    yaw_rad and metres from there."""
    legs_m = np.hypot(track[1:, 0] - track[:-1, 0], track[1:, 1] - track[:-1, 1])
    along_m = np.concatenate([[0.0], np.cumsum(legs_m)])
    at_m = np.arange(0.0, along_m[-1] + WAY_M, WAY_M)
    moves = np.concatenate([[True], legs_m > 0.0])
    columns = track[moves, 0], track[moves, 1], unwrapped(track[:, 2])[moves]
    x, y, yaw_rad = (np.interp(at_m, along_m[moves], column) for column in columns)
    nearest = int(np.argmin(np.hypot(x - x_m, y - y_m)))
    return np.array([x, y, yaw_rad, at_m - at_m[nearest]]).T[nearest:]


def distance_along(way: Floats, poses: Floats) -> Floats:
    """(n,) how far along a way (k, 4) each of n poses is, never decreasing."""
    away_m = np.hypot(way[:, None, 0] - poses[None, :, 0], way[:, None, 1] - poses[None, :, 1])
    return np.maximum.accumulate(way[np.argmin(away_m, axis=0), 3])


def shortest_ways_left(
    poses: Floats, way: Floats, along_m: Floats, reach_m: Floats, half_of_poses: Floats, half_of_way: Floats
) -> Floats:
    """(r,) the shortest way that a robot has left, at any of n looks, until its envelope meets that of each of r
    others; inf if they do not meet within reach.

    `poses` (r, n, 3) are those of the others, with half sides (2, r). The robot, with half sides (2,), is `along_m`
    (n,) on its way (k, 4) at each look, and reaches `reach_m` (n,) from there.
    """
    ahead_m = way[:, None, 3] - along_m
    is_ahead = (ahead_m >= 0.0) & (ahead_m <= reach_m)
    rows = is_ahead.any(axis=1)
    ahead_m, is_ahead = ahead_m[rows], is_ahead[rows]
    apart_m = _gaps_to(poses, way[rows], half_of_poses, half_of_way)
    first_m = apart_m[:, is_ahead.argmax(axis=0), np.arange(len(along_m))]
    comes = is_ahead & (apart_m < TOUCHES_M) & (apart_m < first_m[:, None] - NEARER_M)
    return np.where(comes, ahead_m, inf).min(axis=(1, 2), initial=inf)


def _gaps_to(poses: Floats, way: Floats, half_of_poses: Floats, half_of_way: Floats) -> Floats:
    """(r, k, n) distance of the envelope at each of k places of a way from that of each of r robots at n looks;
    negative in overlap."""
    shape = len(poses), len(way), poses.shape[1]
    from_m, to_m = way[None, :, None], poses[:, None]
    columns = to_m[..., 0] - from_m[..., 0], to_m[..., 1] - from_m[..., 1], from_m[..., 2], to_m[..., 2]
    pairs = [np.broadcast_to(column, shape).reshape(-1, shape[2]) for column in columns]
    sizes = [np.repeat(half_of_way[:, None], shape[0] * shape[1], axis=1), np.repeat(half_of_poses, shape[1], axis=1)]
    return signed_gap(*pairs, *sizes).reshape(shape)


def unwrapped(yaw_rad: Floats) -> Floats:
    """(n,) the headings as `np.unwrap` returns them, at once if none of them wraps, as most often."""
    return yaw_rad if (np.abs(yaw_rad[1:] - yaw_rad[:-1]) < pi).all() else np.unwrap(yaw_rad)
