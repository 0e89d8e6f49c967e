"""Where places lie: which resource a point is in, which zones an envelope sweeps through."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import dist, inf

import numpy as np
import shapely

from deconflict.advisory import Location
from deconflict.contention.robots.bounding_boxes import ROUNDING_M, grown, touching
from deconflict.contention.robots.lookahead import STEPS, Ahead, Ways, corners
from deconflict.settings.shared_places import Place, Resource, Zone, outlines
from ingest.batch import Bools, Floats, Ints

CHANGEOVER_S = 4.0
"""From when a robot sets out from a resource, or is out of a lane, until the next one can be there."""


@dataclass(frozen=True, slots=True, eq=False)
class Passage:
    """One robot's way through a zone, as it is forecast now."""

    zone: str
    enter_s: float
    """The first time it is in the zone; now where it is in it already."""
    leave_s: float
    """When it is out; inf where that lies beyond the forecast."""
    t_s: Floats
    """(k,) times at which it is in the zone."""
    along_m: Floats
    """(k,) where its centre then is along the aisle's axis; zeros where the zone has none."""
    across_m: float = 0.0
    """How far to the left of the axis its centre is, on the mean."""

    @property
    def direction(self) -> int:
        """1 along the axis, -1 against it, 0 where it goes neither way."""
        moved_m = float(self.along_m[-1] - self.along_m[0])
        return 0 if abs(moved_m) < 0.5 else 1 if moved_m > 0 else -1

    @property
    def rate_mps(self) -> float:
        """Mean speed along the axis."""
        return float(self.along_m[-1] - self.along_m[0]) / max(float(self.t_s[-1] - self.t_s[0]), 0.5)

    @property
    def reach_m(self) -> float:
        """How far along the axis it goes: where it stops in the zone, else beyond either end."""
        stops = len(self.along_m) > 2 and abs(float(self.along_m[-1] - self.along_m[-3])) < 0.1
        return float(self.along_m[-1]) if stops else self.direction * inf

    def through_s(self, way_m: float) -> float:
        """How long it takes through, over this way; beyond the forecast, at its mean speed so far."""
        told_s = min(self.leave_s, float(self.t_s[-1])) - self.enter_s
        if self.leave_s < inf or abs(self.reach_m) < inf:
            return told_s
        return max(told_s, way_m / max(abs(self.rate_mps), 0.1))

    def at_m(self, t_s: float) -> float:
        """Where along the axis its centre is, held at both ends of the passage."""
        return float(np.interp(t_s, self.t_s, self.along_m))


