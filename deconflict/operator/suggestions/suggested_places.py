"""The places of a site that suggestions may concern."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple, Self

import shapely

from deconflict.operator.suggestions.evidence import PlaceKey
from deconflict.settings.shared_places import Point, outlines
from deconflict.settings.site import Site

LONG_AS_WIDE = 3.0
"""An area that is so many times as long as wide is an aisle."""
SERVED = ("dock", "charger", "station")
"""Kinds of resources at which robots queue, and of which there can be more."""


class ServedPlace(NamedTuple):
    """A resource that robots wait for."""

    name: str
    kind: str
    floor: str
    group: str
    """Those of one group replace each other; its own name if it has none."""
    x_m: float
    y_m: float


@dataclass(frozen=True, slots=True)
class SuggestedPlaces:
    """Docks, aisles and crossings, and whose participants are people."""

    served: tuple[ServedPlace, ...] = ()
    aisles: frozenset[PlaceKey] = frozenset()
    crossings: frozenset[PlaceKey] = frozenset()
    people: frozenset[str] = frozenset()
    """Vendors. Nobody asks people to let others go first, or for forecasts."""

    @classmethod
    def of(cls, site: Site) -> Self:
        return cls(tuple(_served(site)), frozenset(_aisles(site)), frozenset(_crossings(site)), site.people)


def _served(site: Site) -> Iterable[ServedPlace]:
    for resource in site.resources:
        if resource.kind in SERVED:
            middle = shapely.Polygon(resource.polygon).centroid
            group = resource.group or resource.id
            yield ServedPlace(resource.label, resource.kind, resource.datum, group, middle.x, middle.y)


def _aisles(site: Site) -> Iterable[PlaceKey]:
    for zone in site.zones:
        if zone.kind == "aisle":
            yield from (PlaceKey(datum, zone.label) for datum, _ in outlines(zone))
    for area in site.areas:
        if _is_long(area.outline_m):
            yield PlaceKey(area.floor or site.datums[0].id, area.name)


def _crossings(site: Site) -> Iterable[PlaceKey]:
    for zone in site.zones:
        if zone.kind == "crossing":
            yield from (PlaceKey(datum, zone.label) for datum, _ in outlines(zone))


def _is_long(outline: Iterable[Point]) -> bool:
    """Whether an outline is that of an aisle."""
    rectangle = shapely.Polygon(outline).minimum_rotated_rectangle
    corners = [shapely.Point(corner) for corner in rectangle.exterior.coords[:3]]
    sides_m = sorted((corners[0].distance(corners[1]), corners[1].distance(corners[2])))
    return sides_m[1] >= LONG_AS_WIDE * sides_m[0]
