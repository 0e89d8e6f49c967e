"""What honest robots lose by the others on their floor, and which of their meetings are real."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from benchmarks.drawn_floors.driving import Drive, Warned
from benchmarks.drawn_floors.floor import Floor
from benchmarks.drawn_floors.motion import PATH_S, WAITS_MPS, Poses, Robot
from benchmarks.drawn_floors.others import LARGEST_M
from ingest.batch import Bools, Floats, Ints, Pair

CLEARANCE_M = 0.3
SAME_S, LATE_S = 0.3, 0.5
"""Warnings raised this near to each other are the same; this much later is late."""
MATCHED_S = 5.0
"""Farther apart they are different warnings."""
AHEAD_S = 2.0
"""A meeting is warned of if a warning stands so long before it."""
BEFORE_S, AFTER_S = 5.0, 12.0
"""A warning may differ if one of its robots meets one of the others from so long before it was raised until so long
after."""
STEP_S = 0.2
GROWN_M = 1.0
"""By how much a silent robot grows on every side."""
SETTLED_S = 4.0
"""Honest robots' warnings are compared from then on."""


class Meeting(NamedTuple):
    """Two robots come within the clearance, at first at a time."""

    pair: Pair
    at_s: float


@dataclass(slots=True)
class Verdict:
    """Honest pairs' warnings beside others, compared with those without them."""

    compared: int = 0
    excused: int = 0
    """Not compared, since one of the robots meets one of the others."""
    missing: list[str] = field(default_factory=list)
    late: list[str] = field(default_factory=list)
    additional: list[str] = field(default_factory=list)
    severity: list[str] = field(default_factory=list)
    """Of the same warnings, those with another highest severity."""
    meetings: int = 0
    told_alone: int = 0
    told_beside: int = 0
    """True meetings of honest robots, those warned of ahead without the others, and beside them."""
    missed: int = 0
    """Meetings warned of ahead without the others and not beside them, that are not excused."""
    met_others: int = 0
    told_of_others: int = 0
    """True meetings of honest robots with others, and those warned of ahead."""

    @property
    def differ(self) -> int:
        return len(self.missing) + len(self.late) + len(self.additional)


def compared(floor: Floor, alone: Drive, beside: Drive, seconds: float) -> Verdict:
    """The verdict on a floor."""
    verdict, honest = Verdict(), {robot.uuid for robot in floor.honest}
    excused = _Excused(floor, beside, seconds)
    pairs = {pair for pair in (*alone.warnings, *beside.warnings) if honest.issuperset(pair)}
    for pair in sorted(pairs):
        _compare_pair(verdict, pair, alone.warnings.get(pair, []), beside.warnings.get(pair, []), excused, seconds)
    for meeting in meetings(floor.honest, floor.honest, SETTLED_S + AHEAD_S, seconds):
        ahead_alone, ahead_beside = told_of(meeting, alone), told_of(meeting, beside)
        verdict.meetings += 1
        verdict.told_alone += ahead_alone is not None
        verdict.told_beside += ahead_beside is not None
        if ahead_alone and not ahead_beside:
            verdict.missed += not excused.at(meeting.pair, ahead_alone.raised_s)
    for meeting in meetings(floor.honest, floor.others, 10.0, seconds):
        verdict.met_others += 1
        verdict.told_of_others += told_of(meeting, beside) is not None
    return verdict


def _compare_pair(
    verdict: Verdict,
    pair: Pair,
    alone: Sequence[Warned],
    beside: Sequence[Warned],
    excused: "_Excused",
    until_s: float,
) -> None:
    left = list(beside)
    for warning in alone:
        near = [each for each in left if abs(each.raised_s - warning.raised_s) <= MATCHED_S]
        match = min(near, key=lambda each: abs(each.raised_s - warning.raised_s), default=None)
        if match:
            left.remove(match)
        if not SETTLED_S <= warning.raised_s < until_s - LATE_S:
            continue
        if excused.at(pair, warning.raised_s):
            verdict.excused += 1
            continue
        verdict.compared += 1
        text = f"{pair[0][:8]} {pair[1][:8]} at {warning.raised_s:.1f} s"
        if match is None:
            verdict.missing.append(text)
        elif match.raised_s - warning.raised_s >= LATE_S:
            verdict.late.append(f"{text}, {match.raised_s - warning.raised_s:.1f} s late")
        elif match.severity != warning.severity and abs(match.raised_s - warning.raised_s) <= SAME_S:
            verdict.severity.append(f"{text}, {warning.severity} and {match.severity}")
    for warning in left:
        if warning.raised_s >= SETTLED_S and not excused.at(pair, warning.raised_s):
            verdict.additional.append(f"{pair[0][:8]} {pair[1][:8]} at {warning.raised_s:.1f} s")


