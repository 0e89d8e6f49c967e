"""What contention knows of each robot: where it stands, what it has, where it goes next and by which way."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely
from shapely.ops import substring

from deconflict.contention.ahead import STEP_S, STEPS, Ahead, ahead, corners, ways_ahead
from deconflict.contention.arrivals import Arrivals, Quantiles
from deconflict.contention.destinations import UNTOLD, Destinations, Stop
from deconflict.contention.geometry import Geometry, Passage
from deconflict.contention.promises import Spot, near
from deconflict.gathering import Gathered
from ingest.seam import Basis, Floats

STANDS_M = 0.1
"""A robot that has moved no further than this stands."""
STANDS_S = 3.0
"""For so long, if it is forecast to move."""
WAY_M = 0.5
"""A way with less than this left is gone."""
STRAIGHT = int(3.0 / STEP_S)
"""A robot that tells no path is taken to go straight on for so many steps; nobody knows its way beyond."""
RESTING = frozenset(("idle", "charging", "disabled", "offline"))
"""States of robots that want to go nowhere now."""


@dataclass(frozen=True, slots=True, eq=False)
class Shapes:
    """Where the n robots of a batch are and will be, as numbers: few are ever asked for as shapes."""

    yaw_rad: Floats
    """(n,) now."""
    ways: Floats
    """(n, STEPS + 1, 2) of their envelopes' centres, as far as they are known and stay on their floor."""


Said = tuple[str, str, str, float, Spot, float, float, float, bool, list[float]]
"""What `Seen` tells of a robot from its vendor on to the box around its way, in that order."""


@dataclass(slots=True, eq=False)
class Seen:
    """One robot, as last heard of."""

    uuid: str
    shapes: Shapes
    row: int
    """Of `shapes`."""
    vendor: str = ""
    name: str = ""
    state: str = ""
    event_s: float = 0.0
    spot: Spot = ("", 0.0, 0.0)
    """Where it is; on "" where it is compared with nothing."""
    length_m: float = 0.0
    width_m: float = 0.0
    way_m: float = 0.0
    """How far it gets in the next ten seconds."""
    goes: bool = False
    """Whether it is forecast to move."""
    box_m: Sequence[float] = ()
    """West, south, east and north of its way, or of the last one that it was on."""
    stands: bool = True
    """Whether it is at rest, whatever it says: it has not moved for a while, or is not to."""
    stood_s: float = 0.0
    """Since when it stands where it is."""
    stood_at: Spot = ("", 0.0, 0.0)
    here: str | None = None
    """The resource it has."""
    came_s: float = 0.0
    """Since when it has that."""
    stops: tuple[Stop, ...] = ()
    """By time, without any that it is at already."""
    way_left: shapely.LineString | None = None
    """Of one that waits on its way, until it is through or rests."""
    passages: dict[str, Passage] = field(default_factory=dict)
    """By zone."""

    @property
    def datum(self) -> str:
        return self.spot[0]

    @property
    def x_m(self) -> float:
        return self.spot[1]

    @property
    def y_m(self) -> float:
        return self.spot[2]

    @property
    def speed_mps(self) -> float:
        """Along its way; walking pace where it is not forecast to move."""
        return max(self.way_m / (STEPS * STEP_S), 0.2) if self.goes else 1.0

    def hear(self, said: Said, shapes: Shapes, row: int) -> None:
        """Take in what it says now."""
        went, ways, at, was_at = self.goes, self.shapes.ways, self.row, self.spot
        self.shapes, self.row = shapes, row
        (
            self.vendor,
            self.name,
            self.state,
            self.event_s,
            self.spot,
            self.length_m,
            self.width_m,
            self.way_m,
            self.goes,
            box_m,
        ) = said
        if self.goes:
            self.box_m = box_m
        if self.goes or self.state in RESTING:
            self.way_left = None
        elif went or (self.way_left is not None and was_at != self.spot):
            self.way_left = _rest_of(shapely.linestrings(ways[at]) if went else self.way_left, self)


