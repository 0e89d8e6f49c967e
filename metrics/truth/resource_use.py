"""What robots did at the shared places of a site, from their reports: where they stood, what was full, who waited.

A robot occupies a resource while the centre of its envelope is inside. It occupies a zone while its envelope touches
the zone. A robot stands if it stays within 0.1 m for at least 3 s. It waited for a place if it stood outside of every
resource for at least 5 s while the place was full, and either announced the place as its destination all that time, or
stood within 10 m of it and then entered it. Robots above or below it do not count as occupying the place.
"""

from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from math import hypot, inf
from typing import Any, NamedTuple

import numpy as np
import shapely

from deconflict.contention.robots.bounding_boxes import enlarged, touching_boxes
from deconflict.contention.robots.lookahead import corners
from deconflict.settings.shared_places import Place, Resource, Zone, outlines
from deconflict.sweep.geometry.heights import at_one_height, largest_group_at_one_height
from ingest.batch import Batch, Floats, Ints

STANDS_M, STOOD_S = 0.1, 3.0
WAITED_S, WAITED_M = 5.0, 10.0
LEAVES_S, LEAVES_SPOT_S = 5.0, 35.0
"""A robot with a longer gap between reports is not known to have stood in it. The second limit holds if it is at the
same place after the gap, because reports may be 30 s apart."""
MOST_PENDING = 32
"""Stands of one robot that are kept until it enters a place."""
NOWHERE = frozenset[str]()


class TimeSpan(NamedTuple):
    """A time span."""

    from_s: float
    to_s: float

    def within(self, other: "TimeSpan") -> "TimeSpan":
        """The intersection of two spans. If they have none, it ends before it begins."""
        return TimeSpan(max(self.from_s, other.from_s), min(self.to_s, other.to_s))

    @property
    def lasts_s(self) -> float:
        return self.to_s - self.from_s


class Stand(NamedTuple):
    """A robot stood at one place."""

    span: TimeSpan
    floor: str
    """Datum of the floor."""
    x_m: float
    """Centre of the envelope in the floor's frame."""
    y_m: float
    outside: bool
    """Whether it stood outside of every resource."""
    goals: dict[str, float]
    """Resources that it had announced as destinations, and since when."""
    bottom_m: float
    """Lowest height of the robot, -inf if unknown."""
    top_m: float
    """Highest height of the robot, inf if unknown."""

    def since(self, t_s: float) -> "Stand":
        """The part of it after a time."""
        return self._replace(span=self.span.within(TimeSpan(t_s, inf)))


class Stay(NamedTuple):
    """A robot occupied a place."""

    span: TimeSpan
    """It ends at inf while the robot is inside."""
    bottom_m: float
    """Lowest and highest height of the robot, as in `Stand`."""
    top_m: float


class QueueWait(NamedTuple):
    """A robot waited for a place."""

    place: str
    """Id of a resource or zone."""
    robot: str
    """UUID."""
    span: TimeSpan
    """From the beginning of the first wait to the end of the last one of the same stand."""


class PlaceEntry(NamedTuple):
    """A robot entered a place."""

    place: str
    """Id of a resource or zone."""
    robot: str
    """UUID."""
    t_s: float
    """Time of the first report from inside."""
    known_s: float
    """Time of the robot's first report."""


class _Report(NamedTuple):
    """One report of a robot. Fields with the names of those of `Stand` have the same meaning."""

    t_s: float
    """Time of the pose."""
    floor: str
    x_m: float
    y_m: float
    places: frozenset[str]
    """Ids of the resources and zones in which the robot is."""
    outside: bool
    goals: frozenset[str]
    """Ids of the resources that it announces as destinations."""
    bottom_m: float
    top_m: float


@dataclass(slots=True, eq=False)
class _RobotState:
    """One robot at one position, by its reports so far."""

    arrived: _Report
    """Its first report from the position where it is."""
    newest: _Report
    places: frozenset[str] = NOWHERE
    """Ids of the resources and zones in which it is counted."""
    goals: dict[str, float] = field(default_factory=dict)
    """Resources that it announces as destinations, and since when."""
    pending: list[Stand] = field(default_factory=list)
    """Its stands since it last entered a place: each may turn out to be a wait for the next one."""


