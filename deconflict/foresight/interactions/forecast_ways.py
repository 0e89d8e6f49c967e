"""The ways that robots forecast, as places at equal distances."""

import numpy as np

from ingest.batch import Floats

WAY_M = 0.15
"""Distance between two samples of a way."""


def way_from(track: Floats, x_m: float, y_m: float) -> Floats:
    """(k, 4) the way of a forecast `track` (n, 3) from its place nearest to (x_m, y_m) on, every `WAY_M`: x_m, y_m,
    yaw_rad and metres from there."""
    legs_m = np.hypot(track[1:, 0] - track[:-1, 0], track[1:, 1] - track[:-1, 1])
    along_m = np.concatenate([[0.0], np.cumsum(legs_m)])
    at_m = np.arange(0.0, along_m[-1] + WAY_M, WAY_M)
    moves = np.concatenate([[True], legs_m > 0.0])
    columns = track[moves, 0], track[moves, 1], np.unwrap(track[:, 2])[moves]
    x, y, yaw_rad = (np.interp(at_m, along_m[moves], column) for column in columns)
    nearest = int(np.argmin(np.hypot(x - x_m, y - y_m)))
    return np.stack([x, y, yaw_rad, at_m - at_m[nearest]], axis=1)[nearest:]
