"""Robots' journeys as legs: what each has, what it wants next, and for how long it keeps what it has.

A robot keeps its place until it sets out for the next, and what it wants must be free by then: robots that each want
the other's place would otherwise need somewhere to pass each other, of which the service knows nothing.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import hypot, inf
from typing import NamedTuple, Self

import numpy as np
import shapely

from deconflict.contention.robots import record_kernels
from deconflict.contention.robots.bounding_boxes import ROUNDING_M, touching
from deconflict.contention.robots.record_kernels import LEAST_M
from deconflict.contention.robots.robot_table import Robots
from deconflict.contention.robots.robot_view import Seen
from deconflict.contention.waiting.deadlocks import Node, Want
from deconflict.sweep.geometry.heights import heights_overlap, heights_overlap_each
from ingest.batch import Bools, Floats, Ints

WAY_M = 1.0
"""A robot that stands with less than this left to what is in its way waits for it."""
AT = "at "
"""Prefix of the name of a place that nobody drew: where a robot stands."""
PATH = "path"


class Around(NamedTuple):
    """Boxes (n, 4), and whose they are, of what may be where a robot stands."""

    ends_m: Floats
    standing_m: Floats
    going_m: Floats
    ends: Ints
    """(n, 2) slot of a robot, and which of its stops."""
    standing: Ints
    """Slots."""
    going: Ints
    """Slots."""

    @classmethod
    def of(cls, robots: Robots) -> Self:
        return cls(*record_kernels.around(robots.records, robots.stops, ROUNDING_M))

    def stood_on(self, robots: Robots) -> list[tuple[tuple[int, int], int]]:
        """Ends of legs, by slot and stop, that are near a robot which stands outside of every resource; its slot."""
        row, at = touching(self.ends_m, self.standing_m).T
        ends, standing, one = self.ends[row], self.standing[at], robots.records
        near = (ends[:, 0] != standing) & ~one["here"][standing] & _beside(robots, ends[:, 0], standing)
        return list(zip(map(tuple, ends[near].tolist()), standing[near].tolist(), strict=True))

    def in_way(self, robots: Robots) -> list[tuple[int, int]]:
        """Slots of robots with one that stands near their way, and its slot."""
        row, at = touching(self.going_m, self.standing_m).T
        going, standing, floor = self.going[row], self.standing[at], robots.records["floor"]
        near = (going != standing) & (floor[going] == floor[standing]) & _beside(robots, going, standing)
        return list(zip(going[near].tolist(), standing[near].tolist(), strict=True))


def _beside(robots: Robots, slots: Ints, others: Ints) -> Bools:
    """(n,) whether neither of two robots passes above the other."""
    bottom_m, top_m = robots.records["bottom_m"], robots.records["top_m"]
    return heights_overlap_each(bottom_m[slots], top_m[slots], bottom_m[others], top_m[others])


class Leg(NamedTuple):
    """One robot keeps `place` from `since_s` to `until_s`, and is at `wants` from `arrives_s` on."""

    node: Node
    place: str
    since_s: float
    until_s: float
    bottom_m: float
    """Heights that the robot reaches from and to."""
    top_m: float
    wants: str | None = None
    arrives_s: float = inf


def legs(robots: Robots, around: Around, now_s: float) -> list[Leg]:
    """The legs, as far as they reach, of robots that have or want something that another may have or want.

    That is a resource, or the place where a robot stands that another goes to: whoever else stands is where nobody
    goes. A robot that has nothing and goes to one place only has a leg where another wants that place.
    """
    stood_on = _stood_on(robots, around)
    met = {one.uuid: one for one in (*robots.placed(), *robots.bound(), *stood_on.values())}
    met |= {uuid: robots[uuid] for uuid, _ in stood_on}
    having = {uuid: one for uuid, one in met.items() if one.here or one.stands or len(one.stops) > 1}
    found = [leg for one in having.values() for leg in _legs(one, stood_on, now_s)]
    wanted = {leg.wants for leg in found if leg.wants}
    for uuid in met.keys() - having.keys():
        one = met[uuid]
        if one.stops and (one.stops[0].resource in wanted or (uuid, 0) in stood_on):
            found += _legs(one, stood_on, now_s)
    return found


def _legs(one: Seen, stood_on: Mapping[Node, Seen], now_s: float) -> Iterable[Leg]:
    place = one.here or (AT + one.uuid if one.stands else None)
    since_s, datum, x_m, y_m = one.came_s if one.here else one.stood_s, one.datum, one.x_m, one.y_m
    for number, stop in enumerate(one.stops):
        node = one.uuid, number
        wants = stop.resource or (AT + stood_on[node].uuid if node in stood_on else None)
        away_s = hypot(stop.x_m - x_m, stop.y_m - y_m) if stop.datum == datum else 0.0
        if place:
            until_s = max(stop.t_s - away_s, since_s, now_s)
            yield Leg(node, place, since_s, until_s, one.bottom_m, one.top_m, wants, stop.t_s)
        place, since_s, datum, x_m, y_m = wants, stop.t_s, stop.datum, stop.x_m, stop.y_m
    if place:
        yield Leg((one.uuid, len(one.stops)), place, since_s, inf, one.bottom_m, one.top_m)


def _stood_on(robots: Robots, around: Around) -> dict[Node, Seen]:
    """By leg, the robot that now stands where the leg ends, outside of every resource."""
    pairs = around.stood_on(robots)
    if not pairs:
        return {}
    ends = list(dict.fromkeys(end for end, _ in pairs))
    standing = sorted({slot for _, slot in pairs}, key=lambda slot: robots.uuids[slot])
    stops = robots.stops[[slot for slot, _ in ends], [number for _, number in ends]]
    points = shapely.points(stops["x_m"], stops["y_m"])
    found: dict[Node, Seen] = {}
    may_meet = set(pairs)
    for row, index in sorted(shapely.STRtree(robots.outlines(standing)).query(points, "intersects").T.tolist()):
        (slot, number), other = ends[row], standing[index]
        if (ends[row], other) in may_meet and stops["floor"][row] == robots.records["floor"][other]:
            found.setdefault((robots.uuids[slot], number), robots[robots.uuids[other]])
    return found


def place_wants(every: Iterable[Leg], capacity: Mapping[str, int]) -> list[Want]:
    """Who wants a place that is full when it sets out for it, and of whom.

    One who means to be gone by then, to a place that it wants itself, may be there still: it goes only if it can.
    """
    by_place: dict[str, list[Leg]] = {}
    every = list(every)
    for leg in every:
        by_place.setdefault(leg.place, []).append(leg)
    wants = []
    for leg in every:
        if leg.wants is None:
            continue
        robot = leg.node[0]
        holders = [
            other.node
            for other in by_place.get(leg.wants, ())
            if other.node[0] != robot
            and heights_overlap(other, leg)
            and other.since_s < leg.arrives_s
            and (other.until_s >= leg.until_s or other.wants is not None)
        ]
        if len({holder for holder, _ in holders}) >= capacity.get(leg.wants, 1):
            wants.append(Want(leg.node, tuple(sorted(holders)), _public(leg.wants), leg.until_s))
    return wants


def _public(place: str) -> str:
    return PATH if place.startswith(AT) else place


@dataclass(frozen=True, slots=True)
class Hindrance:
    """A standing robot in another one's way."""

    waiter: str
    blocker: str
    from_s: float
    """When the waiter gets there."""


