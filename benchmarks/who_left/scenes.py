"""Scenes of which it is known who has left, and who is only silent.

- `street`: people and robots cross a part of a street that is seen, and leave over its open edges in the west and east.
- `hall`: robots come through doors in the north wall and a lift, go to stations at the walls, and leave through the
  doors or the lift. The site file has these. A third door is between the two halves: nobody leaves there.
- `bare hall`: the same without a site file.

On each scene bodies stand in the middle whose radios fail for a while, some that walk stall there and fall silent, and
others drive on through a dead spot. In the halls the radio also fails at one station, at the south wall.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from benchmarks.silent_floor import HALL
from benchmarks.who_left.walks import Point, Span, Walk, walked
from deconflict.settings.shared_places import Resource, Zone
from deconflict.settings.site import Site
from ingest.settings import Datum

EAST_M, NORTH_M = 20.0, 12.0
"""The corner of a scene whose other corner is the origin."""
EVERY_S = {"street": 1.8, "hall": 3.0, "bare hall": 3.0}
"""Mean time between two that come, by scene."""
STAND_AT: Sequence[Point] = ((6.0, 4.0), (9.0, 8.5), (14.0, 3.0), (16.0, 7.0))
STALLS_AT: Sequence[Point] = ((7.5, 6.5), (12.0, 5.5))
STALLS_S = 60.0
DOORS: Sequence[Point] = ((3.0, NORTH_M), (15.0, NORTH_M))
LIFT: Point = (EAST_M - 1.0, 1.0)
STATIONS: Sequence[Point] = ((2.0, 0.6), (8.0, 0.6), (13.0, 0.6), (0.6, 6.0), (EAST_M - 0.6, 9.0))
DEAD_STATION = STATIONS[1]
GAP: Point = (EAST_M / 2, 6.0)
"""The middle of the door between the two halves of a hall."""


class Standing(NamedTuple):
    """A place in the middle at which a body stands, and when somebody has stalled there."""

    at_m: Point
    spans: list[Span]


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """The scene of one kind and seed."""

    kind: str
    seed: int
    seconds: float
    walks: list[Walk] = field(default_factory=list)

    @property
    def site(self) -> Site:
        """With the exits of a hall whose plan is known."""
        datums = (Datum(id=HALL, name="Hall"),)
        if self.kind != "hall":
            return Site(datums=datums)
        doors = [*DOORS, (EAST_M / 2, 6.0)]
        zones = tuple(
            Zone(kind="door", id=f"door {row}", datum=HALL, polygon=_box(middle, 0.5 + (row < 2)))
            for row, middle in enumerate(doors)
        )
        lift = Resource(kind="lift", id="lift", datum=HALL, polygon=_box(LIFT, 1.0))
        return Site(datums=datums, zones=zones, resources=(lift,))


def scene_of(kind: str, seed: int, seconds: float) -> Scene:
    """A scene by its kind."""
    scene, rng = Scene(kind, seed, seconds), np.random.default_rng(seed)
    scene.walks.extend(_parked(rng, seconds))
    stalls = iter(_stall_times(rng, seconds))
    stall = next(stalls, None)
    t_s, number = 0.0, 0
    while t_s < seconds:
        if stall and t_s >= stall[0]:
            scene.walks.append(_stalled(kind, rng, f"stalled {number}", t_s, stall[1], seconds))
            stall = next(stalls, None)
        else:
            scene.walks.append(_walk(kind, rng, f"walk {number}", t_s))
        t_s, number = t_s + rng.exponential(EVERY_S[kind]), number + 1
    return scene


def _parked(rng: Generator, seconds: float) -> list[Walk]:
    parked = []
    for number, place in enumerate(STAND_AT):
        walk = Walk(f"parked {number}", 0.0, np.array([place]), tells_goal=True, stays=True)
        t_s = rng.uniform(10, 60)
        while t_s < seconds:
            walk.silent.append((t_s, t_s + rng.uniform(15, 60)))
            t_s = walk.silent[-1][1] + rng.uniform(15, 60)
        parked.append(walk)
    return parked


def _stall_times(rng: Generator, seconds: float) -> list[tuple[float, Point]]:
    """From when on, and where, the next one stalls."""
    times = np.arange(20.0, seconds, STALLS_S).tolist()
    return [(t_s + rng.uniform(0, 15), STALLS_AT[row % len(STALLS_AT)]) for row, t_s in enumerate(times)]


def _stalled(kind: str, rng: Generator, name: str, t_s: float, at_m: Point, seconds: float) -> Walk:
    """One that stalls on its way, falls silent just before, and goes on after a while; every third never does."""
    mps, (begin, end) = rng.uniform(0.8, 1.4), _ends(kind, rng)
    way = [(begin, 0.0), (at_m, rng.uniform(30, 50)), (end, 0.0)]
    stands_for_ever = rng.random() < 1 / 3
    if stands_for_ever:
        way = [way[0], (at_m, 1.0)]
    walk = Walk(name, t_s, walked(way, mps, STAND_AT), rng.random() < 0.5 or kind != "street", stays=stands_for_ever)
    reaches_s = t_s + len(walked(way[:2], mps, STAND_AT)) * 0.1 - way[1][1] - 0.5
    walk.silent.append((reaches_s, seconds if stands_for_ever else reaches_s + way[1][1] + 1.0))
    return walk


def _walk(kind: str, rng: Generator, name: str, t_s: float) -> Walk:
    """One that crosses the scene. Some drive on through a dead spot in the middle."""
    mps, (begin, end) = rng.uniform(0.7, 1.5), _ends(kind, rng)
    way = [(begin, 0.0), *_stops(kind, rng, begin, end), (end, 0.0)]
    at_m = walked(way, mps, (*STAND_AT, *STALLS_AT))
    walk = Walk(name, t_s, at_m, tells_goal=kind != "street" and rng.random() < 0.7)
    if rng.random() < 0.08:
        begin_s = t_s + rng.uniform(0.2, 0.35) * len(at_m) * 0.1
        walk.silent.append((begin_s, begin_s + rng.uniform(7, 12)))
    for stop, wait_s in way[1:-1]:
        if stop == DEAD_STATION:
            reaches_s = t_s + 0.1 * float(np.argmin(np.hypot(*(at_m - stop).T)))
            walk.silent.append((reaches_s - 1.0, reaches_s + wait_s))
    return walk


def _ends(kind: str, rng: Generator) -> tuple[Point, Point]:
    """Where one comes from, and where it leaves."""
    if kind == "street":
        ends = (0.0, rng.uniform(1, NORTH_M - 1)), (EAST_M, rng.uniform(1, NORTH_M - 1))
        return ends if rng.random() < 0.5 else ends[::-1]
    from_row, to_row = rng.choice(3, 2, replace=False).tolist()
    exits = [(x + rng.uniform(-0.4, 0.4), y) for x, y in DOORS] + [(LIFT[0], LIFT[1] + rng.uniform(-0.2, 0.2))]
    return exits[from_row], exits[to_row]


def _stops(kind: str, rng: Generator, begin: Point, end: Point) -> list[tuple[Point, float]]:
    """What it passes on its way, and for how long it stays there."""
    if kind == "street":
        return []
    station = STATIONS[int(rng.integers(len(STATIONS)))]
    stops: list[tuple[Point, float]] = [(station, rng.uniform(5, 15))]
    for row, (first, last) in reversed(list(enumerate(((begin, station), (station, end))))):
        if (first[0] < GAP[0]) != (last[0] < GAP[0]):
            stops.insert(row, (GAP, 0.0))
    return stops


def _box(middle: Point, half_m: float) -> tuple[Point, ...]:
    (x, y), h = middle, half_m
    return (x - h, y - h), (x + h, y - h), (x + h, y + h), (x - h, y + h)
