"""What one clearance's engine said, kept until it can be judged, beside what the believer of paths would have said."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from math import inf
from typing import Any

from deconflict.advisory import AdvisoryState, ConflictAdvisory
from ingest.batch import Batch, Pair
from metrics.replay.engine_output import Said
from metrics.scoring.warnings import warning_scores
from metrics.scoring.warnings.alert_scores import STANDING_S, Alert, Presence, score
from metrics.scoring.warnings.calibration_scores import SETTLED_S, Calibration
from metrics.scoring.warnings.judged_alerts import judged
from metrics.scoring.warnings.outcomes_by_moment import ContactFates, InteractionFates
from metrics.scoring.warnings.path_believer import Believer
from metrics.truth.absences import Absences
from metrics.truth.advised_waits import Waits
from metrics.truth.encounters import Truth
from metrics.truth.interactions import Interactions
from metrics.truth.pair_outcomes import Outcomes


@dataclass(slots=True)
class Told:
    """One advisory so far: what scoring needs of its revisions."""

    pair: Pair
    vendors: tuple[str, str]
    raised_s: float
    predicted_s: float
    place: tuple[str, float, float]
    encounter_class: str
    """When it was raised."""
    cleared_s: float = inf


class Verdict:
    """One clearance."""

    def __init__(self, clearance_m: float, truth: Truth, interactions: Interactions, absences: Absences) -> None:
        self.clearance_m = clearance_m
        self.raised: Counter[str] = Counter()
        """Advisories by kind."""
        self.told: dict[str, Told] = {}
        """By advisory."""
        self.believer = Believer(clearance_m)
        self._truth, self._absences = truth, absences
        self._outcomes = Outcomes(truth, interactions, clearance_m)
        self._waits = Waits()
        self._of_contact, self._of_interaction = Calibration(self._waits), Calibration(self._waits)
        self._contacts, self._interactions = ContactFates(truth, clearance_m), InteractionFates(truth, self._outcomes)

    def take(self, now_s: float, batch: Batch, said: Said) -> None:
        """One pass, and what the engine said at it."""
        self.raised.update(said.raised)
        for one in said.revisions:
            self._take(one)
        self._of_contact.sample(now_s, said.contact_probabilities)
        self._of_interaction.sample(now_s, said.probabilities)
        self._waits.see(now_s, said.waiting)
        self.believer.take(batch)

    def resolve(self, vendor_of: Mapping[str, str]) -> None:
        """Judge the probabilities of which it is known what came of them."""
        self._of_contact.resolve(self._contacts, vendor_of)
        self._of_interaction.resolve(self._interactions, vendor_of)

    def score(self, vendor_of: Mapping[str, str], end_s: float) -> dict[str, Any]:
        """All figures, once nothing more comes: the log ended at `end_s`."""
        contact, alerts = self._of_contact, list(self._alerts())
        spans = [(one.pair, one.raised_s, one.cleared_s) for one in alerts]
        seen = Presence(vendor_of, self._truth.motion.present_s())
        figures = score(self._truth.encounters(self.clearance_m), alerts, self.clearance_m, seen, contact.by_vendors)
        there = Presence(vendor_of, self._truth.silences.present_s())
        return figures | {
            "censored_samples": int(contact.whole().left.sum()),
            "heeded_samples": contact.heeded,
            "settled": {"after_s": SETTLED_S, **contact.settled.figures()},
            "silences": self._absences.figures(self.clearance_m, spans, STANDING_S),
            "warnings": self._warnings(alerts, there, end_s) | {"probability": self._probability()},
            "believer": self._warnings(self.believer.alerts(), there, end_s),
        }

    def _warnings(self, alerts: Iterable[Alert], there: Presence, end_s: float) -> dict[str, Any]:
        cases = judged(alerts, self._outcomes, there, self._waits, end_s)
        return warning_scores.figures(cases, there, self._truth.silences.by_minute())

    def _probability(self) -> dict[str, Any]:
        """How true the probability of getting in each other's way is."""
        of_it = self._of_interaction
        whole = of_it.whole()
        onsets = [(pair, span.onset_s) for pair, came in self._outcomes.every().items() for span in came.spans]
        return {
            **whole.figures(),
            "censored_samples": int(whole.left.sum()),
            "heeded_samples": of_it.heeded,
            "doubted_samples": of_it.doubted,
            "settled": {"after_s": SETTLED_S, **of_it.settled.figures()},
            "intervals": whole.intervals(),
            "likely": of_it.likely.figures(onsets),
            "by_vendor_pair": [
                {"vendors": list(vendors), **tally.figures()} for vendors, tally in sorted(of_it.by_vendors.items())
            ],
            "cases": [[round(value, 6) for value in row] for row in whole.every_group().tolist()],
        }

    def _alerts(self) -> Iterator[Alert]:
        for one in self.told.values():
            left_s = min(self._truth.motion.last_seen_s(robot) for robot in one.pair)
            is_heeded = self._waits.began_s(one.pair, one.raised_s, one.cleared_s) < inf
            yield Alert(
                one.pair,
                one.vendors,
                one.raised_s,
                one.cleared_s,
                one.predicted_s,
                left_s,
                one.place,
                is_heeded,
                one.encounter_class,
            )

    def _take(self, one: ConflictAdvisory) -> None:
        predicted_s = one.predicted_at.timestamp()
        told = self.told.get(one.id)
        if told is None:
            place = (one.location.datum, one.location.x, one.location.y)
            raised_s, kind = one.raised_at.timestamp(), one.encounter_class.value
            told = self.told[one.id] = Told(one.robots, one.vendors, raised_s, predicted_s, place, kind)
        if one.time_to_conflict_s > 0:
            told.predicted_s = predicted_s
        if one.state is AdvisoryState.CLEARED:
            told.cleared_s = one.updated_at.timestamp()
