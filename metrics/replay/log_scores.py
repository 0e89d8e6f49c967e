"""The scores of a replay: what happened on the floor, compared with the output of every engine."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from math import floor, inf
from typing import Any

from deconflict.foresight.near_misses.near_events import NearEvent
from deconflict.foresight.near_misses.warning_before import lead_of, warning_before
from deconflict.operator.ledger.loss_ledger import LedgerEntry, LossLedger
from deconflict.operator.ledger.loss_questions import LossQuestion
from deconflict.settings.site import Site
from deconflict_client.advisory import AdvisoryState
from deconflict_client.answers.loss_models import LossKey
from ingest.batch import Batch, Pair
from ingest.languages import timestamps
from metrics.replay import conformance_counts
from metrics.replay.engine_output import EngineOutput
from metrics.replay.recorded_passes import EnginePass, PassReader
from metrics.scoring.arrival_scores import ArrivalScores
from metrics.scoring.contention_scores import ContentionScores
from metrics.scoring.forecast_scores import ForecastScores
from metrics.scoring.situation_scores import LONG_STOP_S, SituationScores, SituationTruth
from metrics.scoring.vendor_records import VendorRecords
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
from metrics.truth.nearest_scenes import NearestScene
from metrics.truth.pair_outcomes import AllPairOutcomes
from metrics.truth.placebo import Placebo
from metrics.truth.recent_tracks import RecentTracks
from metrics.truth.resource_use import TimeSpan


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


LOSS_KEYS: tuple[tuple[LossKey, ...], ...] = (("vendor", "by"), ("floor", "place"))


class LogScores:
    """What happened in one log, and the scores of every clearance. The first clearance's engine gives all figures that
    do not depend on the clearance."""

    def __init__(self, site: Site, clearances_m: Sequence[float]) -> None:
        self.truth = EncounterFinder(clearances_m, site.conflict.clear_margin_m)
        self.tracks, self._clearance_m = RecentTracks(), clearances_m[0]
        self.interactions = Interactions(Placebo())
        self.absences = Absences(clearances_m)
        self.by_clearance = [
            ClearanceScores(clearance_m, self.truth, self.interactions, self.absences) for clearance_m in clearances_m
        ]
        self.forecasts, self.arrivals, self.contention = ForecastScores(), ArrivalScores(), ContentionScores(site)
        self.situations = SituationScores()
        self.names = LogNames(floor_names={datum.id: datum.name for datum in site.datums})
        self._vendors = VendorRecords()
        self._losses: list[LedgerEntry] = []
        self._loss_settings = site.losses
        self._second: int | None = None

    def add(self, engine_pass: EnginePass, outputs: Sequence[EngineOutput]) -> None:
        """Add one pass and the output of each engine at it."""
        now_s, batch = engine_pass.now_s, engine_pass.batch
        self.names.vendor_of.update(zip(batch.robots, batch.vendors, strict=True))
        self.names.name_of.update(zip(batch.robots, batch.names, strict=True))
        self.names.participant_of.update(zip(batch.robots, batch.participants, strict=True))
        self.names.floors = batch.floors
        self.tracks.add_batch(batch)
        self.truth.add_batch(batch)
        self.absences.add_batch(batch)
        self.interactions.add_batch(batch, self.forecasts.add_batch(batch, now_s, outputs[0].bands_m))
        self.arrivals.add_batch(batch)
        self.contention.add_batch(batch)
        self.contention.add_output(now_s, outputs[0].advisories, outputs[0].place_forecast)
        self.situations.add(now_s, outputs[0].situations)
        self._losses += outputs[0].losses
        for scores, output in zip(self.by_clearance, outputs, strict=True):
            scores.add(now_s, batch, output)
        self._advance_believers(now_s)
        if engine_pass.measures and outputs[0].measures:
            self._vendors.update(now_s, (engine_pass.measures, outputs[0].measures))
        known_until_s = self.truth.until_s
        self.truth.advance(now_s)
        if self.truth.until_s > known_until_s:
            self._resolve()
            self.truth.scenes.measure(self.truth.until_s, self._event)

    def result(self, passes: PassReader, measures: dict[str, Any]) -> dict[str, Any]:
        """What the log holds, and the scores of every clearance. Call it once, after the last pass.

        `measures` are the final measures of the first clearance's engine.
        """
        self._finish()
        self.names.first_s = passes.first_s
        scores = [scores.figures(self.names, passes.now_s) for scores in self.by_clearance]
        ece = {row["vendor"]: row["ece"] for row in scores[0]["by_vendor"]}
        self.truth.scenes.measure(inf, self._event)
        nearest = [self._scene(scene) for scene in self.truth.scenes.finish(self.truth.motion)]
        self._vendors.update(passes.now_s, (passes.measures(), measures))
        contention = self.contention.figures()
        return {
            **_span(passes),
            "floors": dict(self.names.floor_names),
            "messages": passes.messages,
            "robots": len(self.names.vendor_of),
            "participants": dict(Counter(self.names.participant_of.values())),
            "span_s": passes.span_s,
            "scores": scores,
            "interactions": self.interactions.figures(),
            "vendors": self._vendors.figures(ece),
            "forecast_error": self.forecasts.figures(),
            "arrivals": self.arrivals.figures(),
            "contention": contention,
            "situations": self.situations.figures(self._situation_truth(passes.span_s)),
            "places": self.contention.place_figures(),
            "advisories_raised": dict(sorted(self.by_clearance[0].raised.items())),
            "losses": self._loss_figures(),
            "nearest": nearest,
            "conformance": conformance_counts.findings(passes.fleet.measures),
        }

    def _loss_figures(self) -> dict[str, Any]:
        """Lost time as the live ledger has it."""
        with closing(LossLedger(None, self._loss_settings)) as ledger:
            ledger.add("replay", 1, self._losses)
            by_vendors, by_place = (ledger.ask(LossQuestion(0.0, inf, keys)) for keys in LOSS_KEYS)
        rows = {"by_vendors": by_vendors.rows, "by_place": by_place.rows}
        lists = {name: [row.model_dump() for row in found] for name, found in rows.items()}
        return {"currency": by_vendors.currency, "total": by_vendors.total.model_dump(), **lists}

    def _situation_truth(self, span_s: float) -> SituationTruth:
        """What happened, by the outcomes at the first clearance. Call it after the figures of contention."""
        first, silences = self.by_clearance[0], self.truth.silences
        advised: dict[Pair, list[TimeSpan]] = {}
        for alert in first.advisories.values():
            advised.setdefault(alert.pair, []).append(TimeSpan(alert.raised_s, alert.cleared_s))
        return SituationTruth(
            span_s=span_s,
            robot_hours=sum(silences.present_s().values()) / 3600,
            outcomes=first.outcomes.every(),
            lasting_s=first.outcomes.lasting_onsets_s(LONG_STOP_S),
            advised=advised,
            others=self.contention.outcomes,
            waits=first.waits,
            left_s=silences.left_s,
        )

    def _advance_believers(self, now_s: float) -> None:
        """Advance the path believers at the first pass of each second."""
        before, self._second = self._second, floor(now_s)
        if before == self._second:
            return
        fallen_silent = self.truth.silences.fallen_silent(now_s)
        for scores in self.by_clearance:
            scores.believer.advance(now_s, fallen_silent)

    def _finish(self) -> None:
        """Process what still waits for later reports."""
        self.truth.finish()
        self.absences.finish()
        self.forecasts.finish()
        self._resolve()

    def _resolve(self) -> None:
        for scores in self.by_clearance:
            scores.resolve(self.names.vendor_of)

    def _event(self, pair: Pair, at_s: float) -> NearEvent | None:
        return self.tracks.event(pair, self._clearance_m, at_s, self.truth.motion.newest_s)

    def _scene(self, scene: NearestScene) -> dict[str, Any]:
        """One of the nearest moments, and the lead of the first clearance's advisory that warned of it."""
        at_s, began_s = scene.at_s, scene.began_s
        advisories = (each for each in self.by_clearance[0].advisories.values() if each.pair == scene.pair)
        lead = lead_of(warning_before(advisories, began_s), began_s)
        floor_id = self.names.floors[scene.floor] if scene.floor >= 0 else ""
        return {
            "vendors": [self.names.vendor_of[robot] for robot in scene.pair],
            "names": [self.names.name_of[robot] for robot in scene.pair],
            "at": timestamps.write(at_s),
            "began_at": timestamps.write(began_s) if scene.event else None,
            "into_s": round(at_s - self.names.first_s, 1),
            "floor": floor_id,
            "floor_name": self.names.floor_names.get(floor_id, ""),
            "warned_s": lead.raised_s if lead else None,
            "warned_until_s": lead.cleared_s if lead else None,
            **scene.document(),
        }


def _span(passes: PassReader) -> dict[str, str]:
    """When the log begins and ends; nothing if it has no message."""
    if not passes.messages:
        return {}
    return {"from": timestamps.write(passes.first_s), "until": timestamps.write(passes.last_s)}
