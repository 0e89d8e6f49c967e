"""Which robots have or will want which place, when, and for how long: the entries of all queues."""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from math import hypot, inf

from deconflict.contention.queues.dwell_times import DwellTimes
from deconflict.contention.queues.queue_forecast import QueueEntry
from deconflict.contention.queues.zone_flow import ZoneFlows
from deconflict.contention.robots.destinations import PlannedStop
from deconflict.contention.robots.place_geometry import PlaceGeometry
from deconflict.contention.robots.robot_table import RobotTable
from deconflict.contention.robots.robot_view import RobotView
from deconflict.contention.waiting.wait_graph import Leg
from deconflict.sweep.geometry.heights import at_one_height

LOOK_S = 1.0
"""Time between two looks."""
REACH_S = 900.0
"""How far ahead demand is forecast (standard 5.2.3)."""
QUEUES_M = 10.0
"""A robot that stands this near to a place without room for it waits for the place."""


class QueueEntries:
    """Collects the entries of one look."""

    def __init__(
        self, geometry: PlaceGeometry, robots: RobotTable, dwells: Mapping[str, DwellTimes], flows: ZoneFlows
    ) -> None:
        """`dwells` are those of every resource, by id."""
        self._geometry, self._robots, self._dwells, self._flows = geometry, robots, dwells, flows

    def collect(
        self, passing: Iterable[RobotView], bound: Iterable[RobotView], journeys: Iterable[Leg], now_s: float
    ) -> dict[str, list[QueueEntry]]:
        """The entries by place. `passing` are robots with a zone on their way, `bound` those with a destination,
        `journeys` all robots' legs."""
        entries = defaultdict[str, list[QueueEntry]](list)
        for robot in passing:
            self._add_passages(entries, robot, now_s)
        for leg in journeys:
            if leg.node[1] == 0 and leg.place in self._dwells:
                entries[leg.place].append(self._stay(leg, now_s))
        usual_s = {place: dwells.service_s for place, dwells in self._dwells.items()}
        for robot in bound:
            self._add_stops(entries, robot, usual_s, now_s)
        return entries

    def _add_passages(self, entries: dict[str, list[QueueEntry]], robot: RobotView, now_s: float) -> None:
        """Add the zones that are on a robot's way."""
        for zone, passage in robot.passages.items():
            through_s = min(passage.leave_s, float(passage.t_s[-1]) + LOOK_S) - max(passage.enter_s, now_s)
            coming, service_s = not self._flows.is_inside(robot.uuid, zone), max(through_s, 0.0)
            arrival_s, heights_m = max(passage.enter_s, now_s if coming else -inf), (robot.bottom_m, robot.top_m)
            entries[zone].append(QueueEntry(coming, arrival_s, robot.uuid, service_s, LOOK_S, *heights_m))

    def _add_stops(
        self, entries: dict[str, list[QueueEntry]], robot: RobotView, usual_s: Mapping[str, float], now_s: float
    ) -> None:
        """Add the resources that a robot will come to, each once; `usual_s` is how long robots stay at each."""
        added, last = {robot.here}, len(robot.stops) - 1
        for number, stop in enumerate(robot.stops):
            place = stop.resource
            if place is None or place in added:
                continue
            added.add(place)
            arrival_s, spread_s = stop.expected_s, stop.spread_s
            if number == 0 and arrival_s > stop.t_s and self._waits(robot, stop, entries.get(place, ())):
                arrival_s, spread_s = stop.t_s, 0.0
            if arrival_s <= now_s + REACH_S:
                service_s = _stay_s(stop, robot.stops[number + 1]) if number < last else usual_s[place]
                heights_m = robot.bottom_m, robot.top_m
                entries[place].append(QueueEntry(True, arrival_s, robot.uuid, service_s, spread_s, *heights_m))

    def _waits(self, robot: RobotView, stop: PlannedStop, entries: Iterable[QueueEntry]) -> bool:
        """Whether a robot stands near its next stop because there is no room yet."""
        away_m = hypot(stop.x_m - robot.x_m, stop.y_m - robot.y_m) if stop.datum == robot.datum else inf
        if not robot.stands or away_m > QUEUES_M or stop.resource is None:
            return False
        inside = [entry for entry in entries if not entry.coming and at_one_height(entry, robot)]
        return len(inside) >= self._geometry.capacity(stop.resource)

    def _stay(self, leg: Leg, now_s: float) -> QueueEntry:
        """The entry of a robot in a resource: for as long as it announced, or else as robots usually stay."""
        robot = self._robots[leg.node[0]]
        left_s = self._dwells[leg.place].remaining_s(now_s - robot.came_s)
        if leg.until_s < inf:
            late_s = robot.stops[0].expected_s - robot.stops[0].t_s
            left_s = leg.until_s + late_s - now_s
        return QueueEntry(False, leg.since_s, robot.uuid, left_s, 0.0, robot.bottom_m, robot.top_m)


def _stay_s(stop: PlannedStop, after: PlannedStop) -> float:
    """How long a robot may stay at a stop before it departs for the next."""
    return max(after.expected_s - hypot(after.x_m - stop.x_m, after.y_m - stop.y_m) - stop.expected_s, 1.0)
