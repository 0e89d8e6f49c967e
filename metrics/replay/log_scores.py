"""The scores of a replay: what happened on the floor, compared with the output of every engine."""

from collections import Counter
from collections.abc import Sequence
from contextlib import closing
from math import floor, inf
from typing import Any

from deconflict.foresight.near_misses.near_events import NearEvent
from deconflict.foresight.near_misses.warning_before import lead_of, warning_before
from deconflict.operator.ledger.loss_ledger import LedgerEntry, LossLedger
from deconflict.operator.ledger.loss_questions import LossQuestion
from deconflict.settings.site import Site
from deconflict_client.answers.loss_models import LossKey
from ingest.batch import Pair
from ingest.languages import timestamps
from metrics.replay import conformance_counts
from metrics.replay.clearance_scores import ClearanceScores
from metrics.replay.engine_output import EngineOutput
from metrics.replay.recorded_passes import EnginePass, PassReader
from metrics.scoring.arrival_scores import ArrivalScores
from metrics.scoring.contention_scores import ContentionScores
from metrics.scoring.forecast_scores import ForecastScores
from metrics.scoring.situation_scores import LONG_STOP_S, SituationScores, SituationTruth
from metrics.scoring.vendor_records import VendorRecords
from metrics.scoring.warnings.listed_cases import LogNames
from metrics.truth.absences import Absences
from metrics.truth.encounters import EncounterFinder
from metrics.truth.interactions import Interactions
from metrics.truth.nearest_scenes import NearestScene
from metrics.truth.placebo import Placebo
from metrics.truth.recent_tracks import RecentTracks
from metrics.truth.resource_use import TimeSpan

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
