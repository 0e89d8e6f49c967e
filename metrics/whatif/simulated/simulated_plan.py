"""From the demand of a log to the plan of a simulated floor, with or without a change."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from deconflict.settings.site import Site
from deconflict.simulation.driving.crossings import CrossingPassage
from deconflict.simulation.driving.routes import Drive, drive
from deconflict.simulation.floor_layout import Place
from deconflict.simulation.participants import BodySize, Chassis, Protection
from ingest.batch import Floats
from metrics.whatif.change import NO_CHANGE, Change, WiderPlace
from metrics.whatif.demand import SAME_PLACE_M, Demand, RobotDemand, Trip
from metrics.whatif.road_crossings import drive_passages, road_crossings
from metrics.whatif.roads import FloorWay, IsForbidden, Roads, sampled_way
from metrics.whatif.simulated.ordered_places import with_order, without_order
from metrics.whatif.simulated.replayed_floor import RobotIdentity, SimulatedRobot, SimulatedTrip

GAIN_MPS2, BRAKE_MPS2 = 0.7, 1.2
STOP_GAP_M = 0.45
TURN_RADPS = 1.0
PERSON_GAP_M, PERSON_GAIN_MPS2, PERSON_BRAKE_MPS2 = 0.3, 1.5, 2.5
AGAINST_M = 1.0
"""A way is not allowed if it leads where nobody may drive for longer than this."""


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedPlan:
    """What is simulated."""

    robots: tuple[SimulatedRobot, ...]
    crossings: tuple[Place, ...]
    floors: tuple[str, ...]
    """Ids of the floors by index."""
    advised_by: Site | None = None
    """The site whose service the robots follow; None if they follow no advice."""
    wider: tuple[WiderPlace, ...] = ()
    shared: frozenset[int] = frozenset()
    """Crossings with one order for all fleets."""
    impossible: int = 0
    """Trips that have no way with the change. They keep the old one."""
    rerouted: int = 0
    """Trips that take another way."""


class Planner:
    """Makes the plans of a recorded demand: as it was, and with changes."""

    def __init__(self, demand: Demand) -> None:
        self._demand = demand
        self._ways = [FloorWay(trip.corners, trip.floor) for robot in demand.robots for trip in robot.trips]
        self._crossings = road_crossings(self._ways)
        self._fleets = sorted({robot.track.vendor for robot in demand.robots})
        self._after = _order(demand)
        self._chassis = [_chassis(robot) for robot in demand.robots]

    def plan(self, change: Change = NO_CHANGE) -> SimulatedPlan:
        """The plan with a change."""
        routes = _Routes(self._ways, change)
        robots = [
            self._planned(number, robot, chassis, routes, change)
            for number, (robot, chassis) in enumerate(zip(self._demand.robots, self._chassis, strict=True))
        ]
        places = [crossing.middle for crossing in self._crossings]
        ordered = [(place.outline.centroid.x, place.outline.centroid.y) for place in change.ordered]
        return SimulatedPlan(
            robots=tuple(robots),
            crossings=(*places, *ordered),
            floors=self._demand.floors,
            advised_by=change.advised_by,
            wider=change.wider,
            shared=frozenset(range(len(places), len(places) + len(ordered))),
            impossible=routes.impossible,
            rerouted=routes.rerouted,
        )

    def _planned(
        self, number: int, robot: RobotDemand, chassis: Chassis, routes: "_Routes", change: Change
    ) -> SimulatedRobot:
        track, trips, yaw_rad = robot.track, [], robot.start.yaw_rad
        for index, trip in enumerate(robot.trips):
            corners = routes.corners(trip)
            way = drive(corners, yaw_rad, chassis, change.speed_shares.get(trip.floor))
            passages = self._passages(way, trip, change)
            after = self._after.get((number, index))
            counts = trip.is_whole and not track.is_person
            trips.append(SimulatedTrip(way, passages, trip.floor, trip.stop.stay_s, counts, after))
            yaw_rad = float(way.yaw_rad[-1])
        return SimulatedRobot(
            identity=RobotIdentity(track.uuid, track.name, track.vendor, track.model),
            chassis=chassis,
            fleet=self._fleets.index(track.vendor),
            start=robot.start.place,
            yaw_rad=robot.start.yaw_rad,
            floor=robot.start.floor,
            from_s=robot.start.from_s,
            stay_s=robot.start.stay_s,
            trips=tuple(trips),
            goes_first=track.vendor == change.first_vendor,
        )

    def _passages(self, way: Drive, trip: Trip, change: Change) -> tuple[CrossingPassage, ...]:
        found = drive_passages(way, trip.floor, self._crossings)
        found = without_order(way, trip.floor, found, change.unordered)
        return with_order(way, trip.floor, found, change.ordered, len(self._crossings))


class _Routes:
    """The ways of trips with a change."""

    def __init__(self, ways: Sequence[FloorWay], change: Change) -> None:
        self._ways, self._change = ways, change
        self._roads: dict[int, Roads] = {}
        self.impossible = self.rerouted = 0

    def corners(self, trip: Trip) -> tuple[Place, ...]:
        """The way of a trip: the recorded one if that is allowed."""
        recorded = trip.corners
        is_forbidden = self._change.forbidden.get(trip.floor)
        if is_forbidden is None or not _is_against(recorded, is_forbidden):
            return recorded
        if trip.floor not in self._roads:
            ways = [way.corners for way in self._ways if way.floor == trip.floor]
            self._roads[trip.floor] = Roads(ways, is_forbidden)
        found = self._roads[trip.floor].way(recorded[0], recorded[-1])
        if found is None:
            self.impossible += 1
            return recorded
        self.rerouted += 1
        return found


def _is_against(corners: Sequence[Place], is_forbidden: IsForbidden) -> bool:
    points = sampled_way(np.array(corners))
    legs = np.diff(points, axis=0)
    legs_m = np.maximum(np.hypot(*legs.T), 1e-9)
    against = is_forbidden(points[:-1, 0], points[:-1, 1], legs / legs_m[:, None])
    return bool(legs_m[against].sum() > AGAINST_M)


def _chassis(robot: RobotDemand) -> Chassis:
    track = robot.track
    body = BodySize(track.length_m, track.width_m)
    return Chassis(
        body=body,
        loaded=body,
        height_m=1.0,
        max_speed_mps=robot.top_mps,
        gain_mps2=PERSON_GAIN_MPS2 if track.is_person else GAIN_MPS2,
        brake_mps2=PERSON_BRAKE_MPS2 if track.is_person else BRAKE_MPS2,
        stop_gap_m=PERSON_GAP_M if track.is_person else STOP_GAP_M,
        lane_m=0.0,
        turn_radps=TURN_RADPS,
        protection=Protection.ATTEND if track.is_person else Protection.STOP,
    )


def _order(demand: Demand) -> dict[tuple[int, int], tuple[int, int]]:
    """By robot and number of a trip: the robot that left its goal last before it set out, and the number of the trip
    with which that one left."""
    leaves: list[tuple[float, int, int, Place, int]] = []
    for number, robot in enumerate(demand.robots):
        here, floor = robot.start.place, robot.start.floor
        for index, trip in enumerate(robot.trips):
            leaves.append((trip.departs_s, number, index, here, floor))
            here, floor = trip.stop.place, trip.stop.floor
    leaves.sort(key=lambda leave: leave[0])
    departs: Floats = np.array([leave[0] for leave in leaves])
    places = np.array([leave[3] for leave in leaves]).reshape(-1, 2)
    floors = np.array([leave[4] for leave in leaves])
    found = {}
    for departs_s, number, index, _, _ in leaves:
        trip = demand.robots[number].trips[index]
        near = np.hypot(*(places - trip.stop.place).T) < SAME_PLACE_M
        before = np.flatnonzero(near & (floors == trip.stop.floor) & (departs < departs_s))
        others = [(leaves[row][1], leaves[row][2]) for row in before.tolist() if leaves[row][1] != number]
        if others:
            found[number, index] = others[-1]
    return found
