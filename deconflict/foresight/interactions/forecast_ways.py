"""Ways that robots forecast: their places, how far along a robot is, and how much is left to another robot."""

from math import inf

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
    legs_m = np.hypot(np.diff(track[:, 0]), np.diff(track[:, 1]))
    along_m = np.concatenate([[0.0], np.cumsum(legs_m)])
    at_m = np.arange(0.0, along_m[-1] + WAY_M, WAY_M)
    moves = np.concatenate([[True], legs_m > 0.0])
    yaw_rad = np.unwrap(track[:, 2])
    way = np.column_stack(
        [np.interp(at_m, along_m[moves], column[moves]) for column in (track[:, 0], track[:, 1], yaw_rad)]
    )
    nearest = int(np.argmin(np.hypot(way[:, 0] - x_m, way[:, 1] - y_m)))
    return np.column_stack([way[nearest:], at_m[nearest:] - at_m[nearest]])


def distance_along(way: Floats, poses: Floats) -> Floats:
    """(n,) how far along a way (k, 4) each of n poses is, never decreasing."""
    away_m = np.hypot(way[:, None, 0] - poses[None, :, 0], way[:, None, 1] - poses[None, :, 1])
    return np.maximum.accumulate(way[np.argmin(away_m, axis=0), 3])


def gaps_to(poses: Floats, way: Floats, half_of_poses: Floats, half_of_way: Floats) -> Floats:
    """(k, n) distance of the envelope at each of k places of a way from that at each of n poses; negative in
    overlap."""
    k, n = len(way), len(poses)
    dx_m, dy_m = poses[None, :, 0] - way[:, None, 0], poses[None, :, 1] - way[:, None, 1]
    yaw_way, yaw_pose = np.broadcast_to(way[:, None, 2], (k, n)), np.broadcast_to(poses[None, :, 2], (k, n))
    sizes = [np.repeat(half[:, None], k, axis=1) for half in (half_of_way, half_of_poses)]
    return signed_gap(dx_m, dy_m, yaw_way, yaw_pose, *sizes)


def shortest_way_left(apart_m: Floats, way_m: Floats, along_m: Floats, reach_m: Floats) -> float:
    """The shortest way that is left at any look until the envelopes meet; inf if they do not meet within reach."""
    least_m = inf
    for look in range(apart_m.shape[1]):
        ahead_m = way_m - along_m[look]
        is_ahead = (ahead_m >= 0.0) & (ahead_m <= reach_m[look])
        column = apart_m[is_ahead, look]
        if not len(column):
            continue
        comes = (column < TOUCHES_M) & (column < column[0] - NEARER_M)
        if comes.any():
            least_m = min(least_m, float(ahead_m[is_ahead][np.argmax(comes)]))
    return least_m
