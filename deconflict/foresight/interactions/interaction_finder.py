"""Who gave way to whom, by what robots report.

A robot gives way where it brakes or swerves against its own forecast (see `progress`) while another is in its way.
The nearest one ahead of it counts. Where both are of one vendor and it goes on once the other has cleared its way, that
is the order of their fleet. Live, in a replay and in scores the same code finds them.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from math import inf
from typing import NamedTuple

import numpy as np

from deconflict.foresight.interactions.progress_kernels import (
    AHEAD_S,
    BRAKED,
    BRAKES_MPS2,
    KEPT,
    RESUMED,
    STATE,
    Findings,
    follow,
)
from deconflict.sweep.geometry.rectangles import signed_gap
from ingest.batch import Bools, Floats, Ints

BEYOND_M = 1.0
"""Who is within the stopping distance and so much of a robot's way is in its way."""
TOUCHES_M = 0.1
"""A way leads to another robot where the envelopes come so near."""
NEARER_M = 0.05
"""And nearer than they were by this: one that stands beside the way is not in it."""
LOOK_S = 0.5
"""Between two looks at who is in the way, from the onset on."""
EARLIER_S = 1.0
"""Who was in the way so long before the onset counts too: reports are a second apart."""
SEARCHED_S = 4.0
"""So long after the onset who is in the way is looked for."""
WAY_M = 0.15
"""Between two places of a way that are looked at."""
CLEARED_M = 0.3
"""The way of a robot is cleared where so much more of it is free."""
APART_S = 15.0
"""Interactions of a pair that are less apart in time are one."""
SETTLED_S = 20.0
"""So long after the onset a pair of one vendor is known to keep an order, or stays unknown."""


class InteractionOutcome(IntEnum):
    """What an interaction is."""

    YIELDED = 0
    """One gave way to the other."""
    ORDERED = 1
    """Both are of one vendor, and the one that stood went on when the other had cleared."""
    UNKNOWN = 2
    """Both are of one vendor, and it is not known whether their fleet had ordered it."""


class Interaction(NamedTuple):
    """What is known of a pair at one moment."""

    robot: int
    """Slot of the robot that gave way."""
    other: int
    """Slot of the one that it gave way to."""
    outcome: InteractionOutcome
    swerved: bool
    """It left its way, and did not brake."""
    onset_s: float
    doubt_s: float
    """By how much the onset may be off."""
    speed_mps: float
    """Of the robot at the onset."""
    end_s: float
    """When it went on; inf while it has not."""
    again: bool
    """The pair's last interaction had not been over for `APART_S`: this is more of it."""


@dataclass(slots=True, eq=False)
class _Open:
    """A robot that gives way, and has not gone on."""

    onset_s: float
    doubt_s: float
    speed_mps: float
    swerved: bool
    way: Floats
    """(k, 4) x_m, y_m, yaw_rad and metres from the first, from the onset on."""
    floor: float
    other: int = -1
    """Slot of the robot in its way; -1 while none is found."""
    gap_m: float = inf
    """How much of its way was left to that robot, where it was least."""
    ordered: bool = False
    """Both are of one vendor, so that it hangs on how it ends."""
    settled: bool = False
    again: bool = False
    """It is more of the pair's last interaction."""


class InteractionReports(NamedTuple):
    """n robots of a batch, each of them once. Arrays are (n,) but for two."""

    slot: Ints
    event_s: Floats
    track: Floats
    """(n, k, 4) x_m, y_m, yaw_rad and floor as reported, and as forecast for each whole second from then on, at least
    `AHEAD_S`; nan where that is not known."""
    explained: Bools
    """Whether the robot says why it stands: it charges, is stuck, is driven by hand."""
    usual_m: Floats
    """(n, AHEAD_S) how far forecasts of its kind are usually off so many whole seconds ahead."""


