"""What came of the warnings of a running service, judged by the functions that judge those of a recorded log.

A pair is judged once it has been quiet for `QUIET_S`: none of its warnings is open, and it is in nobody's way. The
judgement needs the motion on both sides of a moment, so the counts are behind by that time.
"""

import logging
from collections.abc import Collection, Iterable
from math import floor, inf

from deconflict.foresight.near_misses.warning_before import WITHIN_S
from deconflict_client.advisory import AnyAdvisory, ConflictAdvisory
from ingest.batch import Batch, Floats, Pair
from ingest.measures.measures import Measures
from metrics.monitoring.queries import OUTCOMES
from metrics.scoring.forecast_scores import ForecastScores
from metrics.scoring.warnings.judged_alerts import JudgedAlert, JudgedOnset, add_revision, judged
from metrics.scoring.warnings.precision_by_encounters import Alert, RobotPresence
from metrics.truth.advised_waits import AdvisedWaits
from metrics.truth.encounters import EncounterFinder
from metrics.truth.interactions import Interactions
from metrics.truth.pair_outcomes import FRESH_S, AllPairOutcomes, outcome_of
from metrics.truth.recorded_motion import without_doubted
from metrics.truth.separations import TooManyPairsError

QUIET_S = WITHIN_S + FRESH_S + 15.0
"""Reports of an event arrive, and a robot is seen to yield, within the last part of it."""
SILENT_S = 600.0
"""A pair with a silent robot is judged so much later: until then another robot may drive through its place."""
RENEWED_AFTER_S, MOST_ROBOTS = 6 * 3600.0, 10_000
"""After this time, or this many robots, the judge begins anew, so that its memory is bounded. Warnings of that moment
are not judged."""
MOST_NEAR = 12.0
"""The judge begins anew if there are more near pairs for each robot. Robots that are parked side by side have half as
many."""
MOST_KINDS = 200
"""Kinds of forecasts that are told apart: a robot may name another model each second, and a kind takes 170 kB."""
AHEAD_BOUNDS_S = (*(half / 2 for half in range(1, 21)), 12.0, 15.0, 20.0, 30.0, 60.0)
WARNINGS, EVENTS = "deconflict_warnings_judged_total", "deconflict_events_judged_total"
VENDOR_WARNINGS, VENDOR_EVENTS = "deconflict_vendor_warnings_judged_total", "deconflict_vendor_events_judged_total"
AHEAD_BY = "deconflict_warned_ahead_seconds"

log = logging.getLogger(__name__)


