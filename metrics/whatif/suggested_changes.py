"""What to change on a floor, from the losses of its log, each simulated with the model."""

import argparse
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from deconflict.foresight.losses.loss_places import LossPlaces
from deconflict.operator.ledger.loss_ledger import LossLedger, ledger_entries
from deconflict.operator.ledger.loss_questions import HOUR_S
from deconflict.operator.suggestions.evidence import LossEvidence, WarningCounts, evidence_of
from deconflict.operator.suggestions.found_suggestions import (
    evidence_questions,
    found_suggestions,
    none_because,
    ranked,
)
from deconflict.operator.suggestions.place_rules import saved
from deconflict.operator.suggestions.suggested_places import SuggestedPlaces
from deconflict.operator.suggestions.suggestion import Saving, Suggestion, whatif_command
from deconflict.settings.site import LossSettings, Site
from ingest.recording.log_reader import LogReader
from metrics.replay.replay import replay
from metrics.whatif.answer import ASSUMES, WhatIfAnswer, WhatIfModel
from metrics.whatif.change import Change, ChangeError, named_outlines, one_way, priority, wider
from metrics.whatif.demand import Demand, demand_of
from metrics.whatif.more_docks import more_docks
from metrics.whatif.recorded_tracks import RecordedFloor

CLEARANCE_SHARES = (0.7, 1.4)
"""Other clearances that are scored, as shares of the site's."""
Asked = tuple[str, Callable[[], Change]]
"""A command, and the change that it asks about. The change raises `ChangeError` if it can't be made."""


@dataclass(frozen=True, slots=True)
class SimulatedSuggestion:
    """A suggestion, and what the model says of it."""

    suggestion: Suggestion
    meaning: str

    def line(self) -> str:
        return f"{self.suggestion.text} {self.meaning}"


@dataclass(frozen=True, slots=True)
class SuggestedChanges:
    """The suggestions from a log."""

    hours: float
    found: list[SimulatedSuggestion]
    none_because: str
    problems: tuple[str, ...] = ()

    def document(self) -> dict[str, Any]:
        suggestions = [each.suggestion.model_dump() | {"simulated": each.meaning} for each in self.found]
        return {"hours": self.hours, "suggestions": suggestions, "none_because": self.none_because, "assumes": ASSUMES}

    def lines(self) -> list[str]:
        """For a person."""
        if not self.found:
            return [f"Nothing to suggest: {self.none_because}."]
        lines = [f"{number}. {each.line()}" for number, each in enumerate(self.found, 1)]
        return [f"From {60 * self.hours:.0f} min of log:", *lines, *ASSUMES]


def suggested(
    floor: RecordedFloor, site: Site, warnings: Sequence[WarningCounts], args: argparse.Namespace
) -> SuggestedChanges:
    """The suggestions from a log. Those that the model contradicts are left out."""
    evidence = loss_evidence(floor, site, warnings)
    suggestions = found_suggestions(evidence, SuggestedPlaces.of(site))
    demand = demand_of(floor)
    model = WhatIfModel(floor, demand, args.seeds, args.jobs)
    simulated = [_simulated(each, _questions(each, site, floor, demand), model) for each in suggestions]
    kept = {each.suggestion.text: each for each in simulated if each is not None}
    found = [kept[each.text] for each in ranked(each.suggestion for each in kept.values())]
    contradicted = "the simulation contradicts what the losses suggest" if suggestions else none_because(evidence)
    return SuggestedChanges(round(evidence.hours, 2), found, "" if found else contradicted)


def loss_evidence(floor: RecordedFloor, site: Site, warnings: Sequence[WarningCounts] = ()) -> LossEvidence:
    """The losses of a log as the ledger of the service would sum them."""
    ledger = LossLedger(None, LossSettings())
    placed = LossPlaces.of(site).placed(floor.losses, floor.floors)
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


def _questions(suggestion: Suggestion, site: Site, floor: RecordedFloor, demand: Demand) -> list[Asked]:
    """What the model can be asked about a suggestion."""
    if suggestion.kind == "priority":
        return [(suggestion.check, lambda: priority(suggestion.vendor, demand))]
    if suggestion.kind not in ("dock", "one_way"):
        return []
    places = named_outlines(site, floor.floors, suggestion.place)
    if suggestion.kind == "dock":
        return [(suggestion.check, lambda: more_docks(places, demand))]
    return [
        (suggestion.check, lambda: one_way(places[0], demand)),
        (f"{suggestion.check} --reverse", lambda: one_way(places[0], demand, reverse=True)),
        (whatif_command("--widen", suggestion.place), lambda: wider(places, demand, floor.losses)),
    ]


def _simulated(suggestion: Suggestion, questions: Iterable[Asked], model: WhatIfModel) -> SimulatedSuggestion | None:
    """A suggestion with what its best question saves; None if each of them clearly loses time."""
    asked, reasons = [], []
    for command, change in questions:
        try:
            answer = model.ask(change())
        except ChangeError as error:
            reasons.append(str(error))
            continue
        if answer.problems:
            reasons += answer.problems
        else:
            asked.append((command, answer))
    if not asked:
        reason = f"Not simulated: {'; '.join(dict.fromkeys(reasons))}." if reasons else "No simulation answers it."
        return SimulatedSuggestion(suggestion, reason)
    command, best = min(asked, key=lambda entry: entry[1].figures["lost_s"].change)
    if best.figures["lost_s"].low > 0:
        return None
    return SimulatedSuggestion(_with_answer(suggestion, command, best), _meaning(best))


def _with_answer(suggestion: Suggestion, command: str, answer: WhatIfAnswer) -> Suggestion:
    lost = answer.figures["lost_s"]
    saving = Saving(low_s_per_hour=-lost.high, high_s_per_hour=-lost.low, by="model")
    return suggestion.model_copy(update={"saving": saving, "check": command})


def _meaning(answer: WhatIfAnswer) -> str:
    lost = answer.figures["lost_s"]
    if lost.meaning == "less":
        saving = Saving(low_s_per_hour=-lost.high, high_s_per_hour=-lost.low, by="model")
        return f"Simulated: if {answer.change}, robots lose {saved(saving)} less."
    return f"Simulated: if {answer.change}, there is no clear change ({lost.low:+.0f} to {lost.high:+.0f} s an hour)."