class InteractionFinder:
    """By slot: the newest reports of each robot, and whether it gives way to another."""

    def __init__(self) -> None:
        self._states = np.zeros(0, STATE)
        self._t_s = np.zeros((0, KEPT))
        self._tracks = np.zeros((0, KEPT, AHEAD_S + 1, 3))
        self._floor = np.zeros((0, KEPT))
        self._speed = np.zeros((0, KEPT))
        self._follows = np.zeros((0, KEPT))
        self._open: dict[int, _Open] = {}
        """By slot of the robot that gives way."""
        self._ended_s: dict[tuple[int, int], float] = {}
        """By pair of slots, when its last interaction was over; of those that may go on."""

    def grow(self, slots: int) -> None:
        """Have room for so many robots."""
        more = slots - len(self._states)
        if more > 0:
            for name in ("_states", "_t_s", "_tracks", "_floor", "_speed", "_follows"):
                column = getattr(self, name)
                setattr(self, name, np.concatenate([column, np.zeros((more, *column.shape[1:]), column.dtype)]))

    def forget(self, slots: Iterable[int]) -> None:
        """Other robots have these slots from now on."""
        gone = set(slots)
        for slot in gone:
            self._states[slot] = np.zeros((), STATE)
        self._open = {
            slot: giving for slot, giving in self._open.items() if slot not in gone and giving.other not in gone
        }
        self._ended_s = {pair: ended_s for pair, ended_s in self._ended_s.items() if gone.isdisjoint(pair)}

    def receive(self, reports: InteractionReports, half_m: Floats, levels_m: Floats, vendor: Ints) -> list[Interaction]:
        """Take in reports; the interactions that they show, and those of which they show more.

        By slot are `half_m` (2, slots) half sides, `levels_m` (2, slots) bottom and top, and `vendor` (slots,).
        """
        slots = reports.slot
        findings = follow(
            self._states, self._t_s, self._tracks, self._floor, self._speed, self._follows, slots, reports.event_s,
            reports.track, half_m[1, slots], reports.explained, reports.usual_m,
        )  # fmt: skip
        found = [self._resumed(finding, slots, half_m) for finding in findings if finding["kind"] == RESUMED]
        for finding in findings:
            if finding["kind"] != RESUMED:
                self._begin(finding, int(slots[finding["row"]]))
        if self._open:
            for row, slot in enumerate(slots.tolist()):
                giving = self._open.get(slot)
                if giving and not giving.settled:
                    found.append(self._looked(slot, giving, float(reports.event_s[row]), half_m, levels_m, vendor))
        return [interaction for interaction in found if interaction is not None]

    def giving_way(self) -> dict[int, int]:
        """By slot of each robot that gives way, that of the one that it gives way to."""
        return {slot: giving.other for slot, giving in self._open.items() if giving.other >= 0}

    def _begin(self, finding: Findings, slot: int) -> None:
        place, made = int(finding["onset_place"]), int(finding["forecast_place"])
        x_m, y_m = self._tracks[slot, place, 0, :2]
        way = _way_from(self._tracks[slot, made], x_m, y_m)
        onset_s, doubt_s = float(finding["onset_s"]), float(finding["doubt_s"])
        swerved = int(finding["kind"]) != BRAKED
        floor = float(self._floor[slot, place])
        self._open[slot] = _Open(onset_s, doubt_s, float(finding["speed_mps"]), swerved, way, floor)

    def _looked(
        self, slot: int, giving: _Open, now_s: float, half_m: Floats, levels_m: Floats, vendor: Ints
    ) -> Interaction | None:
        """Look for who is in the way of a robot that gives way; what is new of it."""
        if giving.other < 0:
            giving.other, giving.gap_m = self._in_the_way(slot, giving, now_s, half_m, levels_m)
            if giving.other < 0:
                giving.settled = now_s > giving.onset_s + giving.doubt_s + SEARCHED_S
                return None
            giving.again = self._is_more(slot, giving)
            giving.ordered = bool(vendor[slot] == vendor[giving.other])
            giving.settled = not giving.ordered
            outcome = InteractionOutcome.UNKNOWN if giving.ordered else InteractionOutcome.YIELDED
            return _interaction(slot, giving, outcome)
        giving.settled = now_s > giving.onset_s + SETTLED_S
        return None

    def _resumed(self, finding: Findings, slots: Ints, half_m: Floats) -> Interaction | None:
        """What is known of a robot that goes on."""
        slot, end_s = int(slots[finding["row"]]), float(finding["onset_s"])
        giving = self._open.pop(slot, None)
        if giving is None or giving.other < 0:
            return None
        self._ended_s[_pair(slot, giving.other)] = end_s
        if not giving.ordered:
            return _interaction(slot, giving, InteractionOutcome.YIELDED, end_s)
        if giving.settled:
            return _interaction(slot, giving, InteractionOutcome.UNKNOWN, end_s)
        ahead_m = self._gaps_ahead_m(slot, giving, np.array([end_s]), [giving.other], half_m)[0]
        cleared = ahead_m > giving.gap_m + CLEARED_M
        return _interaction(slot, giving, InteractionOutcome.ORDERED if cleared else InteractionOutcome.YIELDED, end_s)

    def _is_more(self, slot: int, giving: _Open) -> bool:
        """Whether a robot gives way to one with which it has been at odds until lately."""
        for pair, ended_s in list(self._ended_s.items()):
            if ended_s < giving.onset_s - APART_S:
                del self._ended_s[pair]
        back = self._open.get(giving.other)
        return _pair(slot, giving.other) in self._ended_s or (back is not None and back.other == slot)

    def _in_the_way(
        self, slot: int, giving: _Open, now_s: float, half_m: Floats, levels_m: Floats
    ) -> tuple[int, float]:
        """The slot of the robot that is nearest on the way of another, -1 where there is none, and how near."""
        here = self._tracks[slot, self._states["newest"][slot], 0]
        known = np.flatnonzero(self._states["reports"] > 0)
        newest = self._states["newest"][known]
        away_m = np.hypot(*(self._tracks[known, newest, 0, :2] - here[:2]).T)
        reach_m = giving.speed_mps**2 / (2 * BRAKES_MPS2) + BEYOND_M + giving.speed_mps * EARLIER_S
        sizes_m = np.hypot(*half_m[:, known]) + np.hypot(*half_m[:, slot])
        moved_m = self._speed[known, newest] * (now_s - giving.onset_s + EARLIER_S)
        near = (away_m < reach_m + sizes_m + moved_m) & (self._floor[known, newest] == giving.floor) & (known != slot)
        near &= (levels_m[0, known] < levels_m[1, slot]) & (levels_m[0, slot] < levels_m[1, known])
        others = known[near].tolist()
        if not others:
            return -1, inf
        looks_s = np.arange(giving.onset_s - EARLIER_S, max(now_s, giving.onset_s) + 1e-9, LOOK_S)
        gaps_m = self._gaps_ahead_m(slot, giving, looks_s, others, half_m)
        nearest = int(np.argmin(gaps_m))
        return (others[nearest], float(gaps_m[nearest])) if gaps_m[nearest] < inf else (-1, inf)

    def _gaps_ahead_m(self, slot: int, giving: _Open, looks_s: Floats, others: Sequence[int], half_m: Floats) -> Floats:
        """(n,) how much of its way a robot has before it comes to each of `others`, where that is least at the times
        `looks_s` (k,); inf where it does not within its stopping distance and `BEYOND_M`."""
        way = giving.way
        along_m = _along(way, self._poses(slot, looks_s))
        speed_mps = np.gradient(along_m, looks_s).clip(0.0, giving.speed_mps) if len(looks_s) > 1 else np.zeros(1)
        reach_m = speed_mps**2 / (2 * BRAKES_MPS2) + BEYOND_M
        gaps_m = np.empty(len(others))
        for row, other in enumerate(others):
            apart_m = _gaps(self._poses(other, looks_s), way, half_m[:, other], half_m[:, slot])
            gaps_m[row] = _least_ahead(apart_m, way[:, 3], along_m, reach_m)
        return gaps_m

    def _poses(self, slot: int, looks_s: Floats) -> Floats:
        """(n, 3) where a robot was: between its reports, and after the newest by its forecast."""
        state = self._states[slot]
        places = (state["newest"] - np.arange(state["reports"])[::-1]) % KEPT
        newest = self._tracks[slot, state["newest"]]
        t_s = np.concatenate([self._t_s[slot, places], self._t_s[slot, state["newest"]] + np.arange(1, AHEAD_S + 1)])
        poses = np.concatenate([self._tracks[slot, places, 0], newest[1:]])
        columns = [np.interp(looks_s, t_s, poses[:, 0]), np.interp(looks_s, t_s, poses[:, 1])]
        return np.column_stack([*columns, np.interp(looks_s, t_s, np.unwrap(poses[:, 2]))])


