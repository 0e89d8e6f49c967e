"""What contention knows of each robot: where it stands, what it has, where it goes next and by which way."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely
from shapely.ops import substring

from deconflict.contention.ahead import STEP_S, STEPS, Ahead, ahead, corners
from deconflict.contention.arrivals import Arrivals, Quantiles
from deconflict.contention.destinations import UNTOLD, Destinations, Stop
from deconflict.contention.geometry import Geometry, Passage
from deconflict.contention.promises import Spot, near
from deconflict.gathering import Gathered
from ingest.seam import Basis, Batch, Floats, Ints

STANDS_M = 0.1
"""A robot that has moved no further than this stands."""
STANDS_S = 3.0
"""For so long, if it is forecast to move."""
WAY_M = 0.5
"""A way with less than this left is gone."""
STRAIGHT_S = 3.0
"""A robot that tells no path is taken to go straight on for so long; nobody knows its way beyond."""
RESTING = frozenset(("idle", "charging", "disabled", "offline"))
"""States of robots that want to go nowhere now."""


@dataclass(frozen=True, slots=True, eq=False)
class Shapes:
    """Where the n robots of a batch are and will be, as numbers: few are ever asked for as shapes."""

    yaw_rad: Floats
    """(n,) now."""
    ways: Floats
    """(n, STEPS + 1, 2) of their envelopes' centres, as far as they are known and stay on their floor."""


Said = tuple[str, str, str, float, str, float, float, float, float, float, bool]
"""What `Seen` tells of a robot from its vendor on to whether it goes, in that order."""


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
    datum: str = ""
    """"" where it is compared with nothing."""
    x_m: float = 0.0
    y_m: float = 0.0
    length_m: float = 0.0
    width_m: float = 0.0
    way_m: float = 0.0
    """How far it gets in the next ten seconds."""
    goes: bool = False
    """Whether it is forecast to move."""
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
    def speed_mps(self) -> float:
        """Along its way; walking pace where it is not forecast to move."""
        return max(self.way_m / (STEPS * STEP_S), 0.2) if self.goes else 1.0

    def hear(self, said: Said, shapes: Shapes, row: int) -> None:
        """Take in what it says now."""
        went, ways, at = self.goes, self.shapes.ways, self.row
        self.shapes, self.row = shapes, row
        (
            self.vendor,
            self.name,
            self.state,
            self.event_s,
            self.datum,
            self.x_m,
            self.y_m,
            self.length_m,
            self.width_m,
            self.way_m,
            self.goes,
        ) = said
        if self.goes or self.state in RESTING:
            self.way_left = None
        elif went or self.way_left is not None:
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
        shapes, way_m = _shapes(batch, view)
        goes = (batch.basis != Basis.STATIONARY) & (way_m > WAY_M)
        datums = batch.datums(view.floor[:, 0])
        here = self._geometry.resources_at(datums, view.x_m[:, 0], view.y_m[:, 0])
        ends = self._geometry.resources_at(datums, view.x_m[:, -1], view.y_m[:, -1])
        passages = self._geometry.passages(datums, view, shapes.ways, sizes.length_m, sizes.width_m)
        destinations = Destinations(batch, view, now_s, here, self._geometry)
        numbers = (view.x_m[:, 0], view.y_m[:, 0], sizes.length_m, sizes.width_m, way_m, goes)
        words = (batch.vendors, batch.names, batch.states, batch.event_s.tolist(), datums)
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
        each = zip(robots, destinations.first, destinations.spans, ends, batch.basis.tolist(), strict=True)
        for row, (one, first, (_, last), end, basis) in enumerate(each):
            one.stops = tuple(stops[first:last])
            if end and not one.stops and basis != Basis.VELOCITY:
                one.stops = _end_of_way(one, view, row, end)
        return left

    def _rate(self, one: Seen, now_s: float, destinations: Destinations, row: int) -> Quantiles:
        """Take in what a robot says of where it goes; what to make of that."""
        first, last = destinations.spans[row]
        here, told = (one.datum, one.x_m, one.y_m), (destinations.spots[first:last], destinations.told_s[first:last])
        self.arrivals.heard(one.uuid, one.vendor, now_s, here, *told)
        return self.arrivals.quantiles(one.vendor) if destinations.first[row] < last else UNTOLD


def _placed(one: Seen, here: str | None, new: bool) -> list[tuple[str, float]]:
    """Set since when a robot stands where it is, and what it has; the resource that it has left, if any."""
    spot = (one.datum, one.x_m, one.y_m)
    if new or not near(spot, one.stood_at, STANDS_M):
        one.stood_at, one.stood_s = spot, one.event_s
    one.stands = not one.goes or one.event_s - one.stood_s >= STANDS_S
    if not new and here == one.here:
        return []
    left = [(one.here, one.event_s - one.came_s)] if one.here else []
    one.here, one.came_s = here, one.event_s
    return left


def _shapes(batch: Batch, view: Ahead) -> tuple[Shapes, Floats]:
    """And how long the ways are that robots are forecast to go on their floor."""
    stays = view.floor == view.floor[:, :1]
    last = np.where(stays.all(axis=1), stays.shape[1] - 1, np.argmin(stays, axis=1) - 1)
    x_m, y_m = _up_to(last, view.x_m, view.y_m)
    way_m = np.hypot(np.diff(x_m, axis=1), np.diff(y_m, axis=1)).sum(axis=1)
    known = np.where(batch.basis == Basis.VELOCITY, int(STRAIGHT_S / STEP_S), stays.shape[1] - 1)
    ways = np.stack(_up_to(known, x_m, y_m), axis=-1)
    return Shapes(view.yaw_rad[:, 0].copy(), ways), way_m


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


def _up_to(last: Ints, *columns: Floats) -> list[Floats]:
    """(n, m) columns of which each row stays as it is in its column `last` (n,) from there on."""
    steps = columns[0].shape[1]
    if (last >= steps - 1).all():
        return list(columns)
    kept = np.minimum(np.arange(steps), last[:, None])
    return [np.take_along_axis(column, kept, 1) for column in columns]


def _end_of_way(one: Seen, view: Ahead, row: int, resource: str | None) -> tuple[Stop, ...]:
    """Where a robot tells no destination, the resource that its way ends in."""
    if resource is None or resource == one.here or not one.goes or view.floor[row, -1] != view.floor[row, 0]:
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
