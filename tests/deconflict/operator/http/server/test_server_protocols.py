"""Connections of the operators' port: idle, unread, too many, or without a handshake."""

import asyncio
import socket
from collections.abc import AsyncIterator
from contextlib import suppress
from pathlib import Path

import httpx
import pytest
import trustme
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidMessage, InvalidStatus

from deconflict.operator.http.server.server_protocols import Places
from deconflict.settings.site import Person
from ingest.settings import Tls
from tests.deconflict.operator.http.served_face import Served, served, until
from tests.helpers.made_advisories import made
from tests.helpers.patience import PATIENCE_S
from tests.helpers.plain_http import http_client
from tests.ingest.security.made_tls import trusting, write


async def test_an_idle_connection_is_ended_and_a_subscriber_is_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("deconflict.operator.http.server.server_protocols.IDLE_TIMEOUT_S", 0.5)
    begun = b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n"
    async with served(tmp_path) as face, connect(face.stream()) as following:
        host, port = face.address.split(":")
        torn = b"POST /advisories/none/acknowledgement HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 10\r\n\r\n{"
        for message in (b"", b"GET /heal", begun, begun + b"\r\n" + begun, torn):
            reader, writer = await asyncio.open_connection(host, int(port))
            writer.write(message)
            async with asyncio.timeout(PATIENCE_S):
                with suppress(ConnectionResetError):
                    await reader.read()
            writer.close()
        assert refused(face, "face-idle") == 5
        await face.publish(made(1))
        assert '"advisory-1"' in str(await following.recv())


HANDSHAKE = (
    "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
)


@pytest.mark.parametrize(
    ("request_line", "headers", "status"),
    [
        ("GET /advisories/stream", f"X-Long: {'x' * 9000}\r\n", 431),
        (f"GET /advisories/stream?{'x' * 9000}", "", 414),
        ("GET /advisories/stream", "".join(f"X-{n}: 1\r\n" for n in range(200)), 431),
        ("GET /advisories/stream", "Content-Length: 5\r\n", 400),
        ("GET /advisories/stream", "Transfer-Encoding: chunked\r\n", 400),
        ("POST /advisories/stream", "", 405),
        ("GET /advisories/stream", f"X-Huge: {'x' * 60_000}\r\n", 431),
        ("GET /advisories/stream", f"Cookie: {'; '.join(f'c{n}={n:090}' for n in range(300))}\r\n", 101),
        ("GET /advisories/stream", "".join(f"Cookie: c{n}={n:090}\r\n" for n in range(150)), 101),
    ],
)
async def test_every_handshake_is_answered(tmp_path: Path, request_line: str, headers: str, status: int) -> None:
    async with served(tmp_path) as face:
        host, port = face.address.split(":")
        reader, writer = await asyncio.open_connection(host, int(port))
        writer.write(f"{request_line} HTTP/1.1\r\nHost: {face.address}\r\n{HANDSHAKE}{headers}\r\n".encode())
        async with asyncio.timeout(10):
            assert (await reader.readline()).split()[1] == str(status).encode()
            if status != 101:
                with suppress(ConnectionResetError):
                    await reader.read()
        writer.close()
        await until(lambda: face.connections() == 0)


async def test_a_handshake_that_nothing_answers_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("deconflict.operator.http.server.server_protocols.IDLE_TIMEOUT_S", 0.5)

    async def never(*_: object) -> None:
        await asyncio.Event().wait()

    async with served(tmp_path) as face:
        monkeypatch.setattr("deconflict.operator.http.access.AccessMiddleware.__call__", never)
        with pytest.raises((InvalidMessage, ConnectionError)):
            await connect(face.stream(), open_timeout=PATIENCE_S)
        assert refused(face, "face-idle") == 1


async def test_a_browser_with_many_cookies_keeps_its_session(tmp_path: Path) -> None:
    (tmp_path / "token").write_text("a token of the leader")
    people = (Person(name="Kim", token=f"file:{tmp_path / 'token'}"),)
    async with served(tmp_path, people=people) as face, http_client() as client:
        answer = await client.post(f"{face.http}/login", data={"token": "a token of the leader"})
        session = answer.cookies["deconflict_session"]
        many = "; ".join(f"c{n}={n:090}" for n in range(200))
        for n, cookies in enumerate(
            (f"{many}; deconflict_session={session}; {many}", f"deconflict_session={session}"), 1
        ):
            async with connect(face.stream(), additional_headers={"Cookie": cookies}) as following:
                assert (await client.get(f"{face.http}/advisories", headers={"Cookie": cookies})).status_code == 200
                await face.publish(made(n))
                assert f'"advisory-{n}"' in str(await following.recv())
        with pytest.raises(InvalidStatus):
            await connect(face.stream(), additional_headers={"Cookie": many})


