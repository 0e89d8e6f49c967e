"""Names of places in words that a person on the floor can walk to: a place of the site, or the nearest mark."""

from collections.abc import Iterable, Sequence
from math import inf
from typing import NamedTuple, Self

import numpy as np
import shapely
from numpy.typing import NDArray

from deconflict.advisories.words.words import Spot
from deconflict.settings.shared_places import NamedArea, Obstacle, Place, Resource, outlines
from deconflict.settings.site import Site
from deconflict_client.advisory import NamedPlace
from ingest.batch import Bools, FloorPoint
from ingest.settings import Datum

FARTHEST_M = 15.0
"""A mark that is farther away helps less than coordinates."""
AT_M = 1.5
"""Nearer than this a person says "at"."""
TOUCHES_M = 0.1
"""An obstacle that is nearer to a mark does not hide it: the mark is on it."""


class NamedShapes(NamedTuple):
    """Shapes of one floor in a spatial index, and what a point in or near each is said to be at."""

    shapes: shapely.STRtree
    spots: tuple[Spot, ...]

    @classmethod
    def of(cls, named: Sequence[tuple[Spot, shapely.Geometry]]) -> Self:
        return cls(shapely.STRtree([shape for _, shape in named]), tuple(spot for spot, _ in named))


class PlaceNames:
    """Describes points by the named places, obstacles and reference points of a site."""

    def __init__(
        self,
        datums: Iterable[Datum],
        places: Iterable[Place],
        obstacles: Iterable[Obstacle] = (),
        areas: Iterable[NamedArea] = (),
    ) -> None:
        datums = tuple(datums)
        self._floor_names = {datum.id: datum.name for datum in datums}
        marks = {datum.id: _marks(datum) for datum in datums}
        inside: dict[str, list[tuple[Spot, shapely.Geometry]]] = {}
        for place in places:
            preposition = "at" if isinstance(place, Resource) else "in"
            mark = Spot(place.label, (NamedPlace(id=place.id, name=place.label),))
            for datum_id, outline in outlines(place):
                shape = shapely.Polygon(outline)
                inside.setdefault(datum_id, []).append((mark._replace(text=f"{preposition} {mark.text}"), shape))
                marks.setdefault(datum_id, []).append((mark, shape))
        hiding: dict[str, list[tuple[Spot, shapely.Polygon]]] = {}
        for obstacle in obstacles:
            datum_id, shape = obstacle.floor or datums[0].id, shapely.Polygon(obstacle.outline_m)
            hiding.setdefault(datum_id, []).append((Spot(obstacle.name), shape))
            if obstacle.name:
                marks.setdefault(datum_id, []).append((Spot(obstacle.name), shape))
        self._obstacles = {datum_id: NamedShapes.of(named) for datum_id, named in hiding.items()}
        """By floor, what may hide a mark."""
        self._marks = {datum_id: NamedShapes.of(named) for datum_id, named in marks.items() if named}
        """By floor, what a point can be near to."""
        self._inside = {datum_id: NamedShapes.of(sorted(named, key=_by_size)) for datum_id, named in inside.items()}
        """By floor, what a point can be inside of, the smallest first."""
        within: dict[str, list[tuple[Spot, shapely.Geometry]]] = {}
        for area in areas:
            floor, spot = area.floor or datums[0].id, Spot(area.name, (NamedPlace(name=area.name),))
            within.setdefault(floor, []).append((spot, shapely.Polygon(area.outline_m)))
        self._areas = {datum_id: NamedShapes.of(named) for datum_id, named in within.items()}
        """By floor, the areas in which a point can be, in the order of the site file."""

    @classmethod
    def of(cls, site: Site) -> Self:
        return cls(site.datums, (*site.resources, *site.zones), site.obstacles, site.areas)

    def describe(self, points: Sequence[FloorPoint]) -> list[Spot]:
        """Where each point is, such as "3 m from Column C3 on Ground hall".

        The smallest place that holds the point, or else the areas that do, or else the nearest mark or place in sight
        and its distance, or else the coordinates; and the floor.
        """
        described = [Spot("")] * len(points)
        for datum_id in {point.datum for point in points}:
            rows = [row for row, point in enumerate(points) if point.datum == datum_id]
            spots = self._spots(datum_id, [points[row][1:] for row in rows])
            floor = self._floor_names.get(datum_id, datum_id)
            for row, (text, places) in zip(rows, spots, strict=True):
                described[row] = Spot(text if text.endswith(f" {floor}") else f"{text} on {floor}", places)
        return described

    def _spots(self, datum_id: str, at_m: Sequence[tuple[float, float]]) -> list[Spot]:
        """Where each of some points of one floor is, without the floor."""
        points = shapely.points(at_m)
        spots = {row: _in_areas(areas[:2]) for row, areas in _holding(self._areas.get(datum_id), points).items()}
        spots |= {row: holding[0] for row, holding in _holding(self._inside.get(datum_id), points).items()}
        elsewhere = [row for row in range(len(points)) if row not in spots]
        if elsewhere and (marks := self._marks.get(datum_id)):
            nearest = _nearest(marks, points[elsewhere], self._obstacles.get(datum_id))
            for at, (distance_m, mark) in nearest.items():
                text = f"at {mark.text}" if distance_m < AT_M else f"{distance_m:.0f} m from {mark.text}"
                spots[elsewhere[at]] = Spot(text, mark.places)
        return [spots.get(row, Spot(f"near ({x_m:.1f}, {y_m:.1f})")) for row, (x_m, y_m) in enumerate(at_m)]


