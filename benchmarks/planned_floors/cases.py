"""Each alert and each outcome of a floor, judged: what the figures are made of."""

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from enum import IntEnum
from math import floor
from typing import Self

import numpy as np

from benchmarks.planned_floors.alerts import Alert
from benchmarks.planned_floors.encounters import Pair
from benchmarks.planned_floors.log import Robot
from benchmarks.planned_floors.motion import STEP_S
from benchmarks.planned_floors.outcomes import Happenings
from benchmarks.planned_floors.truth import FloorTruth
from ingest.seam import Floats, Ints

WITHIN_S = 10.0
"""An alert is true where the outcome follows within this."""
LEADS_S = (0.0, 2.0, 4.0, 6.0)
MINUTE_S = 60.0


class Verdict(IntEnum):
    """What came of an alert, or of one second of it."""

    TRUE = 0
    IN_VAIN = 1
    UNKNOWN = 2
    """A robot left, or the log ended, before anything could be seen."""
    IN_PROGRESS = 3
    """The pair was in each other's way already."""


@dataclass(frozen=True, slots=True, eq=False)
class Cases:
    """The judged cases of one floor, or of several joined."""

    stops: Floats
    """(n, 5) of each fresh stop, 1 where an alert was raised at least 0, 2, 4 and 6 s before its onset and stands at
    it; last, 1 where any alert stood in the 10 s before."""
    encounters: Floats
    """(n, 5) the same of natural encounters."""
    silent: Floats
    """(n, 5) the same of outcomes with a robot that was there and had been silent for longer than its limit."""
    passes: Floats
    """(n, 1) 1 where two robots that passed each other had an alert."""
    verdicts: Floats
    """(alerts, 1) `Verdict` of each."""
    seconds: Floats
    """(alerts, 4) whole seconds of each alert by `Verdict`."""
    gone: Floats
    """(alerts, 1) 1 where a robot of it had left, and been silent for longer than its limit, when it was raised."""
    minutes: Floats
    """(minutes, 3) alerts raised, seconds that alerts stood, seconds that robots were there."""

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        return cls(**{one.name: np.concatenate([getattr(part, one.name) for part in parts]) for one in fields(cls)})


def judged(alerts: list[Alert], truth: FloorTruth, happened: Happenings, robots: list[Robot]) -> Cases:
    """All cases of one floor."""
    by_pair: dict[Pair, list[Alert]] = {}
    for alert in alerts:
        by_pair.setdefault(alert.pair, []).append(alert)
    presence, silences = Presence(truth), _Silences(robots)
    seconds = [_seconds(alert, happened, presence) for alert in alerts]
    credited = _credited(by_pair, happened)
    verdicts = [_verdict(alert in credited, counts.tolist()) for alert, counts in zip(alerts, seconds, strict=True)]
    silent = [
        (outcome.pair, outcome.onset_s)
        for of_pair in happened.outcomes.values()
        for outcome in of_pair
        if any(silences.silent(robot, outcome.onset_s) for robot in outcome.pair)
    ]
    gone = [
        any(
            silences.silent(robot, alert.raised_s) and not presence.there(robot, alert.raised_s) for robot in alert.pair
        )
        for alert in alerts
    ]
    passes = [
        any(
            alert.raised_s <= one.end_s and alert.cleared_s > one.start_s - WITHIN_S
            for alert in by_pair.get(one.pair, ())
        )
        for one in happened.passes
    ]
    return Cases(
        stops=_told([(stop.pair, stop.start_s) for stop in happened.stops], by_pair),
        encounters=_told([(one.pair, one.start_s) for one in happened.encounters], by_pair),
        silent=_told(silent, by_pair),
        passes=np.array(passes, np.float64).reshape(-1, 1),
        verdicts=np.array(verdicts, np.float64).reshape(-1, 1),
        seconds=np.array(seconds, np.float64).reshape(-1, len(Verdict)),
        gone=np.array(gone, np.float64).reshape(-1, 1),
        minutes=_minutes(alerts, truth),
    )


