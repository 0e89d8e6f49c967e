import asyncio
import json
import time
from pathlib import Path

import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosedError, InvalidStatus

from deconflict.operator.http.access import exposed_ports, role_needed
from deconflict.settings.site import Operator, Person, Site
from ingest.settings import ReceiverSettings, Vendor
from tests.deconflict.operator.http.served_face import Served, served, until
from tests.helpers.made_advisories import made
from tests.helpers.plain_http import http_client

READER, LEADER, CHIEF = (f"{name}-0123456789abcdef" for name in ("reader", "leader", "chief"))


@pytest.fixture
def people(monkeypatch: pytest.MonkeyPatch) -> tuple[Person, ...]:
    monkeypatch.setenv("READER", READER)
    monkeypatch.setenv("LEADER", LEADER)
    monkeypatch.setenv("CHIEF", CHIEF)
    return (
        Person(name="wallboard", token="env:READER"),
        Person(name="Ada", role="acknowledge", token="env:LEADER"),
    )


def bearer(token: str) -> dict[str, str]:
    return {"authorization": f"Bearer {token}"}


async def test_without_people_everybody_has_access(tmp_path: Path) -> None:
    async with (
        served(tmp_path) as face,
        http_client(face.http) as client,
    ):
        assert (await client.get("/advisories")).status_code == 200


async def test_what_a_page_of_another_site_fetches_without_an_origin_is_refused(tmp_path: Path) -> None:
    elsewhere = {"sec-fetch-site": "cross-site"}
    frame = elsewhere | {"sec-fetch-mode": "navigate", "sec-fetch-dest": "iframe"}
    link = elsewhere | {"sec-fetch-mode": "navigate", "sec-fetch-dest": "document"}
    async with served(tmp_path) as face, http_client(face.http) as client:
        for headers in (elsewhere, frame):
            assert (await client.get("/advisories", headers=headers)).status_code == 403
        assert (await client.post("/reload", headers=link)).status_code == 403
        assert (await client.get("/advisories", headers=link)).status_code == 200
        assert (await client.get("/advisories", headers={"sec-fetch-site": "same-origin"})).status_code == 200
        with pytest.raises(InvalidStatus) as refused:
            await connect(face.stream(), additional_headers=link | {"sec-fetch-mode": "websocket"})
        assert refused.value.response.status_code == 403


async def test_without_a_token_only_health_is_served(tmp_path: Path, people: tuple[Person, ...]) -> None:
    async with (
        served(tmp_path, people=people) as face,
        http_client(face.http) as client,
    ):
        paths = ["/", *(path for path in face.app.openapi()["paths"] if "{" not in path), "/openapi.json", "/absent"]
        answered = {path: (await client.get(path)).status_code for path in paths}
        assert answered.pop("/healthz") == 200
        assert set(answered.values()) == {401}
        for headers in ({}, bearer("guessed-0123456789abcdef")):
            with pytest.raises(InvalidStatus) as refused:
                await connect(face.stream(), additional_headers=headers)
            answer = refused.value.response
            assert (answer.status_code, json.loads(answer.body)["detail"][:26]) == (401, "send 'Authorization: Beare")


async def test_a_token_opens_the_api_and_the_stream(tmp_path: Path, people: tuple[Person, ...]) -> None:
    async with served(tmp_path, people=people) as face:
        async with http_client(face.http, headers=bearer(READER)) as client:
            assert (await client.get("/robots")).status_code == 200
        await face.publish(made(1))
        async with connect(face.stream("?after=0"), additional_headers=bearer(READER)) as stream:
            assert '"advisory-1"' in str(await stream.recv())


