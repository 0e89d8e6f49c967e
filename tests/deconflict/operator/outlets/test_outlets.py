"""Outlets that begin, end and change while the service runs."""

import asyncio
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

import pytest

from deconflict.operator.outlets import webhooks
from deconflict.operator.outlets.outlets import Outlets
from deconflict.operator.outlets.webhook_signatures import SignatureError, signed, verified
from deconflict.operator.store.publisher import Publisher
from deconflict.operator.store.store import Store
from deconflict.settings.outlet_settings import Mqtt, Webhook
from tests.deconflict.operator.http.served_face import until
from tests.deconflict.operator.outlets.made_outlets import (
    SECRET,
    Hearer,
    broker,
    delivered,
    heard,
    hearing,
    held_now,
    kept,
    needs_mosquitto,
    numbers,
    retained,
)
from tests.helpers.made_advisories import cleared, made
from tests.helpers.patience import PATIENCE_S


@asynccontextmanager
async def outlets(folder: Path) -> AsyncIterator[tuple[Outlets, Store, Publisher]]:
    (folder / "secret").write_text(SECRET)
    with kept(folder) as (store, publisher):
        running = Outlets(store, publisher)
        try:
            yield running, store, publisher
        finally:
            await running.close()
            await publisher.close()


def hook(other: Hearer, folder: Path, name: str = "mes") -> Webhook:
    return Webhook(
        name=name, url=other.url, secret=f"file:{folder / 'secret'}", retry_s=(0.02, 0.1), kinds=("advisory",)
    )


def waiting(publisher: Publisher) -> set[str]:
    """Outlets that are measured."""
    return {name for (name,) in publisher.measures.values["deconflict_outlet_waiting"]}


async def test_a_changed_outlet_resumes_and_the_others_keep_running(tmp_path: Path) -> None:
    with hearing() as first, hearing() as second, hearing() as other:
        async with outlets(tmp_path) as (running, _, publisher):
            running.renew([hook(first, tmp_path), hook(other, tmp_path, "wms")], None)
            await until(lambda: waiting(publisher) == {"mes", "wms"})
            await publisher.publish([made(1)])
            await delivered(publisher, 1)
            running.renew([hook(second, tmp_path), hook(other, tmp_path, "wms")], None)
            await publisher.publish([made(2), made(3)])
            await delivered(publisher, 3)
            await delivered(publisher, 3, "wms")
        assert (numbers(first.heard), numbers(second.heard)) == ([1], [2, 3])
        assert numbers(other.heard) == [1, 2, 3]


async def test_a_stuck_outlet_with_a_new_address_loses_nothing(tmp_path: Path) -> None:
    with hearing() as gone:
        stuck = hook(gone, tmp_path)
    with hearing() as other:
        async with outlets(tmp_path) as (running, _, publisher):
            running.renew([stuck], None)
            await until(lambda: waiting(publisher))
            await publisher.publish([made(1), made(2)])
            await until(lambda: publisher.measures.values["deconflict_outlet_failures_total"]["mes",] > 1)
            running.renew([hook(other, tmp_path)], None)
            await heard(other, 2)
        assert numbers(other.heard) == [1, 2]


async def test_a_removed_outlet_sends_nothing_and_has_no_measures(tmp_path: Path) -> None:
    with hearing() as other:
        async with outlets(tmp_path) as (running, _, publisher):
            running.renew([hook(other, tmp_path)], None)
            await until(lambda: waiting(publisher))
            running.renew([], None)
            assert not waiting(publisher)
            await publisher.publish([made(1)])
            running.renew([hook(other, tmp_path, "new")], None)
            await until(lambda: waiting(publisher))
            await publisher.publish([made(2)])
            await heard(other, 1)
        assert numbers(other.heard) == [2]


