"""No input leads to an error of the service, and no body is kept that no route needs."""

import asyncio
import time
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
from anyio.to_thread import current_default_thread_limiter

from deconflict.operator.http.request_limits import (
    BURST_S,
    BYTES_PER_S,
    LONGEST_DEBT_S,
    MOST_BODY_BYTES,
    MOST_WAIT_S,
    REQUEST_S,
    SAFE_HEADERS,
    RequestShares,
)
from tests.deconflict.operator.http.served_face import served
from tests.helpers.made_advisories import made
from tests.helpers.patience import PATIENCE_S
from tests.helpers.plain_http import http_client

ACKNOWLEDGEMENT = "/advisories/{}/acknowledgement"
HOSTILE = [
    b'{"name": NaN, "reason": "x"}',
    b'{"name": "Ada", "reason": Infinity}',
    b'{"name": 1e999, "reason": "x"}',
    b'{"name": "\\ud800", "reason": "x"}',
    b'{"name": "Ada", "reason": "\\udfff"}',
    b'{"\\ud800": 1}',
    b"[" * 5000,
    b"\xff\xfe",
]


async def chunks() -> AsyncIterator[bytes]:
    for _ in range(64):
        yield b" " * 4096


@pytest.mark.parametrize("body", HOSTILE)
async def test_no_body_leads_to_an_error_of_the_service(tmp_path: Path, body: bytes) -> None:
    async with (
        served(tmp_path) as face,
        http_client(face.http) as client,
    ):
        await face.publish(made(1))
        headers = {"content-type": "application/json"}
        answer = await client.post(ACKNOWLEDGEMENT.format(made(1).id), content=body, headers=headers)
        assert 400 <= answer.status_code < 500


@pytest.mark.parametrize("origin", ["http://[", "http://]", "\\", "http://a:b:c"])
async def test_no_origin_leads_to_an_error_of_the_service(tmp_path: Path, origin: str) -> None:
    async with (
        served(tmp_path) as face,
        http_client(face.http) as client,
    ):
        assert (await client.get("/robots", headers={"origin": origin})).status_code == 403


async def test_a_long_body_is_refused_announced_or_not(tmp_path: Path) -> None:
    async with (
        served(tmp_path) as face,
        http_client(face.http) as client,
    ):
        for path in (ACKNOWLEDGEMENT.format("x"), "/absent"):
            announced = await client.post(path, content=b" " * (MOST_BODY_BYTES + 1))
            assert announced.status_code == 413
        assert (await client.post(ACKNOWLEDGEMENT.format("x"), content=chunks())).status_code == 413


async def test_no_cookie_takes_long_to_read(tmp_path: Path) -> None:
    quoted = 'deconflict_session="' + 60_000 * "\\" + '"'
    async with (
        served(tmp_path) as face,
        http_client(face.http) as client,
    ):
        plain_s: list[float] = []
        quoted_s: list[float] = []
        for _ in range(3):
            for cookie, took_s in ((60_000 * "a", plain_s), (quoted, quoted_s)):
                began_s = time.process_time()
                assert (await client.get("/advisories", headers={"cookie": cookie})).status_code == 200
                took_s.append(time.process_time() - began_s)
        assert min(quoted_s) < 10 * min(plain_s)


async def test_health_answers_while_every_thread_waits(tmp_path: Path) -> None:
    async with served(tmp_path) as face, http_client(face.http) as http:
        threads = current_default_thread_limiter()
        holders = [object() for _ in range(int(threads.available_tokens))]
        for holder in holders:
            await threads.acquire_on_behalf_of(holder)
        try:
            async with asyncio.timeout(PATIENCE_S):
                assert (await http.get("/healthz")).status_code == 200
        finally:
            for holder in holders:
                threads.release_on_behalf_of(holder)


async def test_every_answer_has_safe_headers(tmp_path: Path) -> None:
    async with (
        served(tmp_path) as face,
        http_client(face.http) as client,
    ):
        for path in ("/", "/robots", "/absent", "/healthz", "/metrics"):
            answer = await client.get(path)
            assert answer.headers.keys() >= SAFE_HEADERS.keys()


def test_requests_of_one_sender_wait_their_turn_and_those_of_another_do_not() -> None:
    shares = RequestShares()
    waits_s = [shares.wait_s("10.0.0.1", 0.0) for _ in range(200)]
    assert waits_s[:90] == [0.0] * 90
    assert waits_s == sorted(waits_s)
    assert waits_s[-1] == pytest.approx(200 * REQUEST_S - BURST_S)
    assert shares.wait_s("10.0.0.2", 0.0) == 0.0
    assert shares.wait_s("10.0.0.1", 200 * REQUEST_S) == 0.0


def test_long_answers_cost_their_reader_more_turns() -> None:
    shares = RequestShares()
    shares.charge("10.0.0.1", 25e6 / BYTES_PER_S, 0.0)
    assert shares.wait_s("10.0.0.1", 0.0) == pytest.approx(5.0 - BURST_S + REQUEST_S)


async def test_a_flood_of_requests_waits_and_what_would_wait_for_long_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("deconflict.operator.http.request_limits.MOST_WAIT_S", 0.3)
    monkeypatch.setattr("deconflict.operator.http.request_limits.BURST_S", 0.2)
    async with served(tmp_path) as face, http_client(face.http) as client:
        answers = await asyncio.gather(*(client.get("/schema/advisory") for _ in range(60)))
        assert {answer.status_code for answer in answers} == {200, 429}
        refusals = face.app.state.measures.values["deconflict_connections_refused_total"]
        assert refusals == {("face-too-many",): sum(answer.status_code == 429 for answer in answers)}
        refused = next(answer for answer in answers if answer.status_code == 429)
        assert "ask less often" in refused.json()["detail"]
        assert refused.headers["x-content-type-options"] == "nosniff"


def test_a_sender_is_served_at_once_again_soon_after_a_flood() -> None:
    shares = RequestShares()
    waits_s = [shares.wait_s("10.0.0.1", 0.0) for _ in range(40_000)]
    assert max(waits_s) > MOST_WAIT_S
    assert shares.wait_s("10.0.0.1", LONGEST_DEBT_S) == 0.0