def _by_size(named: tuple[Spot, shapely.Geometry]) -> tuple[float, str]:
    return named[1].area, named[0].text


def _in_areas(areas: Sequence[Spot]) -> Spot:
    """In one area, or where two meet."""
    text = f"where {areas[0].text} meets {areas[1].text}" if len(areas) > 1 else f"in {areas[0].text}"
    return Spot(text, tuple(place for area in areas for place in area.places))


def _holding(named: NamedShapes | None, points: NDArray[np.object_]) -> dict[int, list[Spot]]:
    """By row of `points`, the spots of the shapes that hold the point, in their order."""
    found: dict[int, list[Spot]] = {}
    if named:
        for row, shape in sorted(zip(*named.shapes.query(points, predicate="covered_by").tolist(), strict=True)):
            found.setdefault(row, []).append(named.spots[shape])
    return found


def _nearest(
    marks: NamedShapes, points: NDArray[np.object_], obstacles: NamedShapes | None
) -> dict[int, tuple[float, Spot]]:
    """By row of `points`, the distance and the spot of the nearest mark or place in sight; only if one is near enough.

    Of several at the same distance, the first by name.
    """
    rows, found = marks.shapes.query(points, predicate="dwithin", distance=FARTHEST_M)
    shapes = marks.shapes.geometries[found]
    distance_m = shapely.distance(points[rows], shapes)
    hidden = _hidden(points[rows], shapes, obstacles) if obstacles else np.zeros(len(rows), np.bool_)
    nearest: dict[int, tuple[float, Spot]] = {}
    for row, mark, metres in zip(*(each[~hidden].tolist() for each in (rows, found, distance_m)), strict=True):
        least_m, other = nearest.get(row, (inf, Spot("")))
        if (metres, marks.spots[mark].text) < (least_m, other.text):
            nearest[row] = metres, marks.spots[mark]
    return nearest


def _hidden(points: NDArray[np.object_], shapes: NDArray[np.object_], obstacles: NamedShapes) -> Bools:
    """Whether an obstacle is between each of `points` and its shape."""
    sights = shapely.shortest_line(points, shapes)
    rows, found = obstacles.shapes.query(sights, predicate="crosses")
    is_other = shapely.distance(obstacles.shapes.geometries[found], shapely.get_point(sights[rows], -1)) > TOUCHES_M
    hidden = np.zeros(len(points), np.bool_)
    hidden[rows[is_other]] = True
    return hidden


def _marks(datum: Datum) -> list[tuple[Spot, shapely.Geometry]]:
    """The reference points of a floor that have a name; none if its coordinates are not metres."""
    if datum.coordinates != "metres":
        return []
    return [(Spot(point.name), shapely.Point(point.x, point.y)) for point in datum.reference_points if point.name]
