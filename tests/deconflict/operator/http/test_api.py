import json
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from jsonschema import Draft202012Validator
from openapi_spec_validator import validate

from deconflict_client.situations import BAD_AFTER, BAD_KINDS, POSITION_LOST, STORE_FAILED
from tests.deconflict.operator.http.served_face import ROBOT_DOCUMENTS, Served, served
from tests.helpers.made_advisories import ROBOTS, cleared, made
from tests.helpers.plain_http import http_client

API_PAGE = Path(__file__).parents[4] / "docs" / "api.md"


@pytest.fixture
async def face(tmp_path: Path) -> AsyncIterator[Served]:
    async with served(tmp_path) as served_face:
        yield served_face


@pytest.fixture
async def client(face: Served) -> AsyncIterator[httpx.AsyncClient]:
    async with http_client(face.http) as http:
        yield http


async def ids(client: httpx.AsyncClient, query: str = "") -> list[str]:
    answer = await client.get("/advisories" + query)
    assert answer.status_code == 200, answer.text
    return [advisory["id"] for advisory in answer.json()["advisories"]]


async def test_advisories_are_the_open_ones_newest_first_with_the_place_in_the_stream(
    face: Served, client: httpx.AsyncClient
) -> None:
    stored = await face.publish(made(1), made(2), cleared(2), made(1, 2), made(3))
    listing = (await client.get("/advisories")).json()
    assert listing["seq"] == 5
    assert listing["more"] is False
    assert listing["advisories"] == [stored[4].model_dump(mode="json"), stored[3].model_dump(mode="json")]


async def test_advisories_by_state_kind_vendor_robot_and_limit(face: Served, client: httpx.AsyncClient) -> None:
    await face.publish(made(1), made(2, vendors=("Acme", "Cargo")), made(3, robots=("a", "b")), made(4), cleared(4))
    assert await ids(client, "?state=cleared") == ["advisory-4"]
    assert await ids(client, "?state=all") == ["advisory-4", "advisory-3", "advisory-2", "advisory-1"]
    assert await ids(client, "?vendor=Cargo") == ["advisory-2"]
    assert await ids(client, f"?robot={ROBOTS[1].upper()}") == ["advisory-2", "advisory-1"]
    assert await ids(client, "?kind=conflict&limit=1") == ["advisory-3"]
    assert (await client.get("/advisories?limit=1")).json()["more"] is True


async def test_all_open_advisories_of_a_large_floor_are_listed(face: Served, client: httpx.AsyncClient) -> None:
    await face.publish(*(made(number) for number in range(1, 1202)))
    listing = (await client.get("/advisories?limit=10000")).json()
    assert (len(listing["advisories"]), listing["more"]) == (1201, False)


@pytest.mark.parametrize(
    ("address", "detail"),
    [
        ("/advisories?after=4", "after: is no parameter of /advisories; expected state, "),
        ("/robots?name=A-1", "name: is no parameter of /robots; expected vendor"),
        ("/vendors?grade=A", "grade: is no parameter of /vendors; it has none"),
        ("/heat?until=5", "until: is no parameter of /heat; expected until_s"),
    ],
)
async def test_an_unknown_parameter_is_refused(client: httpx.AsyncClient, address: str, detail: str) -> None:
    answer = await client.get(address)
    assert answer.status_code == 422
    assert answer.json()["detail"].startswith(detail)


@pytest.mark.parametrize("query", ["state=shut", "kind=collision", "limit=0", "limit=100000", "limit=many"])
async def test_an_invalid_query_names_the_parameter(client: httpx.AsyncClient, query: str) -> None:
    answer = await client.get(f"/advisories?{query}")
    assert answer.status_code == 422
    assert answer.json()["detail"].startswith(f"{query.split('=', maxsplit=1)[0]}: Input should be ")


async def test_one_advisory_is_all_its_revisions(face: Served, client: httpx.AsyncClient) -> None:
    await face.publish(made(1), made(2), made(1, 2), cleared(1, 3))
    revisions = (await client.get("/advisories/advisory-1")).json()["advisories"]
    assert [(revision["revision"], revision["state"]) for revision in revisions] == [
        (1, "raised"),
        (2, "updated"),
        (3, "cleared"),
    ]
    missing = await client.get("/advisories/advisory-7")
    assert missing.status_code == 404
    assert "advisory-7" in missing.json()["detail"]