async def test_a_browser_signs_in_once(tmp_path: Path, people: tuple[Person, ...]) -> None:
    async with (
        served(tmp_path, people=people) as face,
        http_client(face.http) as browser,
    ):
        page = await browser.get("/", headers={"accept": "text/html"})
        assert (page.status_code, 'action="/login"' in page.text) == (401, True)
        assert (await browser.post("/login", data={"token": "guessed-0123456789abcdef"})).status_code == 401
        assert (await browser.get("/advisories")).status_code == 401
        entered = await browser.post("/login", data={"token": READER})
        assert entered.status_code == 303
        assert {"HttpOnly", "SameSite=strict"} <= set(entered.headers["set-cookie"].split("; "))
        assert READER not in entered.headers["set-cookie"]
        assert (await browser.get("/advisories")).status_code == 200


async def test_refused_requests_are_logged_once_for_each_reason_and_never_with_their_token(
    tmp_path: Path, people: tuple[Person, ...], caplog: pytest.LogCaptureFixture
) -> None:
    guessed = "guessed-0123456789abcdef"
    async with served(tmp_path, people=people) as face, http_client(face.http) as client:
        for _ in range(2):
            await client.get("/", headers={"accept": "text/html"})
            await client.get(f"/advisories?token={guessed}")
            await client.get("/robots", headers=bearer(guessed))
            await client.post("/login", data={"token": guessed})
            await client.post("/site/reload", headers=bearer(READER))
            await client.get("/advisories", headers={"origin": "https://elsewhere.example"})
            with pytest.raises(InvalidStatus):
                await connect(face.stream(), additional_headers=bearer(guessed))
    logged = [record.getMessage() for record in caplog.records if "is refused" in record.getMessage()]
    begin = "127.0.0.1 at the operators' port is refused, which is logged once an hour: "
    assert logged == [
        f"{begin}it sends no token and has not signed in",
        f"{begin}its token is nobody's",
        f"{begin}it signs in with a token that is nobody's",
        f"{begin}wallboard has the role read; this takes the role administer",
        f"{begin}pages of other sites may not use this service",
    ]
    assert not any(secret in caplog.text for secret in (guessed, READER, "elsewhere"))


async def test_reloading_the_site_needs_the_role_administer(tmp_path: Path, people: tuple[Person, ...]) -> None:
    chief = Person(name="Grace", role="administer", token="env:CHIEF")
    async with (
        served(tmp_path, people=(*people, chief)) as face,
        http_client(face.http) as client,
    ):
        for token, may in ((READER, "read"), (LEADER, "acknowledge")):
            refused = await client.post("/site/reload", headers=bearer(token))
            assert (refused.status_code, f"role {may}" in refused.json()["detail"]) == (403, True)
        assert face.sources.reloads == 0
        applied = await client.post("/site/reload", headers=bearer(CHIEF))
        assert (applied.status_code, applied.json()["needs_restart"]) == (200, ["receiver.port"])
        refused = await client.post("/site/reload", headers=bearer(CHIEF))
        assert (refused.status_code, refused.json()["applied"]) == (422, False)
        assert refused.json()["problems"]


async def test_changed_people_apply_at_once_and_end_the_sessions_of_removed_people(
    tmp_path: Path, people: tuple[Person, ...]
) -> None:
    async with (
        served(tmp_path, people=people) as face,
        http_client(face.http) as browser,
    ):
        await browser.post("/login", data={"token": READER})
        assert (await browser.get("/advisories")).status_code == 200
        face.app.state.people.renew(people[1:])
        assert (await browser.get("/advisories")).status_code == 401
        assert (await browser.get("/advisories", headers=bearer(LEADER))).status_code == 200


@pytest.mark.parametrize("found", ["", None])
async def test_a_token_that_can_not_be_read_as_the_people_change_ends_no_session(
    tmp_path: Path, people: tuple[Person, ...], found: str | None
) -> None:
    file = tmp_path / "token"
    file.write_text(CHIEF)
    chief = Person(name="chief", role="administer", token=f"file:{file}")
    async with served(tmp_path, people=(*people, chief)) as face, http_client(face.http) as browser:
        await browser.post("/login", data={"token": CHIEF})
        file.unlink() if found is None else file.write_text(found)
        face.app.state.people.renew((chief,))
        assert (await browser.get("/advisories")).status_code == 200
        face.app.state.people.renew(people)
        face.app.state.people.renew((*people, chief))
        assert (await browser.get("/advisories")).status_code == 401
        assert (await browser.get("/advisories", headers=bearer(CHIEF))).status_code == 401


