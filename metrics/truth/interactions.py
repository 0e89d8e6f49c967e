"""Who gave way to whom in a log, found from its reports by the code that the service learns from."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import repeat
from math import inf
from typing import Any

import numpy as np

from deconflict.foresight.forecast_errors.pose_sampling import poses_at
from deconflict.foresight.interactions.interaction_finder import Interaction, InteractionFinder, InteractionOutcome
from deconflict.foresight.interactions.progress_kernels import AHEAD_S, SPARSE_S
from deconflict.foresight.interactions.report_progress import interaction_reports
from ingest.batch import Batch, Floats, Ints, Pair
from ingest.kernels import ready
from metrics.truth.placebo import Placebo

LOOKS_S: Floats = np.arange(AHEAD_S + 1.0)
"""So long after each report its forecast is looked at."""


@dataclass(slots=True, eq=False)
class YieldEvent:
    """One robot that gave way to another, as far as is known."""

    robot: str
    other: str
    outcome: InteractionOutcome
    onset_s: float
    doubt_s: float
    """By how much the onset may be off."""
    end_s: float
    """When it went on; inf while it has not."""
    is_more: bool
    """It is more of the pair's last interaction."""
    is_sparse: bool
    """It shows in reports that are more than `SPARSE_S` apart."""

    @property
    def pair(self) -> Pair:
        return (self.robot, self.other) if self.robot < self.other else (self.other, self.robot)


class Interactions:
    """As reports come in. Memory holds the newest reports of each robot, and a few numbers for each interaction."""

    def __init__(self) -> None:
        self.by_pair: dict[Pair, list[YieldEvent]] = {}
        """By onset."""
        self.placebo = Placebo()
        self._finder = InteractionFinder()
        self._slots: dict[str, int] = {}
        self._names: list[str] = []
        self._spare: list[int] = []
        self._half_m = np.zeros((2, 0))
        self._levels_m = np.zeros((2, 0))
        """Bottom and top."""
        self._vendor = np.zeros(0, np.int64)
        self._vendors: dict[str, int] = {}
        self._heard_s = np.zeros(0)
        """When the newest report was true."""
        self._gap_s = np.zeros(0)
        """From the report before to the newest."""
        self._open: dict[int, YieldEvent] = {}
        """By slot of the robot that gives way and has not gone on."""

    def add_batch(self, batch: Batch, usual_m: Floats) -> None:
        """Take in the n robots of a batch, whose forecasts are usually off by `usual_m` (n, AHEAD_S), so many whole
        seconds ahead."""
        if batch.gone:
            self._forget(batch.gone)
        if not len(batch):
            return
        slots, told = self._slots_of(batch.robots), batch.forecasts
        self._half_m[:, slots] = told.length_m / 2, told.width_m / 2
        self._levels_m[:, slots] = told.bottom_m, told.top_m
        self._vendor[slots] = [self._vendors.setdefault(vendor, len(self._vendors)) for vendor in batch.vendors]
        self._hear(slots, batch.event_s)
        reports = interaction_reports(batch, slots, poses_at(told, ready(batch.event_s), LOOKS_S), usual_m)
        self.placebo.keep(reports)
        for interaction in self._finder.receive(reports, self._half_m, self._levels_m, self._vendor):
            self._note(interaction)
        self._end_what_is_over()

    def figures(self) -> dict[str, Any]:
        """How many interactions were found, and how far that is to be trusted."""
        found = [one for of_pair in self.by_pair.values() for one in of_pair]
        counts = {outcome.name.lower(): sum(one.outcome is outcome for one in found) for outcome in InteractionOutcome}
        sparse = sum(one.is_sparse for one in found)
        return {
            "found": len(found),
            **counts,
            "more_of_the_last": sum(one.is_more for one in found),
            "sparse": sparse,
            "sparse_share": sparse / len(found) if found else None,
            "doubt_s": float(np.median([one.doubt_s for one in found])) if found else None,
            "placebo": self.placebo.figures(),
        }

    def _hear(self, slots: Ints, event_s: Floats) -> None:
        gap_s = event_s - self._heard_s[slots]
        newer = gap_s > 0.0
        self._gap_s[slots[newer]], self._heard_s[slots[newer]] = gap_s[newer], event_s[newer]

    def _note(self, interaction: Interaction) -> None:
        slot, other = interaction.robot, self._names[interaction.other]
        gave_way = self._open.get(slot)
        if gave_way is None or gave_way.onset_s != interaction.onset_s or gave_way.other != other:
            gave_way = self._begin(interaction)
        gave_way.outcome, gave_way.end_s = interaction.outcome, interaction.end_s
        if interaction.end_s < inf:
            del self._open[slot]

    def _begin(self, interaction: Interaction) -> YieldEvent:
        """An interaction that was not known."""
        slot = interaction.robot
        before = self._open.get(slot)
        if before is not None:
            before.end_s = interaction.onset_s
        gave_way = YieldEvent(
            self._names[slot],
            self._names[interaction.other],
            interaction.outcome,
            interaction.onset_s,
            interaction.doubt_s,
            inf,
            interaction.again,
            bool(self._gap_s[slot] > SPARSE_S),
        )
        self._open[slot] = gave_way
        self.by_pair.setdefault(gave_way.pair, []).append(gave_way)
        self.placebo.look(interaction, self._half_m, self._levels_m)
        return gave_way

    def _end_what_is_over(self) -> None:
        """End the interactions of robots that have braked anew before they went on, or that are gone."""
        if not self._open:
            return
        giving_way = self._finder.giving_way()
        for slot, gave_way in list(self._open.items()):
            other = giving_way.get(slot, -1)
            if other < 0 or self._names[other] != gave_way.other:
                gave_way.end_s = max(float(self._heard_s[slot]), gave_way.onset_s)
                del self._open[slot]

    def _slots_of(self, robots: Sequence[str]) -> Ints:
        slots = np.fromiter(map(self._slots.get, robots, repeat(-1)), np.int64, len(robots))
        for row in np.flatnonzero(slots < 0).tolist():
            slots[row] = self._slot(robots[row])
        return slots

    def _slot(self, robot: str) -> int:
        """A new robot's own."""
        if self._spare:
            slot = self._spare.pop()
            self._names[slot] = robot
        else:
            slot = len(self._names)
            self._names.append(robot)
            if slot >= len(self._heard_s):
                self._grow(max(2 * slot, 16))
        self._slots[robot], self._heard_s[slot] = slot, -inf
        return slot

    def _grow(self, slots: int) -> None:
        more = slots - len(self._heard_s)
        for name in ("_half_m", "_levels_m", "_vendor", "_heard_s", "_gap_s"):
            column = getattr(self, name)
            setattr(self, name, np.concatenate([column, np.zeros((*column.shape[:-1], more), column.dtype)], axis=-1))
        self._finder.grow(slots)

    def _forget(self, robots: Iterable[str]) -> None:
        slots = [self._slots.pop(robot) for robot in robots if robot in self._slots]
        if slots:
            self._finder.forget(slots)
            self.placebo.forget(slots)
            self._end_what_is_over()
            self._spare.extend(slots)
