"""Robots with their trailers in the next ten seconds: a zone is free once the last trailer has left it."""

from typing import NamedTuple

import numpy as np

from deconflict.contention.robots.lookahead import STEPS, Lookahead, PathsAhead, look_ahead, paths_ahead
from deconflict.sweep.shapes.trailers import trailer_forecasts
from ingest.batch import Floats, Forecasts, Ints


class BodiesAhead(NamedTuple):
    """n robots and, after them, their trailers."""

    row: Ints
    """(k,) the row of the robot, or of the robot that pulls the trailer."""
    view: Lookahead
    """(k, STEPS + 1)"""
    paths: PathsAhead
    length_m: Floats
    """(k,)"""
    width_m: Floats
    """(k,)"""
    reported: Floats
    """(k, 3) x_m, y_m and yaw_rad of the newest report."""


def reported_poses(forecasts: Forecasts) -> Floats:
    """(n, 3) x, y and yaw of each robot in its newest report: its first knot."""
    first = forecasts.start[:-1]
    return np.column_stack([forecasts.x_m[first], forecasts.y_m[first], forecasts.yaw_rad[first]])


def bodies_ahead(forecasts: Forecasts, view: Lookahead, paths: PathsAhead, now_s: float) -> BodiesAhead:
    """Robots with these paths, and their trailers. Trailers of a robot whose numbers are not finite are left out."""
    unknown = np.flatnonzero(view.floor[:, 0] < 0).tolist()
    reported = reported_poses(forecasts)
    robots = BodiesAhead(np.arange(len(forecasts)), view, paths, forecasts.length_m, forecasts.width_m, reported)
    trailers, pulled_by = trailer_forecasts(forecasts, unknown)
    if not len(pulled_by):
        return robots
    ahead = look_ahead(trailers, now_s)
    trailer_paths = paths_ahead(ahead, np.full(len(pulled_by), STEPS))
    return BodiesAhead(
        np.concatenate([robots.row, pulled_by]),
        Lookahead._make(map(np.concatenate, zip(view, ahead, strict=True))),
        PathsAhead._make(map(np.concatenate, zip(paths, trailer_paths, strict=True))),
        np.concatenate([robots.length_m, trailers.length_m]),
        np.concatenate([robots.width_m, trailers.width_m]),
        np.concatenate([reported, reported_poses(trailers)]),
    )
