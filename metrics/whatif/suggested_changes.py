"""What to change on a floor, from the losses of its log, each simulated with the model."""

import argparse
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from typing import Any

from deconflict.foresight.losses.loss_places import LossPlaces
from deconflict.operator.ledger.loss_ledger import LossLedger, ledger_entries
from deconflict.operator.ledger.loss_questions import HOUR_S
from deconflict.operator.suggestions.evidence import LossEvidence, Passes, PlaceKey, WarningCounts, evidence_of
from deconflict.operator.suggestions.found_suggestions import (
    OF_NO_PLACE,
    evidence_questions,
    found_suggestions,
    none_because,
)
from deconflict.operator.suggestions.suggested_places import SuggestedPlaces
from deconflict.operator.suggestions.worst_places import changes_of, with_tried, worst_places
from deconflict.settings.site import LossSettings, Site
from deconflict_client.answers.suggestion_models import Saving, Suggestion, TriedChange, WorstPlace
from ingest.recording.log_reader import LogReader
from metrics.replay.replay import replay
from metrics.whatif.answer import ASSUMES, WhatIfModel
from metrics.whatif.change import Change, ChangeError, named_outlines, one_way, passes_of, priority, wider
from metrics.whatif.demand import Demand
from metrics.whatif.more_docks import more_docks
from metrics.whatif.recorded_tracks import RecordedFloor
from metrics.whatif.simulated.ordered_places import demand_past_crossings, ordered

CLEARANCE_SHARES = (0.7, 1.4)
"""Other clearances that are scored, as shares of the site's."""


@dataclass(frozen=True, slots=True)
class SuggestedChanges:
    """The suggestions from a log: the worst places with what was tried, and what concerns the whole floor."""

    hours: float
    places: list[WorstPlace]
    suggestions: list[Suggestion]
    none_because: str
    problems: tuple[str, ...] = ()

    def document(self) -> dict[str, Any]:
        return {
            "hours": self.hours,
            "places": [each.model_dump() for each in self.places],
            "suggestions": [each.model_dump() for each in self.suggestions],
            "none_because": self.none_because,
            "assumes": ASSUMES,
        }

    def lines(self) -> list[str]:
        """For a person."""
        texts = [*(each.text for each in self.places), *(each.text for each in self.suggestions)]
        if not texts:
            return [f"Nothing to suggest: {self.none_because}."]
        lines = [f"{number}. {text}" for number, text in enumerate(texts, 1)]
        return [f"From {60 * self.hours:.0f} min of log, the worst places first:", *lines, *ASSUMES]


def suggested(
    floor: RecordedFloor, site: Site, warnings: Sequence[WarningCounts], args: argparse.Namespace
) -> SuggestedChanges:
    """The suggestions from a log. What may help at the worst places is simulated."""
    demand, places = demand_past_crossings(floor, site), SuggestedPlaces.of(site)
    evidence = replace(loss_evidence(floor, site, warnings), passes=_passes(site, floor, demand))
    asker = _Asker(site, floor, demand, WhatIfModel(floor, demand, args.seeds, args.jobs))
    tried = [
        with_tried(found, [asker.tried(each) for each in changes_of(found, evidence, places)] if found.best else ())
        for found in worst_places(evidence, places, 0.0)
    ]
    of_floor = [found for found in found_suggestions(evidence, places) if found.kind in OF_NO_PLACE]
    reason = "" if tried or of_floor else none_because(evidence)
    return SuggestedChanges(round(evidence.hours, 2), tried, of_floor, reason)


class _Asker:
    """What the model says of changes."""

    def __init__(self, site: Site, floor: RecordedFloor, demand: Demand, model: WhatIfModel) -> None:
        self._site, self._floor, self._demand, self._model = site, floor, demand, model

    def tried(self, change: TriedChange) -> TriedChange:
        """A change with what it saves. A one-way is tried in both directions, and the better one counts."""
        answers = [
            self._answered(change, reverse=reverse) for reverse in (False, *([True] * (change.kind == "one_way")))
        ]
        return max(answers, key=_saved_s)

    def _answered(self, change: TriedChange, *, reverse: bool) -> TriedChange:
        if reverse:
            change = change.model_copy(update={"check": f"{change.check} --reverse"})
        try:
            answer = self._model.ask(self._change(change, reverse=reverse))
        except ChangeError as error:
            return change.model_copy(update={"note": str(error)})
        if answer.problems:
            return change.model_copy(update={"note": "; ".join(answer.problems)})
        lost = answer.figures["lost_s"]
        saving = Saving(low_s_per_hour=-lost.high, high_s_per_hour=-lost.low, by="model")
        return change.model_copy(update={"change": answer.change, "saving": saving})

    def _change(self, change: TriedChange, *, reverse: bool) -> Change:
        if change.kind == "priority":
            return priority(change.subject, self._demand)
        places = named_outlines(self._site, self._floor.floors, change.subject)
        match change.kind:
            case "dock":
                return more_docks(places, self._demand)
            case "order":
                return ordered(places, self._demand, self._floor.losses)
            case "widen":
                return wider(places, self._demand, self._floor.losses)
        return one_way(places[0], self._demand, reverse=reverse)


def _saved_s(change: TriedChange) -> float:
    return -inf if change.saving is None else change.saving.low_s_per_hour + change.saving.high_s_per_hour


def _passes(site: Site, floor: RecordedFloor, demand: Demand) -> dict[PlaceKey, dict[str, Passes]]:
    """How robots of each vendor drive each aisle of the site."""
    found = {}
    for zone in (zone for zone in site.zones if zone.kind == "aisle" and zone.datum in floor.floors):
        [aisle] = named_outlines(site, [zone.datum], zone.id)
        outline = replace(aisle, floor=floor.floors.index(zone.datum))
        found[PlaceKey(zone.datum, zone.label)] = passes_of(outline, demand)
    return found


def loss_evidence(floor: RecordedFloor, site: Site, warnings: Sequence[WarningCounts] = ()) -> LossEvidence:
    """The losses of a log as the ledger of the service would sum them."""
    placed = LossPlaces.of(site).placed(floor.losses, floor.floors)
    with closing(LossLedger(None, LossSettings())) as ledger:
        ledger.add("log", 1, ledger_entries(placed))
        answers = [ledger.ask(question) for question in evidence_questions(0.0, floor.span_s + HOUR_S)]
    return evidence_of(answers, warnings=warnings, span_s=floor.span_s)


def warning_counts(logs: Sequence[Path], site: Site) -> list[WarningCounts]:
    """What came of the warnings of a log with its clearance, and with others."""
    clearance_m = site.conflict.clearance_m
    clearances_m = [clearance_m, *(round(share * clearance_m, 2) for share in CLEARANCE_SHARES)]
    reader = LogReader()
    return [
        WarningCounts(
            score["clearance_m"],
            (warnings := score["warnings"])["alerts"],
            warnings["in_vain"],
            (stops := warnings["stops"])["fresh"],
            round(stops["fresh"] * (stops["told_at_any_time"] or 0.0)),
        )
        for score in replay(reader, reader.read(logs), site, clearances_m)["scores"]
    ]
