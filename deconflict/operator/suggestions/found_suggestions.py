"""Suggestions from the sums of lost time: all rules, and which suggestions come first. Those for a vendor
whose forecasts cost others, and for the clearance, are here.

Pure: the sums, the places of the site and what is known of vendors in; a list of at most five out.
"""

from collections.abc import Iterable
from itertools import chain

from deconflict.operator.ledger.loss_questions import LossQuestion
from deconflict.operator.suggestions.evidence import QUESTIONS, LossEvidence, WarningCounts
from deconflict.operator.suggestions.place_rules import (
    LEAST_LOSSES,
    LEAST_S,
    dock_suggestions,
    is_enough,
    is_steady,
    one_way_suggestions,
    priority_suggestions,
    saved,
)
from deconflict.operator.suggestions.suggested_places import SuggestedPlaces
from deconflict.operator.suggestions.suggestion import expected_s, minutes, whatif_command
from deconflict.operator.suggestions.worst_places import worst_places
from deconflict_client.answers.loss_models import LossList
from deconflict_client.answers.suggestion_models import Saving, Suggestion, SuggestionEvidence, SuggestionList
from deconflict_client.counted_nouns import count_of

UNANNOUNCED = ("blockage",)
"""The other robot stands for nobody, where its forecast said that it would drive."""
LEAST_TIMES_OTHERS = 2.0
"""Robots of the vendor cost others so many times as much as a robot of the other vendors does."""
BAD_GRADES = ("D", "E")
LEAST_WARNINGS, LEAST_STOPS = 50, 30
CLEARLY_IN_VAIN, CLEARLY_SEEN, HARDLY = 0.2, 0.05, 0.02
"""Shares of the warnings in vain and of the stops seen."""


def vendor_suggestions(evidence: LossEvidence, places: SuggestedPlaces) -> Iterable[Suggestion]:
    """The vendor with bad forecasts whose robots stand in others' way more often than others' do."""
    robots = {
        vendor: known.robots
        for vendor, known in evidence.forecasts.items()
        if known.robots and vendor not in places.people
    }
    pairs = [pair for pair in evidence.pairs if pair.kind in UNANNOUNCED and pair.vendor != pair.by]
    for vendor in sorted(robots):
        others = sum(count for name, count in robots.items() if name != vendor)
        if evidence.forecasts[vendor].grade not in BAD_GRADES or not others:
            continue
        caused = [pair for pair in pairs if pair.by == vendor]
        lost_s = sum(pair.lost_s for pair in caused)
        usual_s = (
            robots[vendor] * sum(pair.lost_s for pair in pairs if pair.by in robots and pair.by != vendor) / others
        )
        keys = {pair.key for pair in caused}
        figures = evidence.of_pairs(caused)
        if lost_s >= LEAST_TIMES_OTHERS * usual_s and is_enough(figures) and is_steady(evidence, keys):
            yield _vendor(vendor, evidence.forecasts[vendor].grade, figures, (lost_s - usual_s) / evidence.hours)


def _vendor(vendor: str, grade: str, figures: SuggestionEvidence, most_s: float) -> Suggestion:
    saving = Saving(low_s_per_hour=0.0, high_s_per_hour=round(most_s, 1))
    text = (
        f"Ask {vendor} to announce stops and to report better forecasts (now of grade {grade}): others lose "
        f"{minutes(figures.lost_s_per_hour)} an hour to its robots that stand in their way, and this would save "
        f"{saved(saving)}."
    )
    return Suggestion(kind="vendor", vendor=vendor, text=text, evidence=figures, saving=saving, check="")


def clearance_suggestions(evidence: LossEvidence) -> Iterable[Suggestion]:
    """A clearance with clearly fewer warnings in vain and hardly fewer stops seen, or with clearly more seen and
    hardly more in vain. It changes warnings, and no lost time by itself."""
    if not evidence.warnings:
        return
    now, *others = evidence.warnings
    if now.warnings < LEAST_WARNINGS or now.stops < LEAST_STOPS:
        return
    better = [other for other in others if _is_better(now, other)]
    if better:
        best = max(better, key=lambda other: (other.seen - now.seen, now.in_vain - other.in_vain))
        yield _clearance(evidence, now, best)


def _is_better(now: WarningCounts, other: WarningCounts) -> bool:
    seen = (other.seen - now.seen) / now.stops
    in_vain = (other.in_vain - now.in_vain) / max(now.in_vain, 1)
    fewer_in_vain = seen >= -HARDLY and in_vain <= -CLEARLY_IN_VAIN
    return fewer_in_vain or (seen >= CLEARLY_SEEN and in_vain <= HARDLY)


def _clearance(evidence: LossEvidence, now: WarningCounts, best: WarningCounts) -> Suggestion:
    size = "smaller" if best.clearance_m < now.clearance_m else "larger"
    text = (
        f"Make the clearance {size}, {best.clearance_m:g} m instead of {now.clearance_m:g} m: in this log "
        f"{count_of(best.in_vain, 'warning')} instead of {now.in_vain} would have been in vain, and {best.seen} of "
        f"{count_of(now.stops, 'stop')} for others instead of {now.seen} would have had a warning."
    )
    command = whatif_command("--set", f"clearance={best.clearance_m:g}")
    return Suggestion(kind="clearance", text=text, evidence=evidence.of_cells((), ()), saving=None, check=command)


MOST_SUGGESTIONS = 5
OF_NO_PLACE = "vendor", "clearance"
"""Kinds of suggestions that no place has."""
MOST_ROWS = 20_000
"""Of each sum; the smallest are left out."""
NOTHING_STANDS_OUT = "no place, crossing or vendor stands out enough for a suggestion"
TOO_LITTLE = "too little time was lost yet to suggest anything"


def evidence_questions(from_s: float, until_s: float) -> list[LossQuestion]:
    """What to ask the ledger for `evidence_of`."""
    return [LossQuestion(from_s, until_s, keys, limit=MOST_ROWS) for keys in QUESTIONS]


def found_suggestions(evidence: LossEvidence, places: SuggestedPlaces) -> list[Suggestion]:
    """The suggestions, the largest expected saving first."""
    found = chain(
        dock_suggestions(evidence, places),
        one_way_suggestions(evidence, places),
        priority_suggestions(evidence, places),
        vendor_suggestions(evidence, places),
        clearance_suggestions(evidence),
    )
    return ranked(found)


def ranked(suggestions: Iterable[Suggestion]) -> list[Suggestion]:
    return sorted(suggestions, key=lambda each: expected_s(each.saving), reverse=True)[:MOST_SUGGESTIONS]


def suggestion_list(evidence: LossEvidence, places: SuggestedPlaces, span: LossList) -> SuggestionList:
    """The suggestions of the span of an answer of the ledger."""
    return SuggestionList(
        from_s=span.from_s,
        until_s=span.until_s,
        hours=round(evidence.hours, 2),
        suggestions=(found := found_suggestions(evidence, places)),
        places=worst_places(evidence, places, span.from_s),
        none_because="" if found else none_because(evidence),
    )


def none_because(evidence: LossEvidence) -> str:
    """Why there is no suggestion."""
    losses = sum(cell.losses for cell in evidence.cells)
    return TOO_LITTLE if evidence.lost_s < LEAST_S or losses < LEAST_LOSSES else NOTHING_STANDS_OUT
