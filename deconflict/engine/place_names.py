"""Where something is, in words that a person on the floor can walk to: a place of the site, or the nearest mark."""

from collections.abc import Iterable, Sequence
from math import inf
from operator import itemgetter
from typing import NamedTuple, Self

import numpy as np
import shapely
from numpy.typing import NDArray

from deconflict.settings.shared_places import Place, Resource, outlines
from ingest.settings import Datum

FARTHEST_M = 15.0
"""A mark that is farther than this says less than the coordinates do."""
AT_M = 1.5
"""Nearer than this a person would say "at"."""


class Spot(NamedTuple):
    """A point in the frame of a floor."""

    datum: str
    """The floor's id."""
    x_m: float
    y_m: float


class Named(NamedTuple):
    """Shapes of a floor, to look up by where they lie, and what each is called."""

    shapes: shapely.STRtree
    names: tuple[str, ...]

    @classmethod
    def of(cls, named: Sequence[tuple[str, shapely.Geometry]]) -> Self:
        return cls(shapely.STRtree([shape for _, shape in named]), tuple(name for name, _ in named))


class Landmarks:
    """The named places and reference points of a site."""

    def __init__(self, datums: Iterable[Datum], places: Iterable[Place]) -> None:
        datums = tuple(datums)
        self._floors = {one.id: one.name for one in datums}
        marks = {one.id: _marks(one) for one in datums}
        inside: dict[str, list[tuple[float, str, shapely.Polygon]]] = {}
        for place in places:
            word = "at" if isinstance(place, Resource) else "in"
            for datum, outline in outlines(place):
                shape = shapely.Polygon(outline)
                inside.setdefault(datum, []).append((shape.area, f"{word} {place.label}", shape))
                marks.setdefault(datum, []).append((place.label, shape))
        self._marks = {datum: Named.of(here) for datum, here in marks.items()}
        self._inside = {
            datum: Named.of([(words, shape) for _, words, shape in sorted(here, key=itemgetter(0, 1))])
            for datum, here in inside.items()
        }
        """The smallest first."""

    def places(self, spots: Sequence[Spot]) -> list[str]:
        """Says where each of some points is, "3 m from Column C3 on Ground hall".

        The smallest place that holds the point, else the nearest mark or place and how far it is, else the coordinates;
        and the floor.
        """
        told = [""] * len(spots)
        for datum in {spot.datum for spot in spots}:
            rows = [row for row, spot in enumerate(spots) if spot.datum == datum]
            for row, words in zip(rows, self._words(datum, [spots[row][1:] for row in rows]), strict=True):
                told[row] = f"{words} on {self._floors.get(datum, datum)}"
        return told

    def _words(self, datum: str, at_m: Sequence[tuple[float, float]]) -> list[str]:
        """Of points on one floor."""
        words = [f"near ({x_m:.1f}, {y_m:.1f})" for x_m, y_m in at_m]
        marks = self._marks.get(datum)
        if marks is None:
            return words
        points = shapely.points(at_m)
        for row, (away_m, name) in _nearest(marks, points).items():
            words[row] = f"at {name}" if away_m < AT_M else f"{away_m:.0f} m from {name}"
        if inside := self._inside.get(datum):
            found = zip(*inside.shapes.query(points, predicate="covered_by").tolist(), strict=True)
            for row, place in sorted(found, reverse=True):
                words[row] = inside.names[place]
        return words


def _nearest(marks: Named, points: NDArray[np.object_]) -> dict[int, tuple[float, str]]:
    """How far the nearest mark or place is of those points that are near any, and its name; of several as near the
    first by name."""
    found, away_m = marks.shapes.query_nearest(points, max_distance=FARTHEST_M, return_distance=True)
    nearest: dict[int, tuple[float, str]] = {}
    for row, mark, metres in zip(*found.tolist(), away_m.tolist(), strict=True):
        nearest[row] = min((metres, marks.names[mark]), nearest.get(row, (inf, "")))
    return nearest


def _marks(datum: Datum) -> list[tuple[str, shapely.Geometry]]:
    """The marks of a floor that lie in metres and have a name that a person uses."""
    if datum.coordinates != "metres":
        return []
    return [(one.name, shapely.Point(one.x, one.y)) for one in datum.reference_points if one.name]
