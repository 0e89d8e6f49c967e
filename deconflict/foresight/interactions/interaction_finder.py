"""Interactions: which robot gave way to which, by what robots report.

A robot gives way if it brakes or swerves against its own forecast (see `progress_kernels`) while another robot is in
its way. The nearest robot ahead of it counts. If both are of one vendor, and it drives on once the other one has
cleared its way, the two followed an order of their fleet. The live service, replays and scores use this same code.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from math import inf
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from deconflict.foresight.interactions.forecast_ways import distance_along, gaps_to, shortest_way_left, way_from
from deconflict.foresight.interactions.progress_kernels import (
    AHEAD_S,
    BRAKED,
    KEPT,
    RESUMED,
    STATE,
    Findings,
    add_reports,
)
from deconflict.foresight.motion_assumptions import BRAKES_MPS2
from deconflict.sweep.geometry.heights import heights_overlap
from deconflict.sweep.robot_slots import lengthen
from ingest.batch import Bools, Floats, Ints

BEYOND_M = 1.0
"""A robot is in the way of another one if it is on that one's way within its stopping distance plus this."""
LOOK_S = 0.5
"""Time between two looks for robots in the way, from the onset on."""
EARLIER_S = 1.0
"""The search for the robot in the way begins this time before the onset, as reports are a second apart."""
SEARCHED_S = 4.0
"""The search for the robot in the way ends this time after the onset."""
CLEARED_M = 0.3
"""The way of a robot is cleared if this much more of it is free than before."""
APART_S = 15.0
"""Interactions of a pair that are less apart in time count as one."""
SETTLED_S = 20.0
"""Within this time after the onset it shows whether a pair of one vendor keeps an order; else it stays unknown."""


class InteractionOutcome(IntEnum):
    """The kind of an interaction."""

    YIELDED = 0
    """One robot gave way to the other."""
    ORDERED = 1
    """Both are of one vendor, and the one that stood drove on when the other had cleared its way."""
    UNKNOWN = 2
    """Both are of one vendor, and it is not known whether they followed an order of their fleet."""


class Interaction(NamedTuple):
    """What is known of a pair at one moment."""

    robot: int
    """Slot of the robot that gave way."""
    other: int
    """Slot of the robot to which it gave way."""
    outcome: InteractionOutcome
    swerved: bool
    """The robot left its way, and did not brake."""
    onset_s: float
    doubt_s: float
    """Uncertainty of the onset."""
    speed_mps: float
    """Of the robot at the onset."""
    end_s: float
    """When the robot drove on; inf while it waits."""
    again: bool
    """The pair's last interaction ended less than `APART_S` before: this one continues it."""


@dataclass(slots=True, eq=False)
class _OpenInteraction:
    """A robot that gives way, and has not driven on."""

    onset_s: float
    doubt_s: float
    speed_mps: float
    swerved: bool
    way: Floats
    """(k, 4) its forecast way from the onset on: x_m, y_m, yaw_rad, and metres from the first place."""
    floor: float
    other: int = -1
    """Slot of the robot in its way, -1 until one is found."""
    gap_m: float = inf
    """The shortest way that was left to that robot."""
    ordered: bool = False
    """Both are of one vendor, so that the end of the interaction decides its kind."""
    settled: bool = False
    """No more is looked for."""
    again: bool = False
    """It continues the pair's last interaction."""


class InteractionReports(NamedTuple):
    """n robots of a batch, each of them once. Arrays are (n,) if not said otherwise."""

    slot: Ints
    event_s: Floats
    track: Floats
    """(n, k, 4) x_m, y_m, yaw_rad and floor: as reported, and as forecast for each whole second after that, at least
    `AHEAD_S`; nan if unknown."""
    explained: Bools
    """Whether the robot says why it stands, such as that it charges or is driven by hand."""
    usual_m: Floats
    """(n, AHEAD_S) usual errors of forecasts of its kind, by whole seconds ahead."""


class ReportedMotion(NamedTuple):
    """The newest `KEPT` reports of each robot, by slot, as views that change with each report."""

    states: NDArray[Any]
    """(slots,) of `STATE`: which report is the newest, and how many are kept."""
    t_s: Floats
    """(slots, KEPT) time of each."""
    tracks: Floats
    """(slots, KEPT, AHEAD_S + 1, 3) x_m, y_m and yaw_rad, as reported and as forecast for each second after that."""
    floor: Floats
    """(slots, KEPT)"""
    speed: Floats
    """(slots, KEPT) speed from the report before."""


