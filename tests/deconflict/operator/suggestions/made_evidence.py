"""Ledgers that were made up, and the evidence from them."""

from collections.abc import Sequence
from contextlib import closing

from deconflict.operator.ledger.loss_ledger import LedgerEntry, LossLedger
from deconflict.operator.ledger.loss_questions import HOUR_S
from deconflict.operator.suggestions.evidence import LossEvidence, VendorForecasts, WarningCounts, evidence_of
from deconflict.operator.suggestions.found_suggestions import evidence_questions, found_suggestions
from deconflict.operator.suggestions.suggested_places import SuggestedPlaces
from deconflict.settings.shared_places import NamedArea, Resource, Zone
from deconflict.settings.site import LossSettings, Site
from deconflict_client.answers.suggestion_models import Suggestion
from ingest.settings import Datum

HALL = "11111111-1111-4111-8111-111111111111"
SQUARE = ((0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0))
SITE = Site(
    datums=(Datum(id=HALL, name="Hall"),),
    resources=(Resource(id="dock-1", name="Dock 1", kind="dock", datum=HALL, polygon=SQUARE),),
    zones=(
        Zone(
            id="lane",
            name="Lane",
            kind="aisle",
            datum=HALL,
            polygon=((20.0, 20.0), (40.0, 20.0), (40.0, 22.0), (20.0, 22.0)),
            axis=((20.0, 21.0), (40.0, 21.0)),
        ),
    ),
    areas=(NamedArea(name="Yard", outline_m=((50.0, 50.0), (70.0, 50.0), (70.0, 70.0), (50.0, 70.0))),),
)
START_S = 1_800_000_000 // HOUR_S * HOUR_S
HOURS = 4


def loss(kind: str, place: str, x_m: float, y_m: float, lost_s: float = 20.0) -> LedgerEntry:
    return LedgerEntry(
        START_S, "Alder", "A100", "Corvid", "Corvid", kind, HALL, place, x_m, y_m, lost_s, lost_s, is_sure=True
    )


def every_hour(entry: LedgerEntry, times: int = 20) -> list[LedgerEntry]:
    """So many such losses in each hour."""
    return [
        entry._replace(from_s=START_S + hour * HOUR_S + 10.0 * time) for hour in range(HOURS) for time in range(times)
    ]


def evidence(
    entries: Sequence[LedgerEntry],
    forecasts: dict[str, VendorForecasts] | None = None,
    warnings: Sequence[WarningCounts] = (),
) -> LossEvidence:
    with closing(LossLedger(None, LossSettings())) as ledger:
        ledger.add("engine", 1, entries)
        answers = [ledger.ask(question) for question in evidence_questions(START_S, START_S + HOURS * HOUR_S)]
    return evidence_of(answers, forecasts, warnings)


def suggestions(found: LossEvidence) -> list[Suggestion]:
    return found_suggestions(found, SuggestedPlaces.of(SITE))
