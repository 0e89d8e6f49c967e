"""Every alert and fresh onset of a log, judged by the outcomes of its pair. `precision_by_outcomes` counts them."""

from bisect import bisect_left
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from math import ceil, inf, nan
from typing import NamedTuple

from deconflict.foresight.near_misses.warning_before import WITHIN_S, lead_of, warning_before
from deconflict_client.advisory import AdvisoryState, ConflictAdvisory
from ingest.batch import Pair
from metrics.scoring.warnings.calibration_scores import Vendors
from metrics.scoring.warnings.precision_by_encounters import Alert, RobotPresence
from metrics.truth.advised_waits import AdvisedWaits
from metrics.truth.pair_outcomes import NOTHING, AllPairOutcomes, PairOutcomes, Verdict
from metrics.truth.recorded_motion import RecordedPlace

LEADS_S = (2.0, 4.0, 6.0)


class JudgedAlert(NamedTuple):
    """One alert, and its verdict."""

    alert: Alert
    vendors: Vendors
    stood_s: float
    verdict: Verdict
    seconds: tuple[int, ...]
    """Number of whole seconds at which it was open, by `Verdict`. If there is none, the moment it was raised counts."""


class JudgedOnset(NamedTuple):
    """A fresh onset of a pair, and whether alerts preceded it."""

    pair: Pair
    vendors: Vendors
    onset_s: float
    is_stop: bool
    """Whether one yielded. Otherwise the two met."""
    warned: tuple[bool, ...]
    """For each of `LEADS_S`, whether an alert that is open at the onset was raised at least that long before. Last,
    whether any alert was open in the 10 s before."""
    ahead_s: float
    """Since when the first of these alerts had been raised; nan without one. One that is open at the onset comes
    before cleared ones."""
    place: RecordedPlace | None


class JudgedCases(NamedTuple):
    """All judged alerts and onsets of one source of alerts."""

    alerts: list[JudgedAlert]
    """In the order in which they were raised."""
    onsets: list[JudgedOnset]
    """In the order of time."""


def add_revision(alerts: dict[str, Alert], revision: ConflictAdvisory) -> None:
    """Add a revision to the alerts, by id. What the robots did is not known yet: none is heeded, and no robot has
    left."""
    predicted_s, place = revision.predicted_at.timestamp(), revision.location
    alert = alerts.get(revision.id) or Alert(
        revision.robots,
        revision.vendors,
        revision.raised_at.timestamp(),
        cleared_s=inf,
        predicted_s=predicted_s,
        left_s=inf,
        place=(place.datum, place.x, place.y),
        encounter_class=revision.encounter_class.value,
        advisory=revision.id,
    )
    if revision.time_to_conflict_s > 0:
        alert = replace(alert, predicted_s=predicted_s)
    if revision.state is AdvisoryState.CLEARED:
        alert = replace(alert, cleared_s=revision.updated_at.timestamp())
    alerts[revision.id] = alert


def judged(
    alerts: Iterable[Alert],
    outcomes: AllPairOutcomes,
    robots: RobotPresence,
    waits: AdvisedWaits,
    end_s: float,
    pairs: Collection[Pair] | None = None,
) -> JudgedCases:
    """Judge the alerts over a log that ended at `end_s`, with the onsets of `pairs`, or of all."""
    every, by_pair = outcomes.every(pairs), _by_pair(alerts)
    found: list[JudgedAlert] = []
    for pair, of_pair in by_pair.items():
        outcomes_of_pair = every.get(pair, NOTHING)
        credited = _credited(of_pair, outcomes_of_pair)
        for alert in of_pair:
            counts = _seconds(alert, outcomes_of_pair, outcomes, waits, end_s)
            stood_s = max(min(alert.cleared_s, end_s) - alert.raised_s, 0.0)
            verdict = Verdict.TRUE if alert in credited else _verdict(counts)
            found.append(JudgedAlert(alert, robots.vendors(pair), stood_s, verdict, tuple(counts)))
    onsets = [
        JudgedOnset(
            pair,
            robots.vendors(pair),
            onset_s,
            is_stop,
            _warned(by_pair.get(pair, ()), onset_s),
            _ahead_s(by_pair.get(pair, ()), onset_s),
            outcomes_of_pair.places.get(onset_s),
        )
        for pair, outcomes_of_pair in every.items()
        for is_stop, onsets_s in ((True, outcomes_of_pair.stops_s), (False, outcomes_of_pair.meetings_s))
        for onset_s in onsets_s
    ]
    found.sort(key=lambda case: (case.alert.raised_s, case.alert.pair))
    return JudgedCases(found, sorted(onsets, key=lambda onset: (onset.onset_s, onset.pair)))