class Robots:
    """Every robot; takes in those that changed."""

    def __init__(self, geometry: Geometry) -> None:
        self.seen: dict[str, Seen] = {}
        self.arrivals = Arrivals()
        self._geometry = geometry

    def forget(self, uuids: Iterable[str]) -> list[Seen]:
        """Those that were known."""
        for uuid in uuids:
            self.arrivals.forget(uuid)
        return [one for uuid in uuids if (one := self.seen.pop(uuid, None))]

    def look(self, gathered: Gathered) -> list[tuple[str, float]]:
        """Take in the robots of a batch; the resources that robots have left, and for how long they had them."""
        batch, now_s = gathered
        if not len(batch):
            return []
        view, sizes = ahead(batch.forecasts, now_s), batch.forecasts
        ways = ways_ahead(view, np.where(batch.basis == Basis.VELOCITY, STRAIGHT, STEPS))
        shapes = Shapes(view.yaw_rad[:, 0].copy(), ways.lines_m)
        goes = (batch.basis != Basis.STATIONARY) & (ways.way_m > WAY_M)
        datums = batch.datums(view.floor[:, 0])
        here = self._geometry.resources_at(datums, view.x_m[:, 0], view.y_m[:, 0])
        passages = self._geometry.passages(datums, view, ways, sizes.length_m, sizes.width_m)
        destinations = Destinations(batch, view, now_s, here, self._geometry)
        spots = zip(datums, view.x_m[:, 0].tolist(), view.y_m[:, 0].tolist(), strict=True)
        numbers = (sizes.length_m, sizes.width_m, ways.way_m, goes, ways.boxes_m)
        words = (batch.vendors, batch.names, batch.states, batch.event_s.tolist(), spots)
        said = zip(*words, *(column.tolist() for column in numbers), strict=True)
        robots, rates = list[Seen](), list[Quantiles]()
        left = list[tuple[str, float]]()
        for row, (uuid, told, place, at_s) in enumerate(zip(batch.robots, said, here, now_s.tolist(), strict=True)):
            one, new = self.seen.get(uuid), False
            if one is None:
                one, new = self.seen.setdefault(uuid, Seen(uuid, shapes, row)), True
            one.hear(told, shapes, row)
            left += _placed(one, place, new)
            one.passages = passages.get(row, {})
            robots.append(one)
            rates.append(self._rate(one, at_s, destinations, row))
        stops = destinations.stops(rates)
        for one, first, (_, last) in zip(robots, destinations.first, destinations.spans, strict=True):
            one.stops = tuple(stops[first:last])
        if self._geometry.resources:
            going = np.flatnonzero(goes & (batch.basis != Basis.VELOCITY))
            self._follow([row for row in going.tolist() if not robots[row].stops], robots, datums, view)
        return left

    def _follow(self, rows: list[int], robots: Sequence[Seen], datums: Sequence[str], view: Ahead) -> None:
        """Where those go that tell no destination: to the resource that their way ends in."""
        ends = self._geometry.resources_at([datums[row] for row in rows], view.x_m[rows, -1], view.y_m[rows, -1])
        for row, end in zip(rows, ends, strict=True):
            if end:
                robots[row].stops = _end_of_way(robots[row], view, row, end)

    def _rate(self, one: Seen, now_s: float, destinations: Destinations, row: int) -> Quantiles:
        """Take in what a robot says of where it goes; what to make of that."""
        first, last = destinations.spans[row]
        if first < last or self.arrivals.awaits(one.uuid):
            told = destinations.spots[first:last], destinations.told_s[first:last]
            self.arrivals.heard(one.uuid, one.vendor, now_s, one.spot, *told)
        return self.arrivals.quantiles(one.vendor) if destinations.first[row] < last else UNTOLD


def _placed(one: Seen, here: str | None, new: bool) -> list[tuple[str, float]]:
    """Set since when a robot stands where it is, and what it has; the resource that it has left, if any."""
    spot = one.spot
    if new or not near(spot, one.stood_at, STANDS_M):
        one.stood_at, one.stood_s = spot, one.event_s
    one.stands = not one.goes or one.event_s - one.stood_s >= STANDS_S
    if not new and here == one.here:
        return []
    left = [(one.here, one.event_s - one.came_s)] if one.here else []
    one.here, one.came_s = here, one.event_s
    return left


def outlines(robots: Sequence[Seen]) -> list[shapely.Polygon]:
    """Envelopes of one or more robots."""
    poses = [(one.x_m, one.y_m, one.shapes.yaw_rad[one.row], one.length_m, one.width_m) for one in robots]
    found: list[shapely.Polygon] = shapely.polygons(corners(*np.array(poses).T)).tolist()
    return found


def ways(robots: Sequence[Seen]) -> list[shapely.LineString]:
    """Ways of robots, as far as they are forecast; of those that go nowhere, what is left of theirs."""
    going = [one.shapes.ways[one.row] for one in robots if one.goes]
    lines = iter(shapely.linestrings(going).tolist() if going else ())
    return [next(lines) if one.goes else one.way_left for one in robots]


def _end_of_way(one: Seen, view: Ahead, row: int, resource: str) -> tuple[Stop, ...]:
    """As if that were its destination, unless it has it, or is on another floor by then."""
    if resource == one.here or view.floor[row, -1] != view.floor[row, 0]:
        return ()
    x_m, y_m = float(view.x_m[row, -1]), float(view.y_m[row, -1])
    short_m = np.hypot(view.x_m[row] - x_m, view.y_m[row] - y_m)
    arrives_s = float(view.t_s[row, int(np.argmax(short_m < STANDS_M))])
    return (Stop(arrives_s, STEP_S, one.datum, x_m, y_m, resource),)


def _rest_of(way: shapely.LineString, one: Seen) -> shapely.LineString | None:
    """What is left of its way to a robot that has come to stand on it; None once it is through, or off it."""
    here = shapely.Point(one.x_m, one.y_m)
    done_m = float(shapely.line_locate_point(way, here))
    if way.length - done_m < WAY_M or shapely.distance(way, here) > one.length_m:
        return None
    return way if done_m == 0 else substring(way, done_m, way.length)
