"""Geometry of places: which resource a point is in, which zones an envelope passes through."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from math import dist, inf

import numpy as np
import shapely

from deconflict.contention.robots.bodies_ahead import BodiesAhead
from deconflict.contention.robots.bounding_boxes import ROUNDING_M, enlarged, touching_boxes
from deconflict.contention.robots.lookahead import STEPS, Lookahead, corners
from deconflict.settings.shared_places import Place, Resource, Zone, outlines
from deconflict_client.advisory import Location
from ingest.batch import Bools, Floats, Ints

CHANGEOVER_S = 4.0
"""From when a robot leaves a resource or a lane until the next robot can be there."""


@dataclass(frozen=True, slots=True, eq=False)
class ZonePassage:
    """One robot's way through a zone by its newest forecast."""

    zone: str
    enter_s: float
    """The first time from now on at which it will be in the zone by its path; now if it is inside."""
    leave_s: float
    """When it is out; inf if that is beyond the forecast."""
    t_s: Floats
    """(k,) times at which it is in the zone."""
    along_m: Floats
    """(k,) position of its centre along the aisle's axis; zeros if the zone has no axis."""
    across_m: float = 0.0
    """Mean distance of its centre to the left of the axis."""
    was_inside: bool = False
    """Whether a part of it was in the zone at its newest report."""
    rests: bool = False
    """Whether it rested there: then it is where it was, wherever its path leads."""

    def is_inside(self, now_s: float) -> bool:
        """Whether a part of it is in the zone."""
        return self.was_inside if self.rests else self.enter_s <= now_s < self.leave_s

    @property
    def direction(self) -> int:
        """1 along the axis, -1 against it, 0 if neither."""
        moved_m = float(self.along_m[-1] - self.along_m[0])
        return 0 if abs(moved_m) < 0.5 else 1 if moved_m > 0 else -1

    @property
    def rate_mps(self) -> float:
        """Mean speed along the axis."""
        return float(self.along_m[-1] - self.along_m[0]) / max(float(self.t_s[-1] - self.t_s[0]), 0.5)

    @property
    def reach_m(self) -> float:
        """How far along the axis it goes: where it stops in the zone; infinitely far if it does not stop."""
        stops = len(self.along_m) > 2 and abs(float(self.along_m[-1] - self.along_m[-3])) < 0.1
        return float(self.along_m[-1]) if stops else self.direction * inf

    def through_s(self, way_m: float) -> float:
        """How long it takes for `way_m` through the zone; beyond the forecast, at its mean speed so far."""
        forecast_s = min(self.leave_s, float(self.t_s[-1])) - self.enter_s
        if self.leave_s < inf or abs(self.reach_m) < inf:
            return forecast_s
        return max(forecast_s, way_m / max(abs(self.rate_mps), 0.1))

    def at_m(self, t_s: float) -> float:
        """Position of its centre along the axis; before and after the passage, at its ends."""
        return float(np.interp(t_s, self.t_s, self.along_m))


class PlaceOutlines:
    """The outlines of places on one floor."""

    def __init__(self, datum: str, outlines: Sequence[tuple[str, Iterable[tuple[float, float]]]]) -> None:
        self.datum = datum
        self.ids = [place for place, _ in outlines]
        self.outlines = np.array([shapely.Polygon(outline) for _, outline in outlines])
        shapely.prepare(self.outlines)
        self.tree = shapely.STRtree(self.outlines)
        self.bounds_m: Floats = shapely.bounds(self.outlines)
        """(n, 4) the boxes around them."""

    def near(self, datums: Sequence[str], boxes_m: Floats) -> Ints:
        """(k,) rows of `boxes_m` (n, 4) that are on this floor and touch a box around an outline."""
        rows = dict.fromkeys(touching_boxes(boxes_m, self.bounds_m)[:, 0].tolist())
        return np.array([row for row in rows if datums[row] == self.datum], np.int64)

    def touched(self, index: Ints, view: Lookahead, who: Ints, length_m: Floats, width_m: Floats) -> Bools:
        """(pairs, k) whether the envelopes of the robots `who` touch the outlines `index`, both (pairs,).

        Shapes are compared only if the centre is near enough.
        """
        x_m, y_m, yaw_rad = view.x_m[who], view.y_m[who], view.yaw_rad[who]
        west, south, east, north = self.bounds_m[index].T[:, :, None]
        beside_m = np.hypot(np.maximum(west - x_m, x_m - east).clip(0), np.maximum(south - y_m, y_m - north).clip(0))
        touched: Bools = beside_m <= np.hypot(length_m, width_m)[:, None] / 2 + ROUNDING_M
        pair, step = np.nonzero(touched)
        poses = (x_m[pair, step], y_m[pair, step], yaw_rad[pair, step])
        envelopes = shapely.polygons(corners(*poses, length_m[pair], width_m[pair]))
        touched[pair, step] = shapely.intersects(self.outlines[index[pair]], envelopes)
        return touched