async def test_robots_are_what_the_receiver_knows_and_a_number_that_json_lacks_is_null(
    client: httpx.AsyncClient,
) -> None:
    assert (await client.get("/robots")).json() == {
        "robots": [ROBOT_DOCUMENTS[0], ROBOT_DOCUMENTS[1] | {"age_s": None}]
    }
    assert (await client.get("/robots?vendor=Acme")).json() == {"robots": [ROBOT_DOCUMENTS[0]]}
    assert (await client.get(f"/robots/{ROBOTS[0].upper()}")).json() == ROBOT_DOCUMENTS[0]
    assert (await client.get("/robots/nobody")).status_code == 404


async def test_rejected_messages_are_shown_with_their_reasons(client: httpx.AsyncClient) -> None:
    (rejected,) = (await client.get("/quarantine")).json()["rejected"]
    assert rejected["reason"] == "ends too early"


@pytest.mark.parametrize("path", ["/robots", f"/robots/{ROBOTS[0]}", "/quarantine"])
async def test_an_answer_that_needs_a_silent_role_is_503_and_names_the_role(
    face: Served, client: httpx.AsyncClient, path: str
) -> None:
    face.sources.down = {"receiver"}
    answer = await client.get(path)
    assert answer.status_code == 503
    assert answer.json()["role"] == "receiver"
    assert "the receiver does not answer" in answer.json()["detail"]
    assert await ids(client) == []


async def test_health_is_200_only_while_every_role_and_the_store_answer(
    face: Served, client: httpx.AsyncClient
) -> None:
    await face.publish(made(1))
    answer = await client.get("/healthz")
    assert answer.status_code == 200
    assert answer.json() == {
        "status": "ok",
        "roles": {"receiver": "up", "engine": "up"},
        "store": {"status": "ok", "seq": 1, "bytes": face.store.used_bytes()},
    }
    for role in ("engine", "supervisor"):
        face.sources.down = {role}
        answer = await client.get("/healthz")
        assert answer.status_code == 503
        assert answer.json()["status"] == "degraded"
        assert answer.json()["roles"][role] == "down"


async def test_a_store_that_fails_shows_in_health_and_advisories(face: Served, client: httpx.AsyncClient) -> None:
    face.store.close()
    answer = await client.get("/healthz")
    assert (answer.status_code, answer.json()["status"]) == (503, "degraded")
    assert answer.json()["store"]["status"] == "failing"
    answer = await client.get("/advisories")
    assert (answer.status_code, answer.json()["role"]) == (503, "store")


async def test_metrics_are_those_of_all_roles(face: Served, client: httpx.AsyncClient) -> None:
    await face.publish(made(1))
    answer = await client.get("/metrics")
    assert answer.headers["content-type"] == "text/plain; version=0.0.4; charset=utf-8"
    lines = answer.text.splitlines()
    assert 'deconflict_messages_total{result="accepted",vendor="Acme"} 7.0' in lines
    assert "deconflict_advisories_stored_total 1.0" in lines
    assert "deconflict_stream_subscribers 0.0" in lines
    assert not [line for line in lines if line.startswith("deconflict_uncatalogued_measures{")]


async def test_metrics_are_served_while_a_role_is_silent_and_show_it(face: Served, client: httpx.AsyncClient) -> None:
    face.sources.down = {"receiver"}
    answer = await client.get("/metrics")
    assert answer.status_code == 200
    assert 'deconflict_role_up{role="receiver"} 0.0' in answer.text.splitlines()
    assert "deconflict_stream_subscribers" in answer.text


async def test_the_schema_describes_what_is_published(face: Served, client: httpx.AsyncClient) -> None:
    schema = (await client.get("/schema/advisory")).json()
    Draft202012Validator.check_schema(schema)
    validator = Draft202012Validator(schema)
    for advisory in await face.publish(made(1), cleared(1)):
        validator.validate(json.loads(advisory.model_dump_json()))
    assert not validator.is_valid(made(1).model_dump(mode="json") | {"severity": "mild"})
    assert not validator.is_valid(made(1).model_dump(mode="json") | {"safety_rated": True})


async def test_what_is_cleared_cannot_be_acknowledged(face: Served, client: httpx.AsyncClient) -> None:
    await face.publish(made(1), cleared(1))
    answer = await client.post(f"/advisories/{made(1).id}/acknowledgement", json={"name": "Kim", "reason": "seen"})
    assert answer.status_code == 409
    assert "is cleared" in answer.json()["detail"]