class WarningJudge:
    """Counts what came of warnings, and how many events were warned of."""

    def __init__(self, clearance_m: float, drawn_apart_m: float, measures: Measures) -> None:
        self._bounds_m, self._measures = (clearance_m, drawn_apart_m), measures
        self._begin_counters()
        self._alerts: dict[str, Alert] = {}
        self._doubted_s: dict[str, float] = {}
        """When robots were last doubted."""
        self._vendors: set[str] = set()
        self._begin()

    def _begin_counters(self, *vendor: str) -> None:
        """Begin the counters of all, or of a vendor, at 0, so that the first rise is seen."""
        for outcome in OUTCOMES:
            self._measures.count(VENDOR_WARNINGS if vendor else WARNINGS, *vendor, outcome, by=0)
        for warned in ("yes", "no"):
            self._measures.count(VENDOR_EVENTS if vendor else EVENTS, *vendor, warned, by=0)
        self._measures.observe(AHEAD_BY, [], bounds=AHEAD_BOUNDS_S)

    def _begin(self) -> None:
        clearance_m, drawn_apart_m = self._bounds_m
        self._truth = EncounterFinder([clearance_m], drawn_apart_m, MOST_NEAR, draws_scenes=False)
        self._interactions = Interactions()
        self._outcomes = AllPairOutcomes(self._truth, self._interactions, clearance_m)
        self._forecasts, self._waits = ForecastScores(MOST_KINDS), AdvisedWaits()
        self._vendor_of: dict[str, str] = {}
        self._began_s, self._second = inf, -1

    def begin_anew(self) -> None:
        """Forget all robots. The warnings that are not judged yet will not be."""
        for alert in self._alerts.values():
            if alert.cleared_s < inf:
                self._count_warning(tuple(sorted(alert.vendors)), "not_judged")
        self._alerts = {name: alert for name, alert in self._alerts.items() if alert.cleared_s == inf}
        self._begin()

    def add(
        self,
        now_s: float,
        batch: Batch,
        bands_m: Floats,
        revisions: Iterable[AnyAdvisory],
        waiting: Iterable[str | Pair],
        doubted: Collection[str] = (),
    ) -> None:
        """Add a pass of the engine. `bands_m` as of `ForecastScores.add_batch`, `waiting` as of `AdvisedWaits.add`,
        `doubted` as of `without_doubted`."""
        self._began_s = min(self._began_s, now_s)
        batch, bands_m = without_doubted(batch, bands_m, doubted)
        for vendor in set(batch.vendors) - self._vendors:
            self._vendors.add(vendor)
            self._begin_counters(vendor)
        self._vendor_of.update(zip(batch.robots, batch.vendors, strict=True))
        self._truth.add_batch(batch)
        self._interactions.add_batch(batch, self._forecasts.add_batch(batch, now_s, bands_m))
        self._note(revisions)
        self._doubted_s |= dict.fromkeys(doubted, now_s)
        self._waits.add(now_s, waiting)
        if floor(now_s) == self._second:
            return
        self._second, until_s = floor(now_s), self._truth.until_s
        self._truth.silences.fallen_silent(now_s)
        try:
            self._truth.advance(now_s)
        except TooManyPairsError:
            log.warning("too many robots report from one place: the warnings of the last minute are not judged")
            self.begin_anew()
            return
        if self._truth.until_s > until_s:
            self._settle(now_s)
        if now_s - self._began_s > RENEWED_AFTER_S or len(self._vendor_of) > MOST_ROBOTS:
            self.begin_anew()

    def _note(self, revisions: Iterable[AnyAdvisory]) -> None:
        for revision in revisions:
            if isinstance(revision, ConflictAdvisory):
                add_revision(self._alerts, revision)

    def _is_doubted(self, pair: Pair, since_s: float) -> bool:
        """Whether a robot of a pair was doubted since then: nobody can say what it did."""
        return any(self._doubted_s.get(robot, -inf) >= since_s for robot in pair)

    def _settle(self, now_s: float) -> None:
        """Judge the pairs that are quiet, and forget them."""
        over_s = {pair: self._outcomes.until_s(pair) for pair in self._outcomes.pairs()}
        for alert in self._alerts.values():
            over_s[alert.pair] = max(over_s.get(alert.pair, -inf), alert.cleared_s)
        quiet_s = min(now_s, self._truth.until_s) - QUIET_S
        quiet = {
            pair
            for pair, until_s in over_s.items()
            if until_s < quiet_s and (until_s < quiet_s - SILENT_S or not self._may_have_left(pair, until_s + WITHIN_S))
        }
        alerts = {name: alert for name, alert in self._alerts.items() if alert.pair in quiet}
        cases = judged(alerts.values(), self._outcomes, RobotPresence(self._vendor_of), self._waits, now_s, quiet)
        for case in cases.alerts:
            self._count_alert(case)
        for onset in cases.onsets:
            if not self._is_doubted(onset.pair, onset.onset_s - WITHIN_S):
                self._count_onset(onset)
        self._outcomes.forget(quiet)
        for name in alerts:
            del self._alerts[name]
        self._doubted_s = {
            robot: at_s for robot, at_s in self._doubted_s.items() if at_s > quiet_s - SILENT_S - WITHIN_S
        }

    def _may_have_left(self, pair: Pair, before_s: float) -> bool:
        return any(self._truth.silences.may_have_left(robot, before_s) for robot in pair)

    def _count_alert(self, case: JudgedAlert) -> None:
        """A warning from before the beginning came true if that was seen. Otherwise nobody can say, nor of one of which
        a robot was doubted."""
        alert, outcome = case.alert, outcome_of(case.verdict)
        is_known = alert.raised_s >= self._began_s or outcome == "came_true"
        is_known &= not self._is_doubted(alert.pair, alert.raised_s)
        self._count_warning(tuple(sorted(alert.vendors)), outcome if is_known else "not_judged")

    def _count_warning(self, vendors: tuple[str, ...], outcome: str) -> None:
        self._measures.count(WARNINGS, outcome)
        for vendor in sorted(set(vendors)):
            self._measures.count(VENDOR_WARNINGS, vendor, outcome)

    def _count_onset(self, onset: JudgedOnset) -> None:
        warned = "yes" if onset.warned[-1] else "no"
        self._measures.count(EVENTS, warned)
        for vendor in sorted(set(onset.vendors)):
            self._measures.count(VENDOR_EVENTS, vendor, warned)
        if onset.warned[-1]:
            self._measures.observe(AHEAD_BY, [onset.ahead_s], bounds=AHEAD_BOUNDS_S)
