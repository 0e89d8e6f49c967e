"""Handshakes of TLS at the robots' port that fail, or never end."""

import asyncio
from contextlib import suppress
from unittest.mock import Mock

import pytest
import trustme
from websockets.asyncio.client import connect

from ingest.port import receiver
from ingest.security.certificates import Certificates
from ingest.security.tls_handshakes import TlsHandshakes
from ingest.settings import Tls
from tests.helpers.patience import PATIENCE_S
from tests.ingest.port.made_receiver import floor, until
from tests.ingest.security.made_tls import trusting


async def ended(reader: asyncio.StreamReader) -> None:
    """Waits for the other end to end it."""
    with suppress(ConnectionResetError):
        async with asyncio.timeout(PATIENCE_S):
            await reader.read()


async def test_a_handshake_that_never_ends_or_is_none_is_ended_and_counted_and_others_speak(
    authority: trustme.CA, site_tls: Tls
) -> None:
    async with floor(tls=site_tls, open_timeout_s=3.0) as served_floor:
        silent, held = await asyncio.open_connection("127.0.0.1", served_floor.receiver.port)
        async with connect(
            f"wss://127.0.0.1:{served_floor.receiver.port}", ssl=trusting(authority), open_timeout=60
        ) as robot:
            await robot.send("hello")
            await until(lambda: served_floor.raws() == [b"hello"])
            await ended(silent)
            await until(lambda: served_floor.count("tls-failed") == 1)
            plain, writer = await asyncio.open_connection("127.0.0.1", served_floor.receiver.port)
            writer.write(b"GET /healthz HTTP/1.1\r\n\r\n")
            await ended(plain)
            await until(lambda: served_floor.count("tls-failed") == 2)
            _, leaving = await asyncio.open_connection("127.0.0.1", served_floor.receiver.port)
            leaving.close()
            await until(lambda: served_floor.count("tls-failed") == 3)
            await robot.send("again")
            await until(lambda: served_floor.raws() == [b"hello", b"again"])
        for each in (held, writer):
            each.close()


async def test_handshakes_that_go_on_count_among_the_connections(
    authority: trustme.CA, site_tls: Tls, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(receiver, "HANDSHAKE_FILES", 2)
    async with floor(tls=site_tls, open_timeout_s=600.0, max_connections=3) as served_floor:
        silent = [await asyncio.open_connection("127.0.0.1", served_floor.receiver.port) for _ in range(8)]
        await until(lambda: served_floor.count("full") == 3)
        for _, writer in silent[:5]:
            writer.close()
        await until(lambda: served_floor.count("tls-failed") == 5)
        url = f"wss://127.0.0.1:{served_floor.receiver.port}"
        async with connect(url, ssl=trusting(authority), open_timeout=60) as robot:
            await robot.send("hello")
            await until(lambda: served_floor.delivered)
        assert served_floor.count("full") == 3
        for _, writer in silent[5:]:
            writer.close()


async def test_closing_the_port_ends_handshakes_that_go_on(site_tls: Tls) -> None:
    async with floor(tls=site_tls, open_timeout_s=600.0) as served_floor:
        reader, writer = await asyncio.open_connection("127.0.0.1", served_floor.receiver.port)
        shaking = served_floor.receiver._handshakes
        await until(lambda: shaking)
    await ended(reader)
    assert not shaking
    writer.close()


async def test_a_connection_that_ends_together_with_its_handshake_is_not_begun(
    site_tls: Tls, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def start_tls(transport: Mock, early: asyncio.Protocol, *_: object, **__: object) -> Mock:
        early.connection_lost(None)
        return transport

    monkeypatch.setattr(asyncio.get_running_loop(), "start_tls", start_tls)
    protocol, failed = Mock(), Mock()
    handshakes = TlsHandshakes(Certificates(site_tls), 1.0, failed)
    await handshakes.begin(Mock(), protocol)
    assert not protocol.mock_calls
    assert not failed.mock_calls
