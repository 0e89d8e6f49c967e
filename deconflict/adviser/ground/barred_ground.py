"""Ground of the site file onto which no robot is sent."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import shapely

from deconflict.adviser.ways import Boxes
from deconflict.contention.robots.lookahead import corners
from deconflict.settings.shared_places import Point, outlines
from deconflict.settings.site import Site
from ingest.batch import Bools

FloorOutlines = Mapping[str, shapely.STRtree]
"""Outlines by the floor that they are on."""


class BarredGround:
    """The outlines of a site that say where robots should not stand, and where they should not drive."""

    def __init__(self, site: Site) -> None:
        keep_clear = (area for area in site.areas if area.keep_clear)
        parts = [(part.floor or site.datums[0].id, part.outline_m) for part in (*keep_clear, *site.obstacles)]
        doors = (zone for zone in site.zones if zone.kind == "door")
        places = [outline for place in (*site.resources, *doors) for outline in outlines(place)]
        self._not_to_drive_on = _by_floor(parts)
        self._not_to_stand_on = _by_floor([*parts, *places])

    def bars_standing(self, floor: str, boxes: Boxes) -> Bools:
        """(n,) whether each of `boxes` (n,) touches ground on which no robot is sent to stand."""
        return _touched(self._not_to_stand_on.get(floor), boxes)

    def bars_driving(self, floor: str, boxes: Boxes) -> Bools:
        """(n,) whether each of `boxes` (n,) touches ground onto which no robot is sent at all."""
        return _touched(self._not_to_drive_on.get(floor), boxes)


def _by_floor(floor_outlines: Iterable[tuple[str, Sequence[Point]]]) -> FloorOutlines:
    found: dict[str, list[shapely.Polygon]] = {}
    for floor, outline in floor_outlines:
        found.setdefault(floor, []).append(shapely.Polygon(outline))
    return {floor: shapely.STRtree(polygons) for floor, polygons in found.items()}


def _touched(outlines_here: shapely.STRtree | None, boxes: Boxes) -> Bools:
    """(n,) whether each of `boxes` (n,) touches an outline."""
    found = np.zeros(len(boxes.x_m), np.bool_)
    if outlines_here is None:
        return found
    rectangles = shapely.polygons(corners(*boxes[:3], 2 * boxes.half_length_m, 2 * boxes.half_width_m))
    found[outlines_here.query(rectangles, predicate="intersects")[0]] = True
    return found
