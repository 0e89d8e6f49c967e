"""The judged alerts and outcomes of a floor, from which the figures are computed."""

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from enum import IntEnum
from math import ceil, floor, inf
from typing import Self
from zlib import crc32

import numpy as np

from benchmarks.planned_floors.logs.reports import Robot
from benchmarks.planned_floors.scoring.alerts import Alert
from benchmarks.planned_floors.scoring.presence import Presence, Silences
from benchmarks.planned_floors.truth.encounters import Encounter, Pair
from benchmarks.planned_floors.truth.floor_truth import FloorTruth
from benchmarks.planned_floors.truth.motion import STEP_S
from benchmarks.planned_floors.truth.outcomes import Happenings
from ingest.batch import Floats
from metrics.scoring.bootstrap import GROUPS

WITHIN_S = 10.0
"""An alert is true if an outcome follows within this time."""
LEADS_S = (0.0, 2.0, 4.0, 6.0)
MINUTE_S = 60.0

Sample = tuple[Pair, float, float]
"""A pair, a time, and the probability that was published for the pair at that time."""


class Verdict(IntEnum):
    """The outcome of an alert, or of one second of it."""

    TRUE = 0
    IN_VAIN = 1
    UNKNOWN = 2
    """A robot left, or the log ended, before an outcome."""
    IN_PROGRESS = 3
    """The pair was already in each other's way."""


@dataclass(frozen=True, slots=True, eq=False)
class Cases:
    """The judged cases of one floor, or of several joined."""

    stops: Floats
    """(n, 5) of each fresh stop, 1 where an alert was raised at least 0, 2, 4 and 6 s before its onset and stands at
    it; last, 1 where any alert stood in the 10 s before."""
    encounters: Floats
    """(n, 5) the same of natural encounters."""
    outcomes: Floats
    """(n, 5) the same of both, each outcome of a pair once."""
    silent: Floats
    """(n, 5) the same of outcomes with a robot that was there and had been silent for longer than its limit."""
    standing: Floats
    """(n, 5) of these, those with a silent robot that had stood since it made its last report."""
    silent_seconds: Floats
    """(n, 2) of each second of each silent robot, 1 where it was there; 1 where it had stood since its last report."""
    passes: Floats
    """(n, 1) 1 if two robots that passed each other had an alert."""
    verdicts: Floats
    """(alerts, 1) `Verdict` of each."""
    seconds: Floats
    """(alerts, 4) whole seconds of each alert by `Verdict`."""
    gone: Floats
    """(alerts, 1) 1 where a robot of it had left, and been silent for longer than its limit, when it was raised."""
    minutes: Floats
    """(minutes, 3) alerts raised, seconds that alerts stood, seconds that robots were there."""
    probabilities: Floats
    """(n, 3) each probability that was published for a pair that was not in progress, once a second; 1 where an outcome
    followed within 10 s, else 0; the group of pairs of one floor that the pair is in. What is not known is left out."""
    two_s_ahead: Floats
    """(n, 1) the probability of each outcome's pair 2 s before its onset, 0 where none was published; without any rows
    where no probabilities were published at all."""

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        joined = {field.name: np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(cls)}
        floor_of = np.repeat(np.arange(len(parts)), [len(part.probabilities) for part in parts])
        most = joined["probabilities"][:, 2].max(initial=0.0) + 1
        joined["probabilities"][:, 2] += floor_of * most
        return cls(**joined)


