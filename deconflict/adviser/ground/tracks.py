"""Where robots came from: the ground on which a robot can back out, because its own body was there. And ground of the
site file onto which no robot is sent."""

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from math import hypot

import numpy as np
import shapely

from deconflict.adviser.ground.seen_ground import SeenGround, size_of
from deconflict.adviser.ways import Boxes, Ways, bodies, touch_any
from deconflict.contention.robots.lookahead import corners
from deconflict.contention.robots.robot_table import RobotTable
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


STEP_M = 0.5
"""Distance between two kept poses."""
KEPT = 60
POSE = "floor", "reported_x_m", "reported_y_m", "reported_yaw_rad"
ROOM_M = 0.3
"""Room that is left between a robot that has backed out and what passes."""
LEAST_BACK_M = 0.5
"""Nobody is asked to back out less."""


class Tracks:
    """The last metres that each robot drove."""

    def __init__(self, barred: BarredGround, seen: SeenGround) -> None:
        self._barred, self._seen = barred, seen
        self._poses: dict[str, deque[tuple[float, ...]]] = {}
        """By robot floor, x, y and yaw, newest last; all are on one floor."""

    def observe(self, robots: RobotTable, updated: Iterable[str]) -> list[int]:
        """Returns the slots of those whose poses are kept."""
        kept, slots = [], sorted(robots.slots.find({*updated}).tolist())
        columns = (robots.records[name][slots].tolist() for name in POSE)
        for slot, *pose in zip(slots, *columns, strict=True):
            poses = self._poses.setdefault(robots.slots.uuids[slot], deque(maxlen=KEPT))
            if poses and poses[-1][0] != pose[0]:
                poses.clear()
            if not poses or hypot(pose[1] - poses[-1][1], pose[2] - poses[-1][2]) >= STEP_M:
                poses.append(tuple(pose))
                kept.append(slot)
        return kept

    def forget(self, uuids: Iterable[str]) -> None:
        for uuid in uuids:
            self._poses.pop(uuid, None)

    def refuge_m(self, robots: RobotTable, robot: str, passing: Ways, others: Boxes) -> tuple[float, float] | None:
        """The nearest place on a robot's own track where it is in nobody's way: neither on the ways of those that are
        to pass, nor where bodies `others` (m,) are, nor on barred ground, which may lie before it, nor where no body as
        large was seen: its own was less loaded. None if there is none, or if another is on the track before it."""
        poses: Floats = np.array([pose[1:] for pose in self._poses.get(robot, ())])[::-1]
        if not len(poses):
            return None
        size, here = robots[robot], robots.reported_pose(robot)
        halves = (np.full(len(poses), each_m / 2 + ROOM_M) for each_m in (size.length_m, size.width_m))
        places, ways = Boxes(*poses.T, *halves), Boxes._make(column.reshape(-1) for column in passing.boxes)
        is_blocked = touch_any(places, others)
        body = Boxes(*poses.T, *(np.full(len(poses), each_m / 2) for each_m in (size.length_m, size.width_m)))
        is_barred = self._barred.bars_standing(size.datum, body)
        is_seen = self._seen.holds(size.datum, size_of(robots, robot), body)
        is_free = ~touch_any(places, ways) & ~is_barred & is_seen
        reachable = np.logical_and.accumulate(~is_blocked)
        away_m = np.hypot(poses[:, 0] - here[0], poses[:, 1] - here[1])
        found = np.flatnonzero(is_free & reachable & (away_m >= LEAST_BACK_M))
        return (float(poses[found[0], 0]), float(poses[found[0], 1])) if len(found) else None


def other_bodies(robots: RobotTable, slot: int, *but: int) -> Boxes:
    """The bodies of all robots on the floor of a slot, without its own and those of the slots `but`."""
    records = robots.records
    there = records["known"] & (records["floor"] == records["floor"][slot])
    there[[slot, *but]] = False
    return bodies(robots, np.flatnonzero(there))
