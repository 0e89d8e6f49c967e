"""Which robots of a fleet are on the floor: those that a person took off it, and those that begin anew.

A person says that a robot is off the floor. That holds until the person takes it back, or until the robot is heard
elsewhere: farther from where it was than its localisation may err, on another floor, or driving. A robot that still
reports from the same place, as from a bench in its old position, stays off.
"""

from collections import OrderedDict
from collections.abc import Iterable, Mapping, Sequence
from math import hypot
from typing import NamedTuple

from ingest.fleet.prediction.forecast_model import Sighting
from ingest.fleet.prediction.hand_moves import HandMove, is_out_of_reach
from ingest.fleet.robot import Robot
from ingest.measures.measures import Measures
from ingest.recording.operator_events import OffFloorMark

MOVED = "deconflict_robots_moved_total"
BY_HAND, OFF_BEFORE = "by_hand", "off_floor"
"""Name of a metric, and how a robot came to where it is."""
AWAY_M, DRIVEN_M = 1.0, 0.3
"""A robot is heard elsewhere from the first distance on, or from the second if it drives."""
MOST_MARKS, MOST_BACK = 10_000, 200
"""Robots that are kept as off the floor; beyond, the one that was marked longest ago is back. And robots of which it is
kept that they came back."""


class Departures(NamedTuple):
    """What a batch says of robots besides their reports."""

    robots: list[Robot]
    """Those of the batch that are on the floor."""
    gone: tuple[str, ...] = ()
    off_floor: tuple[str, ...] = ()
    """Those of `gone` that a person took off the floor."""
    began_anew: tuple[str, ...] = ()
    """Robots of the batch whose presence had ended before."""


class OffFloor:
    """Robots by UUID. Counts those that come back by themselves, and those that were moved by hand."""

    def __init__(self) -> None:
        self.marks: OrderedDict[str, OffFloorMark] = OrderedDict()
        """What was said of each robot that is off the floor, the oldest first."""
        self.back: OrderedDict[str, OffFloorMark] = OrderedDict()
        """By robot that was heard elsewhere: when that was, and who had said that it is off the floor."""
        self.changes = 0
        """Grows with each change."""
        self._known: set[str] = set()
        """Robots of which anything was said since the start; a file that was written before knows less of them."""
        self._off: dict[str, None] = {}
        """Those that were marked since the last batch."""
        self._again: set[str] = set()
        """Those that are back since then."""
        self._moved: set[str] = set()
        """Those that were moved by hand since then."""
        self._returned: list[OffFloorMark] = []

    def note(self, mark: OffFloorMark) -> bool:
        """Take note of what a person says of a robot, from the next batch on. Returns whether that is new."""
        if mark.is_off and mark.uuid in self.back and self.back[mark.uuid].at_s >= mark.at_s:
            return False  # it comes again, from the other machines of a cluster
        self._known.add(mark.uuid)
        before = self.marks.pop(mark.uuid, None)
        self.back.pop(mark.uuid, None)
        if mark.is_off:
            self.marks[mark.uuid] = before or mark
            self._off[mark.uuid] = None
        elif before:
            self._off.pop(mark.uuid, None)
            self._again.add(mark.uuid)
        if len(self.marks) > MOST_MARKS:
            self.marks.popitem(last=False)
        is_new = mark.is_off is not bool(before)
        self.changes += is_new
        return is_new

    def read(self, marks: Iterable[OffFloorMark]) -> None:
        """Take over the marks of a file."""
        for mark in marks:
            if mark.uuid not in self._known:
                self.note(mark)

    def note_sighting(self, robot: Robot, before: Sighting, now: Sighting, measures: Measures) -> None:
        """Let a robot begin anew if it can't have driven from the sighting before: what its motion has shown ends."""
        fastest_mps = robot.context.body.max_speed_mps if robot.context else None
        if not is_out_of_reach(before, now, robot.doubt_m, fastest_mps):
            return
        times, took_s = robot.moved.times + 1 if robot.moved else 1, now.t_s - before.t_s
        distance_m, at_s = hypot(now.x_m - before.x_m, now.y_m - before.y_m), now.t_s
        robot.begin_anew(HandMove(at_s, distance_m, took_s, times))
        self._moved.add(robot.uuid)
        measures.count(MOVED, robot.vendor, BY_HAND)

    def without(self, robots: list[Robot]) -> list[Robot]:
        """The robots that are on the floor."""
        return [robot for robot in robots if robot.uuid not in self.marks] if self.marks else robots

    def departures(
        self,
        robots: list[Robot],
        known: Mapping[str, Robot],
        gone: tuple[str, ...],
        floors: Sequence[str],
        measures: Measures,
    ) -> Departures:
        """What the next batch says, of these robots and of those of all `known` that are back. A robot that is heard
        elsewhere is back."""
        for robot in robots if self.marks else ():
            mark = self.marks.get(robot.uuid)
            if mark and _is_elsewhere(mark, robot, floors):
                self._end(mark, robot, measures)
        robots = self.without(robots)
        if not (gone or self._moved or self._off or self._again):
            return Departures(robots)
        present = {robot.uuid for robot in robots}
        again = [known[uuid] for uuid in sorted(self._again - present) if uuid in known and known[uuid].forecast]
        present |= {robot.uuid for robot in again}
        anew = present & (self._moved | set(gone) | self._off.keys())
        off = tuple(uuid for uuid in self._off if uuid in known and uuid not in present)
        left = tuple(dict.fromkeys(uuid for uuid in (*gone, *off) if uuid not in present))
        self._off, self._moved, self._again = {}, set(), set()
        return Departures([*robots, *again], left, off, tuple(sorted(anew)))

    def take_returned(self) -> list[OffFloorMark]:
        """The robots that came back by themselves since the last call."""
        returned, self._returned = self._returned, []
        return returned

    def _end(self, mark: OffFloorMark, robot: Robot, measures: Measures) -> None:
        back = OffFloorMark(mark.uuid, robot.arrival_s, is_off=False, by=mark.by)
        self.note(back)
        robot.came_s = robot.arrival_s
        self.back[mark.uuid] = back
        if len(self.back) > MOST_BACK:
            self.back.popitem(last=False)
        self._returned.append(back)
        measures.count(MOVED, robot.vendor, OFF_BEFORE)


def _is_elsewhere(mark: OffFloorMark, robot: Robot, floors: Sequence[str]) -> bool:
    """Whether a robot was heard elsewhere since it was marked."""
    seen = robot.seen
    if seen is None or robot.arrival_s <= mark.at_s:
        return False
    if datum_of(robot, floors) != mark.datum:
        return True
    away_m = hypot(seen.x_m - mark.x_m, seen.y_m - mark.y_m)
    is_driving = seen.is_driving and not seen.is_overruled
    return away_m > max(AWAY_M, robot.doubt_m) or (is_driving and away_m > DRIVEN_M)


def datum_of(robot: Robot, floors: Sequence[str]) -> str:
    """The floor on which a robot was seen; "" if that is compared with no other."""
    return floors[robot.seen.floor] if robot.seen and robot.seen.floor >= 0 else ""
