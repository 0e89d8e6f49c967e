"""One more dock beside another: every second robot that stops at the dock uses the new one."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from deconflict.simulation.floor_layout import Place
from deconflict_client.counted_nouns import count_of
from ingest.batch import Floats
from metrics.whatif.change import Change, ChangeError, NamedOutline
from metrics.whatif.demand import Demand, RobotDemand, Stop
from metrics.whatif.roads import sampled_way

BESIDE_M = 0.6
"""Gap between robots at the two docks."""
LEAST_STOPS = 4


def more_docks(places: Sequence[NamedOutline], demand: Demand) -> Change:
    """One more dock like the given one. Raises `ChangeError` if too few robots stop at it."""
    stops = _stops_in(places, demand)
    if len(stops) < LEAST_STOPS:
        times = count_of(len(stops), "time")
        raise ChangeError(f"robots stop {times} at {places[0].name} in the log: {LEAST_STOPS} are needed")
    return Change(f"there is one more place like {places[0].name}", demand=partial(_with_dock, places))


def _stops_in(places: Sequence[NamedOutline], demand: Demand) -> list[tuple[float, int, int]]:
    """When, by which robot and at the end of which of its trips robots stop there, by time."""
    found = []
    for number, robot in enumerate(demand.robots):
        for index, trip in enumerate(robot.trips):
            x_m, y_m = (np.array([value]) for value in trip.stop.place)
            if any(place.floor == trip.stop.floor and place.holds(x_m, y_m)[0] for place in places):
                found.append((trip.stop.from_s, number, index))
    return sorted(found)


def _with_dock(places: Sequence[NamedOutline], demand: Demand) -> Demand:
    stops = _stops_in(places, demand)
    beside_m = _beside_m(demand, [demand.robots[number].trips[index].stop for _, number, index in stops])
    moved: dict[int, set[int]] = {}
    for _, number, index in stops[1::2]:
        moved.setdefault(number, set()).add(index)
    robots = [
        _moved(robot, moved[number], beside_m) if number in moved else robot
        for number, robot in enumerate(demand.robots)
    ]
    return replace(demand, robots=tuple(robots))


def _beside_m(demand: Demand, stops: Sequence[Stop]) -> float:
    """How far to the left of a robot at the dock the new one is: on the side where fewer robots drive."""
    widest_m = max(robot.track.width_m for robot in demand.robots)
    sides = []
    for side_m in (widest_m + BESIDE_M, -widest_m - BESIDE_M):
        place = np.array(_beside(stops[0], side_m))
        ways = [trip for robot in demand.robots for trip in robot.trips if trip.floor == stops[0].floor]
        near_m = [_least_m(np.array(trip.corners), place) for trip in ways if trip.stop not in stops]
        sides.append((min(near_m, default=np.inf), side_m))
    return max(sides)[1]


def _least_m(corners: Floats, place: Floats) -> float:
    return float(np.hypot(*(sampled_way(corners) - place).T).min())


def _beside(stop: Stop, left_m: float) -> Place:
    x_m, y_m = stop.place
    return x_m - left_m * float(np.sin(stop.yaw_rad)), y_m + left_m * float(np.cos(stop.yaw_rad))


def _moved(robot: RobotDemand, indices: set[int], left_m: float) -> RobotDemand:
    """The demand of a robot that stops beside the dock at the end of these trips."""
    trips = list(robot.trips)
    for index in indices:
        stop = replace(trips[index].stop, place=_beside(trips[index].stop, left_m))
        trips[index] = replace(trips[index], corners=(*trips[index].corners[:-1], stop.place), stop=stop)
        if index + 1 < len(trips) and trips[index + 1].floor == stop.floor:
            trips[index + 1] = replace(trips[index + 1], corners=(stop.place, *trips[index + 1].corners[1:]))
    return replace(robot, trips=tuple(trips))