class _Floor:
    """The outlines of one floor, and whose they are."""

    def __init__(self, datum: str, drawn: Sequence[tuple[str, Iterable[tuple[float, float]]]]) -> None:
        self.datum = datum
        self.ids = [place for place, _ in drawn]
        self.outlines = np.array([shapely.Polygon(outline) for _, outline in drawn])
        shapely.prepare(self.outlines)
        self.tree = shapely.STRtree(self.outlines)
        self.bounds_m: Floats = shapely.bounds(self.outlines)

    def near(self, datums: Sequence[str], boxes_m: Floats) -> Ints:
        """(k,) rows of what is on this floor, in boxes (n, 4) of which some touch those around outlines."""
        touched = dict.fromkeys(touching(boxes_m, self.bounds_m)[:, 0].tolist())
        return np.array([row for row in touched if datums[row] == self.datum], np.int64)

    def touched(self, index: Ints, view: Ahead, who: Ints, length_m: Floats, width_m: Floats) -> Bools:
        """(pairs, STEPS + 1) whether the envelopes of robots touch the outlines, all else of (pairs,).

        Only where the middle is near enough for that is it asked of the shapes.
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


class Geometry:
    """The site's places, floor by floor."""

    def __init__(self, resources: Iterable[Resource], zones: Iterable[Zone]) -> None:
        self.resources = {one.id: one for one in resources}
        self.zones = {one.id: one for one in zones}
        places: list[Place] = [*self.resources.values(), *self.zones.values()]
        self.chargers = tuple(one.id for one in self.resources.values() if one.kind == "charger")
        self._middles = {place.id: _middle(place) for place in places}
        self._locations = {place: _location(*middle) for place, middle in self._middles.items()}
        self._groups: dict[str, list[str]] = {}
        for one in self.resources.values():
            self._groups.setdefault(one.group, []).append(one.id)
        self._resources = _floors(self.resources.values())
        self._zones = _floors(self.zones.values())

    def label(self, place: str) -> str:
        found = self.resources.get(place) or self.zones.get(place)
        return found.label if found else place

    def capacity(self, place: str) -> int:
        found = self.resources.get(place)
        return found.capacity if found else self.zones[place].capacity

    def changeover_s(self, place: str) -> float:
        """From one robot's turn to the next one's; none at a zone, which is left when the last of a robot is out."""
        return CHANGEOVER_S if place in self.resources else 0.0

    def lane_m(self, zone: str) -> float:
        """Length of an aisle's axis; 0 of another zone."""
        axis = self.zones[zone].axis
        return dist(*axis) if axis else 0.0

    def middle(self, place: str) -> tuple[str, float, float]:
        """Datum, x and y of a point inside."""
        return self._middles[place]

    def location(self, place: str) -> Location:
        """The same as it is told, to the millimetre."""
        return self._locations[place]

    def group(self, place: str) -> list[str]:
        """The places that can stand in for one another, this one among them, in the order of the site file."""
        found = self.resources.get(place)
        return self._groups[found.group] if found and found.group else [place]

    def resources_at(self, datums: Sequence[str], x_m: Floats, y_m: Floats) -> list[str | None]:
        """The resource that each point lies in, the first in the site file where outlines overlap."""
        found: list[str | None] = [None] * len(datums)
        if not self._resources:
            return found
        boxes_m = np.stack([x_m, y_m, x_m, y_m], axis=1)
        for floor in self._resources:
            rows = floor.near(datums, boxes_m)
            if len(rows):
                inside = floor.tree.query(shapely.points(x_m[rows], y_m[rows]), predicate="intersects")
                for row, index in sorted(inside.T.tolist(), reverse=True):
                    found[rows[row]] = floor.ids[index]
        return found

    def resource_boxes(self) -> list[tuple[str, Floats]]:
        """By datum, boxes (n, 4) around the resources there."""
        return [(floor.datum, floor.bounds_m) for floor in self._resources]

    def zone_boxes(self) -> list[tuple[str, Floats]]:
        return [(floor.datum, floor.bounds_m) for floor in self._zones]

    def passages(
        self, datums: Sequence[str], view: Ahead, ways: Ways, length_m: Floats, width_m: Floats
    ) -> dict[int, dict[str, Passage]]:
        """The zones that each envelope sweeps through while it stays on its floor: by row, by id of the zone."""
        found: dict[int, dict[str, Passage]] = {}
        if not self._zones:
            return found
        reach_m = np.hypot(length_m, width_m) / 2
        boxes_m = grown(ways.boxes_m, reach_m)
        for floor in self._zones:
            rows = floor.near(datums, boxes_m)
            if not len(rows):
                continue
            lines = shapely.linestrings(ways.lines_m[rows])
            near, index = floor.tree.query(lines, predicate="dwithin", distance=reach_m[rows])
            who = rows[near]
            inside = floor.touched(index, view, who, length_m[who], width_m[who])
            inside &= view.floor[who] == view.floor[who, :1]
            pairs = np.flatnonzero(inside.any(axis=1))
            runs = zip(who[pairs].tolist(), index[pairs].tolist(), *_first_runs(inside[pairs]), strict=True)
            for row, at, first, end in runs:
                zone = floor.ids[at]
                found.setdefault(row, {})[zone] = self._passage(zone, view, row, first, end)
        return found

    def _passage(self, zone: str, one: Ahead, row: int, first: int, end: int) -> Passage:
        """That is inside from step `first` to `end`."""
        axis = self.zones[zone].axis
        along_m, across_m = np.zeros(end - first), 0.0
        if axis:
            (ax, ay), (bx, by) = axis
            unit = np.array([bx - ax, by - ay]) / np.hypot(bx - ax, by - ay)
            x_m, y_m = one.x_m[row, first:end] - ax, one.y_m[row, first:end] - ay
            along_m, across_m = x_m * unit[0] + y_m * unit[1], float((y_m * unit[0] - x_m * unit[1]).mean())
        leave_s, t_s = float(one.t_s[row, end]) if end <= STEPS else inf, one.t_s[row, first:end]
        return Passage(zone, float(t_s[0]), leave_s, t_s, along_m, across_m)


def _first_runs(inside: Bools) -> tuple[list[int], list[int]]:
    """Where the first run of steps that are inside begins and ends; (n, steps), in each row there is one."""
    first = inside.argmax(axis=1)
    out = ~inside & (np.arange(inside.shape[1]) > first[:, None])
    return first.tolist(), np.where(out.any(axis=1), out.argmax(axis=1), inside.shape[1]).tolist()


def _middle(place: Place) -> tuple[str, float, float]:
    point = shapely.Polygon(place.polygon).representative_point()
    return place.datum, point.x, point.y


def _location(datum: str, x_m: float, y_m: float) -> Location:
    return Location(datum=datum, x=round(x_m, 3), y=round(y_m, 3))


def _floors(places: Iterable[Place]) -> list[_Floor]:
    drawn: dict[str, list[tuple[str, Iterable[tuple[float, float]]]]] = {}
    for place in places:
        for datum, outline in outlines(place):
            drawn.setdefault(datum, []).append((place.id, outline))
    return [_Floor(datum, one) for datum, one in drawn.items()]
