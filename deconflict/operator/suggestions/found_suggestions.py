"""Suggestions from the sums of lost time: all rules, and which suggestions come first.

Pure: the sums, the places of the site and what is known of vendors in; a list of at most five out.
"""

from collections.abc import Iterable
from itertools import chain

from deconflict.operator.ledger.loss_questions import LossQuestion
from deconflict.operator.suggestions.evidence import QUESTIONS, LossEvidence
from deconflict.operator.suggestions.place_rules import (
    LEAST_LOSSES,
    LEAST_S,
    dock_suggestions,
    one_way_suggestions,
    priority_suggestions,
)
from deconflict.operator.suggestions.suggested_places import SuggestedPlaces
from deconflict.operator.suggestions.suggestion import expected_s
from deconflict.operator.suggestions.vendor_rules import clearance_suggestions, vendor_suggestions
from deconflict.operator.suggestions.worst_places import worst_places
from deconflict_client.answers.loss_models import LossList
from deconflict_client.answers.suggestion_models import Suggestion, SuggestionList

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
