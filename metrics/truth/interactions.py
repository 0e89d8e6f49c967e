"""Interactions in a log: which robot yielded to which. Found in its reports by the same code that the service uses."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np

from deconflict.foresight.interactions.interaction_finder import Interaction, InteractionFinder, InteractionOutcome
from deconflict.foresight.interactions.progress_kernels import AHEAD_S
from deconflict.foresight.interactions.recent_reports import interaction_reports
from deconflict.foresight.motion_assumptions import JOINED_S
from deconflict.sweep.geometry.pose import poses_at
from deconflict.sweep.robot_slots import RobotSlots, lengthen
from ingest.batch import Batch, Floats, Ints, Pair
from ingest.kernels import ready
from metrics.truth.placebo import Placebo
from metrics.truth.recorded_motion import RecordedPlace

LOOKS_S: Floats = np.arange(AHEAD_S + 1.0)
"""Times after each report at which its forecast is sampled."""
_COLUMNS = "_half_m", "_levels_m", "_place", "_vendor", "_heard_s", "_gap_s"
"""Arrays by slot."""


@dataclass(slots=True, eq=False)
class YieldEvent:
    """One robot yielded to another."""

    robot: str
    """UUID of the robot that yielded."""
    other: str
    """UUID of the other robot."""
    outcome: InteractionOutcome
    onset_s: float
    """When it began to yield."""
    doubt_s: float
    """Uncertainty of the onset."""
    end_s: float
    """When it drove on; inf until then."""
    is_more: bool
    """Whether it continues the pair's last interaction."""
    is_sparse: bool
    """Whether the robot's reports were more than `JOINED_S` apart."""
    place: RecordedPlace
    """Where it was when it was seen to yield."""

    @property
    def pair(self) -> Pair:
        return (self.robot, self.other) if self.robot < self.other else (self.other, self.robot)


class Interactions:
    """Finds interactions while batches arrive. Keeps the newest reports of each robot, and a few numbers for each
    interaction."""

    def __init__(self, placebo: Placebo | None = None) -> None:
        """`placebo` tests what is found, for the figures."""
        self.by_pair: dict[Pair, list[YieldEvent]] = {}
        """In the order of onset."""
        self._placebo = placebo
        self._finder = InteractionFinder()
        self._slots = RobotSlots()
        self._half_m = np.zeros((2, 0))
        self._levels_m = np.zeros((2, 0))
        """Bottom and top."""
        self._place = np.zeros((3, 0))
        """Floor, x and y of the newest report."""
        self._vendor = np.zeros(0, np.int64)
        self._vendors: dict[str, int] = {}
        self._heard_s = np.zeros(0)
        """When the newest report was true."""
        self._gap_s = np.zeros(0)
        """From the report before to the newest."""
        self._open: dict[int, YieldEvent] = {}
        """By slot of a robot that yields and has not driven on."""

    def add_batch(self, batch: Batch, usual_m: Floats) -> None:
        """Add the n robots of a batch. `usual_m` (n, AHEAD_S) are the usual errors of their forecasts by whole seconds
        ahead."""
        if batch.gone:
            self._forget(batch.gone)
        if not len(batch):
            return
        slots, forecasts = self._slots_of(batch.robots), batch.forecasts
        self._half_m[:, slots] = forecasts.length_m / 2, forecasts.width_m / 2
        self._levels_m[:, slots] = forecasts.bottom_m, forecasts.top_m
        at = forecasts.start[:-1]
        self._place[:, slots] = forecasts.floor[at], forecasts.x_m[at], forecasts.y_m[at]
        self._vendor[slots] = [self._vendors.setdefault(vendor, len(self._vendors)) for vendor in batch.vendors]
        self._update_times(slots, batch.event_s)
        reports = interaction_reports(batch, slots, poses_at(forecasts, ready(batch.event_s), LOOKS_S), usual_m)
        if self._placebo:
            self._placebo.add_reports(reports)
        for interaction in self._finder.receive(reports, self._half_m, self._levels_m, self._vendor):
            self._update_event(interaction)
        self._end_finished()

    def figures(self) -> dict[str, Any]:
        """The number of interactions found, and figures of their reliability."""
        events = [event for of_pair in self.by_pair.values() for event in of_pair]
        counts = {
            outcome.name.lower(): sum(event.outcome is outcome for event in events) for outcome in InteractionOutcome
        }
        sparse = sum(event.is_sparse for event in events)
        return {
            "found": len(events),
            **counts,
            "more_of_the_last": sum(event.is_more for event in events),
            "sparse": sparse,
            "sparse_share": sparse / len(events) if events else None,
            "doubt_s": float(np.median([event.doubt_s for event in events])) if events else None,
            "placebo": self._placebo.figures() if self._placebo else None,
        }

    def _update_times(self, slots: Ints, event_s: Floats) -> None:
        gap_s = event_s - self._heard_s[slots]
        newer = gap_s > 0.0
        self._gap_s[slots[newer]], self._heard_s[slots[newer]] = gap_s[newer], event_s[newer]

    def _update_event(self, interaction: Interaction) -> None:
        slot, other = interaction.robot, self._slots.uuids[interaction.other]
        event = self._open.get(slot)
        if event is None or event.onset_s != interaction.onset_s or event.other != other:
            event = self._begin(interaction)
        event.outcome, event.end_s = interaction.outcome, interaction.end_s
        if interaction.end_s < inf:
            del self._open[slot]

    def _begin(self, interaction: Interaction) -> YieldEvent:
        """Add a new interaction."""
        slot = interaction.robot
        before = self._open.get(slot)
        if before is not None:
            before.end_s = interaction.onset_s
        event = YieldEvent(
            self._slots.uuids[slot],
            self._slots.uuids[interaction.other],
            interaction.outcome,
            interaction.onset_s,
            interaction.doubt_s,
            inf,
            interaction.again,
            bool(self._gap_s[slot] > JOINED_S),
            RecordedPlace(int(self._place[0, slot]), float(self._place[1, slot]), float(self._place[2, slot])),
        )
        self._open[slot] = event
        self.by_pair.setdefault(event.pair, []).append(event)
        if self._placebo:
            self._placebo.check(interaction, self._half_m, self._levels_m)
        return event

    def _end_finished(self) -> None:
        """End the interactions of robots that braked again before they drove on, or that are gone."""
        if not self._open:
            return
        giving_way = self._finder.giving_way()
        for slot, event in list(self._open.items()):
            other = giving_way.get(slot, -1)
            if other < 0 or self._slots.uuids[other] != event.other:
                event.end_s = max(float(self._heard_s[slot]), event.onset_s)
                del self._open[slot]

    def _slots_of(self, robots: Sequence[str]) -> Ints:
        slots, new = self._slots.assign(robots)
        if (more := len(self._slots) - len(self._heard_s)) > 0:
            lengthen(self, _COLUMNS, max(more, len(self._heard_s), 16), axis=-1)
            self._finder.grow(len(self._heard_s))
        self._heard_s[slots[new]] = -inf
        return slots

    def _forget(self, robots: Iterable[str]) -> None:
        slots = self._slots.release(robots).tolist()
        if slots:
            self._finder.forget(slots)
            if self._placebo:
                self._placebo.forget(slots)
            self._end_finished()