def hindrances(robots: Robots, around: Around, now_s: float) -> list[Hindrance]:
    """Which of those that stand are in others' way, by waiter and time."""
    near = around.in_way(robots)
    if not near:
        return []
    going, standing = (list(dict.fromkeys(slots)) for slots in zip(*near, strict=True))
    all_ways, outlines = robots.ways(going), robots.outlines(standing)
    reach = np.maximum(robots.records["width_m"][going] / 2 - LEAST_M, LEAST_M)
    pairs = shapely.STRtree(outlines).query(all_ways, predicate="dwithin", distance=reach).T.tolist()
    met = [(all_ways[row], going[row], standing[column]) for row, column in pairs]
    may_meet = set(near)
    met = [(way, slot, other) for way, slot, other in met if (slot, other) in may_meet]
    if not met:
        return []
    ones = [(robots[robots.uuids[slot]], robots[robots.uuids[other]]) for _, slot, other in met]
    middles = shapely.points([(other.x_m, other.y_m) for _, other in ones])
    along_m = shapely.line_locate_point([way for way, _, _ in met], middles).tolist()
    found = [_hindrance(one, other, to_m, now_s) for (one, other), to_m in zip(ones, along_m, strict=True)]
    return sorted(found, key=lambda each: (each.waiter, each.from_s, each.blocker))


def _hindrance(one: Seen, other: Seen, along_m: float, now_s: float) -> Hindrance:
    """From when a robot comes to where it has to stop, or since when it stands there; the other is so far ahead."""
    to_go_m = along_m - (one.length_m + min(other.length_m, other.width_m)) / 2
    since_s = one.stood_s if one.stands and to_go_m < WAY_M else now_s + max(to_go_m, 0.0) / one.speed_mps
    return Hindrance(one.uuid, other.uuid, max(since_s, now_s))


def way_wants(found: Iterable[Hindrance]) -> list[Want]:
    return [Want((one.waiter, 0), ((one.blocker, 0),), PATH, one.from_s) for one in found]


def aisle_wants(robots: Iterable[Seen], aisles: Iterable[str]) -> list[Want]:
    """Robots that go through a single lane towards each other at one height, of each other."""
    wanted = set(aisles)
    by_aisle: dict[str, list[Seen]] = {}
    for one in robots:
        for zone in one.passages.keys() & wanted:
            by_aisle.setdefault(zone, []).append(one)
    wants = []
    for zone, inside in sorted(by_aisle.items()):
        forth = [one for one in inside if one.passages[zone].direction > 0]
        back = [one for one in inside if one.passages[zone].direction < 0]
        for a in forth:
            for b in back:
                meet_s = _meet_s(a, b, zone) if heights_overlap(a, b) else None
                if meet_s is not None:
                    wants.append(Want((a.uuid, 0), ((b.uuid, 0),), zone, meet_s))
                    wants.append(Want((b.uuid, 0), ((a.uuid, 0),), zone, meet_s))
    return wants


def _meet_s(forth: Seen, back: Seen, zone: str) -> float | None:
    """When two that drive towards each other in a lane are nose to nose; None where they do not come to that.

    Nor do they where the lane is wide enough for their ways to pass each other.
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
