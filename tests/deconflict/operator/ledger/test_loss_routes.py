"""`GET /losses`."""

import json

import httpx
import pytest
from fastapi import FastAPI

from deconflict.operator.ledger.loss_ledger import LossLedger
from deconflict.operator.ledger.loss_questions import LossQuestion
from deconflict.operator.ledger.loss_routes import add_loss_routes
from deconflict.settings.site import LossSettings
from deconflict_client.answers.loss_models import LossList
from tests.deconflict.operator.ledger.made_entries import CROSSED, LATER, QUEUED, START_S

SPAN = {"from_s": START_S, "until_s": START_S + 86400}


@pytest.fixture
async def client() -> httpx.AsyncClient:
    ledger, app = LossLedger(None, LossSettings(currency="EUR", cost_per_robot_hour={"Alder": 36.0})), FastAPI()
    ledger.add("engine", 1, [QUEUED, CROSSED, LATER, QUEUED._replace(vendor="=1+1")])

    async def ask(question: LossQuestion) -> LossList:
        return ledger.ask(question)

    async def unknown(**names: str | None) -> dict[str, str]:
        return {parameter: f"no {name}, ö" for parameter, name in names.items() if name}

    add_loss_routes(app, ask, unknown)
    return httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://face")


async def test_the_rows_have_the_keys_that_were_asked_for(client: httpx.AsyncClient) -> None:
    document = (await client.get("/losses", params=SPAN | {"group": "vendor,kind", "vendor": "Alder"})).json()
    nothing = {"refusals": 0, "refused_s": 0.0, "unable": 0, "unable_s": 0.0}
    assert document["rows"] == [
        {"lost_s": 8.0, "sure_s": 8.0, "losses": 1, "cost": 0.08, "vendor": "Alder", "kind": "queue"}
        | {"over_usual_s": 6.0, "warned_s": 8.0, "advised_s": 8.0, "heeded_s": 0.0}
        | nothing,
        {"lost_s": 3.0, "sure_s": 0.0, "losses": 1, "cost": 0.03, "vendor": "Alder", "kind": "crossing"}
        | {"over_usual_s": 2.5, "warned_s": 3.0, "advised_s": 0.0, "heeded_s": 0.0}
        | nothing,
    ]
    assert (document["currency"], document["total"]["lost_s"], document["more"]) == ("EUR", 11.0, False)


async def test_a_limit_says_that_there_is_more(client: httpx.AsyncClient) -> None:
    document = (await client.get("/losses", params=SPAN | {"limit": 1})).json()
    assert (len(document["rows"]), document["more"]) == (1, True)


async def test_an_unknown_key_is_refused_with_those_that_there_are(client: httpx.AsyncClient) -> None:
    answer = await client.get("/losses", params={"group": "vendor,colour"})
    assert answer.status_code == 422
    assert "'colour'" in answer.json()["detail"]
    assert "place" in answer.json()["detail"]


async def test_csv_has_no_text_that_a_spreadsheet_takes_for_a_formula(client: httpx.AsyncClient) -> None:
    text = (await client.get("/losses", params=SPAN | {"group": "vendor", "format": "csv"})).text
    figures = "lost_s,over_usual_s,sure_s,warned_s,advised_s,heeded_s,losses,cost,refusals,refused_s,unable,unable_s"
    assert text.splitlines()[0] == f"vendor,{figures}"
    assert "'=1+1,8.0,6.0,8.0,8.0,8.0,0.0,1,,0,0.0,0,0.0" in text.splitlines()


async def test_a_name_that_nobody_has_is_named_where_nothing_is_found(client: httpx.AsyncClient) -> None:
    nobody = SPAN | {"by": "Nobody"}
    assert (await client.get("/losses", params=nobody)).json()["unknown"] == {"by": "no Nobody, ö"}
    table = await client.get("/losses", params=nobody | {"format": "csv"})
    assert json.loads(table.headers["deconflict-unknown"]) == {"by": "no Nobody, ö"}
    assert len(table.text.splitlines()) == 1
    found = await client.get("/losses", params=SPAN | {"vendor": "Alder"})
    assert "unknown" not in found.json()
