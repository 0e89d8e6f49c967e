import asyncio
import logging
import ssl
from contextlib import suppress
from pathlib import Path

import httpx
import pytest
import trustme

from deconflict.operator.outlets.store_cursor import StoreCursor
from deconflict.operator.outlets.webhook_signatures import verified
from deconflict.operator.outlets.webhooks import WebhookOutlet
from deconflict.operator.store.publisher import Publisher
from deconflict.settings.outlet_settings import Webhook
from ingest.measures.measures import Measures
from ingest.measures.outages import QUIET_S
from tests.deconflict.operator.http.served_face import until
from tests.deconflict.operator.outlets.made_outlets import SECRET, hearing, kept, numbers, posting, working
from tests.helpers.made_advisories import cleared, cleared_situation, made, situation


async def test_each_revision_is_posted_signed_and_in_order(tmp_path: Path) -> None:
    with hearing() as other, kept(tmp_path) as (store, publisher):
        async with posting(other.url, store, publisher, tmp_path):
            published = await publisher.publish([made(1), made(2)])
            published += await publisher.publish([cleared(1)])
            await until(lambda: len(other.heard) == 3)
        advisories = [
            verified(headers, body, SECRET, float(headers["webhook-timestamp"])) for headers, body in other.heard
        ]
        assert advisories == published


async def test_a_refused_revision_is_sent_again_before_the_next(tmp_path: Path) -> None:
    with hearing(503, 500, 404) as other, kept(tmp_path) as (store, publisher):
        async with posting(other.url, store, publisher, tmp_path):
            await publisher.publish([made(1), made(2)])
            await until(lambda: publisher.measures.values["deconflict_outlet_deliveries_total"]["mes",] == 2)
        assert numbers(other.heard) == [1, 1, 1, 1, 2]
        assert publisher.measures.values["deconflict_outlet_failures_total"]["mes",] == 3
        assert publisher.measures.values["deconflict_outlet_waiting"]["mes",] == 0


async def test_an_unusable_secret_is_counted_until_it_is_corrected(tmp_path: Path) -> None:
    path = tmp_path / "secret"
    with hearing() as other, kept(tmp_path) as (store, publisher):
        failures = publisher.measures.values["deconflict_outlet_failures_total"]
        path.write_text("whsec_" + "A" * 33)
        settings = Webhook(name="mes", url=other.url, secret=f"file:{path}", retry_s=(0.02, 0.1), timeout_s=5)
        poster = WebhookOutlet(settings, StoreCursor("mes", ["advisory"], store, publisher))
        async with working(poster.run(), publisher):
            await publisher.publish([made(1)])
            await until(lambda: failures.get(("mes",), 0) > 1)
            path.write_text(SECRET)
            poster.refresh()
            await until(lambda: numbers(other.heard) == [1])


async def test_the_authorities_of_this_machine_are_read_again_after_a_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    authority, trusted = trustme.CA(), tmp_path / "trusted.pem"
    trustme.CA().cert_pem.write_to_path(str(trusted))
    monkeypatch.setenv("SSL_CERT_FILE", str(trusted))
    tls = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    authority.issue_cert("127.0.0.1").configure_cert(tls)
    with hearing(tls=tls) as other, kept(tmp_path) as (store, publisher):
        failures = publisher.measures.values["deconflict_outlet_failures_total"]
        async with posting(other.url, store, publisher, tmp_path):
            await publisher.publish([made(1)])
            await until(lambda: failures.get(("mes",), 0) > 1)
            assert other.heard == []
            authority.cert_pem.write_to_path(str(trusted))
            await until(lambda: numbers(other.heard) == [1])


async def test_a_restart_resumes_and_loses_nothing(tmp_path: Path) -> None:
    with hearing() as other:
        with kept(tmp_path) as (store, publisher):
            async with posting(other.url, store, publisher, tmp_path):
                await publisher.publish([made(1)])
                await until(lambda: store.position("mes") == 1)
            await publisher.publish([made(2), made(3)])
        with kept(tmp_path) as (store, publisher):
            async with posting(other.url, store, publisher, tmp_path):
                await until(lambda: len(other.heard) == 3)
        assert numbers(other.heard) == [1, 2, 3]


async def test_a_webhook_hears_the_end_of_what_it_was_told_of_though_much_was_removed(tmp_path: Path) -> None:
    with hearing() as other, kept(tmp_path) as (store, publisher):
        async with posting(other.url, store, publisher, tmp_path):
            await publisher.publish([made(1)])
            await until(lambda: store.position("mes") == 1)
        await publisher.publish([cleared(1), made(2), cleared(2)])
        assert store.prune_to(1) == 1
        async with posting(other.url, store, Publisher(store, Measures()), tmp_path):
            await until(lambda: len(other.heard) == 2)
        assert numbers(other.heard) == [1, 2]