class Judge:
    """Judges the alerts and probabilities of one floor. Events before `from_s` are not scored."""

    def __init__(self, truth: FloorTruth, happened: Happenings, robots: list[Robot], from_s: float) -> None:
        self._truth, self._happened, self._from_s = truth, happened, from_s
        self._presence, self._silences = Presence(truth), Silences(robots)
        self._outcomes = [
            outcome for of_pair in happened.outcomes.values() for outcome in of_pair if outcome.onset_s >= from_s
        ]

    def cases(self, alerts: list[Alert], samples: Sequence[Sample]) -> Cases:
        by_pair: dict[Pair, list[Alert]] = {}
        for alert in alerts:
            by_pair.setdefault(alert.pair, []).append(alert)
        scored = [alert for alert in alerts if alert.raised_s >= self._from_s]
        seconds = [self._seconds(alert) for alert in scored]
        credited = _credited(by_pair, self._happened)
        verdicts = [_verdict(alert in credited, counts) for alert, counts in zip(scored, seconds, strict=True)]
        silent = [
            outcome
            for outcome in self._outcomes
            if any(self._silences.silent(robot, outcome.onset_s) for robot in outcome.pair)
        ]
        standing = [
            outcome for outcome in silent if any(self._stands_silent(robot, outcome.onset_s) for robot in outcome.pair)
        ]
        return Cases(
            stops=self._warned([(stop.pair, stop.start_s) for stop in self._happened.stops], by_pair),
            encounters=self._warned([(met.pair, met.start_s) for met in self._happened.encounters], by_pair),
            outcomes=self._warned(self._happened.warnable, by_pair),
            silent=self._warned([(outcome.pair, outcome.onset_s) for outcome in silent], by_pair),
            standing=self._warned([(outcome.pair, outcome.onset_s) for outcome in standing], by_pair),
            silent_seconds=self._silent_seconds(),
            passes=_column(
                [_alerted(passed, by_pair) for passed in self._happened.passes if passed.start_s >= self._from_s]
            ),
            verdicts=_column(verdicts),
            seconds=np.array(seconds, np.float64).reshape(-1, len(Verdict)),
            gone=_column([self._about_gone(alert) for alert in scored]),
            minutes=self._minutes(scored),
            probabilities=self._probabilities(samples),
            two_s_ahead=self._two_s_ahead(samples),
        )

    def _warned(self, onsets: list[tuple[Pair, float]], by_pair: Mapping[Pair, list[Alert]]) -> Floats:
        """(n, 5) as `Cases.stops`."""
        rows = [_warned_row(by_pair.get(pair, ()), onset_s) for pair, onset_s in onsets if onset_s >= self._from_s]
        return np.array(rows, np.float64).reshape(-1, len(LEADS_S) + 1)

    def _seconds(self, alert: Alert) -> list[int]:
        """(4,) its whole seconds by verdict. If there is none, the moment at which it was raised counts."""
        counts = [0] * len(Verdict)
        for second in alert.seconds() or (alert.raised_s,):
            counts[self._verdict_at(alert.pair, float(second))] += 1
        return counts

    def _verdict_at(self, pair: Pair, t_s: float) -> Verdict:
        if self._happened.in_progress(pair, t_s):
            return Verdict.IN_PROGRESS
        if self._happened.next_onset_s(pair, t_s) <= t_s + WITHIN_S:
            return Verdict.TRUE
        if any(self._presence.until(robot, t_s) < t_s + WITHIN_S for robot in pair):
            return Verdict.UNKNOWN
        return Verdict.IN_VAIN

    def _about_gone(self, alert: Alert) -> bool:
        return any(
            self._silences.silent(robot, alert.raised_s) and not self._presence.there(robot, alert.raised_s)
            for robot in alert.pair
        )

    def _stands_silent(self, robot: str, t_s: float) -> bool:
        """Whether a robot is silent at a time, and has stood since it made its last report."""
        heard_s = self._silences.heard_s(robot, t_s)
        return heard_s < inf and self._presence.stands(robot, heard_s, t_s)

    def _silent_seconds(self) -> Floats:
        """(n, 2) as `Cases.silent_seconds`."""
        motion = self._truth.motion
        seconds = range(ceil(max(self._from_s, motion.start_s)), floor(motion.end_s) + 1)
        rows = [
            (self._presence.there(robot, second), self._stands_silent(robot, second))
            for robot in self._silences.robots
            for second in seconds
            if self._silences.silent(robot, second)
        ]
        return np.array(rows, np.float64).reshape(-1, 2)

    def _minutes(self, alerts: list[Alert]) -> Floats:
        """(minutes, 3) as `Cases.minutes`."""
        motion = self._truth.motion
        count = floor((motion.end_s - motion.start_s) / MINUTE_S) + 1
        rows = np.zeros((count, 3))
        for alert in alerts:
            row = rows[min(max(int((alert.raised_s - motion.start_s) / MINUTE_S), 0), count - 1)]
            row[0] += 1
            row[1] += alert.cleared_s - alert.raised_s
        there = np.count_nonzero(~np.isnan(motion.x_m), axis=1) * STEP_S
        since_s = np.arange(len(there)) * STEP_S
        scored = since_s >= self._from_s - motion.start_s
        np.add.at(rows[:, 2], (since_s[scored] / MINUTE_S).astype(np.int64), there[scored])
        return rows[rows[:, 2] > 0]

    def _probabilities(self, samples: Sequence[Sample]) -> Floats:
        """(n, 3) as `Cases.probabilities`."""
        rows = []
        for pair, t_s, probability in samples:
            verdict = self._verdict_at(pair, t_s) if t_s >= self._from_s else Verdict.UNKNOWN
            if verdict in {Verdict.TRUE, Verdict.IN_VAIN}:
                rows.append((probability, verdict is Verdict.TRUE, crc32("".join(pair).encode()) % GROUPS))
        return np.array(rows, np.float64).reshape(-1, 3)

    def _two_s_ahead(self, samples: Sequence[Sample]) -> Floats:
        """(n, 1) as `Cases.two_s_ahead`."""
        if not samples:
            return np.empty((0, 1))
        published = {(pair, floor(t_s)): probability for pair, t_s, probability in samples}
        return _column([published.get((outcome.pair, floor(outcome.onset_s - 2.0)), 0.0) for outcome in self._outcomes])