def _by_pair(alerts: Iterable[Alert]) -> dict[Pair, list[Alert]]:
    by_pair: dict[Pair, list[Alert]] = {}
    for alert in sorted(alerts, key=lambda alert: (alert.raised_s, alert.pair)):
        by_pair.setdefault(alert.pair, []).append(alert)
    return by_pair


def _credited(alerts: Sequence[Alert], outcomes_of_pair: PairOutcomes) -> set[Alert]:
    """The true alerts of a pair. Each outcome credits the alert that is open at its onset, or else the last alert that
    was open in the 10 s before."""
    by_end = sorted(alerts, key=lambda alert: alert.cleared_s)
    ends_s, credited = [alert.cleared_s for alert in by_end], set[Alert]()
    for onset_s, _ in outcomes_of_pair.spans:
        recent = by_end[bisect_left(ends_s, onset_s - WITHIN_S) :]
        before = [alert for alert in recent if alert.raised_s < onset_s and alert not in credited]
        standing = [alert for alert in before if alert.cleared_s > onset_s]
        credited.update((standing or before)[-1:])
    return credited


def _seconds(
    alert: Alert, outcomes_of_pair: PairOutcomes, outcomes: AllPairOutcomes, waits: AdvisedWaits, end_s: float
) -> list[int]:
    """The number of whole seconds of an alert by verdict."""
    heeded_s = waits.began_s(alert.pair, alert.raised_s, alert.cleared_s)
    counts = [0] * len(Verdict)
    for at_s in range(ceil(alert.raised_s), ceil(min(alert.cleared_s, end_s))) or (alert.raised_s,):
        verdict = outcomes_of_pair.verdict(at_s, outcomes.left_s(alert.pair, at_s))
        if verdict not in {Verdict.TRUE, Verdict.IN_PROGRESS} and heeded_s < at_s + WITHIN_S:
            verdict = Verdict.HEEDED
        counts[verdict] += 1
    return counts


def _verdict(counts: Sequence[int]) -> Verdict:
    """The verdict of an alert that no outcome credits, from its seconds by verdict."""
    if counts[Verdict.IN_PROGRESS] == sum(counts):
        return Verdict.IN_PROGRESS
    for verdict in (Verdict.HEEDED, Verdict.UNKNOWN, Verdict.ORDERED):
        if counts[verdict]:
            return verdict
    return Verdict.REPEATED if counts[Verdict.TRUE] else Verdict.KEPT_APART


def _warned(alerts: Sequence[Alert], onset_s: float) -> tuple[bool, ...]:
    """Whether the alerts of its pair preceded an onset, see `JudgedOnset.warned`."""
    standing_s = [alert.raised_s for alert in alerts if alert.raised_s <= onset_s < alert.cleared_s]
    leads = [any(raised_s <= onset_s - lead_s for raised_s in standing_s) for lead_s in LEADS_S]
    return (*leads, warning_before(alerts, onset_s) is not None)


def _ahead_s(alerts: Sequence[Alert], onset_s: float) -> float:
    lead = lead_of(warning_before(alerts, onset_s), onset_s)
    return lead.raised_s if lead else nan