async def test_an_answer_without_end_is_not_read_to_its_end(tmp_path: Path) -> None:
    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readuntil(b"\r\n\r\n")
        writer.write(b"HTTP/1.1 200 OK\r\n\r\n")
        with suppress(ConnectionError):
            while True:
                writer.write(bytes(4096))
                await writer.drain()

    endless = await asyncio.start_server(answer, "127.0.0.1", 0)
    url = f"http://127.0.0.1:{endless.sockets[0].getsockname()[1]}/"
    with kept(tmp_path) as (store, publisher):
        async with posting(url, store, publisher, tmp_path):
            await publisher.publish([made(1), made(2)])
            await until(lambda: publisher.measures.values["deconflict_outlet_deliveries_total"]["mes",] == 2)
    endless.close()


async def test_a_new_webhook_begins_with_the_next_revision(tmp_path: Path) -> None:
    with hearing() as other, kept(tmp_path) as (store, publisher):
        await publisher.publish([made(1)])
        async with posting(other.url, store, publisher, tmp_path):
            await publisher.publish([made(2)])
            await until(lambda: len(other.heard) == 1)
        assert numbers(other.heard) == [2]


async def test_an_unreachable_address_is_logged_once_without_its_secrets(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with hearing() as gone:
        address = gone.url
    with kept(tmp_path) as (store, publisher), caplog.at_level(logging.INFO, "deconflict"):
        async with posting(address, store, publisher, tmp_path):
            await publisher.publish([made(1)])
            await until(lambda: publisher.measures.values["deconflict_outlet_failures_total"]["mes",] >= 3)
        assert publisher.measures.values["deconflict_outlet_waiting"]["mes",] == 1
    warnings = [record.getMessage() for record in caplog.records if record.levelno == logging.WARNING]
    place = httpx.URL(address).netloc.decode()
    assert warnings == [f"mes accepts no revisions and is tried again: {place}: All connection attempts failed"]
    assert SECRET not in caplog.text
    assert "key=abc" not in caplog.text


async def test_a_receiver_that_comes_and_goes_is_logged_once_and_then_counted(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    now_s = [0.0]
    with kept(tmp_path) as (store, publisher), caplog.at_level(logging.INFO, "deconflict"):
        await publisher.publish([made(number) for number in range(1, 5)])
        cursor = StoreCursor("mes", ["advisory"], store, publisher, lambda: now_s[0])
        lines = aiter(cursor.lines())
        for now_s[0] in (0.0, 10.0, 20.0, QUIET_S + 1):
            cursor.failed("it answered 503")
            cursor.delivered(await anext(lines))
    assert [record.getMessage().partition(",")[0] for record in caplog.records] == [
        "mes accepts no revisions and is tried again: it answered 503",
        "mes accepts revisions again",
        "mes accepts no revisions and is tried again: it answered 503",
        "mes accepts revisions again",
    ]
    assert "after 2 more outages" in caplog.text


async def test_a_webhook_receives_situations_unless_it_asks_for_other_kinds(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text(SECRET)
    with hearing() as other, kept(tmp_path) as (store, publisher):
        settings = Webhook(name="mes", url=other.url, secret=f"file:{tmp_path / 'secret'}")
        outlet = WebhookOutlet(settings, StoreCursor("mes", settings.kinds, store, publisher))
        async with working(outlet.run(), publisher):
            await publisher.publish([made(1), situation(1), made(2), cleared_situation(1), cleared(1)])
            waiting = publisher.measures.values["deconflict_outlet_waiting"]
            await until(lambda: len(other.heard) == 2 and waiting["mes",] == 0)
        assert [headers["webhook-id"] for headers, _ in other.heard] == ["situation-2", "situation-4"]
        revisions = [
            verified(headers, body, SECRET, float(headers["webhook-timestamp"])) for headers, body in other.heard
        ]
        assert [(revision.id, revision.state) for revision in revisions] == [
            ("situation-1", "raised"),
            ("situation-1", "cleared"),
        ]
        assert store.position("mes") == 5, "what it does not receive is not gone through again"


async def test_an_outlet_with_other_kinds_continues_from_its_position(tmp_path: Path) -> None:
    with hearing() as other, kept(tmp_path) as (store, publisher):
        async with posting(other.url, store, publisher, tmp_path):
            await publisher.publish([made(1), situation(1)])
            await until(lambda: store.position("mes") == 2)
        await publisher.publish([situation(2), made(2), situation(1, 2)])
        settings = Webhook(name="mes", url=other.url, secret=f"file:{tmp_path / 'secret'}")
        outlet = WebhookOutlet(settings, StoreCursor("mes", settings.kinds, store, publisher))
        async with working(outlet.run(), publisher):
            await until(lambda: len(other.heard) == 3)
        assert [headers["webhook-id"] for headers, _ in other.heard] == ["advisory-1", "situation-3", "situation-5"]