async def test_a_tls_handshake_that_hangs_is_ended_and_counts_as_a_connection(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("deconflict.operator.http.server.uvicorn_server.HANDSHAKE_S", 3.0)
    authority = trustme.CA()
    write(authority, tmp_path)
    async with served(tmp_path, tls=Tls(certificate=str(tmp_path / "site.pem"))) as face:
        host, port = face.address.split(":")
        face.app.state.places.most = 2
        silent = [await asyncio.open_connection(host, int(port)) for _ in range(4)]
        for reader, _ in silent:
            async with asyncio.timeout(60):
                with suppress(ConnectionResetError):
                    assert await reader.read() == b""
        await until(lambda: refused(face, "face-tls-failed") == 4, 60)
        assert refused(face, "face-full") == 2
        async with httpx.AsyncClient(trust_env=False, verify=trusting(authority), timeout=60) as client:
            assert (await client.get(f"https://{face.address}/healthz")).status_code == 200
        for _, writer in silent:
            writer.close()


async def test_tls_handshakes_of_an_address_that_never_end_make_room_for_those_of_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("deconflict.operator.http.server.uvicorn_server.HANDSHAKE_S", 600.0)
    monkeypatch.setattr("deconflict.operator.http.server.server_protocols.MOST_HANDSHAKES", 3)
    authority = trustme.CA()
    write(authority, tmp_path)
    async with served(tmp_path, tls=Tls(certificate=str(tmp_path / "site.pem"))) as face:
        host, port = face.address.split(":")
        silent = [await asyncio.open_connection(host, int(port), local_addr=("127.0.0.2", 0)) for _ in range(5)]
        await until(lambda: refused(face, "face-full") == 2)
        async with httpx.AsyncClient(trust_env=False, verify=trusting(authority), timeout=60) as client:
            assert (await client.get(f"https://{face.address}/healthz")).status_code == 200
        assert refused(face, "face-full") == 3
        await until(lambda: sum(reader.at_eof() or reader.exception() is not None for reader, _ in silent) == 3)
        await until(lambda: len(face.app.state.newcomers) == 2)
        for _, writer in silent:
            writer.close()


def refused(face: Served, reason: str) -> float:
    counted: dict[tuple[str, ...], float] = face.app.state.measures.values["deconflict_connections_refused_total"]
    return counted.get((reason,), 0)


class MadeTransport(asyncio.Transport):
    """Tells whether it was aborted."""

    is_aborted = False

    def abort(self) -> None:
        self.is_aborted = True


def places(most: int) -> Places:
    made_places = Places()
    made_places.most = most
    return made_places


def test_a_newcomer_takes_the_place_of_the_oldest_connection_of_the_address_with_most() -> None:
    held = places(6)
    greedy = [MadeTransport() for _ in range(3)]
    for port, transport in enumerate(greedy):
        assert held.add(transport, ("10.0.0.1", port)) == []
    assert [held.add(MadeTransport(), (f"10.0.0.{n}", 1)) for n in (2, 3, 4)] == [[], [], []]
    assert held.add(MadeTransport(), ("10.0.0.5", 1)) == [greedy[0]]


def test_one_address_has_half_of_the_places_and_then_its_own_oldest_goes() -> None:
    held = places(4)
    own = [MadeTransport() for _ in range(3)]
    gone = [held.add(transport, ("2001:db8::1", port)) for port, transport in enumerate(own[:2])]
    assert [*gone, held.add(own[2], ("2001:db8::2", 1))] == [[], [], [own[0]]]


def test_a_connection_of_a_signed_in_person_is_not_its_addresss() -> None:
    held = places(4)
    signed_in, other = MadeTransport(), MadeTransport()
    held.add(signed_in, ("10.0.0.1", 1))
    held.sign_in(("10.0.0.1", 1), "Kim")
    assert held.add(other, ("10.0.0.1", 2)) == []
    replaced = [gone for port in range(3, 50) for gone in held.add(MadeTransport(), ("10.0.0.1", port))]
    assert signed_in not in replaced
    assert other in replaced


def test_a_connection_that_ends_leaves_its_place() -> None:
    held = places(4)
    for port in range(100):
        transport = MadeTransport()
        assert held.add(transport, ("10.0.0.1", port)) == []
        held.remove(transport)


async def test_who_keeps_many_connections_keeps_nobody_out(tmp_path: Path) -> None:
    async with served(tmp_path) as face:
        face.app.state.places.most = 8
        host, port = face.address.split(":")
        held = [await asyncio.open_connection(host, int(port)) for _ in range(20)]
        async with http_client() as client:
            assert (await client.get(f"{face.http}/healthz")).status_code == 200
        await until(lambda: face.connections() <= 8)
        assert refused(face, "face-replaced") >= 12
        for _, writer in held:
            writer.close()


async def test_a_stream_of_a_signed_in_person_stays_while_others_take_every_place(tmp_path: Path) -> None:
    token = tmp_path / "token"
    token.write_text("a-token-of-some-length")
    people = (Person(name="Kim", token=f"file:{token}"),)
    async with served(tmp_path, people=people) as face:
        face.app.state.places.most = 8
        host, port = face.address.split(":")
        headers = {"Authorization": "Bearer a-token-of-some-length"}
        async with connect(face.stream(), additional_headers=headers) as following:
            held = [await asyncio.open_connection(host, int(port)) for _ in range(20)]
            await face.publish(made(1))
            assert '"advisory-1"' in str(await following.recv())
            for _, writer in held:
                writer.close()


async def test_who_reads_no_answer_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("deconflict.operator.http.server.server_protocols.WRITE_TIMEOUT_S", 0.3)
    async with served(tmp_path) as face:
        host, port = face.address.split(":")
        raw = socket.socket()
        raw.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        raw.setblocking(False)
        loop = asyncio.get_running_loop()
        await loop.sock_connect(raw, (host, int(port)))
        request = f"GET /openapi.json HTTP/1.1\r\nHost: {face.address}\r\n\r\n".encode()
        sending = asyncio.create_task(loop.sock_sendall(raw, request * 2000))
        await until(lambda: refused(face, "face-unread") == 1)
        await until(lambda: face.connections() == 0)
        sending.cancel()
        raw.close()


HEAD = b"POST /advisories/none/acknowledgement HTTP/1.1\r\nHost: face\r\n"


@pytest.mark.parametrize(
    "request_bytes",
    [
        HEAD + b"Content-Length: 2\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n",
        HEAD + b"transfer-encoding: chunked\r\ncontent-length: 2\r\n\r\n0\r\n\r\n",
        b"GET /healthz HTTP/1.1\r\nHost: face\r\nX-Folded: a\r\n b\r\n\r\n",
        b"GET /healthz HTTP/1.1\nHost: face\n\n",
        b"GET /healthz HTTP/1.1\r\nHost: face\nX-Smuggled: a\r\n\r\n",
        b"GET /healthz HTTP/1.1\r\nHost: face\r\n\r\nGET /healthz HTTP/1.1\r\nHost: face\n\r\n",
    ],
    ids=["two lengths", "two lengths, other order", "folded", "bare line feeds", "one bare line feed", "pipelined"],
)
async def test_a_request_that_could_be_read_in_two_ways_is_refused(tmp_path: Path, request_bytes: bytes) -> None:
    async with served(tmp_path) as face:
        host, port = face.address.split(":")
        reader, writer = await asyncio.open_connection(host, int(port))
        writer.write(request_bytes)
        async with asyncio.timeout(PATIENCE_S):
            answer = await reader.read()
        assert answer.count(b"HTTP/1.1 400") == 1
        assert b"Ambiguous" in answer
        writer.close()


async def test_a_plain_request_in_pieces_and_a_chunked_one_are_answered(tmp_path: Path) -> None:
    async with served(tmp_path) as face, http_client() as client:
        host, port = face.address.split(":")
        reader, writer = await asyncio.open_connection(host, int(port))
        for piece in (b"GET /healthz HTTP/1.1\r", b"\nHost: localhost\r\n", b"Connection: close\r\n\r", b"\n"):
            writer.write(piece)
            await asyncio.sleep(0.05)
        assert b"HTTP/1.1 200" in await reader.read()
        writer.close()

        async def chunks() -> AsyncIterator[bytes]:
            yield b'{"name": "Kim",\n'
            yield b'"reason": "seen"}'

        answer = await client.post(f"{face.http}/advisories/none/acknowledgement", content=chunks())
        assert answer.status_code in (404, 422)