class InteractionFinder:
    """By slot: the newest reports of each robot, and whether it gives way to another one."""

    def __init__(self) -> None:
        self._states = np.zeros(0, STATE)
        self._t_s = np.zeros((0, KEPT))
        """(slots, KEPT) time of each kept report."""
        self._tracks = np.zeros((0, KEPT, AHEAD_S + 1, 3))
        """(slots, KEPT, AHEAD_S + 1, 3) x_m, y_m and yaw_rad of each kept report and of its forecast."""
        self._floor = np.zeros((0, KEPT))
        """(slots, KEPT) floor of each kept report."""
        self._speed = np.zeros((0, KEPT))
        """(slots, KEPT) speed from the report before."""
        self._follows = np.zeros((0, KEPT))
        """(slots, KEPT) share of the forecast way that the robot had come since the report before."""
        self._open: dict[int, _OpenInteraction] = {}
        """By slot of the robot that gives way."""
        self._ended_s: dict[tuple[int, int], float] = {}
        """By pair of slots, when its last interaction ended, if that may still continue."""

    def grow(self, slots: int) -> None:
        """Make room for this many slots."""
        more = slots - len(self._states)
        if more > 0:
            lengthen(self, ("_states", "_t_s", "_tracks", "_floor", "_speed", "_follows"), more)

    def forget(self, slots: Iterable[int]) -> None:
        """Other robots have these slots from now on."""
        gone = set(slots)
        for slot in gone:
            self._states[slot] = np.zeros((), STATE)
        self._open = {
            slot: interaction
            for slot, interaction in self._open.items()
            if slot not in gone and interaction.other not in gone
        }
        self._ended_s = {pair: ended_s for pair, ended_s in self._ended_s.items() if gone.isdisjoint(pair)}

    def receive(self, reports: InteractionReports, half_m: Floats, levels_m: Floats, vendor: Ints) -> list[Interaction]:
        """Add reports. Returns the interactions of which they show something new.

        By slot are the half sides `half_m` (2, slots), bottom and top `levels_m` (2, slots), and `vendor` (slots,).
        """
        slots = reports.slot
        findings = add_reports(
            self._states, self._t_s, self._tracks, self._floor, self._speed, self._follows, slots, reports.event_s,
            reports.track, half_m[1, slots], reports.explained, reports.usual_m,
        )  # fmt: skip
        found = [self._finish(finding, slots, half_m) for finding in findings if finding["kind"] == RESUMED]
        for finding in findings:
            if finding["kind"] != RESUMED:
                self._begin(finding, int(slots[finding["row"]]))
        if self._open:
            for row, slot in enumerate(slots.tolist()):
                interaction = self._open.get(slot)
                if interaction and not interaction.settled:
                    found.append(
                        self._update_open(slot, interaction, float(reports.event_s[row]), half_m, levels_m, vendor)
                    )
        return [interaction for interaction in found if interaction is not None]

    @property
    def history(self) -> ReportedMotion:
        return ReportedMotion(self._states, self._t_s, self._tracks, self._floor, self._speed)

    def giving_way(self) -> dict[int, int]:
        """By slot of each robot that gives way, the slot of the robot to which it gives way."""
        return {slot: interaction.other for slot, interaction in self._open.items() if interaction.other >= 0}

    def _begin(self, finding: Findings, slot: int) -> None:
        place, made = int(finding["onset_index"]), int(finding["forecast_index"])
        x_m, y_m = self._tracks[slot, place, 0, :2]
        way = way_from(self._tracks[slot, made], x_m, y_m)
        onset_s, doubt_s = float(finding["onset_s"]), float(finding["doubt_s"])
        swerved = int(finding["kind"]) != BRAKED
        floor = float(self._floor[slot, place])
        self._open[slot] = _OpenInteraction(onset_s, doubt_s, float(finding["speed_mps"]), swerved, way, floor)

    def _update_open(
        self, slot: int, interaction: _OpenInteraction, now_s: float, half_m: Floats, levels_m: Floats, vendor: Ints
    ) -> Interaction | None:
        """Look for the robot in the way of one that gives way. None if nothing is new."""
        if interaction.other < 0:
            interaction.other, interaction.gap_m = self._in_the_way(slot, interaction, now_s, half_m, levels_m)
            if interaction.other < 0:
                interaction.settled = now_s > interaction.onset_s + interaction.doubt_s + SEARCHED_S
                return None
            interaction.again = self._continues(slot, interaction)
            interaction.ordered = bool(vendor[slot] == vendor[interaction.other])
            interaction.settled = not interaction.ordered
            outcome = InteractionOutcome.UNKNOWN if interaction.ordered else InteractionOutcome.YIELDED
            return _interaction(slot, interaction, outcome)
        interaction.settled = now_s > interaction.onset_s + SETTLED_S
        return None

    def _finish(self, finding: Findings, slots: Ints, half_m: Floats) -> Interaction | None:
        """The interaction of a robot that drives on; None if it gave way to no robot."""
        slot, end_s = int(slots[finding["row"]]), float(finding["onset_s"])
        interaction = self._open.pop(slot, None)
        if interaction is None or interaction.other < 0:
            return None
        self._ended_s[_pair(slot, interaction.other)] = end_s
        if not interaction.ordered:
            return _interaction(slot, interaction, InteractionOutcome.YIELDED, end_s)
        if interaction.settled:
            return _interaction(slot, interaction, InteractionOutcome.UNKNOWN, end_s)
        ahead_m = self._gaps_ahead_m(slot, interaction, np.array([end_s]), [interaction.other], half_m)[0]
        cleared = ahead_m > interaction.gap_m + CLEARED_M
        return _interaction(
            slot, interaction, InteractionOutcome.ORDERED if cleared else InteractionOutcome.YIELDED, end_s
        )

    def _continues(self, slot: int, interaction: _OpenInteraction) -> bool:
        """Whether an interaction continues the last one of the same pair."""
        for pair, ended_s in list(self._ended_s.items()):
            if ended_s < interaction.onset_s - APART_S:
                del self._ended_s[pair]
        back = self._open.get(interaction.other)
        return _pair(slot, interaction.other) in self._ended_s or (back is not None and back.other == slot)

    def _in_the_way(
        self, slot: int, interaction: _OpenInteraction, now_s: float, half_m: Floats, levels_m: Floats
    ) -> tuple[int, float]:
        """The slot of the robot that is nearest on the way of another one, and the way to it; (-1, inf) if there is
        none."""
        here = self._tracks[slot, self._states["newest"][slot], 0]
        known = np.flatnonzero(self._states["reports"] > 0)
        newest = self._states["newest"][known]
        away_m = np.hypot(*(self._tracks[known, newest, 0, :2] - here[:2]).T)
        reach_m = interaction.speed_mps**2 / (2 * BRAKES_MPS2) + BEYOND_M + interaction.speed_mps * EARLIER_S
        sizes_m = np.hypot(*half_m[:, known]) + np.hypot(*half_m[:, slot])
        moved_m = self._speed[known, newest] * (now_s - interaction.onset_s + EARLIER_S)
        near = (
            (away_m < reach_m + sizes_m + moved_m) & (self._floor[known, newest] == interaction.floor) & (known != slot)
        )
        near &= heights_overlap(*levels_m[:, known], *levels_m[:, slot])
        others = known[near].tolist()
        if not others:
            return -1, inf
        looks_s = np.arange(interaction.onset_s - EARLIER_S, max(now_s, interaction.onset_s) + 1e-9, LOOK_S)
        gaps_m = self._gaps_ahead_m(slot, interaction, looks_s, others, half_m)
        nearest = int(np.argmin(gaps_m))
        return (others[nearest], float(gaps_m[nearest])) if gaps_m[nearest] < inf else (-1, inf)

    def _gaps_ahead_m(
        self, slot: int, interaction: _OpenInteraction, looks_s: Floats, others: Sequence[int], half_m: Floats
    ) -> Floats:
        """(n,) the shortest way that a robot has left to each of the robots `others`, at any of the times `looks_s`
        (k,); inf if it does not reach that robot within its stopping distance plus `BEYOND_M`."""
        way = interaction.way
        along_m = distance_along(way, self._poses(slot, looks_s))
        speed_mps = np.gradient(along_m, looks_s).clip(0.0, interaction.speed_mps) if len(looks_s) > 1 else np.zeros(1)
        reach_m = speed_mps**2 / (2 * BRAKES_MPS2) + BEYOND_M
        gaps_m = np.empty(len(others))
        for row, other in enumerate(others):
            apart_m = gaps_to(self._poses(other, looks_s), way, half_m[:, other], half_m[:, slot])
            gaps_m[row] = shortest_way_left(apart_m, way[:, 3], along_m, reach_m)
        return gaps_m

    def _poses(self, slot: int, looks_s: Floats) -> Floats:
        """(n, 3) poses of a robot at these times: between its reports, and after the newest one by its forecast."""
        state = self._states[slot]
        places = (state["newest"] - np.arange(state["reports"])[::-1]) % KEPT
        newest = self._tracks[slot, state["newest"]]
        t_s = np.concatenate([self._t_s[slot, places], self._t_s[slot, state["newest"]] + np.arange(1, AHEAD_S + 1)])
        poses = np.concatenate([self._tracks[slot, places, 0], newest[1:]])
        columns = [np.interp(looks_s, t_s, poses[:, 0]), np.interp(looks_s, t_s, poses[:, 1])]
        return np.column_stack([*columns, np.interp(looks_s, t_s, np.unwrap(poses[:, 2]))])


def _interaction(
    slot: int, interaction: _OpenInteraction, outcome: InteractionOutcome, end_s: float = inf
) -> Interaction:
    return Interaction(
        slot,
        interaction.other,
        outcome,
        interaction.swerved,
        interaction.onset_s,
        interaction.doubt_s,
        interaction.speed_mps,
        end_s,
        interaction.again,
    )


def _pair(slot: int, other: int) -> tuple[int, int]:
    return min(slot, other), max(slot, other)