class ResourceUse:
    """Follows robots by their reports. Keeps each stand, and when each place was full."""

    def __init__(self, resources: Iterable[Resource], zones: Iterable[Zone]) -> None:
        places: list[Place] = [*resources, *zones]
        self._capacity = {place.id: place.capacity for place in places}
        self._resources, self._zones = _PlaceOutlines(resources), _PlaceOutlines(zones)
        self._inside: dict[str, dict[str, Stay]] = {place: {} for place in self._capacity}
        """By place and robot, the stays that have not ended."""
        self._stays: dict[str, list[Stay]] = {place: [] for place in self._capacity}
        """By place, the stays that have ended, in the order of their ends."""
        self._crowded_s: dict[str, float] = {}
        """By place, the time since which it holds more robots than its capacity."""
        self._robots: dict[str, _RobotState] = {}
        self.stands: dict[str, list[Stand]] = {}
        """By robot."""
        self.waits: list[QueueWait] = []
        self.crowds: dict[str, list[TimeSpan]] = {place: [] for place in self._capacity}
        """By place, when it held more robots than its capacity."""
        self._entries: list[PlaceEntry] = []
        """Entries since the last call of `new_entries`."""
        self.last_seen_s: dict[str, float] = {}
        self._known_s: dict[str, float] = {}
        """By robot, the time of its first report."""

    def add_batch(self, batch: Batch) -> None:
        """Add the reports of a batch, and remove the robots that are gone."""
        for robot, report in zip(batch.robots, self._reports(batch), strict=True):
            self._update(robot, report)
        for robot in batch.gone:
            self._leave(robot)

    def finish(self) -> None:
        """End of the log: every robot leaves."""
        for robot in list(self._robots):
            self._leave(robot)

    def _update(self, robot: str, new: "_Report") -> None:
        state = self._robots.get(robot)
        known_s = self._known_s.setdefault(robot, new.t_s)
        if state and new.t_s >= state.newest.t_s:
            entered = new.places - state.places
            self._entries += [PlaceEntry(place, robot, new.t_s, known_s) for place in sorted(entered)]
        if state and new.t_s - state.newest.t_s > (LEAVES_SPOT_S if _is_at(state, new) else LEAVES_S):
            self._leave(robot)
            state = None
        if state is None:
            state = self._robots[robot] = _RobotState(new, new)
        if new.t_s < state.newest.t_s:
            return
        if not _is_at(state, new):
            self._end_stand(robot, state)
            state.arrived = new
        state.newest, self.last_seen_s[robot] = new, new.t_s
        state.goals = {place: state.goals.get(place, new.t_s) for place in new.goals}
        self._occupy(robot, state, new.places, new.t_s)

    def new_entries(self) -> list[PlaceEntry]:
        """The entries since the last call."""
        entries, self._entries = self._entries, []
        return entries

    def stays_s(self, place: str) -> Floats:
        """(n, 2) begin and end of each stay in a place that has ended."""
        return np.array([stay.span for stay in self._stays[place]]).reshape(-1, 2)

    def _end_stand(self, robot: str, state: _RobotState) -> None:
        """The robot has left the position where it was. Keep the stand if it was long enough."""
        place, last = state.arrived, state.newest
        span = TimeSpan(place.t_s, last.t_s)
        if span.lasts_s >= STOOD_S:
            heights_m = last.bottom_m, last.top_m
            stand = Stand(span, place.floor, place.x_m, place.y_m, last.outside, state.goals, *heights_m)
            self.stands.setdefault(robot, []).append(stand)
            state.pending = [*state.pending[1 - MOST_PENDING :], stand]

    def _occupy(self, robot: str, state: _RobotState, places: frozenset[str], t_s: float) -> None:
        if places == state.places:
            return
        for place in state.places - places:
            stay = self._inside[place].pop(robot)
            self._stays[place].append(stay._replace(span=TimeSpan(stay.span.from_s, t_s)))
            self._count(place, t_s)
        entered = places - state.places
        if entered:
            self._add_waits(robot, state, entered)
        for place in entered:
            self._inside[place][robot] = Stay(TimeSpan(t_s, inf), state.newest.bottom_m, state.newest.top_m)
            self._count(place, t_s)
        state.places = places

    def _leave(self, robot: str) -> None:
        state = self._robots.pop(robot, None)
        if state:
            self._end_stand(robot, state)
            self._add_waits(robot, state, frozenset())
            self._occupy(robot, state, frozenset(), state.newest.t_s)

    def _count(self, place: str, t_s: float) -> None:
        """Update whether a place holds more robots than its capacity."""
        inside, capacity = self._inside[place], self._capacity[place]
        if len(inside) > capacity and len(largest_group_at_one_height([*inside.values()])) > capacity:
            self._crowded_s.setdefault(place, t_s)
        elif place in self._crowded_s:
            self.crowds[place].append(TimeSpan(self._crowded_s.pop(place), t_s))

    def _add_waits(self, robot: str, state: _RobotState, entered: frozenset[str]) -> None:
        """The robot has entered places, or is gone. Find out which of its stands were waits."""
        for stand in state.pending:
            near = {
                place
                for outlines in (self._resources, self._zones)
                for place in entered
                if outlines.is_near(place, stand)
            }
            wanted_s = stand.goals | dict.fromkeys(near, stand.span.from_s)
            for place in sorted(wanted_s) if stand.outside else ():
                waited = list(self._full_during(place, stand.since(wanted_s[place])))
                if sum(span.lasts_s for span in waited) >= WAITED_S:
                    self.waits.append(QueueWait(place, robot, TimeSpan(waited[0].from_s, waited[-1].to_s)))
        state.pending = []

    def _full_during(self, place: str, stood: Stand) -> Iterator[TimeSpan]:
        """The spans in which the place was full for a standing robot, in order."""
        ended = self._stays[place]
        first = bisect_right(ended, stood.span.from_s, key=lambda stay: stay.span.to_s)
        stays = [stay for stay in (*ended[first:], *self._inside[place].values()) if at_one_height(stay, stood)]
        changes = [change for stay in stays for change in ((stay.span.from_s, 1), (stay.span.to_s, -1))]
        inside, since_s = 0, -inf
        for t_s, change in sorted(changes):
            full = TimeSpan(since_s, t_s).within(stood.span)
            if inside >= self._capacity[place] and full.lasts_s > 0:
                yield full
            inside, since_s = inside + change, t_s

    def _reports(self, batch: Batch) -> "Iterator[_Report]":
        """One report for each robot of the batch."""
        first, forecasts = batch.forecasts.start[:-1], batch.forecasts
        floors = batch.datums(forecasts.floor[first])
        x_m, y_m = forecasts.x_m[first], forecasts.y_m[first]
        middles = np.stack([x_m, y_m, x_m, y_m], axis=1)
        resources = self._resources.touched(floors, middles, lambda rows: shapely.points(middles[rows, :2]))
        poses = (x_m, y_m, forecasts.yaw_rad[first], forecasts.length_m, forecasts.width_m)
        boxes_m = enlarged(middles, np.hypot(forecasts.length_m, forecasts.width_m) / 2)
        zones = self._zones.touched(
            floors, boxes_m, lambda rows: shapely.polygons(corners(*(column[rows] for column in poses)))
        )
        heights_m = forecasts.bottom_m.tolist(), forecasts.top_m.tolist()
        columns = (batch.event_s.tolist(), floors, x_m.tolist(), y_m.tolist(), self._goals(batch), *heights_m)
        for row, (t_s, floor, x, y, goals, *height_m) in enumerate(zip(*columns, strict=True)):
            kept = resources.get(row, NOWHERE)
            yield _Report(t_s, floor, x, y, kept | zones.get(row, NOWHERE), kept is NOWHERE, goals, *height_m)

    def _goals(self, batch: Batch) -> list[frozenset[str]]:
        """For each robot, the resources that it announces as destinations."""
        destinations, goals = batch.destinations, [NOWHERE] * len(batch)
        spots = np.stack([destinations.x_m, destinations.y_m], axis=1)
        boxes_m = np.concatenate([spots, spots], axis=1)
        found = self._resources.touched(
            batch.datums(destinations.floor), boxes_m, lambda rows: shapely.points(spots[rows])
        )
        robots = np.searchsorted(destinations.start, [*found], side="right") - 1
        for robot, places in zip(robots.tolist(), found.values(), strict=True):
            goals[robot] |= places
        return goals


