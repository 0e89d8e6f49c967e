"""Ground of the site file onto which no robot is sent."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import shapely

from deconflict.adviser.ways import BESIDE_M, Boxes, bodies, wanted_ways
from deconflict.contention.robots.lookahead import corners
from deconflict.contention.robots.robot_table import RobotTable
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

    def bars_standing(self, floor: str, places: Boxes) -> Bools:
        """(n,) whether a body at each of `places` (n,) touches ground on which no robot is sent to stand."""
        return _touched(self._not_to_stand_on.get(floor), places)

    def leaves_a_side(self, robots: RobotTable, slot: int, other: int) -> bool:
        """Whether the robot of a slot may drive past that of another on at least one side of it."""
        outlines_here = self._not_to_drive_on.get(robots.datum(int(robots.records["floor"][slot])))
        return outlines_here is None or not _touched(outlines_here, _sides(robots, slot, other)).all()


def _by_floor(floor_outlines: Iterable[tuple[str, Sequence[Point]]]) -> FloorOutlines:
    found: dict[str, list[shapely.Polygon]] = {}
    for floor, outline in floor_outlines:
        found.setdefault(floor, []).append(shapely.Polygon(outline))
    return {floor: shapely.STRtree(polygons) for floor, polygons in found.items()}


def _touched(outlines_here: shapely.STRtree | None, boxes: Boxes) -> Bools:
    """(n,) whether each of `boxes` (n,) touches an outline."""
    found = np.zeros(len(boxes.x_m), np.bool_)
    if outlines_here is not None:
        rectangles = shapely.polygons(corners(*boxes[:3], 2 * boxes.half_length_m, 2 * boxes.half_width_m))
        found[outlines_here.query(rectangles, predicate="intersects")[0]] = True
    return found


def _sides(robots: RobotTable, slot: int, other: int) -> Boxes:
    """(2,) the strips beside the body of `other`, left and right, as wide as the robot of `slot` with its room."""
    body = bodies(robots, np.array([other]))
    way_rad = _way_rad(robots, slot, body)
    along, across = np.abs(np.cos(body.yaw_rad - way_rad)), np.abs(np.sin(body.yaw_rad - way_rad))
    half_along_m = body.half_length_m * along + body.half_width_m * across
    half_across_m = body.half_length_m * across + body.half_width_m * along
    half_strip_m = robots.records["width_m"][slot] / 2 + BESIDE_M
    left_m = (half_across_m + half_strip_m) * (1.0, -1.0)
    x_m, y_m = body.x_m - left_m * np.sin(way_rad), body.y_m + left_m * np.cos(way_rad)
    return Boxes(x_m, y_m, np.full(2, way_rad), np.full(2, half_along_m), np.full(2, half_strip_m))


def _way_rad(robots: RobotTable, slot: int, body: Boxes) -> float:
    """The direction of a robot's way where it comes nearest to `body` (1,); its heading if it means to stay."""
    ways = wanted_ways(robots, np.array([slot])).boxes
    if not len(ways.x_m):
        return float(robots.records["reported_yaw_rad"][slot])
    away_m = np.hypot(ways.x_m[0, 1:] - body.x_m, ways.y_m[0, 1:] - body.y_m)
    return float(ways.yaw_rad[0, 1 + int(np.nanargmin(away_m))])
