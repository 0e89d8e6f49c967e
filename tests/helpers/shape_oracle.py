"""The true distances of two robots of any shape: shapely's, at many times. Shares only `Track` with the oracle of
rectangles, and with the engine only where trailers are (`trailer_forecasts`, which has tests of its own)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from deconflict.sweep.shapes.trailers import trailer_forecasts
from ingest.batch import Forecasts
from tests.helpers.oracle import Floats, Ints, Track

SAMPLES = 600
DIPS, REFINED = 20, 30
"""How many of the smallest samples are looked at more closely, and at how many times around each."""


@dataclass(frozen=True)
class Approach:
    """What two robots do within the horizon."""

    closest_m: float
    """The smallest distance that was sampled."""
    touch_s: float
    """The first sample within the clearance, seconds since `now_s`; inf if there is none."""
    start_m: float
    """Distance at the begin."""


class ShapedTrack:
    """One body, which is a robot or a trailer: its track, and its parts in its own frame."""

    def __init__(self, forecasts: Forecasts, row: int) -> None:
        self.track = Track(forecasts, row)
        length, width = self.track.size / 2
        bottom, top = self.track.height
        shape = forecasts.shape(row)
        if shape is None or not shape.parts:
            self.parts = [(shapely.box(-length, -width, length, width), 0.0, bottom, top)]
            return
        self.parts = []
        for part in shape.parts:
            core = shapely.Point(part.outline_m[0]) if part.radius_m else shapely.Polygon(part.outline_m)
            is_partial = np.isfinite(part.bottom_m) and np.isfinite(bottom)
            heights = (bottom + part.bottom_m, bottom + part.top_m) if is_partial else (bottom, top)
            self.parts.append((core, part.radius_m, *heights))

    def placed(self, core: shapely.Geometry, t_s: Floats, origin: Floats) -> tuple[Ints, NDArray[np.object_]]:
        """The floor, and the geometry, at each time."""
        floor, pose, _ = self.track.between(t_s, t_s)
        c, s = np.cos(pose[:, 2:]), np.sin(pose[:, 2:])
        x, y = shapely.get_coordinates(core).T
        place = pose[:, :2] - origin
        corners = np.stack([place[:, :1] + c * x - s * y, place[:, 1:] + s * x + c * y], -1)
        cores = np.repeat(np.array([core], object), len(t_s))
        return floor, np.asarray(shapely.set_coordinates(cores, corners.reshape(-1, 2)))


def bodies(forecasts: Forecasts, row: int) -> list[ShapedTrack]:
    """A robot and its trailers."""
    trailers, _ = trailer_forecasts(forecasts.single(row))
    return [ShapedTrack(forecasts, row), *(ShapedTrack(trailers, at) for at in range(len(trailers)))]


def distances(a: Sequence[ShapedTrack], b: Sequence[ShapedTrack], t_s: Floats) -> Floats:
    """(n,) distances of two robots of these bodies at n times, inf on different floors and where all parts pass above
    each other."""
    return np.min([_distances(each, other, t_s) for each in a for other in b], axis=0)


def _distances(a: ShapedTrack, b: ShapedTrack, t_s: Floats) -> Floats:
    apart_m, origin = np.full(len(t_s), np.inf), a.track.pose[0, :2]
    for core_a, radius_a, bottom_a, top_a in a.parts:
        for core_b, radius_b, bottom_b, top_b in b.parts:
            if bottom_a > top_b or bottom_b > top_a:
                continue
            floor_a, placed_a = a.placed(core_a, t_s, origin)
            floor_b, placed_b = b.placed(core_b, t_s, origin)
            gap = np.maximum(shapely.distance(placed_a, placed_b) - radius_a - radius_b, 0.0)
            apart_m = np.minimum(apart_m, np.where((floor_a == floor_b) & (floor_a >= 0), gap, np.inf))
    return apart_m


def approach(
    forecasts: Forecasts, pair: tuple[int, int], *, now_s: float, horizon_s: float, clearance_m: float
) -> Approach:
    """What the robots of two rows do in [`now_s`, `now_s + horizon_s`]."""
    a, b = (bodies(forecasts, row) for row in pair)
    t = np.linspace(0.0, horizon_s, SAMPLES)
    apart_m = distances(a, b, now_s + t)
    within = np.flatnonzero(apart_m <= clearance_m)
    touch_s = float(t[within[0]]) if len(within) else np.inf
    closest_m, start_m = float(apart_m.min()), float(apart_m[0])
    if 0.0 < closest_m < np.inf:
        nearest, step = t[np.argsort(apart_m)[:DIPS]], horizon_s / SAMPLES
        refined = np.unique(np.clip(np.linspace(nearest - step, nearest + step, REFINED), 0.0, horizon_s))
        closest_m = min(closest_m, float(distances(a, b, now_s + refined).min()))
    return Approach(closest_m, touch_s, start_m)
