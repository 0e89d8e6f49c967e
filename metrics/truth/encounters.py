"""Encounters of the recorded motion, found while a log is read, in bounded memory.

The motion of a robot is its reported positions on its floor. If two reports are at most 2.1 s apart, positions between
them are interpolated linearly at 10 Hz. The separation of two robots is that of their shapes and trailers. An encounter
is a maximal run of samples of a pair below a threshold. Two runs are one encounter if the gap is at most 1 s, or if the
separation in the gap stays within `conflict.clear_margin_m` above the threshold. An encounter is foreseeable if both
robots were present for at least 2 s before its start.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from math import floor, inf

import numpy as np

from deconflict.foresight.presence.live_robots import on_foot
from ingest.batch import Batch, Floats, Forecasts, Ints, Pair
from metrics.truth.nearest_scenes import NearestScenes
from metrics.truth.recorded_motion import RecordedMotion, RecordedPlace, SampledMotion
from metrics.truth.separations import Separations, separations
from metrics.truth.silences import Silences

STEP_S = 0.1
BRIDGED = 11
"""Two runs are one encounter if the first sample of the second is at most this many steps after the last of the
first."""
FORESEEABLE_S = 2.0
LAG_S = 3.0
"""All reports about a moment have arrived this long after it."""
STRETCH = 50
"""Samples that are processed together."""


@dataclass(slots=True, eq=False)
class RecordedEncounter:
    """One encounter of a pair below one threshold."""

    pair: Pair
    start_s: float
    """Time of the first sample below the threshold."""
    end_s: float
    """Time of the last one."""
    foreseeable: bool
    """Whether both robots were present for `FORESEEABLE_S` before the start."""
    place: RecordedPlace | None = None
    """The place of one of the two at the start."""


class EncounterFinder:
    """Finds the encounters below each of several thresholds while reports arrive."""

    def __init__(
        self, thresholds_m: Sequence[float], drawn_apart_m: float, most_near: float = inf, *, draws_scenes: bool = True
    ) -> None:
        """A pair has drawn apart `drawn_apart_m` above a threshold: `conflict.clear_margin_m`. `advance` raises
        `TooManyPairsError` if more than `most_near` pairs a robot are near, on average of some samples. Without
        `draws_scenes` there are no `scenes`, which take most of the time where many robots are near each other."""
        self.motion = RecordedMotion()
        self.scenes, self._draws_scenes = NearestScenes(STEP_S), draws_scenes
        self.silences = Silences(self.motion.slots)
        self._below = {threshold_m: ThresholdEncounters(threshold_m, drawn_apart_m) for threshold_m in thresholds_m}
        self._most_near = most_near
        self._next: int | None = None
        """The next sample to process, in steps since the epoch."""
        self._finished = False

    @property
    def until_s(self) -> float:
        """The motion up to this time has been processed."""
        if self._finished:
            return inf
        return -inf if self._next is None else (self._next - 1) * STEP_S

    def add_batch(self, batch: Batch) -> None:
        """Add the reports of a batch. What two people on foot do to each other is nobody's concern."""
        self.silences.on_foot.difference_update(batch.robots)
        self.silences.on_foot.update(on_foot(batch))
        self.report(batch.robots, batch.forecasts, batch.reports_within_s)

    def are_on_foot(self, pair: Pair) -> bool:
        """Whether both of a pair are people on foot."""
        return self.silences.on_foot.issuperset(pair)

    def report(self, robots: Sequence[str], forecasts: Forecasts, reports_within_s: Floats | None = None) -> None:
        """Add the present poses of robots that have reported. These are the first knots of the forecasts.
        `reports_within_s` (n,) as in a batch."""
        self.motion.report(robots, forecasts)
        self.silences.report(robots, forecasts, reports_within_s)
        if self._next is None and len(robots):
            self._next = floor(float(forecasts.t_s[forecasts.start[:-1]].min()) / STEP_S) + 1

    def advance(self, now_s: float) -> None:
        """Process all samples whose reports have arrived, in groups of `STRETCH`."""
        while self._next is not None and (self._next + STRETCH - 1) * STEP_S <= now_s - LAG_S:
            self._process(STRETCH)

    def finish(self) -> None:
        """Process the remaining samples, and end every encounter."""
        last_s = self.motion.newest_s
        self.advance(last_s + LAG_S)
        if self._next is not None:
            self._process(floor(last_s / STEP_S) - self._next + 1)
        self._finished = True
        self.silences.finish()
        for below in self._below.values():
            below.finish()

    def encounters(self, threshold_m: float) -> list[RecordedEncounter]:
        """The encounters that have ended, by start."""
        return sorted(self._below[threshold_m].closed, key=lambda encounter: (encounter.start_s, encounter.pair))

    def by_pair(self, threshold_m: float) -> Mapping[Pair, Sequence[RecordedEncounter]]:
        """The encounters of each pair so far, by start. The last one may not have ended."""
        return self._below[threshold_m].of_pair

    def goes_on(self, threshold_m: float, pair: Pair) -> bool:
        """Whether an encounter of a pair has not ended."""
        return self._below[threshold_m].goes_on(pair)

    def forget(self, pairs: Collection[Pair]) -> None:
        """Forget the encounters of some pairs, of which none goes on."""
        for below in self._below.values():
            below.forget(pairs)

    def _process(self, samples: int) -> None:
        if self._next is None or samples <= 0:
            return
        first, self._next = self._next, self._next + samples
        sampled = self.motion.sampled(first, samples, STEP_S)
        most, within_m = self._most_near * sampled.x_m.size, max(below.apart_m for below in self._below.values())
        near = self._without_people(separations(sampled, within_m, most))
        for below in self._below.values():
            below.advance(near, sampled, self.motion)
        if self._draws_scenes:
            self.scenes.add(sampled, near, self.motion)
        self.silences.find_driven_through(sampled)

    def _without_people(self, near: Separations) -> Separations:
        if not self.silences.on_foot:
            return near
        slots, uuids = np.unique([near.a, near.b]), self.motion.slots.uuids
        people = [slot for slot in slots.tolist() if uuids[slot] in self.silences.on_foot]
        return near.take(np.flatnonzero(~(np.isin(near.a, people) & np.isin(near.b, people))))