def _column(values: Sequence[float]) -> Floats:
    """(n, 1)"""
    return np.array(values, np.float64).reshape(-1, 1)


def _alerted(passed: Encounter, by_pair: Mapping[Pair, list[Alert]]) -> bool:
    """Whether an alert of the pair was open while they passed, or in the 10 s before."""
    since_s = passed.start_s - WITHIN_S
    return any(alert.raised_s <= passed.end_s and alert.cleared_s > since_s for alert in by_pair.get(passed.pair, ()))


def _warned_row(alerts: Sequence[Alert], onset_s: float) -> list[bool]:
    """(5,) one row of `Cases.stops`."""
    standing_s = [alert.raised_s for alert in alerts if alert.stands_at(onset_s)]
    leads = [any(raised_s <= onset_s - lead_s for raised_s in standing_s) for lead_s in LEADS_S]
    return [*leads, any(alert.raised_s <= onset_s and alert.cleared_s > onset_s - WITHIN_S for alert in alerts)]


def _credited(by_pair: dict[Pair, list[Alert]], happened: Happenings) -> set[Alert]:
    """The true alerts. Each outcome credits the alert that is open at its onset, else the last one in the 10 s
    before."""
    credited: set[Alert] = set()
    for pair, outcomes in happened.outcomes.items():
        alerts = sorted(by_pair.get(pair, ()), key=lambda alert: alert.cleared_s)
        ends_s = [alert.cleared_s for alert in alerts]
        for outcome in outcomes:
            recent = alerts[bisect_left(ends_s, outcome.onset_s - WITHIN_S) :]
            before = [alert for alert in recent if alert.raised_s < outcome.onset_s and alert not in credited]
            standing = [alert for alert in before if alert.stands_at(outcome.onset_s)]
            credited.update((standing or before)[-1:])
    return credited


def _verdict(credited: bool, seconds: list[int]) -> Verdict:
    """The verdict of an alert from its seconds by verdict."""
    if credited:
        return Verdict.TRUE
    if not any(seconds[: Verdict.IN_PROGRESS]):
        return Verdict.IN_PROGRESS
    return Verdict.UNKNOWN if seconds[Verdict.UNKNOWN] else Verdict.IN_VAIN