async def test_the_api_description_is_valid_and_covers_what_is_served(client: httpx.AsyncClient) -> None:
    described = (await client.get("/openapi.json")).json()
    validate(described)
    paths: dict[str, Any] = described["paths"]
    assert set(paths) == {
        "/advisories",
        "/advisories/{advisory_id}",
        "/advisories/{advisory_id}/acknowledgement",
        "/heat",
        "/losses",
        "/past",
        "/plans/{datum}",
        "/presence",
        "/recorded",
        "/robots",
        "/robots/{uuid}",
        "/robots/{uuid}/owner",
        "/robots/{uuid}/off-floor",
        "/site",
        "/vendors",
        "/quarantine",
        "/healthz",
        "/metrics",
        "/blackboxes",
        "/blackboxes/{file}",
        "/schema/advisory",
        "/schema/situation",
        "/schema/advice",
        "/advice",
        "/advice/{advice_id}",
        "/advice/{advice_id}/answer",
        "/situations",
        "/situations/{situation_id}",
        "/situations/{situation_id}/acknowledgement",
        "/suggestions",
        "/shift",
        "/site/reload",
    }
    assert described["components"]["schemas"]["ConflictAdvisory"]["properties"]["severity"]
    undocumented = [
        path for path, methods in paths.items() if not all(method["description"] for method in methods.values())
    ]
    assert not undocumented


async def test_the_index_lists_every_route_and_loads_nothing(client: httpx.AsyncClient) -> None:
    page = (await client.get("/api")).text
    for path in (await client.get("/openapi.json")).json()["paths"]:
        assert f">{path}<" in page
    assert "/advisories/stream" in page
    assert "<script" not in page
    assert "http" not in page
    assert (await client.get("/docs")).status_code == 404


async def test_the_api_page_names_every_route_and_close_code(client: httpx.AsyncClient) -> None:
    page = API_PAGE.read_text()
    paths = [*(await client.get("/openapi.json")).json()["paths"], "/advisories/stream", "/live", "/openapi.json"]
    assert not [path for path in paths if f"`{path}`" not in page.replace("`GET ", "`").replace("`POST ", "`")]
    codes = (BAD_AFTER, BAD_KINDS, POSITION_LOST, STORE_FAILED)
    assert not [code for code in codes if f"`{code}`" not in page]


async def test_an_acknowledgement_is_answered_with_the_advisory_and_listed_for_all(
    face: Served, client: httpx.AsyncClient
) -> None:
    await face.publish(made(1))
    path = "/advisories/advisory-1/acknowledgement"
    answered = await client.post(path, json={"name": " Kim ", "reason": "A-7 is called back"})
    assert answered.status_code == 201, answered.text
    assert (answered.json()["seq"], answered.json()["acknowledgement"]["name"]) == (2, "Kim")
    (listed,) = (await client.get("/advisories")).json()["advisories"]
    assert listed == answered.json()
    await face.publish(made(1, revision=2, summary="they close up"))
    (later,) = (await client.get("/advisories")).json()["advisories"]
    assert (later["summary"], later["acknowledgement"]["summary"]) == ("they close up", made(1).summary)


@pytest.mark.parametrize("body", [{"name": "Kim", "reason": "  "}, {"reason": "called back"}, {"name": "Kim"}, {}])
async def test_an_acknowledgement_needs_a_name_and_a_reason(face: Served, client: httpx.AsyncClient, body: Any) -> None:
    await face.publish(made(1))
    assert (await client.post("/advisories/advisory-1/acknowledgement", json=body)).status_code == 422
    assert face.store.last_seq() == 1


async def test_an_unknown_advisory_can_not_be_acknowledged(client: httpx.AsyncClient) -> None:
    answered = await client.post("/advisories/none/acknowledgement", json={"name": "Kim", "reason": "called back"})
    assert answered.status_code == 404


async def test_a_robot_is_given_to_a_known_vendor(client: httpx.AsyncClient) -> None:
    path = f"/robots/{ROBOT_DOCUMENTS[0]['uuid']}/owner"
    answer = await client.post(path, json={"vendor": " Acme "})
    assert answer.json() == {"uuid": ROBOT_DOCUMENTS[0]["uuid"], "vendor": "Acme", "before": "Borealis"}
    refused = await client.post(path, json={"vendor": "Nobody"})
    assert (refused.status_code, "in no site file" in refused.json()["detail"]) == (409, True)
    assert (await client.post("/robots/no-uuid/owner", json={"vendor": "Acme"})).status_code == 422


async def test_what_is_not_found_while_the_file_is_not_in_use_may_be_in_it(
    face: Served, client: httpx.AsyncClient
) -> None:
    face.store.outage = "advisories.db: database is locked"
    await face.publish(made(1))
    assert await ids(client) == ["advisory-1"]
    answer = await client.get("/advisories/advisory-2")
    assert (answer.status_code, answer.json()["role"]) == (503, "store")
    assert "older ones can't be read: advisories.db: database is locked" in answer.json()["detail"]
    health = (await client.get("/healthz")).json()
    assert (health["status"], health["store"]["status"]) == ("degraded", "in memory")
