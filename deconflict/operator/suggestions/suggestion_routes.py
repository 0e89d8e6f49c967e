"""`GET /suggestions`: what to change on the floor, and why."""

import asyncio
import time
from collections.abc import Awaitable, Callable, Sequence
from datetime import datetime, timedelta
from typing import Annotated, Any

from fastapi import FastAPI, Query

from deconflict.operator.ledger.loss_questions import DAY_S
from deconflict.operator.ledger.loss_routes import Ask
from deconflict.operator.suggestions.evidence import VendorForecasts, evidence_of
from deconflict.operator.suggestions.found_suggestions import evidence_questions, suggestion_list
from deconflict.operator.suggestions.standing_places import StandingPlaces, shift_begin
from deconflict.operator.suggestions.suggested_places import SuggestedPlaces
from deconflict.operator.suggestions.worst_places import worst_places
from deconflict.operator.vendor_health import vendor_health
from deconflict.settings.site import Site
from deconflict_client.answers.loss_models import LossList
from deconflict_client.answers.suggestion_models import SuggestionList, WorstPlace

DAYS = 7
Measured = Callable[[], Awaitable[list[dict[str, Any]]]]


def add_suggestion_routes(app: FastAPI, ask: Ask, measures: Measured, site: Callable[[], Site]) -> None:
    """`measures` are those of the roles: they have the grades of vendors."""
    stands = StandingPlaces()

    @app.get("/suggestions", response_model=SuggestionList)
    async def suggestions(
        from_s: Annotated[
            float | None, Query(ge=0, allow_inf_nan=False, description="seconds since the epoch; a week ago if absent")
        ] = None,
        until_s: Annotated[float | None, Query(ge=0, allow_inf_nan=False, description="now if absent")] = None,
    ) -> SuggestionList:
        """What to change on the floor so that robots lose less time to each other: at most five, with evidence.

        The worst places are those of the shift before and of this one, and stand for a shift; with a span those of the
        span."""
        end_s = time.time() if until_s is None else until_s
        begin_s = end_s - DAYS * DAY_S if from_s is None else from_s
        answers = [await ask(question) for question in evidence_questions(begin_s, end_s)]
        forecasts, places = _forecasts(await measures()), SuggestedPlaces.of(site())
        found = await asyncio.to_thread(_found, answers, forecasts, places)
        if from_s is None and until_s is None:
            found.places = await _standing(ask, stands, places, site().shifts_begin, end_s)
        return found


async def _standing(
    ask: Ask, stands: StandingPlaces, places: SuggestedPlaces, begins: Sequence[str], now_s: float
) -> list[WorstPlace]:
    """The worst places of the shift before, and what this shift adds."""
    begin = shift_begin(datetime.fromtimestamp(now_s).astimezone(), begins)
    shift_s = begin.timestamp()
    before_s = shift_begin(begin - timedelta(seconds=1), begins).timestamp()
    found = []
    for from_s, until_s, since_s in ((before_s, shift_s, shift_s), (shift_s, now_s, now_s)):
        answers = [await ask(question) for question in evidence_questions(from_s, until_s)]
        found.append(await asyncio.to_thread(_worst, answers, places, since_s))
    return stands.update(shift_s, *found)


def _worst(answers: list[LossList], places: SuggestedPlaces, since_s: float) -> list[WorstPlace]:
    return worst_places(evidence_of(answers), places, since_s)


def _found(answers: list[LossList], forecasts: dict[str, VendorForecasts], places: SuggestedPlaces) -> SuggestionList:
    return suggestion_list(evidence_of(answers, forecasts), places, answers[0])


def _forecasts(documents: list[dict[str, Any]]) -> dict[str, VendorForecasts]:
    return {vendor.name: VendorForecasts(vendor.robots, vendor.grade or "") for vendor in vendor_health(documents)}