class Presence:
    """When the robots of a floor were truly there."""

    def __init__(self, truth: FloorTruth) -> None:
        self._motion = truth.motion
        self._column = {robot: column for column, robot in enumerate(truth.motion.robots)}
        there = ~np.isnan(truth.motion.x_m)
        self._absent = [np.flatnonzero(~there[:, column]) for column in range(there.shape[1])]

    def there(self, robot: str, t_s: float) -> bool:
        x_m = self._motion.x_m[self._motion.sample(t_s), self._column[robot]]
        return t_s <= self._motion.end_s + STEP_S and not np.isnan(x_m)

    def until(self, robot: str, t_s: float) -> float:
        """Until when it was there from a time on: the end of the log where it stayed."""
        absent = self._absent[self._column[robot]]
        index = int(np.searchsorted(absent, self._motion.sample(t_s)))
        return self._motion.start_s + absent[index] * STEP_S if index < len(absent) else self._motion.end_s


class _Silences:
    """Which robots had been silent for longer than their limit."""

    def __init__(self, robots: list[Robot]) -> None:
        self._received_s = {robot.uuid: [report.received_s for report in robot.reports] for robot in robots}
        self._limit_s = {robot.uuid: robot.silence_limit_s() for robot in robots}

    def silent(self, robot: str, t_s: float) -> bool:
        received_s = self._received_s[robot]
        index = bisect_right(received_s, t_s) - 1
        return index >= 0 and t_s - received_s[index] > self._limit_s[robot]


def _told(onsets: Iterable[tuple[Pair, float]], by_pair: dict[Pair, list[Alert]]) -> Floats:
    """(n, 5) as `Cases.stops`."""
    rows = []
    for pair, onset_s in onsets:
        alerts = by_pair.get(pair, ())
        standing_s = [alert.raised_s for alert in alerts if alert.stands_at(onset_s)]
        leads = [any(raised_s <= onset_s - lead_s for raised_s in standing_s) for lead_s in LEADS_S]
        kindly = any(alert.raised_s <= onset_s and alert.cleared_s > onset_s - WITHIN_S for alert in alerts)
        rows.append([*leads, kindly])
    return np.array(rows, np.float64).reshape(-1, len(LEADS_S) + 1)


def _seconds(alert: Alert, happened: Happenings, presence: Presence) -> Ints:
    """(4,) its whole seconds by verdict; one that stood at none counts by the moment at which it was raised."""
    counts = np.zeros(len(Verdict), np.int64)
    for second in alert.seconds() or (alert.raised_s,):
        counts[_verdict_at(float(second), alert.pair, happened, presence)] += 1
    return counts


def _verdict_at(t_s: float, pair: Pair, happened: Happenings, presence: Presence) -> Verdict:
    if happened.in_progress(pair, t_s):
        return Verdict.IN_PROGRESS
    if happened.next_onset_s(pair, t_s) <= t_s + WITHIN_S:
        return Verdict.TRUE
    if any(presence.until(robot, t_s) < t_s + WITHIN_S for robot in pair):
        return Verdict.UNKNOWN
    return Verdict.IN_VAIN


def _credited(by_pair: dict[Pair, list[Alert]], happened: Happenings) -> set[Alert]:
    """The alerts that came true: each outcome credits the one that stands at its onset, else the last in 10 s."""
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
    """Of an alert with so many seconds of each verdict."""
    if credited:
        return Verdict.TRUE
    if not any(seconds[: Verdict.IN_PROGRESS]):
        return Verdict.IN_PROGRESS
    return Verdict.UNKNOWN if seconds[Verdict.UNKNOWN] else Verdict.IN_VAIN


def _minutes(alerts: list[Alert], truth: FloorTruth) -> Floats:
    """(minutes, 3) as `Cases.minutes`."""
    motion = truth.motion
    count = floor((motion.end_s - motion.start_s) / MINUTE_S) + 1
    rows = np.zeros((count, 3))
    for alert in alerts:
        row = rows[min(max(int((alert.raised_s - motion.start_s) / MINUTE_S), 0), count - 1)]
        row[0] += 1
        row[1] += alert.cleared_s - alert.raised_s
    there = np.count_nonzero(~np.isnan(motion.x_m), axis=1) * STEP_S
    np.add.at(rows[:, 2], (np.arange(len(there)) * STEP_S / MINUTE_S).astype(np.int64), there)
    return rows
