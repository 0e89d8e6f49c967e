"""`GET /suggestions`."""

from datetime import datetime
from typing import Any

import httpx
from fastapi import FastAPI

from deconflict.operator.ledger.loss_ledger import LossLedger
from deconflict.operator.ledger.loss_questions import LossQuestion
from deconflict.operator.suggestions.suggestion_routes import add_suggestion_routes, shift_begin
from deconflict.settings.site import LossSettings
from deconflict_client.answers.loss_models import LossList
from ingest.measures.measures import Measures
from tests.deconflict.operator.suggestions.made_evidence import HOURS, SITE, START_S, every_hour, loss

MEETING = loss("head_on", "Lane", 30.0, 21.0)
SPAN = {"from_s": START_S, "until_s": START_S + HOURS * 3600}


def client(*kinds: str) -> httpx.AsyncClient:
    """A service whose robots lost time in these ways beside the lane's dock. Corvid has bad forecasts."""
    ledger = LossLedger(None, LossSettings())
    for number, kind in enumerate(kinds):
        ledger.add("engine", number, every_hour(loss(kind, "Yard", 60.0, 60.0)))
    return client_of(ledger)


def client_of(ledger: LossLedger) -> httpx.AsyncClient:
    app, measures = FastAPI(), Measures()
    measures.level("deconflict_robots", {("Alder", "heard"): 5, ("Corvid", "heard"): 5})
    measures.level("deconflict_forecast_grade", {("Alder", "B"): 1, ("Corvid", "E"): 1})

    async def ask(question: LossQuestion) -> LossList:
        return ledger.ask(question)

    async def measured() -> list[dict[str, Any]]:
        return [measures.as_document()]

    add_suggestion_routes(app, ask, measured, lambda: SITE)
    return httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://face")


async def test_suggestions_have_evidence_a_saving_and_a_command() -> None:
    document = (await client("crossing", "blockage").get("/suggestions", params=SPAN)).json()
    assert (document["hours"], document["none_because"]) == (HOURS, "")
    vendor, priority = document["suggestions"]
    assert (priority["kind"], priority["vendor"], priority["saving"]["by"]) == ("priority", "Alder", "rule")
    assert (vendor["kind"], vendor["vendor"]) == ("vendor", "Corvid")
    assert priority["evidence"]["lost_s_per_hour"] == 400.0


async def test_without_losses_the_answer_says_why_there_is_nothing() -> None:
    document = (await client().get("/suggestions", params=SPAN)).json()
    assert document["suggestions"] == []
    assert document["none_because"] == "too little time was lost yet to suggest anything"


async def test_the_worst_places_are_those_of_the_shift_before_and_stand() -> None:
    begin_s = shift_begin(datetime.now().astimezone(), SITE.shifts_begin).timestamp()
    ledger = LossLedger(None, LossSettings())
    early = [entry._replace(from_s=entry.from_s - START_S + begin_s - 6 * 3600) for entry in every_hour(MEETING)]
    ledger.add("engine", 1, early)
    async with client_of(ledger) as asked:
        [lane] = (await asked.get("/suggestions")).json()["places"]
        assert (lane["place"], lane["cause"], lane["since_s"]) == ("Lane", "narrow_lane", begin_s)
        assert (lane["evidence"]["from_s"], lane["evidence"]["until_s"]) == (early[0].from_s, begin_s)
        ledger.add("engine", 2, [entry._replace(kind="blockage") for entry in early])
        assert (await asked.get("/suggestions")).json()["places"] == [lane]
        span = {"from_s": begin_s - 8 * 3600, "until_s": begin_s}
        [of_span] = (await asked.get("/suggestions", params=span)).json()["places"]
    assert of_span["kinds"] == {"head_on": 400.0, "blockage": 400.0}
