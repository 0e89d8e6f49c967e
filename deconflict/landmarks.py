"""Where something is, in words that a person on the floor can walk to: a place of the site, or the nearest mark."""

from collections.abc import Iterable, Sequence
from operator import itemgetter
from typing import NamedTuple, Self

import shapely

from deconflict.contention.resources import Place, Resource, outlines
from ingest.settings import Datum

FARTHEST_M = 15.0
"""A mark that is farther than this says less than the coordinates do."""
AT_M = 1.5
"""Nearer than this a person would say "at"."""


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

    def place(self, datum: str, x_m: float, y_m: float) -> str:
        """Says where a point is, "3 m from Column C3 on Ground hall".

        Args:
            datum: the floor's id.
            x_m, y_m: the point in the floor's frame, metres.

        Returns:
            The smallest place that holds the point, else the nearest mark or place and how far it is, else the
            coordinates; and the floor.
        """
        return f"{self._spot(datum, x_m, y_m)} on {self._floors.get(datum, datum)}"

    def _spot(self, datum: str, x_m: float, y_m: float) -> str:
        point = shapely.Point(x_m, y_m)
        if inside := self._inside.get(datum):
            found = inside.shapes.query(point, predicate="covered_by")
            if len(found):
                return inside.names[int(found.min())]
        near = self._nearest(datum, point)
        if near is None:
            return f"near ({x_m:.1f}, {y_m:.1f})"
        return f"at {near[1]}" if near[0] < AT_M else f"{near[0]:.0f} m from {near[1]}"

    def _nearest(self, datum: str, point: shapely.Point) -> tuple[float, str] | None:
        """How far the nearest mark or place is, and its name; of several as near the first by name."""
        marks = self._marks.get(datum)
        if marks is None:
            return None
        found, away_m = marks.shapes.query_nearest(point, max_distance=FARTHEST_M, return_distance=True)
        return min(zip(away_m.tolist(), (marks.names[one] for one in found.tolist()), strict=True), default=None)


def _marks(datum: Datum) -> list[tuple[str, shapely.Geometry]]:
    """The marks of a floor that lie in metres and have a name that a person uses."""
    if datum.coordinates != "metres":
        return []
    return [(one.name, shapely.Point(one.x, one.y)) for one in datum.reference_points if one.name]