class ThresholdEncounters:
    """The encounters below one threshold."""

    def __init__(self, threshold_m: float, drawn_apart_m: float) -> None:
        self.threshold_m, self.apart_m = threshold_m, threshold_m + drawn_apart_m
        self.closed: list[RecordedEncounter] = []
        self.of_pair: dict[Pair, list[RecordedEncounter]] = {}
        self._open: dict[Pair, RecordedEncounter] = {}
        self._together: dict[Pair, int] = {}
        """Pairs within `apart_m` at the last sample, and the sample since which they have been."""

    def advance(self, near: Separations, sampled: SampledMotion, motion: RecordedMotion) -> None:
        """Process the samples of a motion, with the separations of near pairs in it."""
        first, last = sampled.first, sampled.first + sampled.x_m.shape[1] - 1
        near = near.take(np.flatnonzero(near.separation_m <= self.apart_m))
        spans, span_of = _runs(near)
        before, self._together = self._together, {}
        since = near.sample[spans[:, 0]]
        for row, (begin, end) in enumerate(spans.tolist()):
            pair = motion.pair(int(near.a[begin]), int(near.b[begin]))
            if near.sample[begin] == first:
                since[row] = before.get(pair, first)
            if near.sample[end] == last:
                self._together[pair] = int(since[row])
        low = near.separation_m < self.threshold_m if self.threshold_m else near.separation_m <= 0
        rows = np.flatnonzero(low)
        runs, _ = _runs(near.take(rows))
        for begin, end in rows[runs].tolist():
            pair = motion.pair(int(near.a[begin]), int(near.b[begin]))
            place = sampled.place(int(near.a[begin]), int(near.sample[begin]))
            self._add_run(pair, near, begin, end, int(since[span_of[begin]]), place)
        self._close_ended(last)

    def goes_on(self, pair: Pair) -> bool:
        """Whether an encounter of a pair has not ended."""
        return pair in self._open

    def forget(self, pairs: Collection[Pair]) -> None:
        """Forget the encounters of some pairs."""
        self.closed = [encounter for encounter in self.closed if encounter.pair not in pairs]
        for pair in pairs:
            self.of_pair.pop(pair, None)

    def finish(self) -> None:
        self.closed += self._open.values()
        self._open.clear()

    def _add_run(
        self, pair: Pair, near: Separations, begin: int, end: int, together_since: int, place: RecordedPlace
    ) -> None:
        """Add a run of the pair below the threshold, rows `begin` to `end`, which begins at a place."""
        start, end_s = int(near.sample[begin]), int(near.sample[end]) * STEP_S
        known = self._open.get(pair)
        if known is not None:
            last = round(known.end_s / STEP_S)
            if start - last <= BRIDGED or together_since <= last:
                known.end_s = end_s
                return
            self.closed.append(known)
        foreseeable = start * STEP_S - float(near.since_s[begin]) >= FORESEEABLE_S
        encounter = self._open[pair] = RecordedEncounter(pair, start * STEP_S, end_s, foreseeable, place)
        self.of_pair.setdefault(pair, []).append(encounter)

    def _close_ended(self, last: int) -> None:
        for pair, encounter in list(self._open.items()):
            end = round(encounter.end_s / STEP_S)
            if last - end >= BRIDGED and self._together.get(pair, last + 1) > end:
                self.closed.append(self._open.pop(pair))


def _runs(near: Separations) -> tuple[Ints, Ints]:
    """(r, 2) first and last row of each run of one pair at consecutive samples, and (m,) the run of each row."""
    if not len(near.a):
        return np.empty((0, 2), np.int64), np.empty(0, np.int64)
    new = np.ones(len(near.a), bool)
    new[1:] = (np.diff(near.a) != 0) | (np.diff(near.b) != 0) | (np.diff(near.sample) != 1)
    first = np.flatnonzero(new)
    return np.column_stack([first, np.append(first[1:], len(new)) - 1]), np.cumsum(new) - 1
