"""Journeys of robots as legs, and what robots want on each leg that others hold.

A robot keeps its place until it departs for the next, and what it wants must be free by then. Otherwise robots that
each want the other's place would have to pass each other somewhere, which the service can't plan.
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from math import hypot, inf
from typing import NamedTuple, Self

import numpy as np
import shapely

from deconflict.contention.robots import record_kernels
from deconflict.contention.robots.bounding_boxes import ROUNDING_M, touching_boxes
from deconflict.contention.robots.place_geometry import ZonePassage
from deconflict.contention.robots.record_kernels import LEAST_M, STANDS_S
from deconflict.contention.robots.robot_table import RobotTable
from deconflict.contention.robots.robot_view import RobotView
from deconflict.contention.waiting.deadlocks import Node, Want
from deconflict.sweep.geometry.heights import at_one_height, heights_overlap
from deconflict.sweep.pair_choice import nearest_of_each
from ingest.batch import Bools, Floats, Ints

WAY_M, HALTED_WAY_M = 1.0, 4.0
"""A robot that stands this near to what is in its way waits for it. The greater distance counts once it has halted on
its way for `STANDS_S`, and its state is in `GOES_ON`."""
GOES_ON = frozenset(("navigating", "waitingExternalEvent"))
"""States of robots that go on once they can."""
MOST_LEGS = 100
"""More robots than this wait for no resource."""
MOST_BEHIND = 20
"""More than this wait for no robot that stands outside every resource."""
MOST_IN_WAY = 10
"""So many robots in the way of a robot count: the nearest along its path, to which it comes first."""
MOST_FACING = 50
"""Of robots that drive one way through a lane, so many count: the foremost."""
AT = "at "
"""Prefix of the name of a place outside every resource, where a robot stands."""
PATH = "path"


class NearbyBoxes(NamedTuple):
    """Boxes of robots that stand, and of what may be near them."""

    ends_m: Floats
    """(e, 4) boxes of stops outside every resource."""
    standing_m: Floats
    """(s, 4) boxes of robots that stand."""
    going_m: Floats
    """(g, 4) boxes of the paths of robots that move or wait."""
    ends: Ints
    """(e, 2) slot of a robot, and number of the stop."""
    standing: Ints
    """(s,) slots."""
    going: Ints
    """(g,) slots."""

    @classmethod
    def of(cls, robots: RobotTable, crowds: Mapping[str, int]) -> Self:
        """Without the robots in `crowds`: where they are is doubted."""
        boxes = cls(*record_kernels.collect_boxes(robots.records, robots.stops, ROUNDING_M))
        if not crowds:
            return boxes
        is_placed = robots.slots.column(crowds) == 0
        kept = [is_placed[slots] for slots in (boxes.ends[:, 0], boxes.standing, boxes.going)] * 2
        return cls(*(column[rows] for column, rows in zip(boxes, kept, strict=True)))

    def stood_on(self, robots: RobotTable) -> list[tuple[tuple[int, int], int]]:
        """Stops, by slot and number, that are near a robot which stands outside every resource, and its slot."""
        row, at = touching_boxes(self.ends_m, self.standing_m).T
        ends, standing = self.ends[row], self.standing[at]
        near = (ends[:, 0] != standing) & ~robots.records["here"][standing]
        near &= robots.stops["floor"][ends[:, 0], ends[:, 1]] == robots.records["floor"][standing]
        near &= _at_one_height(robots, ends[:, 0], standing)
        return list(zip(map(tuple, ends[near].tolist()), standing[near].tolist(), strict=True))

    def in_way(self, robots: RobotTable) -> Ints:
        """(2, n) slots of robots that have another standing near their path, and its slot."""
        row, at = touching_boxes(self.going_m, self.standing_m).T
        going, standing, floor = self.going[row], self.standing[at], robots.records["floor"]
        near = (going != standing) & (floor[going] == floor[standing]) & _at_one_height(robots, going, standing)
        return np.stack((going[near], standing[near]))


def _at_one_height(robots: RobotTable, slots: Ints, others: Ints) -> Bools:
    """(n,) whether neither robot of a pair passes above the other."""
    bottom_m, top_m = robots.records["bottom_m"], robots.records["top_m"]
    overlap: Bools = heights_overlap(bottom_m[slots], top_m[slots], bottom_m[others], top_m[others])
    return overlap


class Leg(NamedTuple):
    """A robot keeps `place` from `since_s` to `until_s`, and is at `wants` from `arrives_s` on."""

    node: Node
    """The robot, and the number of its next stop, counted from 0."""
    place: str
    """Id of the resource; for a robot outside every resource, `AT` and the UUID of the robot that stands there."""
    since_s: float
    """Seconds since the epoch, as all times of a leg."""
    until_s: float
    """When it departs for `wants`; inf if it has no further stop."""
    bottom_m: float
    """The lowest height that the robot reaches."""
    top_m: float
    """The highest height that it reaches."""
    wants: str | None = None
    """Its next place, named like `place`; None if it goes nowhere, or where nobody else goes."""
    arrives_s: float = inf
    """When it is expected at its next stop."""


def legs(going: Iterable[RobotView], robots: RobotTable, nearby: NearbyBoxes, now_s: float) -> list[Leg]:
    """The legs of robots that have or want something that another robot may have or want: of those `going` somewhere or
    in a resource, and of those that others go to.

    That is a resource, or the place of a standing robot to which another robot goes. A robot that has nothing and goes
    to one place only has a leg only if another robot wants that place.
    """
    stood_on = _stood_on(robots, nearby)
    views = {robot.uuid: robot for robot in (*going, *stood_on.values())}
    views |= {uuid: robots[uuid] for uuid, _ in stood_on}
    having = {uuid: robot for uuid, robot in views.items() if robot.here or robot.stands or len(robot.stops) > 1}
    found = [leg for robot in having.values() for leg in _legs(robot, stood_on, now_s)]
    wanted = {leg.wants for leg in found if leg.wants}
    for uuid in views.keys() - having.keys():
        robot = views[uuid]
        if robot.stops and (robot.stops[0].resource in wanted or (uuid, 0) in stood_on):
            found += _legs(robot, stood_on, now_s)
    return found


def _legs(robot: RobotView, stood_on: Mapping[Node, RobotView], now_s: float) -> Iterable[Leg]:
    """The legs of one robot."""
    place = robot.here or (AT + robot.uuid if robot.stands else None)
    since_s, datum, x_m, y_m = robot.came_s if robot.here else robot.stood_s, robot.datum, robot.x_m, robot.y_m
    for number, stop in enumerate(robot.stops):
        node = robot.uuid, number
        wants = stop.resource or (AT + stood_on[node].uuid if node in stood_on else None)
        away_s = hypot(stop.x_m - x_m, stop.y_m - y_m) if stop.datum == datum else 0.0
        if place:
            until_s = max(stop.t_s - away_s, since_s, now_s)
            yield Leg(node, place, since_s, until_s, robot.bottom_m, robot.top_m, wants, stop.t_s)
        place, since_s, datum, x_m, y_m = wants, stop.t_s, stop.datum, stop.x_m, stop.y_m
    if place:
        yield Leg((robot.uuid, len(robot.stops)), place, since_s, inf, robot.bottom_m, robot.top_m)


def _stood_on(robots: RobotTable, nearby: NearbyBoxes) -> dict[Node, RobotView]:
    """By leg, the robot that now stands where the leg ends, outside every resource."""
    pairs = nearby.stood_on(robots)
    if not pairs:
        return {}
    ends = list(dict.fromkeys(end for end, _ in pairs))
    standing = sorted({slot for _, slot in pairs}, key=lambda slot: robots.slots.uuids[slot])
    stops = robots.stops[[slot for slot, _ in ends], [number for _, number in ends]]
    points = shapely.points(stops["x_m"], stops["y_m"])
    found: dict[Node, RobotView] = {}
    may_meet = set(pairs)
    for row, index in sorted(shapely.STRtree(robots.outlines(standing)).query(points, "intersects").T.tolist()):
        (slot, number), other = ends[row], standing[index]
        if (ends[row], other) in may_meet and stops["floor"][row] == robots.records["floor"][other]:
            found.setdefault((robots.slots.uuids[slot], number), robots[robots.slots.uuids[other]])
    return found


def place_wants(legs: Iterable[Leg], capacity: Mapping[str, int]) -> list[Want]:
    """The wants of robots for places that are full when they depart for them.

    A holder that means to leave before, for a place that it wants itself, may still be there: it leaves only if it can.
    Of each resource `MOST_LEGS` more legs count than it has room for, and as many that lead to it, of each standing
    robot `MOST_BEHIND`: the next of each robot first.
    """
    legs, by_place, leading = list(legs), dict[str, list[Leg]](), dict[str, set[Node]]()
    for leg in sorted(legs, key=lambda leg: leg.node[1]):
        of_place, to_place = by_place.setdefault(leg.place, []), leading.setdefault(leg.wants or "", set())
        if len(of_place) < (MOST_LEGS + capacity[leg.place] if leg.place in capacity else MOST_BEHIND + 1):
            of_place.append(leg)
        if len(to_place) < (MOST_LEGS if leg.wants in capacity else MOST_BEHIND):
            to_place.add(leg.node)
    wants = []
    for leg in legs:
        if leg.wants is None or leg.node not in leading[leg.wants]:
            continue
        robot = leg.node[0]
        holders = [
            other.node
            for other in by_place.get(leg.wants, ())
            if other.node[0] != robot
            and at_one_height(other, leg)
            and other.since_s < leg.arrives_s
            and (other.until_s >= leg.until_s or other.wants is not None)
        ]
        if len({holder for holder, _ in holders}) >= capacity.get(leg.wants, 1):
            wants.append(Want(leg.node, tuple(sorted(holders)), _where(leg.wants), leg.until_s))
    return wants


def _where(place: str) -> str:
    """A place as `Want.where` names it."""
    return PATH if place.startswith(AT) else place


@dataclass(frozen=True, slots=True)
class Hindrance:
    """A standing robot in the way of another."""

    waiter: str
    blocker: str
    from_s: float
    """When the waiter gets there, or now."""
    since_s: float
    """Since when it waits there; if it does not yet, `from_s`."""


def hindrances(robots: RobotTable, nearby: NearbyBoxes, now_s: float) -> list[Hindrance]:
    """The standing robots in the way of others, by waiter and time."""
    near = nearby.in_way(robots)
    if not near.size:
        return []
    going, standing = (np.unique(slots) for slots in near)
    paths, outlines = np.array(robots.paths(going.tolist())), robots.outlines(standing.tolist())
    shapely.prepare(paths)
    row, column = np.searchsorted(going, near[0]), np.searchsorted(standing, near[1])
    reach_m = np.maximum(robots.records["width_m"][near[0]] / 2 - LEAST_M, LEAST_M)
    is_in_way = shapely.dwithin(paths[row], outlines[column], reach_m)
    row, slots, others = row[is_in_way], near[0][is_in_way], near[1][is_in_way]
    centres = shapely.points(robots.records["x_m"][others], robots.records["y_m"][others])
    along_m = shapely.line_locate_point(paths[row], centres)
    kept = nearest_of_each(row, along_m, MOST_IN_WAY)
    met = zip(slots[kept].tolist(), others[kept].tolist(), along_m[kept].tolist(), strict=True)
    uuids = robots.slots.uuids
    found = [_hindrance(robots[uuids[slot]], robots[uuids[other]], to_m, now_s) for slot, other, to_m in met]
    return sorted(found, key=lambda hindrance: (hindrance.waiter, hindrance.from_s, hindrance.blocker))


def _hindrance(waiter: RobotView, blocker: RobotView, along_m: float, now_s: float) -> Hindrance:
    """A blocker that is `along_m` ahead on the waiter's path: from when the waiter comes to where it has to stop."""
    to_go_m = along_m - (waiter.length_m + min(blocker.length_m, blocker.width_m)) / 2
    has_halted = not waiter.goes and waiter.state in GOES_ON and now_s - waiter.stood_s >= STANDS_S
    is_there = waiter.stands and to_go_m < (HALTED_WAY_M if has_halted else WAY_M)
    from_s = now_s if is_there else now_s + max(to_go_m, 0.0) / waiter.speed_mps
    since_s = max(waiter.stood_s, blocker.stood_s) if is_there else from_s
    return Hindrance(waiter.uuid, blocker.uuid, from_s, since_s)


