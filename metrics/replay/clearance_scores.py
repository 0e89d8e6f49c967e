"""The scores of one clearance: of its engine's advisories and probabilities, and of the path believer's alerts."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from math import inf
from typing import Any

from deconflict_client.advisory import AdvisoryState
from ingest.batch import Batch
from metrics.replay.engine_output import EngineOutput
from metrics.scoring.warnings import precision_by_outcomes
from metrics.scoring.warnings.calibration_scores import SETTLED_S, CalibrationScores
from metrics.scoring.warnings.judged_alerts import JudgedCases, add_revision, judged
from metrics.scoring.warnings.listed_cases import LogNames, by_minute, listed
from metrics.scoring.warnings.outcomes_by_moment import ContactOutcomes, InteractionOutcomes
from metrics.scoring.warnings.path_believer import PathBeliever
from metrics.scoring.warnings.precision_by_encounters import STANDING_S, Alert, RobotPresence, score
from metrics.truth.absences import Absences
from metrics.truth.advised_waits import AdvisedWaits
from metrics.truth.encounters import EncounterFinder
from metrics.truth.interactions import Interactions
from metrics.truth.pair_outcomes import AllPairOutcomes


class ClearanceScores:
    """Collects the output of one clearance's engine until its outcome is known, then scores it."""

    def __init__(
        self, clearance_m: float, truth: EncounterFinder, interactions: Interactions, absences: Absences
    ) -> None:
        self.clearance_m = clearance_m
        self.raised: Counter[str] = Counter()
        """Number of raised advisories by kind."""
        self.advisories: dict[str, Alert] = {}
        """By advisory id."""
        self.believer = PathBeliever(clearance_m)
        self._truth, self._absences = truth, absences
        self.outcomes = AllPairOutcomes(truth, interactions, clearance_m)
        self.waits = AdvisedWaits()
        self._contact_calibration = CalibrationScores(self.waits)
        self._interaction_calibration = CalibrationScores(self.waits)
        self._contacts = ContactOutcomes(truth, clearance_m)
        self._interactions = InteractionOutcomes(truth, self.outcomes)

    def add(self, now_s: float, batch: Batch, output: EngineOutput) -> None:
        """Add one pass and the engine's output at it."""
        self.raised.update(advisory.kind for advisory in output.advisories if advisory.state is AdvisoryState.RAISED)
        for revision in output.conflicts():
            add_revision(self.advisories, revision)
        self._contact_calibration.sample(now_s, output.contact_probabilities)
        self._interaction_calibration.sample(now_s, output.probabilities)
        self.waits.add(now_s, output.waiting)
        self.believer.add_batch(batch)

    def resolve(self, vendor_of: Mapping[str, str]) -> None:
        """Score the probabilities whose outcome is known by now."""
        self._contact_calibration.resolve(self._contacts, vendor_of)
        self._interaction_calibration.resolve(self._interactions, vendor_of)

    def figures(self, names: LogNames, end_s: float) -> dict[str, Any]:
        """All figures. Call it after the last pass; the log ended at `end_s`."""
        contact, alerts = self._contact_calibration, list(self._alerts())
        spans = [(alert.pair, alert.raised_s, alert.cleared_s) for alert in alerts]
        silences, moved_s = self._truth.silences, self._truth.motion.present_s()
        seen = RobotPresence(names.vendor_of, {key: moved_s[key] for key in moved_s.keys() - silences.on_foot})
        figures = score(self._truth.encounters(self.clearance_m), alerts, self.clearance_m, seen, contact.by_vendors)
        present = RobotPresence(names.vendor_of, silences.present_s())
        cases = self._judged(alerts, present, end_s)
        return figures | {
            "censored_samples": int(contact.whole().left.sum()),
            "heeded_samples": contact.heeded,
            "settled": {"after_s": SETTLED_S, **contact.settled.figures()},
            "silences": self._absences.figures(self.clearance_m, spans, STANDING_S),
            "warnings": self._warnings(cases, present)
            | {"probability": self._probability_figures()}
            | {"listed": listed(cases, names), "by_minute": by_minute(cases, silences.by_minute_s)},
            "believer": self._warnings(self._judged(self.believer.alerts(), present, end_s), present),
        }

    def _judged(self, alerts: Iterable[Alert], present: RobotPresence, end_s: float) -> JudgedCases:
        return judged(alerts, self.outcomes, present, self.waits, end_s)

    def _warnings(self, cases: JudgedCases, present: RobotPresence) -> dict[str, Any]:
        return precision_by_outcomes.figures(cases, present, self._truth.silences.by_minute_s)

    def _probability_figures(self) -> dict[str, Any]:
        """How well the probability of getting in each other's way is calibrated."""
        calibration = self._interaction_calibration
        whole = calibration.whole()
        onsets = [(pair, span.onset_s) for pair, outcomes in self.outcomes.every().items() for span in outcomes.spans]
        return {
            **whole.figures(),
            "censored_samples": int(whole.left.sum()),
            "heeded_samples": calibration.heeded,
            "doubted_samples": calibration.doubted,
            "settled": {"after_s": SETTLED_S, **calibration.settled.figures()},
            "intervals": whole.intervals(),
            "likely": calibration.likely.figures(onsets),
            "by_vendor_pair": [
                {"vendors": list(vendors), **tally.figures()}
                for vendors, tally in sorted(calibration.by_vendors.items())
            ],
            "cases": [[round(value, 6) for value in row] for row in whole.every_group().tolist()],
        }

    def _alerts(self) -> Iterator[Alert]:
        for alert in self.advisories.values():
            left_s = min(self._truth.motion.last_seen_s(robot) for robot in alert.pair)
            is_heeded = self.waits.began_s(alert.pair, alert.raised_s, alert.cleared_s) < inf
            yield replace(alert, left_s=left_s, heeded=is_heeded)
