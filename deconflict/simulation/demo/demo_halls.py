"""The demo's site where one hall is too small for its robots: places and drawing of the hall repeat beside it."""

from collections.abc import Iterator, Mapping

from deconflict.settings.shared_places import FloorPart, Place, Polygon, Resource
from deconflict.settings.site import Site
from deconflict.simulation.floor_layout import PATTERNS, halls_for

EDGE_M = 0.6
"""What comes so near to both ends of a hall runs through all halls."""


def with_halls(site: Site, robots: int) -> Site:
    """The site with halls side by side for a number of robots, as `layout_for` lays them out."""
    halls = halls_for(robots)
    rows = {datum.id: _HallRow(pattern.width_m, halls) for datum, pattern in zip(site.datums, PATTERNS, strict=True)}
    places = {
        name: tuple(repeated for place in getattr(site, name) for repeated in _places(place, rows))
        for name in ("resources", "zones")
    }
    drawn = {
        name: tuple(repeated for part in getattr(site, name) for repeated in _parts(part, rows[part.floor]))
        for name in ("areas", "obstacles")
    }
    return site.model_copy(update=places | drawn)


class _HallRow:
    """The halls of one floor, from west to east."""

    def __init__(self, width_m: float, halls: int) -> None:
        self.width_m = width_m
        self._last = halls - 1

    def outlines(self, outline: Polygon) -> Iterator[tuple[int, Polygon]]:
        """The halls, counted from 0, that have such a part, and its outline there."""
        west_m, east_m = min(x for x, _ in outline), max(x for x, _ in outline)
        if east_m <= 0.0 or max(y for _, y in outline) < 0.0:  # the wall in the west, and the annex in the south
            yield 0, outline
        elif west_m >= self.width_m:  # the wall in the east
            yield self._last, _moved(outline, self._last * self.width_m)
        elif west_m <= EDGE_M and east_m >= self.width_m - EDGE_M:
            yield 0, tuple((x + self._last * self.width_m if x > EDGE_M else x, y) for x, y in outline)
        else:
            for hall in range(self._last + 1):
                yield hall, _moved(outline, hall * self.width_m)


def _places(place: Place, rows: Mapping[str, _HallRow]) -> Iterator[Place]:
    for hall, polygon in rows[place.datum].outlines(place.polygon):
        changed: dict[str, object] = {"id": f"{place.id}-hall-{hall + 1}" if hall else place.id}
        changed |= {"name": _named(place.name, hall), "polygon": polygon}
        if isinstance(place, Resource):
            changed["group"] = f"{place.group}-{hall + 1}" if hall and place.group else place.group
            changed["floors"] = tuple(
                door.model_copy(update={"polygon": _moved(door.polygon, hall * rows[door.datum].width_m)})
                for door in place.floors
            )
        yield place.model_copy(update=changed)


def _parts(part: FloorPart, row: _HallRow) -> Iterator[FloorPart]:
    for hall, outline_m in row.outlines(part.outline_m):
        yield part.model_copy(update={"name": _named(part.name, hall), "outline_m": outline_m})


def _named(name: str, hall: int) -> str:
    return f"{name} of hall {hall + 1}" if hall and name else name


def _moved(outline: Polygon, east_m: float) -> Polygon:
    return tuple((x + east_m, y) for x, y in outline)
