"""Robots that stand in each other's way: who waits for whom, and since when."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from deconflict.adviser.ways import first_in_way, meetings, wanted_ways
from deconflict.contention.robots.record_kernels import resting
from deconflict.contention.robots.robot_table import RobotTable
from deconflict.contention.waiting.deadlocks import Want, rings
from deconflict.contention.waiting.free_crossings import Crossing
from deconflict.foresight.motion_assumptions import CROSSING_M, CROSSING_S
from deconflict.sweep.pair_choice import NO_CROWDS
from ingest.batch import Bools, Floats, Ints

SLOW_MPS = 0.8
"""A robot that is not faster, and has another in its way, is about to stop for it."""
HEARD_WITHIN_S = 5.0
"""Where a robot is that was last heard longer ago is doubted."""
MOST_QUEUED = 200
"""A longer queue behind a robot is not counted to its end."""


@dataclass(frozen=True, slots=True)
class Waiting:
    """A robot that stands because the body of another is in its way."""

    robot: str
    """UUID."""
    other: str
    """UUID of the robot in its way."""
    since_s: float
    """Since when it rests, seconds since the epoch."""
    other_since_s: float
    """Since when the other rests; inf if it does not."""
    speed_mps: float
    """0 if it rests."""
    way_rad: float
    """Direction of its way where the other's body is."""

    @property
    def both_since_s(self) -> float:
        return max(self.since_s, self.other_since_s)


@dataclass(frozen=True)
class Standing:
    """Who stands for whom at one moment."""

    waiting: dict[str, Waiting]
    """By robot."""
    rings: list[tuple[str, ...]]
    """Robots that stand for each other, each for the next and the last for the first."""

    crossings: list[Crossing] = field(default_factory=list)
    _behind: dict[str, int] = field(default_factory=dict, init=False, compare=False)
    """By robot, how many stand behind it, once that was asked."""

    @cached_property
    def in_rings(self) -> set[str]:
        return {robot for ring in self.rings for robot in ring}

    @cached_property
    def _stand_for(self) -> dict[str, list[str]]:
        """By robot, those that stand for it."""
        found: dict[str, list[str]] = {}
        for each in self.waiting.values():
            found.setdefault(each.other, []).append(each.robot)
        return found

    @cached_property
    def facing(self) -> dict[str, list[str]]:
        """By robot that stands before free crossings, those that stand there for it."""
        found: dict[str, list[str]] = {}
        for a, b in (crossing.robots for crossing in self.crossings):
            found.setdefault(a, []).append(b)
            found.setdefault(b, []).append(a)
        return found

    def behind(self, robot: str) -> int:
        """How many robots stand for a robot, or for one that stands for it; at most `MOST_QUEUED`."""
        if robot not in self._behind:
            self._behind[robot] = len(self._robots_behind(robot)) - 1
        return self._behind[robot]

    def held_up_by(self, robot: str) -> set[str]:
        """The robots that stand for a robot, or for one that stands for it; also before a free crossing. At most
        `MOST_QUEUED` of each robot."""
        return set().union(*map(self._robots_behind, (robot, *self.facing.get(robot, ())))) - {robot}

    def stands_for(self, robot: str) -> set[str]:
        """The robots for which a robot stands, itself or through others: those that have it in `held_up_by`, if no
        queue is longer than `MOST_QUEUED`."""
        at, found = robot, {robot}
        while (each := self.waiting.get(at)) and each.other not in found and len(found) <= MOST_QUEUED:
            at = each.other
            found.add(at)
        return found.union(*(self.facing.get(uuid, ()) for uuid in found)) - {robot}

    def _robots_behind(self, robot: str) -> set[str]:
        """A robot, and the first `MOST_QUEUED` that stand for it, or for one that stands for it."""
        found, to_do, stand_for = {robot}, [robot], self._stand_for
        for at in to_do:
            for name in stand_for.get(at, ()):
                if len(found) > MOST_QUEUED:
                    return found
                if name not in found:
                    found.add(name)
                    to_do.append(name)
        return found

    def last_behind(self, robot: str, but: set[str]) -> list[str]:
        """The robots behind a robot, and not among `but` or behind these, behind which nobody stands."""
        found, seen, to_do = [], {robot, *but}, [robot]
        while to_do:
            at = to_do.pop()
            new = [name for name in self._stand_for.get(at, ()) if name not in seen]
            seen.update(new)
            to_do += new
            found += [at] if not new and at not in but and at != robot else []
        return found


def standing(robots: RobotTable, now_s: float, foresees: bool, crowds: Mapping[str, int] = NO_CROWDS) -> Standing:
    """Who stands for whom, by the newest reports. If it `foresees`, robots that slow down for each other are rings. The
    places of robots in `crowds` are doubted."""
    records = robots.records
    heard = records["known"] & (records["floor"] >= 0) & (now_s - records["event_s"] <= HEARD_WITHIN_S)
    heard[np.flatnonzero(robots.slots.column(crowds))] = False
    rests = heard & resting(records)
    slows = heard & (records["speed_mps"] <= SLOW_MPS) & foresees
    ways = wanted_ways(robots, np.flatnonzero(rests | slows))
    others, way_rad = first_in_way(robots, ways, np.flatnonzero(heard))
    waits = others >= 0
    waiting = _waiting(robots, ways.slots[waits], others[waits], way_rad[waits], rests)
    wants = [Want((each.robot, 0), ((each.other, 0),), "path", each.since_s) for each in waiting.values()]
    found = [tuple(link.waiter for link in ring) for ring in rings(wants)]
    in_rings = {robot for ring in found for robot in ring}
    waiting = {uuid: each for uuid, each in waiting.items() if uuid in in_rings or not each.speed_mps}
    return Standing(waiting, found, _crossings(robots, np.flatnonzero(rests), waiting, now_s))


def _crossings(robots: RobotTable, slots: Ints, waiting: dict[str, Waiting], now_s: float) -> list[Crossing]:
    """Robots among `slots` that have long stood before a crossing for no body."""
    long = [
        slot
        for slot in slots[now_s - robots.records["rests_s"][slots] >= CROSSING_S].tolist()
        if robots.slots.uuids[slot] not in waiting
    ]
    ways = wanted_ways(robots, np.array(long, np.int64), CROSSING_M)
    uuids, rests_s = robots.slots.uuids, robots.records["rests_s"]
    return [
        Crossing((uuids[a], uuids[b]), float(rests_s[[a, b]].max()), before_m)
        for (a, b), before_m in meetings(robots, ways)
    ]


def _waiting(robots: RobotTable, slots: Ints, others: Ints, way_rad: Floats, rests: Bools) -> dict[str, Waiting]:
    """By robot, those of `slots` (n,) whose ways `others` (n,) stand or drive in, which lead to `way_rad` (n,) there;
    `rests` is by slot."""
    uuids, rests_s = robots.slots.uuids, robots.records["rests_s"]
    other_s = np.where(rests[others], rests_s[others], np.inf)
    speed_mps = np.where(rests[slots], 0.0, robots.records["speed_mps"][slots])
    columns = (column.tolist() for column in (slots, others, rests_s[slots], other_s, speed_mps, way_rad))
    return {
        uuids[slot]: Waiting(uuids[slot], uuids[other], *numbers)
        for slot, other, *numbers in zip(*columns, strict=True)
    }