async def test_sessions_of_a_person_are_bounded_and_end_those_of_nobody_else(
    tmp_path: Path, people: tuple[Person, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("deconflict.operator.http.access.MOST_SESSIONS", 2)
    async with (
        served(tmp_path, people=people) as face,
        http_client(face.http) as client,
    ):
        sessions = []
        for token in (LEADER, READER, READER, READER):
            sessions.append((await client.post("/login", data={"token": token})).headers["set-cookie"].split(";")[0])
            client.cookies.clear()
        answers = [await client.get("/advisories", headers={"cookie": f"a=b; {session}"}) for session in sessions]
        assert [answer.status_code for answer in answers] == [200, 401, 200, 200]


async def test_a_changed_token_ends_the_sessions_and_streams_that_the_old_one_opened(
    tmp_path: Path, people: tuple[Person, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    async with (
        served(tmp_path, people=people) as face,
        http_client(face.http) as browser,
        connect(face.stream(), additional_headers=bearer(READER)) as stolen,
        connect(face.stream(), additional_headers=bearer(LEADER)) as kept,
    ):
        await browser.post("/login", data={"token": READER})
        await until_subscribed(face, 2)
        await face.publish(made(1))
        assert '"advisory-1"' in str(await stolen.recv())
        monkeypatch.setenv("READER", READER[::-1])
        face.app.state.people.refresh()
        assert (await browser.get("/advisories")).status_code == 401
        await face.publish(made(2))
        with pytest.raises(ConnectionClosedError, match="no longer allowed"):
            await stolen.recv()
        assert ['"advisory-1"' in str(await kept.recv()), '"advisory-2"' in str(await kept.recv())] == [True, True]


async def test_anonymous_streams_end_once_there_are_people(tmp_path: Path, people: tuple[Person, ...]) -> None:
    async with served(tmp_path) as face, connect(face.stream()) as stream:
        await until_subscribed(face, 1)
        face.app.state.people.renew(people)
        await face.publish(made(1))
        with pytest.raises(ConnectionClosedError, match="no longer allowed"):
            await stream.recv()


async def until_subscribed(face: Served, count: int) -> None:
    await until(lambda: face.app.state.measures.values["deconflict_stream_subscribers"] == {(): count})


async def test_a_foreign_host_name_that_points_to_this_machine_is_refused(tmp_path: Path) -> None:
    """DNS rebinding: the page's own origin, and the name that it was loaded by, are the same."""
    async with (
        served(tmp_path) as face,
        http_client(face.http) as client,
    ):
        port = face.address.rpartition(":")[2]
        rebound = {"host": f"elsewhere.example:{port}", "origin": f"http://elsewhere.example:{port}"}
        refused = await client.get("/advisories", headers=rebound)
        assert (refused.status_code, "localhost" in refused.json()["detail"]) == (403, True)
        assert (await client.get("/advisories", headers={"host": f"elsewhere.example:{port}"})).status_code == 403
        assert (await client.get("/advisories", headers={"host": f"localhost:{port}"})).status_code == 200


async def test_the_role_read_may_not_acknowledge(tmp_path: Path, people: tuple[Person, ...]) -> None:
    async with (
        served(tmp_path, people=people) as face,
        http_client(face.http) as client,
    ):
        refused = await client.post("/advisories/advisory-1/any", headers=bearer(READER))
        assert (refused.status_code, "takes the role acknowledge" in refused.text) == (403, True)
        assert (await client.post("/advisories/advisory-1/any", headers=bearer(LEADER))).status_code in (404, 405)
        await face.publish(made(1))
        fields = {"name": "Somebody Else", "reason": "called back"}
        path = "/advisories/advisory-1/acknowledgement"
        answered = (await client.post(path, json=fields, headers=bearer(LEADER))).json()
        assert answered["acknowledgement"]["name"] == "Ada"
        assert (await client.post("/anything", headers=bearer(LEADER))).status_code == 403


async def test_a_page_of_another_site_is_refused_even_without_people(tmp_path: Path) -> None:
    async with (
        served(tmp_path) as face,
        http_client(face.http) as client,
    ):
        assert (await client.get("/advisories", headers={"origin": "https://elsewhere.example"})).status_code == 403
        assert (await client.get("/advisories", headers={"origin": face.http})).status_code == 200
        with pytest.raises(InvalidStatus) as refused:
            await connect(face.stream(), additional_headers={"origin": "https://elsewhere.example"})
        assert refused.value.response.status_code == 403
        assert b"pages of other sites" in refused.value.response.body


@pytest.mark.parametrize(
    ("method", "path", "role"),
    [
        ("GET", "/robots", "read"),
        ("WEBSOCKET", "/advisories/stream", "read"),
        ("POST", "/advisories/1/acknowledgement", "acknowledge"),
        ("POST", "/situations/1/acknowledgement", "acknowledge"),
        ("POST", "/robots/1/off-floor", "acknowledge"),
        ("POST", "/robots/1/owner", "administer"),
        ("DELETE", "/webhooks/1", "administer"),
    ],
)
def test_each_request_needs_a_role(method: str, path: str, role: str) -> None:
    assert role_needed(method, path) == role


def test_a_network_port_without_credentials_is_exposed() -> None:
    assert exposed_ports(Site()) == []
    assert exposed_ports(Site(receiver=ReceiverSettings(host="::1"), operator=Operator(host="localhost"))) == []
    wide = Site(receiver=ReceiverSettings(host="0.0.0.0"), operator=Operator(host="0.0.0.0"))  # noqa: S104
    assert [exposed_port.split(":")[0] for exposed_port in exposed_ports(wide)] == ["receiver.host", "operator.host"]
    guarded = Site(
        receiver=ReceiverSettings(host="0.0.0.0"),  # noqa: S104
        operator=Operator(host="0.0.0.0", people=(Person(name="Ada", token="env:ADA"),)),  # noqa: S104
        vendors=(Vendor(name="Alder", token="env:ALDER"),),
    )
    assert exposed_ports(guarded) == []


async def test_guessing_a_persons_token_is_slowed_down(
    tmp_path: Path, people: tuple[Person, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ingest.security.failed_sign_ins.STEP_S", 0.1)
    async with (
        served(tmp_path, people=people) as face,
        http_client(face.http) as client,
    ):
        began_s = time.monotonic()
        for _ in range(3):
            guess = {"Authorization": "Bearer guessed-0123456789"}
            assert (await client.get("/advisories", headers=guess)).status_code == 401
            assert (await client.post("/login", data={"token": "guessed-0123456789"})).status_code == 401
        assert time.monotonic() - began_s > 0.1 + 0.2 + 0.25


async def test_who_leaves_while_signing_in_makes_no_error_of_the_service(
    tmp_path: Path, people: tuple[Person, ...], caplog: pytest.LogCaptureFixture
) -> None:
    async with served(tmp_path, people=people) as face:
        _, writer = await asyncio.open_connection(*face.address.split(":"))
        writer.write(b"POST /login HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99\r\n\r\ntoken=")
        await writer.drain()
        await asyncio.sleep(0.2)
        writer.close()
        await asyncio.sleep(0.2)
        async with http_client(face.http) as client:
            assert (await client.get("/healthz")).status_code in (200, 503)
    assert not [record for record in caplog.records if record.levelname == "ERROR"]
