"""`GET /suggestions`: what to change on the floor, and why.

What is said of the worst places stands for a shift. At the change of shift it is made anew, from the shift that has
ended. Within a shift a place is added while there are fewer than five, and a change replaces another one only if it
saves more beyond the doubt of both.
"""

import asyncio
import time
from collections.abc import Awaitable, Callable, Sequence
from datetime import datetime, timedelta
from datetime import time as time_of_day
from threading import Lock
from typing import Annotated, Any

from fastapi import FastAPI, Query

from deconflict.operator.ledger.loss_questions import DAY_S
from deconflict.operator.ledger.loss_routes import Ask
from deconflict.operator.suggestions.evidence import VendorForecasts, evidence_of
from deconflict.operator.suggestions.found_suggestions import evidence_questions, suggestion_list
from deconflict.operator.suggestions.suggested_places import SuggestedPlaces
from deconflict.operator.suggestions.worst_places import MOST_PLACES, SQUARE_M, worst_places
from deconflict.operator.vendor_health import vendor_health
from deconflict.settings.site import Site
from deconflict_client.answers.loss_models import LossList
from deconflict_client.answers.suggestion_models import SuggestionList, WorstPlace


def shift_begin(now: datetime, begins: Sequence[str]) -> datetime:
    """When the shift of a local time began. `begins` are the times of day at which shifts begin, such as "06:00"."""
    days = (now - timedelta(days=1), now)
    begun = [datetime.combine(day, time_of_day.fromisoformat(clock), now.tzinfo) for day in days for clock in begins]
    return max(begin for begin in begun if begin <= now)


def standing(kept: Sequence[WorstPlace], found: Sequence[WorstPlace]) -> list[WorstPlace]:
    """What stands within a shift, of what is kept and what is found now."""
    found_at = {_key(place): place for place in found}
    stands = [_better(place, found_at.pop(_key(place), place)) for place in kept]
    return [*stands, *found_at.values()][:MOST_PLACES]


class StandingPlaces:
    """Keeps what stands. Any thread may call it."""

    def __init__(self) -> None:
        self._lock, self._shift_s = Lock(), 0.0
        self._kept: list[WorstPlace] = []

    def update(self, shift_s: float, before: Sequence[WorstPlace], found: Sequence[WorstPlace]) -> list[WorstPlace]:
        """What stands in the shift that began at `shift_s`. `before` is of the one before it, `found` of it so far."""
        with self._lock:
            if shift_s != self._shift_s:
                self._shift_s, self._kept = shift_s, list(before)
            self._kept = standing(self._kept, found)
            return list(self._kept)


def _better(kept: WorstPlace, found: WorstPlace) -> WorstPlace:
    if found.best is None or found.best.saving is None:
        return kept
    most_s = kept.best.saving.high_s_per_hour if kept.best and kept.best.saving else 0.0
    return found if found.best.saving.low_s_per_hour > most_s else kept


def _key(place: WorstPlace) -> tuple[object, ...]:
    square = () if place.place else (place.x_m // SQUARE_M, place.y_m // SQUARE_M)
    return place.floor, place.place, *square


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
