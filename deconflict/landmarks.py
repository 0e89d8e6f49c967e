"""Where something is, in words that a person on the floor can walk to: a place of the site, or the nearest mark."""

from collections.abc import Iterable

import shapely

from deconflict.contention.resources import Place, Resource, outlines
from ingest.settings import Datum

FARTHEST_M = 15.0
"""A mark that is farther than this says less than the coordinates do."""
AT_M = 1.5
"""Nearer than this a person would say "at"."""


class Landmarks:
    """The named places and reference points of a site."""

    def __init__(self, datums: Iterable[Datum], places: Iterable[Place]) -> None:
        datums = tuple(datums)
        self._floors = {one.id: one.name for one in datums}
        self._marks = {one.id: _marks(one) for one in datums}
        self._inside: dict[str, list[tuple[float, str, shapely.Polygon]]] = {}
        for place in places:
            word = "at" if isinstance(place, Resource) else "in"
            for datum, outline in outlines(place):
                shape = shapely.Polygon(outline)
                self._inside.setdefault(datum, []).append((shape.area, f"{word} {place.label}", shape))
                self._marks.setdefault(datum, []).append((place.label, shape))
        for places_here in self._inside.values():
            places_here.sort(key=lambda one: one[:2])

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
        for _, words, shape in self._inside.get(datum, ()):
            if shape.covers(point):
                return words
        near = min(((mark.distance(point), name) for name, mark in self._marks.get(datum, ())), default=None)
        if near is None or near[0] > FARTHEST_M:
            return f"near ({x_m:.1f}, {y_m:.1f})"
        return f"at {near[1]}" if near[0] < AT_M else f"{near[0]:.0f} m from {near[1]}"


def _marks(datum: Datum) -> list[tuple[str, shapely.Geometry]]:
    """The marks of a floor that lie in metres and have a name that a person uses."""
    if datum.coordinates != "metres":
        return []
    return [(one.name, shapely.Point(one.x, one.y)) for one in datum.reference_points if one.name]
