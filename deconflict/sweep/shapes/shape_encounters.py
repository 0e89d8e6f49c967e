"""The encounter of two robots of any shape: distance and place at one moment."""

from dataclasses import replace
from itertools import product
from math import cos, inf, isnan, sin
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from deconflict.sweep.geometry import encounter as of_rectangles
from deconflict.sweep.geometry.encounter import Encounter, Row
from deconflict.sweep.geometry.heights import at_one_height
from deconflict.sweep.geometry.pose import Pose, pose_at
from deconflict.sweep.shapes.shape_places import places_of
from deconflict.sweep.shapes.trailers import trailer_forecasts
from ingest.batch import Forecasts
from ingest.shapes import ShapePart

SEGMENTS = 32
"""Of a quarter circle, where a circle is drawn."""


class PlacedPart(NamedTuple):
    """A part of a robot in the frame of its floor: its corners, or the centre of a circle."""

    core: BaseGeometry
    radius_m: float
    bottom_m: float
    top_m: float

    @property
    def outline(self) -> BaseGeometry:
        return self.core.buffer(self.radius_m, quad_segs=SEGMENTS) if self.radius_m else self.core


def encounter(a: Row, b: Row, contact_s: float) -> Encounter:
    """The encounter of two robots at `contact_s`. Its place is midway between their nearest points, or in the middle of
    their common area; see `geometry.encounter.encounter` for rectangles."""
    met = of_rectangles.encounter(a, b, contact_s)
    if _are_rectangles(a, b):
        return met
    x_m, y_m = _place_between(a, b, contact_s)
    if isnan(x_m):
        _, part, other = _nearest_parts(a, b, contact_s)
        place = part.outline.intersection(other.outline).centroid
        x_m, y_m = place.x, place.y
    return replace(met, x_m=x_m, y_m=y_m)


def separation_m(a: Row, b: Row, t_s: float) -> float | None:
    """Distance of two robots at `t_s`, 0 if they overlap; None if they are on different floors. Parts that pass above
    each other have no distance."""
    apart_m = of_rectangles.separation_m(a, b, t_s)
    if apart_m is None or _are_rectangles(a, b):
        return apart_m
    return _nearest_parts(a, b, t_s)[0]


def outline(robot: Forecasts, pose: Pose) -> BaseGeometry:
    """The area of one robot at `pose`, without its trailers."""
    return shapely.union_all([part.outline for part in placed_parts(robot, pose)])


def placed_parts(robot: Forecasts, pose: Pose) -> list[PlacedPart]:
    """The parts of one robot at `pose`."""
    bottom_m, top_m, shape = float(robot.bottom_m[0]), float(robot.top_m[0]), robot.shape(0)
    if shape is None or not shape.parts:
        return [PlacedPart(of_rectangles.envelope(robot, pose), 0.0, bottom_m, top_m)]
    return [_placed(part, pose, bottom_m, top_m) for part in shape.parts]


def bodies(robot: Forecasts) -> list[Forecasts]:
    """One robot and its trailers."""
    trailers, _ = trailer_forecasts(robot)
    return [robot, *(trailers.single(row) for row in range(len(trailers)))]


def _placed(part: ShapePart, pose: Pose, bottom_m: float, top_m: float) -> PlacedPart:
    c, s = cos(pose.yaw_rad), sin(pose.yaw_rad)
    corners = [(pose.x_m + c * u - s * v, pose.y_m + s * u + c * v) for u, v in part.outline_m]
    core = shapely.Point(corners[0]) if part.radius_m else shapely.Polygon(corners)
    if part.bottom_m > -inf and bottom_m > -inf:
        bottom_m, top_m = bottom_m + part.bottom_m, bottom_m + part.top_m
    return PlacedPart(core, part.radius_m, bottom_m, top_m)


def _place_between(a: Row, b: Row, t_s: float) -> tuple[float, float]:
    """The place midway between the nearest bodies of two robots; nan if these overlap, or pass above each other."""
    all_bodies = [bodies(forecasts.single(row)) for forecasts, row in (a, b)]
    of_a, of_b = map(len, all_bodies)
    each_a, each_b = np.repeat(np.arange(of_a), of_b), of_a + np.tile(np.arange(of_b), of_a)
    found = places_of(Forecasts.joined([*all_bodies[0], *all_bodies[1]]), each_a, each_b, t_s)
    _, x_m, y_m = found[found[:, 0].argmin()].tolist()
    return x_m, y_m


def _are_rectangles(a: Row, b: Row) -> bool:
    return all(forecasts.shape(row) is None for forecasts, row in (a, b))


def _nearest_parts(a: Row, b: Row, t_s: float) -> tuple[float, PlacedPart, PlacedPart]:
    """The two parts that are nearest to each other, at one height if any are, and their distance."""
    robots = [forecasts.single(row) for forecasts, row in (a, b)]
    parts = [[part for body in bodies(robot) for part in placed_parts(body, pose_at(body, t_s))] for robot in robots]
    found = []
    for part, other in product(*parts):
        apart_m = max(part.core.distance(other.core) - part.radius_m - other.radius_m, 0.0)
        found.append((not at_one_height(part, other), apart_m, part, other))
    passes_above, apart_m, part, other = min(found, key=lambda row: row[:2])
    return inf if passes_above else apart_m, part, other