def way_wants(
    in_way: Iterable[Hindrance], robots: Mapping[str, RobotView], aisles: Collection[str], now_s: float
) -> list[Want]:
    """The wants of robots for their paths; for the aisle, if both robots are in one."""
    lanes = sorted(aisles)
    wants = []
    for each in in_way:
        both = robots[each.waiter], robots[each.blocker]
        lane = next((lane for lane in lanes if all(robot.is_inside(lane, now_s) for robot in both)), PATH)
        wants.append(Want((each.waiter, 0), ((each.blocker, 0),), lane, each.from_s))
    return wants


def aisle_wants(robots: Iterable[RobotView], aisles: Collection[str]) -> list[Want]:
    """The wants of robots for a lane, towards each other at one height."""
    wanted = set(aisles)
    by_aisle: dict[str, list[RobotView]] = {}
    for robot in robots:
        for zone in robot.passages.keys() & wanted:
            by_aisle.setdefault(zone, []).append(robot)
    wants = []
    for zone, inside in sorted(by_aisle.items()):
        inside.sort(key=lambda robot: _foremost(robot.passages[zone], robot.uuid))
        forth = [robot for robot in inside if robot.passages[zone].direction > 0][:MOST_FACING]
        back = [robot for robot in inside if robot.passages[zone].direction < 0][:MOST_FACING]
        for a in forth:
            for b in back:
                meet_s = _meet_s(a, b, zone) if at_one_height(a, b) else None
                if meet_s is not None:
                    wants.append(Want((a.uuid, 0), ((b.uuid, 0),), zone, meet_s))
                    wants.append(Want((b.uuid, 0), ((a.uuid, 0),), zone, meet_s))
    return wants


def _foremost(passage: ZonePassage, robot: str) -> tuple[float, float, str]:
    """Sorts robots that drive one way through a lane: the foremost first, then the first to enter."""
    return -passage.direction * float(passage.along_m[0]), passage.enter_s, robot


def _meet_s(forth: RobotView, back: RobotView, zone: str) -> float | None:
    """When two robots that drive towards each other in a lane are nose to nose; None if they will not be.

    They will not be if the lane is wide enough for their paths beside each other.
    """
    a, b = forth.passages[zone], back.passages[zone]
    first_s, noses_m = max(a.enter_s, b.enter_s), (forth.length_m + back.length_m) / 2
    if first_s >= min(a.leave_s, b.leave_s) or a.reach_m <= b.reach_m:
        return None
    if abs(a.across_m - b.across_m) >= (forth.width_m + back.width_m) / 2:
        return None
    between_m = b.at_m(first_s) - a.at_m(first_s)
    if between_m <= 0:
        return None
    return first_s + max(between_m - noses_m, 0.0) / max(a.rate_mps - b.rate_mps, 0.1)
