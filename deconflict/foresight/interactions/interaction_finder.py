"""Interactions: which robot gave way to which, by what robots report.

A robot gives way if it brakes or swerves against its own forecast (see `progress_kernels`) while another robot is in
its way. The nearest robot ahead of it counts. If both are of one vendor, and it drives on once the other one has
cleared its way, the two followed an order of their fleet. The live service, replays and scores use this same code.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from math import inf
from typing import NamedTuple, Self

import numpy as np
import shapely

from deconflict.foresight.interactions.progress_kernels import BRAKED, RESUMED, Findings
from deconflict.foresight.interactions.recent_reports import InteractionReports, RecentReports
from deconflict.foresight.interactions.way_kernels import BEYOND_M
from deconflict.foresight.motion_assumptions import BRAKES_MPS2
from deconflict.sweep.geometry.heights import heights_overlap
from ingest.batch import Floats, Ints

WAY_M = 0.15
"""Distance between two samples of a way."""
LOOK_S = 0.5
"""Time between two looks for robots in the way, from the onset on."""
EARLIER_S = 1.0
"""The search for the robot in the way begins this time before the onset, as reports are a second apart."""
SEARCHED_S = 4.0
"""The search for the robot in the way ends this time after the onset."""
CLEARED_M = 0.3
"""The way of a robot is cleared if this much more of it is free than before."""
APART_S, FORGOTTEN_S = 15.0, 60.0
"""Interactions of a pair that are less apart in time count as one. Until then at least an ended one is known."""
FASTEST_MPS, MOST_NEAR = 10.0, 32
"""No robot drives faster: what seems to has jumped. And no more bodies than this have room so near to one."""
SETTLED_S = 20.0
"""Within this time after the onset it shows whether a pair of one vendor keeps an order; else it stays unknown."""


class _Bodies(NamedTuple):
    """All robots, as in `RecentReports.places`; by slot half sides and levels as in `InteractionFinder.receive`."""

    half_m: Floats
    levels_m: Floats
    known: Ints
    place: Floats
    speed_mps: Floats
    radius_m: Floats
    """(n,) of the circle around each."""
    tree: shapely.STRtree
    """Their places."""

    @classmethod
    def of(cls, places: tuple[Ints, Floats, Floats], half_m: Floats, levels_m: Floats) -> Self:
        known, place, speed_mps = places
        tree = shapely.STRtree(shapely.points(place[:, :2]))
        radius_m = np.hypot(*half_m[:, known])
        return cls(half_m, levels_m, known, place, np.minimum(speed_mps, FASTEST_MPS), radius_m, tree)

    def within(self, own: int, reach_m: float, for_s: float) -> tuple[Ints, Floats]:
        """(n,) the rows of the others, ascending, whose bodies may have been within a distance of that of the row `own`
        in a time; and how far away their places are."""
        most_m = reach_m + float(self.radius_m[own] + self.radius_m.max() + self.speed_mps.max() * for_s)
        rows = np.sort(self.tree.query(shapely.Point(self.place[own, :2]), "dwithin", most_m))
        away_m = np.hypot(*(self.place[rows, :2] - self.place[own, :2]).T)
        is_near = away_m < reach_m + self.radius_m[own] + self.radius_m[rows] + self.speed_mps[rows] * for_s
        is_near &= rows != own
        return rows[is_near], away_m[is_near]


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


class InteractionFinder:
    """By slot: whether a robot gives way to another one."""

    def __init__(self) -> None:
        self.recent = RecentReports()
        """The reports that are kept."""
        self._open: dict[int, _OpenInteraction] = {}
        """By slot of the robot that gives way."""
        self._ended_s: dict[tuple[int, int], float] = {}
        """By pair of slots, when its last interaction ended, if that may still continue."""

    def grow(self, slots: int) -> None:
        """Make room for this many slots."""
        self.recent.grow(slots)

    def forget(self, slots: Iterable[int]) -> None:
        """Other robots have these slots from now on."""
        gone = set(slots)
        self.recent.release(np.array([*gone], np.int64))
        self._open = {
            slot: interaction
            for slot, interaction in self._open.items()
            if slot not in gone and interaction.other not in gone
        }
        self._ended_s = {pair: ended_s for pair, ended_s in self._ended_s.items() if gone.isdisjoint(pair)}

    def rest(self, slots: Ints) -> list[Interaction]:
        """These robots have been silent for long, and stand where their forecasts ended. Of their reports nothing else
        is kept. Returns the interactions that end with that."""
        ended = list[Interaction]()
        slots, end_s = self.recent.rest(slots)
        for slot, at_s in zip(slots.tolist(), end_s.tolist(), strict=True):
            interaction = self._open.pop(slot, None)
            if interaction and interaction.other >= 0:
                outcome = InteractionOutcome.UNKNOWN if interaction.ordered else InteractionOutcome.YIELDED
                ended.append(_interaction(slot, interaction, outcome, max(at_s, interaction.onset_s)))
        return ended

    def receive(self, reports: InteractionReports, half_m: Floats, levels_m: Floats, vendor: Ints) -> list[Interaction]:
        """Add reports. Returns the interactions of which they show something new.

        By slot are the half sides `half_m` (2, slots), bottom and top `levels_m` (2, slots), and `vendor` (slots,).
        """
        slots = reports.slot
        findings = self.recent.add(reports, half_m[1, slots])
        found = [self._finish(finding, slots, half_m) for finding in findings if finding["kind"] == RESUMED]
        for finding in findings:
            if finding["kind"] != RESUMED and finding["speed_mps"] <= FASTEST_MPS:
                self._begin(finding, int(slots[finding["row"]]))
        if self._ended_s and len(slots):
            since_s = float(reports.event_s.max()) - FORGOTTEN_S
            self._ended_s = {pair: ended_s for pair, ended_s in self._ended_s.items() if ended_s >= since_s}
        heard_s = dict(zip(slots.tolist(), reports.event_s.tolist(), strict=True))
        unsettled = [slot for slot in heard_s if slot in self._open and not self._open[slot].settled]
        if unsettled:
            bodies = _Bodies.of(self.recent.places(), half_m, levels_m)
            found += [self._update_open(slot, self._open[slot], heard_s[slot], bodies, vendor) for slot in unsettled]
        return [interaction for interaction in found if interaction is not None]

    def giving_way(self) -> dict[int, int]:
        """By slot of each robot that gives way, the slot of the robot to which it gives way."""
        return {slot: interaction.other for slot, interaction in self._open.items() if interaction.other >= 0}

    def _begin(self, finding: Findings, slot: int) -> None:
        place, made, row = int(finding["onset_index"]), int(finding["forecast_index"]), self.recent.rows.of_slot[slot]
        tracks = self.recent.tracks[row]
        way = way_from(tracks[made], *tracks[place, 0, :2])
        onset_s, doubt_s = float(finding["onset_s"]), float(finding["doubt_s"])
        swerved = int(finding["kind"]) != BRAKED
        floor = float(self.recent.floor[row, place])
        self._open[slot] = _OpenInteraction(onset_s, doubt_s, float(finding["speed_mps"]), swerved, way, floor)

    def _update_open(
        self, slot: int, interaction: _OpenInteraction, now_s: float, bodies: _Bodies, vendor: Ints
    ) -> Interaction | None:
        """Look for the robot in the way of one that gives way. None if nothing is new."""
        if interaction.other < 0:
            interaction.other, interaction.gap_m = self._in_the_way(slot, interaction, now_s, bodies)
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
        of_way = interaction.way, interaction.speed_mps, half_m
        left_m = self.recent.ways_left_m(slot, np.array([interaction.other]), np.array([end_s]), *of_way)
        cleared = left_m[0] > interaction.gap_m + CLEARED_M
        return _interaction(
            slot, interaction, InteractionOutcome.ORDERED if cleared else InteractionOutcome.YIELDED, end_s
        )

    def _continues(self, slot: int, interaction: _OpenInteraction) -> bool:
        """Whether an interaction continues the last one of the same pair."""
        back, ended_s = self._open.get(interaction.other), self._ended_s.get(_pair(slot, interaction.other), -inf)
        return ended_s >= interaction.onset_s - APART_S or (back is not None and back.other == slot)

    def _in_the_way(self, slot: int, interaction: _OpenInteraction, now_s: float, bodies: _Bodies) -> tuple[int, float]:
        """The slot of the robot that is nearest on the way of another one, and the way to it; (-1, inf) if there is
        none."""
        known, own = bodies.known, int(np.searchsorted(bodies.known, slot))
        if own == len(known) or known[own] != slot:  # it has rested since, and its reports are no longer kept
            return -1, inf
        reach_m = interaction.speed_mps**2 / (2 * BRAKES_MPS2) + BEYOND_M + interaction.speed_mps * EARLIER_S
        rows, away_m = bodies.within(own, reach_m, now_s - interaction.onset_s + EARLIER_S)
        may_meet = heights_overlap(*bodies.levels_m[:, known[rows]], *bodies.levels_m[:, slot])
        may_meet &= bodies.place[rows, 2] == interaction.floor
        rows, away_m = rows[may_meet], away_m[may_meet]
        if len(rows) > MOST_NEAR:
            rows = np.sort(rows[np.argpartition(away_m, MOST_NEAR)[:MOST_NEAR]])
        others = known[rows]
        if not len(others):
            return -1, inf
        looks_s = np.arange(interaction.onset_s - EARLIER_S, max(now_s, interaction.onset_s) + 1e-9, LOOK_S)
        left_m = self.recent.ways_left_m(slot, others, looks_s, interaction.way, interaction.speed_mps, bodies.half_m)
        nearest = int(np.argmin(left_m))
        return (int(others[nearest]), float(left_m[nearest])) if left_m[nearest] < inf else (-1, inf)


def way_from(track: Floats, x_m: float, y_m: float) -> Floats:
    """(k, 4) the way of a forecast `track` (n, 3) from its place nearest to (x_m, y_m) on, every `WAY_M`: x_m, y_m,
    yaw_rad and metres from there."""
    legs_m = np.hypot(track[1:, 0] - track[:-1, 0], track[1:, 1] - track[:-1, 1])
    along_m = np.concatenate([[0.0], np.cumsum(legs_m)])
    at_m = np.arange(0.0, along_m[-1] + WAY_M, WAY_M)
    moves = np.concatenate([[True], legs_m > 0.0])
    columns = track[moves, 0], track[moves, 1], np.unwrap(track[:, 2])[moves]
    x, y, yaw_rad = (np.interp(at_m, along_m[moves], column) for column in columns)
    nearest = int(np.argmin(np.hypot(x - x_m, y - y_m)))
    return np.stack([x, y, yaw_rad, at_m - at_m[nearest]], axis=1)[nearest:]


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
