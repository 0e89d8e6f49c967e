"""The engine of one clearance, and the situations over its advisories, driven through the passes of a recorded log."""

import logging
from math import floor

from deconflict.advisories.situations.situation_lifecycle import SituationLifecycle
from deconflict.advisories.words.place_names import PlaceNames
from deconflict.engine.engine import Engine
from deconflict.operator.blackbox.start_state import StartState
from deconflict.operator.ledger.loss_ledger import ledger_entries
from deconflict.settings.site import Site
from deconflict_client.situations import advisories_of, situations_of
from metrics.replay.engine_output import EngineOutput, PairProbabilities
from metrics.replay.recorded_passes import EnginePass
from metrics.scoring.place_scores import EVERY_S, PlaceForecast, forecast_of

log = logging.getLogger(__name__)


class EngineRun:
    """One clearance's engine over one log."""

    def __init__(self, site: Site, clearance_m: float, start: StartState) -> None:
        conflict = site.conflict.model_copy(update={"clearance_m": clearance_m})
        self.clearance_m = clearance_m
        self.engine = Engine(
            site.model_copy(update={"conflict": conflict}),
            start.open,
            start.encounters,
            burdens_s=start.burdens_s,
            learned=start.learned,
        )
        self._situations = SituationLifecycle(PlaceNames.of(site).describe)
        self._situations.restore((), start.open)
        self._warn_of_set_aside()
        self._start = None if start.resumed_s is None else start
        """What the engine goes on with after the pass at which a running one had it; None after that."""
        self._second = -1
        """The newest second whose probabilities were read."""
        self._place_slot = -1
        """The newest `EVERY_S` whose place forecast was read."""

    def advance(self, engine_pass: EnginePass) -> EngineOutput:
        """Run one pass of the engine."""
        now_s, batch = engine_pass.now_s, engine_pass.batch
        bands_m = self.engine.foresight.ledger.bands_of(batch)
        self.engine.receive(batch)
        recorded = engine_pass.effort, engine_pass.pending, engine_pass.is_own_log, engine_pass.followed
        advisories = self.engine.step(now_s, *recorded)
        self.engine.advise(now_s, effort=engine_pass.effort)
        if self._start and self._start.resumed_s is not None and now_s >= self._start.resumed_s:
            start, self._start = self._start, None
            self.engine.resume(start.open, start.encounters, start.burdens_s, start.learned, start.under_way)
            self._warn_of_set_aside()
        published = self._situations.published(now_s, list(advisories))
        waiting = self.engine.foresight.following_advice(now_s)
        measures = self.measures() if engine_pass.measures else None
        probabilities, contact_probabilities = self._probabilities(now_s)
        return EngineOutput(
            advisories_of(published),
            probabilities,
            contact_probabilities,
            bands_m,
            waiting,
            measures,
            self._place_forecast(now_s),
            situations_of(published),
            losses=ledger_entries(self.engine.losses),
        )

    def _warn_of_set_aside(self) -> None:
        for part, reason in sorted(self.engine.set_aside.items()):
            text = "the part %r of what the engine had learned is left out, so the replay may differ: %s"
            log.warning(text, part, reason)

    def measures(self) -> dict[str, object]:
        """The engine's measures at present, as a document."""
        return self.engine.measures.as_document()

    def _probabilities(self, now_s: float) -> tuple[PairProbabilities, PairProbabilities]:
        """Probabilities of an interaction and of contact. Empty except at the first pass of each second."""
        if floor(now_s) == self._second:
            return (), ()
        self._second = floor(now_s)
        return self.engine.probabilities(), self.engine.foresight.contact_probabilities()

    def _place_forecast(self, now_s: float) -> PlaceForecast | None:
        """The forecast for shared places at the first pass of each `EVERY_S`; None at other passes."""
        if floor(now_s / EVERY_S) == self._place_slot:
            return None
        self._place_slot = floor(now_s / EVERY_S)
        return forecast_of(self.engine.turns(), self.engine.needs(), self.engine.site.resources)