class PlaceGeometry:
    """The site's places, floor by floor."""

    def __init__(self, resources: Iterable[Resource], zones: Iterable[Zone]) -> None:
        self.resources = {resource.id: resource for resource in resources}
        self.zones = {zone.id: zone for zone in zones}
        places: list[Place] = [*self.resources.values(), *self.zones.values()]
        self.chargers = tuple(resource.id for resource in self.resources.values() if resource.kind == "charger")
        self._middles = {place.id: _middle(place) for place in places}
        self._locations = {place: _location(*middle) for place, middle in self._middles.items()}
        self._groups: dict[str, list[str]] = {}
        for resource in self.resources.values():
            self._groups.setdefault(resource.group, []).append(resource.id)
        self.resource_outlines = _floors(self.resources.values())
        """By floor with resources."""
        self.zone_outlines = _floors(self.zones.values())
        """By floor with zones."""

    def label(self, place: str) -> str:
        found = self.resources.get(place) or self.zones.get(place)
        return found.label if found else place

    def capacity(self, place: str) -> int:
        found = self.resources.get(place)
        return found.capacity if found else self.zones[place].capacity

    def changeover_s(self, place: str) -> float:
        """From the end of one turn to the next; 0 at a zone, which a robot has left once all of it is out."""
        return CHANGEOVER_S if place in self.resources else 0.0

    def lane_m(self, zone: str) -> float:
        """Length of an aisle's axis; 0 for other zones."""
        axis = self.zones[zone].axis
        return dist(*axis) if axis else 0.0

    def middle(self, place: str) -> tuple[str, float, float]:
        """Datum, x and y of a point inside."""
        return self._middles[place]

    def location(self, place: str) -> Location:
        """The middle as advisories give it, to the millimetre."""
        return self._locations[place]

    def group(self, place: str) -> list[str]:
        """The places that are interchangeable with this one, and itself, in the order of the site file."""
        found = self.resources.get(place)
        return self._groups[found.group] if found and found.group else [place]

    def resources_at(self, datums: Sequence[str], x_m: Floats, y_m: Floats) -> list[str | None]:
        """The resource that each point lies in; if outlines overlap, the first in the site file."""
        found: list[str | None] = [None] * len(datums)
        if not self.resource_outlines:
            return found
        boxes_m = np.stack([x_m, y_m, x_m, y_m], axis=1)
        for floor in self.resource_outlines:
            rows = floor.near(datums, boxes_m)
            if len(rows):
                inside = floor.tree.query(shapely.points(x_m[rows], y_m[rows]), predicate="intersects")
                for row, index in sorted(inside.T.tolist(), reverse=True):
                    found[rows[row]] = floor.ids[index]
        return found

    def passages(self, datums: Sequence[str], bodies: BodiesAhead, rests: Bools) -> dict[int, dict[str, ZonePassage]]:
        """By row and zone, the passages of each robot with its trailers while they stay on its floor.

        `rests` (rows,) is whether a robot rests where it was last reported.
        """
        found: dict[int, dict[str, ZonePassage]] = {}
        if not self.zone_outlines:
            return found
        robot, view, paths, length_m, width_m, reported = bodies
        seen = view.after(*reported.T)
        datums, reach_m = [datums[row] for row in robot.tolist()], np.hypot(length_m, width_m) / 2
        lines_m = np.concatenate([reported[:, None, :2], paths.lines_m], axis=1)
        boxes_m = enlarged(np.hstack([lines_m.min(axis=1), lines_m.max(axis=1)]), reach_m)
        for floor in self.zone_outlines:
            rows = floor.near(datums, boxes_m)
            if not len(rows):
                continue
            lines = shapely.linestrings(lines_m[rows])
            near, index = floor.tree.query(lines, predicate="dwithin", distance=reach_m[rows])
            who = rows[near]
            inside = floor.touched(index, seen, who, length_m[who], width_m[who])
            inside &= seen.floor[who] == view.floor[who, :1]
            inside[:, 1] = np.where(rests[robot[who]], inside[:, 0], inside[:, 1])
            pairs = np.flatnonzero(inside[:, 1:].any(axis=1))
            rows, zones, inside = _of_robots(robot[who[pairs]], index[pairs], inside[pairs])
            was_inside, runs = inside[:, 0].tolist(), _first_runs(inside[:, 1:])
            for row, at, was, first, end in zip(rows.tolist(), zones.tolist(), was_inside, *runs, strict=True):
                zone = floor.ids[at]
                passage = self._passage(zone, view, row, first, end)
                found.setdefault(row, {})[zone] = replace(passage, was_inside=was, rests=bool(rests[row]))
        return found

    def _passage(self, zone: str, view: Lookahead, row: int, first: int, end: int) -> ZonePassage:
        """The passage of a row that is inside from step `first` to before `end`."""
        axis = self.zones[zone].axis
        along_m, across_m = np.zeros(end - first), 0.0
        if axis:
            (ax, ay), (bx, by) = axis
            unit = np.array([bx - ax, by - ay]) / np.hypot(bx - ax, by - ay)
            x_m, y_m = view.x_m[row, first:end] - ax, view.y_m[row, first:end] - ay
            along_m, across_m = x_m * unit[0] + y_m * unit[1], float((y_m * unit[0] - x_m * unit[1]).mean())
        leave_s, t_s = float(view.t_s[row, end]) if end <= STEPS else inf, view.t_s[row, first:end]
        return ZonePassage(zone, float(t_s[0]), leave_s, t_s, along_m, across_m)


