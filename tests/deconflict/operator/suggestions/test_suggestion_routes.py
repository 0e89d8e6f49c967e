"""`GET /suggestions`."""

from typing import Any

import httpx
from fastapi import FastAPI

from deconflict.operator.ledger.loss_ledger import LossLedger
from deconflict.operator.ledger.loss_questions import LossQuestion
from deconflict.operator.suggestions.suggestion_routes import add_suggestion_routes
from deconflict.settings.site import LossSettings
from deconflict_client.answers.loss_models import LossList
from ingest.measures.measures import Measures
from tests.deconflict.operator.suggestions.made_evidence import HOURS, SITE, START_S, every_hour, loss

SPAN = {"from_s": START_S, "until_s": START_S + HOURS * 3600}


def client(*kinds: str) -> httpx.AsyncClient:
    """A service whose robots lost time in these ways beside the lane's dock. Corvid has bad forecasts."""
    ledger, app, measures = LossLedger(None, LossSettings()), FastAPI(), Measures()
    for number, kind in enumerate(kinds):
        ledger.add("engine", number, every_hour(loss(kind, "Yard", 60.0, 60.0)))
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