@needs_mosquitto
async def test_an_outlet_whose_secret_is_missing_waits_for_it_and_the_others_go_on(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    late = tmp_path / "late"
    with hearing() as other, hearing() as waited:
        async with outlets(tmp_path) as (running, _, publisher), broker() as port:
            secret = {"secret": f"file:{late}"}
            mqtt = Mqtt(host="127.0.0.1", port=port, user="us", password=f"file:{late}", retry_s=(0.02, 0.1))
            hooks = [hook(waited, tmp_path, "late").model_copy(update=secret), hook(other, tmp_path)]
            running.renew(hooks, mqtt.model_copy(update={"kinds": ("advisory",)}))
            await until(lambda: waiting(publisher) == {"late", "mes", "mqtt"})
            await publisher.publish([made(1)])
            await heard(other, 1)
            failures = publisher.measures.values["deconflict_outlet_failures_total"]
            await until(lambda: failures["late",] and failures["mqtt",])
            for outlet, missing in (("late", "secret"), ("mqtt", "password")):
                assert f"{outlet} accepts no revisions and is tried again: its {missing} can't be read" in caplog.text
            assert not waited.heard
            assert not await held_now(port)
            late.write_text(SECRET)
            running.refresh()
            await heard(waited, 1)
            await retained(port, {"service", f"advisories/{made(1).id}"})
        verified(*waited.heard[0], SECRET, time.time())


async def test_a_changed_secret_signs_from_then_on_and_a_lost_one_stays(tmp_path: Path) -> None:
    with hearing() as other:
        async with outlets(tmp_path) as (running, _, publisher):
            running.renew([hook(other, tmp_path)], None)
            await until(lambda: waiting(publisher))
            (tmp_path / "secret").write_text("another secret that both know")
            running.refresh()
            await publisher.publish([made(1)])
            await heard(other, 1)
            (tmp_path / "secret").unlink()
            running.refresh()
            await publisher.publish([made(2)])
            await heard(other, 2)
        for headers, body in other.heard:
            assert verified(headers, body, "another secret that both know", float(headers["webhook-timestamp"]))
            with pytest.raises(SignatureError):
                verified(headers, body, SECRET, float(headers["webhook-timestamp"]))


async def test_an_outlet_with_other_settings_keeps_a_secret_that_can_not_be_read_then(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with hearing() as other:
        async with outlets(tmp_path) as (running, _, publisher):
            before = hook(other, tmp_path)
            running.renew([before], None)
            await until(lambda: waiting(publisher))
            (tmp_path / "secret").unlink()
            running.renew([before.model_copy(update={"timeout_s": 7.0}), hook(other, tmp_path, "another")], None)
            await until(lambda: waiting(publisher) == {"mes", "another"})
            await publisher.publish([made(1)])
            await heard(other, 2)
    assert "the old secret stays in use: " in caplog.text
    for headers, body in other.heard:
        assert verified(headers, body, SECRET, float(headers["webhook-timestamp"]))


async def test_an_outlet_with_an_unexpected_error_restarts_and_is_counted_and_logged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    faults = [RuntimeError("a fault"), RuntimeError("another")]

    def faulty(*rows: Any) -> dict[str, str]:
        if faults:
            raise faults.pop(0)
        return signed(*rows)

    monkeypatch.setattr(webhooks, "signed", faulty)
    with hearing() as other:
        async with outlets(tmp_path) as (running, _, publisher):
            running.renew([hook(other, tmp_path)], None)
            await until(lambda: waiting(publisher))
            await publisher.publish([made(1), made(2)])
            await delivered(publisher, 2)
            assert publisher.measures.values["deconflict_outlet_failures_total"]["mes",] == 2
        assert numbers(other.heard) == [1, 2]
    lines = [record.exc_text or "" for record in caplog.records if record.name == "deconflict.operator.outlets.outlets"]
    assert [text.splitlines()[-1] for text in lines] == ["RuntimeError: a fault", "RuntimeError: another"]


@dataclass
class Lingering:
    """An outlet that takes its time to end, and ends in an error."""

    begun: list[int]
    number: int
    may_end: asyncio.Event

    async def run(self) -> None:
        self.begun.append(self.number)
        try:
            await asyncio.Event().wait()
        finally:
            await self.may_end.wait()
            self.begun.remove(self.number)
            raise RuntimeError("the connection was lost")

    def refresh(self) -> None:
        pass


async def test_an_outlet_never_runs_twice_however_quickly_it_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun: list[int] = []
    may_end, numbered = asyncio.Event(), count()
    monkeypatch.setattr(Outlets, "_create", lambda *_: Lingering(begun, next(numbered), may_end))
    with hearing() as other:
        async with outlets(tmp_path) as (running, _, _):
            try:
                running.renew([hook(other, tmp_path)], None)
                await until(lambda: begun)
                for name in ("twice", "", "thrice"):
                    changed = hook(other, tmp_path).model_copy(update={"url": f"{other.url}&{name}"})
                    running.renew([changed] if name else [], None)
                    for _ in range(10):
                        await asyncio.sleep(0)
                assert begun == [0]
            finally:
                may_end.set()
            await until(lambda: begun != [0], 60)
            await until(lambda: begun, 60)
            assert begun == [2]


@needs_mosquitto
async def test_a_replaced_broker_is_left_with_the_state_offline(tmp_path: Path) -> None:
    async with (
        asyncio.timeout(PATIENCE_S),
        broker() as first,
        broker() as second,
        outlets(tmp_path) as (running, store, publisher),
    ):
        running.renew([], Mqtt(host="127.0.0.1", port=first, retry_s=(0.05, 0.2), kinds=("advisory",)))
        await until(lambda: waiting(publisher))
        await publisher.publish([made(1), made(2)])
        await until(lambda: store.position("mqtt") == 2)
        running.renew([], Mqtt(host="127.0.0.1", port=second, retry_s=(0.05, 0.2), kinds=("advisory",)))
        await publisher.publish([cleared(2)])
        await retained(second, {"service", "advisories/advisory-1"})
        left = await retained(first, {"service", "advisories/advisory-1", "advisories/advisory-2"})
        assert left["deconflict/service"] == "offline"