def _interaction(slot: int, giving: _Open, outcome: InteractionOutcome, end_s: float = inf) -> Interaction:
    return Interaction(
        slot,
        giving.other,
        outcome,
        giving.swerved,
        giving.onset_s,
        giving.doubt_s,
        giving.speed_mps,
        end_s,
        giving.again,
    )


def _pair(slot: int, other: int) -> tuple[int, int]:
    return min(slot, other), max(slot, other)


def _way_from(track: Floats, x_m: float, y_m: float) -> Floats:
    """(k, 4) the way of a forecast `track` (n, 3) from its place that is nearest, every `WAY_M`: x_m, y_m, yaw_rad and
    metres from there."""
    legs_m = np.hypot(np.diff(track[:, 0]), np.diff(track[:, 1]))
    along_m = np.concatenate([[0.0], np.cumsum(legs_m)])
    at_m = np.arange(0.0, along_m[-1] + WAY_M, WAY_M)
    moves = np.concatenate([[True], legs_m > 0.0])
    yaw_rad = np.unwrap(track[:, 2])
    way = np.column_stack(
        [np.interp(at_m, along_m[moves], column[moves]) for column in (track[:, 0], track[:, 1], yaw_rad)]
    )
    nearest = int(np.argmin(np.hypot(way[:, 0] - x_m, way[:, 1] - y_m)))
    return np.column_stack([way[nearest:], at_m[nearest:] - at_m[nearest]])


