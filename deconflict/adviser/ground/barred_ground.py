"""Ground of the site file onto which no robot is sent."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import shapely

from deconflict.adviser.ways import Boxes
from deconflict.contention.robots.lookahead import corners
from deconflict.settings.shared_places import Point, outlines
from deconflict.settings.site import Site
from ingest.batch import Bools, Floats

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

    def bars_standing(self, floor: str, poses: Floats, length_m: float, width_m: float) -> Bools:
        """(n,) whether a body at each pose touches ground on which no robot is sent to stand; `poses` (n, 3) are x, y
        and yaw."""
        outlines_here = self._not_to_stand_on.get(floor)
        if outlines_here is None:
            return np.zeros(len(poses), np.bool_)
        x_m, y_m, yaw_rad = poses.T
        halves_m = (np.full(len(poses), size_m / 2) for size_m in (length_m, width_m))
        return _touched(outlines_here, Boxes(x_m, y_m, yaw_rad, *halves_m))

    def bars_driving(self, floor: str, boxes: Boxes) -> Bools:
        """(n,) whether each of `boxes` (n,) touches ground onto which no robot is sent at all."""
        outlines_here = self._not_to_drive_on.get(floor)
        return np.zeros(len(boxes.x_m), np.bool_) if outlines_here is None else _touched(outlines_here, boxes)


def _by_floor(floor_outlines: Iterable[tuple[str, Sequence[Point]]]) -> FloorOutlines:
    found: dict[str, list[shapely.Polygon]] = {}
    for floor, outline in floor_outlines:
        found.setdefault(floor, []).append(shapely.Polygon(outline))
    return {floor: shapely.STRtree(polygons) for floor, polygons in found.items()}


def _touched(outlines_here: shapely.STRtree, boxes: Boxes) -> Bools:
    """(n,) whether each of `boxes` (n,) touches an outline."""
    rectangles = shapely.polygons(corners(*boxes[:3], 2 * boxes.half_length_m, 2 * boxes.half_width_m))
    found = np.zeros(len(rectangles), np.bool_)
    found[outlines_here.query(rectangles, predicate="intersects")[0]] = True
    return found
