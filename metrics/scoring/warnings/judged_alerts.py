"""Every alert and every fresh onset of a log, judged by what came of its pair: what the figures of warnings rest on."""

from bisect import bisect_left
from collections.abc import Iterable, Sequence
from math import ceil
from typing import NamedTuple

from ingest.batch import Pair
from metrics.scoring.warnings.alert_scores import Alert, RobotPresence
from metrics.scoring.warnings.calibration_scores import Vendors
from metrics.truth.advised_waits import AdvisedWaits
from metrics.truth.pair_outcomes import NOTHING, WITHIN_S, AllPairOutcomes, PairOutcomes, Verdict

LEADS_S = (2.0, 4.0, 6.0)


class JudgedAlert(NamedTuple):
    """One alert, and what came of it."""

    alert: Alert
    vendors: Vendors
    stood_s: float
    verdict: Verdict
    seconds: tuple[int, ...]
    """Whole seconds at which it stood, by `Verdict`; one that stood at none counts by the moment it was raised."""


class JudgedOnset(NamedTuple):
    """A fresh onset of a pair, and how it was told of."""

    pair: Pair
    vendors: Vendors
    onset_s: float
    is_stop: bool
    """One yielded; else the two met."""
    told: tuple[bool, ...]
    """For each of `LEADS_S`, whether an alert that stands at the onset had been raised so long before; last, whether
    any stood in the 10 s before."""


class JudgedCases(NamedTuple):
    """All that is judged of one source of alerts."""

    alerts: list[JudgedAlert]
    """As they were raised."""
    onsets: list[JudgedOnset]
    """By time."""


def judged(
    alerts: Iterable[Alert], outcomes: AllPairOutcomes, there: RobotPresence, waits: AdvisedWaits, end_s: float
) -> JudgedCases:
    """Alerts over a log that ended at `end_s`."""
    every, by_pair = outcomes.every(), _by_pair(alerts)
    found: list[JudgedAlert] = []
    for pair, of_pair in by_pair.items():
        came = every.get(pair, NOTHING)
        credited = _credited(of_pair, came)
        for alert in of_pair:
            counts = _seconds(alert, came, outcomes, waits, end_s)
            stood_s = max(min(alert.cleared_s, end_s) - alert.raised_s, 0.0)
            verdict = Verdict.TRUE if alert in credited else _verdict(counts)
            found.append(JudgedAlert(alert, there.vendors(pair), stood_s, verdict, tuple(counts)))
    onsets = [
        JudgedOnset(pair, there.vendors(pair), onset_s, is_stop, _told(by_pair.get(pair, ()), onset_s))
        for pair, came in every.items()
        for is_stop, onsets_s in ((True, came.stops_s), (False, came.meetings_s))
        for onset_s in onsets_s
    ]
    found.sort(key=lambda one: (one.alert.raised_s, one.alert.pair))
    return JudgedCases(found, sorted(onsets, key=lambda onset: (onset.onset_s, onset.pair)))


def _by_pair(alerts: Iterable[Alert]) -> dict[Pair, list[Alert]]:
    by_pair: dict[Pair, list[Alert]] = {}
    for alert in sorted(alerts, key=lambda alert: (alert.raised_s, alert.pair)):
        by_pair.setdefault(alert.pair, []).append(alert)
    return by_pair


def _credited(alerts: Sequence[Alert], came: PairOutcomes) -> set[Alert]:
    """The alerts of a pair that came true: each outcome credits the one that stands at its onset, or else the last that
    stood in the 10 s before."""
    by_end = sorted(alerts, key=lambda alert: alert.cleared_s)
    ends_s, credited = [alert.cleared_s for alert in by_end], set[Alert]()
    for onset_s, _ in came.spans:
        recent = by_end[bisect_left(ends_s, onset_s - WITHIN_S) :]
        before = [alert for alert in recent if alert.raised_s < onset_s and alert not in credited]
        standing = [alert for alert in before if alert.cleared_s > onset_s]
        credited.update((standing or before)[-1:])
    return credited


def _seconds(
    alert: Alert, came: PairOutcomes, outcomes: AllPairOutcomes, waits: AdvisedWaits, end_s: float
) -> list[int]:
    """How many whole seconds of an alert have each verdict."""
    heeded_s = waits.began_s(alert.pair, alert.raised_s, alert.cleared_s)
    counts = [0] * len(Verdict)
    for at_s in range(ceil(alert.raised_s), ceil(min(alert.cleared_s, end_s))) or (alert.raised_s,):
        verdict = came.verdict(at_s, outcomes.left_s(alert.pair, at_s))
        if verdict not in {Verdict.TRUE, Verdict.IN_PROGRESS} and heeded_s < at_s + WITHIN_S:
            verdict = Verdict.HEEDED
        counts[verdict] += 1
    return counts


def _verdict(counts: Sequence[int]) -> Verdict:
    """Of an alert that no outcome credits, with so many seconds of each verdict."""
    if counts[Verdict.IN_PROGRESS] == sum(counts):
        return Verdict.IN_PROGRESS
    for verdict in (Verdict.HEEDED, Verdict.UNKNOWN, Verdict.ORDERED):
        if counts[verdict]:
            return verdict
    return Verdict.REPEATED if counts[Verdict.TRUE] else Verdict.KEPT_APART


def _told(alerts: Sequence[Alert], onset_s: float) -> tuple[bool, ...]:
    """How an onset was told of by the alerts of its pair, see `JudgedOnset.told`."""
    standing_s = [alert.raised_s for alert in alerts if alert.raised_s <= onset_s < alert.cleared_s]
    leads = [any(raised_s <= onset_s - lead_s for raised_s in standing_s) for lead_s in LEADS_S]
    at_any_time = any(one.raised_s <= onset_s and one.cleared_s > onset_s - WITHIN_S for one in alerts)
    return (*leads, at_any_time)
