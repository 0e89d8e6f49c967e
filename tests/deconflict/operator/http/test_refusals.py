"""Every refusal has one form: an object with a sentence as `detail`."""

from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from deconflict.settings.site import Person
from tests.deconflict.operator.http.served_face import Served, served
from tests.helpers.made_advisories import cleared, made
from tests.helpers.plain_http import http_client

KIM = {"authorization": "Bearer kim-has-a-long-token"}
ANSWER = "/advisories/advisory-1/acknowledgement"


@pytest.fixture
async def face(tmp_path: Path) -> AsyncIterator[Served]:
    async with served(tmp_path / "data") as served_face:
        await served_face.publish(made(1), cleared(1))
        yield served_face


async def refused(face: Served, method: str, address: str, **request: Any) -> tuple[int, str]:
    async with http_client(face.http) as client:
        answer = await client.request(method, address, **request)
    detail = answer.json()["detail"]
    assert isinstance(detail, str)
    return answer.status_code, detail


@pytest.mark.parametrize(
    ("method", "address", "body", "status", "detail"),
    [
        (
            "GET",
            "/advisories?limit=0&state=shut",
            None,
            422,
            "state: Input should be 'open', 'cleared' or 'all'; ",
        ),
        ("GET", "/past", None, 422, "at_s: Field required"),
        ("GET", "/advisories?page=2", None, 422, "page: is no parameter of /advisories"),
        ("GET", "/losses?group=colour", None, 422, "group: 'colour' is no key"),
        ("POST", ANSWER, b"{", 422, "body: is no JSON at character 2: Expecting property name"),
        ("POST", ANSWER, b'{"reason": "seen", "name" "Kim"}', 422, "body: is no JSON at character 27: Expecting ':'"),
        ("POST", ANSWER, b"", 422, "body: Field required"),
        ("POST", ANSWER, b"{}", 422, "reason: Field required"),
        ("POST", ANSWER, b'{"reason": "seen"}', 422, "name: is empty"),
        ("POST", ANSWER, b'{"reason": "seen", "name": "Kim"}', 409, "'advisory-1' is cleared"),
        ("POST", ANSWER, b'"' + b"x" * 70_000 + b'"', 413, "a body has 65536 bytes at most"),
        ("POST", "/robots/no-uuid/owner", b'{"vendor": "Acme"}', 422, "uuid: Input should be a valid UUID"),
        ("GET", "/advisories/advisory-9", None, 404, "no advisory 'advisory-9' is stored"),
        ("GET", "/nothing", None, 404, "there is no /nothing; GET /openapi.json lists all addresses"),
        ("GET", "/advisory/a%0A1", None, 404, "there is no /advisory/a"),
        ("POST", "/advisories", None, 405, "/advisories can't be asked by POST; expected GET"),
        ("DELETE", "/robots/1/owner", None, 405, "/robots/1/owner can't be asked by DELETE; expected POST"),
    ],
)
async def test_a_refusal_is_one_sentence(
    face: Served, method: str, address: str, body: bytes | None, status: int, detail: str
) -> None:
    found, text = await refused(face, method, address, content=body, headers={"content-type": "application/json"})
    assert (found, text[: len(detail)]) == (status, detail)


async def test_a_refused_site_file_a_silent_role_and_a_fault_have_the_same_form(face: Served) -> None:
    async with http_client(face.http) as client:
        assert "detail" not in (await client.post("/site/reload")).json()
    assert await refused(face, "POST", "/site/reload") == (422, "conflict.clearance_m: is missing")
    face.sources.down = {"receiver"}
    assert (await refused(face, "GET", "/robots"))[0] == 503
    face.sources.blackboxes = lambda: 1 / 0  # type: ignore[method-assign, assignment, return-value]
    assert await refused(face, "GET", "/blackboxes") == (500, "the service failed at this request; its log says why")


async def test_who_may_not_is_told_so_in_the_same_form(tmp_path: Path) -> None:
    (tmp_path / "token").write_text("kim-has-a-long-token")
    people = (Person(name="Kim", role="read", token=f"file:{tmp_path / 'token'}"),)
    async with served(tmp_path / "data", people=people) as face:
        assert (await refused(face, "GET", "/advisories"))[0] == 401
        assert (await refused(face, "POST", "/site/reload", headers=KIM))[0] == 403


async def test_the_description_says_so_of_every_refusal(face: Served) -> None:
    async with http_client(face.http) as client:
        described = (await client.get("/openapi.json")).json()
    models = described["components"]["schemas"]
    for path, methods in described["paths"].items():
        for method in methods.values():
            for code, answer in method["responses"].items():
                if code >= "400" and path != "/healthz":
                    model = answer["content"]["application/json"]["schema"]["$ref"].rpartition("/")[2]
                    assert models[model]["properties"]["detail"]["type"] == "string", (path, code)
    assert "HTTPValidationError" not in models