def _is_at(state: _RobotState, new: _Report) -> bool:
    """Whether a robot is still at the same position."""
    place = state.arrived
    return new.floor == place.floor and hypot(new.x_m - place.x_m, new.y_m - place.y_m) <= STANDS_M


class _PlaceOutlines:
    """The outlines of places, to find which of them a shape on a floor touches."""

    def __init__(self, places: Iterable[Place]) -> None:
        drawn = [(datum, place.id, outline) for place in places for datum, outline in outlines(place)]
        self._datums, self._places = [datum for datum, _, _ in drawn], [place for _, place, _ in drawn]
        self._shapes = np.array([shapely.Polygon(outline) for _, _, outline in drawn])
        self._boxes_m = shapely.bounds(self._shapes).reshape(-1, 4)

    def is_near(self, place: str, stood: Stand) -> bool:
        """Whether a place is within `WAITED_M` of where a robot stood."""
        here = shapely.Point(stood.x_m, stood.y_m)
        return any(
            shapely.dwithin(shape, here, WAITED_M)
            for datum, name, shape in zip(self._datums, self._places, self._shapes, strict=True)
            if name == place and datum == stood.floor
        )

    def touched(
        self, datums: Sequence[str], boxes_m: Floats, shapes: Callable[[Ints], Any]
    ) -> dict[int, frozenset[str]]:
        """By row, the places that the shape in a box (n, 4) touches. `shapes` makes the shapes of the given rows."""
        pairs = touching_boxes(boxes_m, self._boxes_m).tolist() if self._places and len(boxes_m) else []
        pairs = [pair for pair in pairs if datums[pair[0]] == self._datums[pair[1]]]
        if not pairs:
            return {}
        found, near = dict[int, frozenset[str]](), np.array(pairs)
        touches = shapely.intersects(shapes(near[:, 0]), self._shapes[near[:, 1]])
        for row, place in near[touches].tolist():
            found[row] = found.get(row, NOWHERE) | {self._places[place]}
        return found