def told_of(meeting: Meeting, drive: Drive) -> Warned | None:
    """The warning that stands some time before a meeting."""
    by_s = meeting.at_s - AHEAD_S
    standing = (each for each in drive.warnings.get(meeting.pair, ()) if each.raised_s <= by_s < each.cleared_s)
    return next(standing, None)


def meetings(some: Sequence[Robot], others: Sequence[Robot], since_s: float, until_s: float) -> list[Meeting]:
    """When robots come within the clearance of others, if they did not touch just before and one of them moves.

    Bodies are taken as rectangles, by the distance of each from the corners and the middle of the other.
    """
    times_s = np.arange(since_s - AHEAD_S, until_s, STEP_S)
    pairs = combinations(some, 2) if some is others else ((robot, other) for robot in some for other in others)
    poses = {robot.uuid: robot.way.at(times_s) for robot in (*some, *others)}
    found = []
    for robot, other in pairs:
        reach_m = (np.hypot(robot.length_m, robot.width_m) + np.hypot(other.length_m, other.width_m)) / 2 + CLEARANCE_M
        a, b = poses[robot.uuid], poses[other.uuid]
        near = np.hypot(a.x_m - b.x_m, a.y_m - b.y_m) <= reach_m
        if not near.any():
            continue
        near[near] = _gap_m(_rows(a, near), robot, _rows(b, near), other) <= CLEARANCE_M
        begins = np.flatnonzero(near[1:] & ~near[:-1]) + 1
        begins = begins[times_s[begins] >= since_s]
        moves = (a.speed_mps[begins] > 0) | (b.speed_mps[begins] > 0)
        pair = (min(robot.uuid, other.uuid), max(robot.uuid, other.uuid))
        found += [Meeting(pair, t_s) for t_s in times_s[begins[moves]].tolist()]
    return found


def _rows(poses: Poses, rows: Bools) -> Poses:
    return Poses(*(column[rows] for column in poses))


def _gap_m(a: Poses, robot: Robot, b: Poses, other: Robot) -> Floats:
    """(n,) the distance of two bodies at n poses, 0 if they overlap, never too small by more than their corners."""
    gap_m = np.full(len(a.x_m), np.inf)
    for here, body, there, its in ((a, robot, b, other), (b, other, a, robot)):
        for ahead, left in ((0, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)):
            x_m, y_m = ahead * its.length_m / 2, left * its.width_m / 2
            x = there.x_m + x_m * np.cos(there.yaw_rad) - y_m * np.sin(there.yaw_rad)
            y = there.y_m + x_m * np.sin(there.yaw_rad) + y_m * np.cos(there.yaw_rad)
            gap_m = np.minimum(gap_m, _outside_m(x - here.x_m, y - here.y_m, here.yaw_rad, body.length_m, body.width_m))
    return gap_m


def _outside_m(x: Floats, y: Floats, yaw_rad: Floats, length_m: float | Floats, width_m: float | Floats) -> Floats:
    """How far points are outside of rectangles, from the middles of which they are given."""
    ahead, left = x * np.cos(yaw_rad) + y * np.sin(yaw_rad), y * np.cos(yaw_rad) - x * np.sin(yaw_rad)
    return np.hypot(np.maximum(np.abs(ahead) - length_m / 2, 0.0), np.maximum(np.abs(left) - width_m / 2, 0.0))