def _of_robots(rows: Ints, zones: Ints, inside: Bools) -> tuple[Ints, Ints, Bools]:
    """Each pair of robot and zone once: it is inside as long as any of its bodies is."""
    code, of_pair = np.unique(rows << 32 | zones, return_inverse=True)
    any_inside = np.zeros((len(code), inside.shape[1]), np.bool_)
    np.logical_or.at(any_inside, of_pair, inside)
    return code >> 32, code & 0xFFFFFFFF, any_inside


def _first_runs(inside: Bools) -> tuple[list[int], list[int]]:
    """Where the first run of true steps begins and ends in each row of (n, steps); each row has one."""
    first = inside.argmax(axis=1)
    out = ~inside & (np.arange(inside.shape[1]) > first[:, None])
    return first.tolist(), np.where(out.any(axis=1), out.argmax(axis=1), inside.shape[1]).tolist()


def _middle(place: Place) -> tuple[str, float, float]:
    point = shapely.Polygon(place.polygon).representative_point()
    return place.datum, point.x, point.y


def _location(datum: str, x_m: float, y_m: float) -> Location:
    return Location(datum=datum, x=round(x_m, 3), y=round(y_m, 3))


def _floors(places: Iterable[Place]) -> list[PlaceOutlines]:
    by_datum: dict[str, list[tuple[str, Iterable[tuple[float, float]]]]] = {}
    for place in places:
        for datum, outline in outlines(place):
            by_datum.setdefault(datum, []).append((place.id, outline))
    return [PlaceOutlines(datum, of_datum) for datum, of_datum in by_datum.items()]