def _along(way: Floats, poses: Floats) -> Floats:
    """(n,) how far along a way (k, 4) each of n poses is, never going back."""
    away_m = np.hypot(way[:, None, 0] - poses[None, :, 0], way[:, None, 1] - poses[None, :, 1])
    return np.maximum.accumulate(way[np.argmin(away_m, axis=0), 3])


def _gaps(poses: Floats, way: Floats, half_of_poses: Floats, half_of_way: Floats) -> Floats:
    """(k, n) how far the envelope at each of k places of a way is from one at each of n poses; negative in overlap."""
    k, n = len(way), len(poses)
    dx_m, dy_m = poses[None, :, 0] - way[:, None, 0], poses[None, :, 1] - way[:, None, 1]
    yaw_way, yaw_pose = np.broadcast_to(way[:, None, 2], (k, n)), np.broadcast_to(poses[None, :, 2], (k, n))
    sizes = [np.repeat(half[:, None], k, axis=1) for half in (half_of_way, half_of_poses)]
    return signed_gap(dx_m, dy_m, yaw_way, yaw_pose, *sizes)


def _least_ahead(apart_m: Floats, way_m: Floats, along_m: Floats, reach_m: Floats) -> float:
    """The least way that is left, at any look, to where envelopes come together; inf where none within reach do."""
    least_m = inf
    for look in range(apart_m.shape[1]):
        ahead_m = way_m - along_m[look]
        is_ahead = (ahead_m >= 0.0) & (ahead_m <= reach_m[look])
        column = apart_m[is_ahead, look]
        if not len(column):
            continue
        comes = (column < TOUCHES_M) & (column < column[0] - NEARER_M)
        if comes.any():
            least_m = min(least_m, float(ahead_m[is_ahead][np.argmax(comes)]))
    return least_m
