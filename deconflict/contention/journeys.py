"""Robots' journeys as legs: what each has, what it wants next, and for how long it keeps what it has.

A robot keeps its place until it sets out for the next, and what it wants must be free by then: robots that each want
the other's place would otherwise need somewhere to pass each other, of which the service knows nothing.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import hypot, inf
from typing import NamedTuple

import numpy as np
import shapely

from deconflict.contention.boxes import grown, touching
from deconflict.contention.deadlocks import Node, Want
from deconflict.contention.robots import Seen, outlines, ways
from ingest.seam import Floats

WAY_M = 1.0
"""A robot that stands with less than this left to what is in its way waits for it."""
AT = "at "
"""Prefix of the name of a place that nobody drew: where a robot stands."""
PATH = "path"
LEAST_M = 0.05
"""What touches another one's way by less than this is not in it; nor is a way narrower than that on either side."""


class Leg(NamedTuple):
    """One robot keeps `place` from `since_s` to `until_s`, and is at `wants` from `arrives_s` on."""

    node: Node
    place: str
    since_s: float
    until_s: float
    wants: str | None = None
    arrives_s: float = inf


def legs(sharing: Sequence[Seen], standing: Sequence[Seen], now_s: float) -> list[Leg]:
    """The legs, as far as they reach, of robots that have something or go somewhere, and of those that stand there.

    Whoever else stands is where nobody goes. A robot that has nothing and goes to one place only has a leg where
    another wants that place.
    """
    stood_on = _stood_on(sharing, standing)
    having = {one.uuid: one for one in (*sharing, *stood_on.values()) if one.here or one.stands or len(one.stops) > 1}
    found = [leg for one in having.values() for leg in _legs(one, stood_on, now_s)]
    wanted = {leg.wants for leg in found}
    met = [
        one
        for one in sharing
        if one.stops and one.uuid not in having and (one.stops[0].resource in wanted or (one.uuid, 0) in stood_on)
    ]
    return found + [leg for one in met for leg in _legs(one, stood_on, now_s)]


def _legs(one: Seen, stood_on: Mapping[Node, Seen], now_s: float) -> Iterable[Leg]:
    place = one.here or (AT + one.uuid if one.stands else None)
    since_s, datum, x_m, y_m = one.came_s if one.here else one.stood_s, one.datum, one.x_m, one.y_m
    for number, stop in enumerate(one.stops):
        node = one.uuid, number
        wants = stop.resource or (AT + stood_on[node].uuid if node in stood_on else None)
        away_s = hypot(stop.x_m - x_m, stop.y_m - y_m) if stop.datum == datum else 0.0
        if place:
            yield Leg(node, place, since_s, max(stop.t_s - away_s, since_s, now_s), wants, stop.t_s)
        place, since_s, datum, x_m, y_m = wants, stop.t_s, stop.datum, stop.x_m, stop.y_m
    if place:
        yield Leg((one.uuid, len(one.stops)), place, since_s, inf)


def _stood_on(robots: Sequence[Seen], standing: Sequence[Seen]) -> dict[Node, Seen]:
    """By leg, the robot that now stands where the leg ends, outside of every resource."""
    standing = sorted((one for one in standing if one.here is None), key=lambda one: one.uuid)
    ends = [(one, number, stop) for one in robots for number, stop in enumerate(one.stops) if not stop.resource]
    if not standing or not ends:
        return {}
    near = touching(np.array([(stop.x_m, stop.y_m) * 2 for _, _, stop in ends]), _around(standing)).tolist()
    near = [(row, index) for row, index in near if ends[row][0] is not standing[index]]
    if not near:
        return {}
    standing = [standing[index] for index in sorted({index for _, index in near})]
    ends = [ends[row] for row in dict(near)]
    points = shapely.points([stop.x_m for _, _, stop in ends], [stop.y_m for _, _, stop in ends])
    found: dict[Node, Seen] = {}
    for row, index in sorted(shapely.STRtree(outlines(standing)).query(points, "intersects").T.tolist()):
        (one, number, stop), other = ends[row], standing[index]
        if one is not other and stop.datum == other.datum:
            found.setdefault((one.uuid, number), other)
    return found


def _around(robots: Sequence[Seen]) -> Floats:
    """(n, 4) boxes around the envelopes of one or more robots, however they are turned."""
    x_m, y_m, length_m, width_m = np.array([(one.x_m, one.y_m, one.length_m, one.width_m) for one in robots]).T
    return grown(np.stack([x_m, y_m, x_m, y_m], axis=1), np.hypot(length_m, width_m) / 2)


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


def hindrances(robots: Iterable[Seen], standing: Sequence[Seen], now_s: float) -> list[Hindrance]:
    """Which of those that stand are in others' way, by waiter and time."""
    if not standing:
        return []
    floors = {one.datum for one in standing}
    going = [one for one in robots if one.datum in floors and (one.goes or one.way_left is not None)]
    if not going:
        return []
    boxes_m = grown(np.array([one.box_m for one in going]), np.array([one.width_m for one in going]) / 2 + LEAST_M)
    near = touching(boxes_m, _around(standing)).tolist()
    near = [(row, at) for row, at in near if going[row] is not standing[at] and going[row].datum == standing[at].datum]
    if not near:
        return []
    going = [going[row] for row in dict(near)]
    standing = [standing[index] for index in {index for _, index in near}]
    all_ways = ways(going)
    reach = [max(one.width_m / 2 - LEAST_M, LEAST_M) for one in going]
    pairs = shapely.STRtree(outlines(standing)).query(all_ways, predicate="dwithin", distance=reach).T.tolist()
    met = [(all_ways[row], going[row], standing[column]) for row, column in pairs]
    met = [(way, one, other) for way, one, other in met if one is not other and one.datum == other.datum]
    if not met:
        return []
    middles = shapely.points([(other.x_m, other.y_m) for _, _, other in met])
    along_m = shapely.line_locate_point([way for way, _, _ in met], middles).tolist()
    found = [_hindrance(one, other, to_m, now_s) for (_, one, other), to_m in zip(met, along_m, strict=True)]
    return sorted(found, key=lambda each: (each.waiter, each.from_s, each.blocker))


def _hindrance(one: Seen, other: Seen, along_m: float, now_s: float) -> Hindrance:
    """From when a robot comes to where it has to stop, or since when it stands there; the other is so far ahead."""
    to_go_m = along_m - (one.length_m + min(other.length_m, other.width_m)) / 2
    since_s = one.stood_s if one.stands and to_go_m < WAY_M else now_s + max(to_go_m, 0.0) / one.speed_mps
    return Hindrance(one.uuid, other.uuid, max(since_s, now_s))


def way_wants(found: Iterable[Hindrance]) -> list[Want]:
    return [Want((one.waiter, 0), ((one.blocker, 0),), PATH, one.from_s) for one in found]


def aisle_wants(robots: Iterable[Seen], aisles: Iterable[str]) -> list[Want]:
    """Robots that go through a single lane towards each other, of each other."""
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
                meet_s = _meet_s(a, b, zone)
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