class _Excused:
    """When each honest robot meets one of the others: in truth, by what those say, or by the service's warnings."""

    def __init__(self, floor: Floor, beside: Drive, seconds: float) -> None:
        self._times_s = np.arange(0.0, seconds + AFTER_S, STEP_S)
        others = floor.others
        self._near = {robot.uuid: np.zeros(len(self._times_s), bool) for robot in floor.honest}
        if not others:
            return
        rectangles = [_rectangles(robot, self._times_s, seconds) for robot in others]
        columns = [np.concatenate([part[column] for part in rectangles]) for column in range(6)]
        rows, x_m, y_m, yaw_rad, length_m, width_m = columns
        rows = rows.astype(np.int64)
        for robot in floor.honest:
            at = robot.way.at(self._times_s)
            reach_m = CLEARANCE_M + np.hypot(robot.length_m, robot.width_m) / 2 + _half_step_m(robot)
            apart_m = _outside_m(at.x_m[rows] - x_m, at.y_m[rows] - y_m, yaw_rad, length_m, width_m)
            self._near[robot.uuid][rows[apart_m <= reach_m]] = True
        self._note_warnings(beside)

    def _note_warnings(self, beside: Drive) -> None:
        for pair, warnings in beside.warnings.items():
            of_honest = [uuid for uuid in pair if uuid in self._near]
            if len(of_honest) == 1:
                for warning in warnings:
                    stood = (self._times_s >= warning.raised_s) & (self._times_s <= warning.cleared_s)
                    self._near[of_honest[0]] |= stood

    def at(self, pair: Iterable[str], raised_s: float) -> bool:
        """Whether a warning of a pair at this time may differ."""
        around = (self._times_s >= raised_s - BEFORE_S) & (self._times_s <= raised_s + AFTER_S)
        return any((self._near[uuid] & around).any() for uuid in pair)


def _half_step_m(robot: Robot) -> float:
    """How far a robot goes at most in half a step."""
    return float(robot.way.speed_mps.max()) * STEP_S / 2


def _rectangles(robot: Robot, times_s: Floats, seconds: float) -> tuple[Any, ...]:
    """Where the body of one of the others may be: rows of `times_s`, middles, yaws, lengths and widths.

    In truth, and by the forecast of its newest report, which holds while it is silent. Each is as long as the way that
    it goes in a step.
    """
    reports_s = robot.reports_s(seconds)
    if not len(reports_s):
        return tuple(np.empty(0) for _ in range(6))
    length_m, width_m = min(robot.length_m, LARGEST_M), min(robot.width_m, LARGEST_M)
    rows = np.flatnonzero(times_s >= reports_s[0])
    truth, newest = robot.way.at(times_s[rows]), np.searchsorted(reports_s, times_s[rows], side="right") - 1
    silent_s = times_s[rows] - reports_s[newest]
    believed = robot.way.at(reports_s[newest] + np.minimum(silent_s, PATH_S))
    grown_m: Floats = np.where(silent_s > PATH_S, 2 * GROWN_M, 0.0)
    parts = [
        _stretched(rows, truth, length_m, width_m),
        _stretched(rows, believed, length_m + grown_m, width_m + grown_m),
    ]
    if robot.says in ("straight", "waits", "bound"):
        poses = robot.forecasts(reports_s)
        poses = poses._replace(speed_mps=np.maximum(poses.speed_mps, WAITS_MPS))
        for ahead_s in range(PATH_S + 1):
            there = Poses(*(column[:, ahead_s] for column in poses))
            at = np.minimum(np.searchsorted(times_s, reports_s + ahead_s), len(times_s) - 1)
            parts.append(_stretched(at, there, length_m, width_m, 1.0))
    return tuple(np.concatenate(columns) for columns in zip(*parts, strict=True))


def _stretched(
    rows: Ints, poses: Poses, length_m: float | Floats, width_m: float | Floats, step_s: float = STEP_S
) -> tuple[Any, ...]:
    x_m, y_m, yaw_rad, speed_mps = poses
    more_m = np.minimum(speed_mps, 100.0) * step_s
    return rows, x_m, y_m, yaw_rad, length_m + more_m, np.broadcast_to(width_m, x_m.shape)
