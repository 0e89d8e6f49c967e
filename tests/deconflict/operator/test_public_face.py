"""The operators' port beside storing and outlets, in a role as it runs."""

import asyncio
import threading
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager
from pathlib import Path
from time import monotonic

import pytest
from pydantic_core import to_json
from websockets.asyncio.client import connect

from deconflict.operator import public_face
from deconflict.operator.public_face import HangingFaceError
from deconflict.operator.store.store import Store
from deconflict.roles.operator_role import OperatorRole
from deconflict.roles.service import runtime_directory
from deconflict.runtime.parcels import STORED, packed_parcel
from deconflict.runtime.rpc import AsyncCaller
from deconflict.settings.outlet_settings import Webhook
from deconflict.settings.site import Operator, Site
from metrics.monitoring.exposition import render
from tests.deconflict.operator.http.served_face import until
from tests.deconflict.operator.outlets.made_outlets import SECRET, Hearer, hearing
from tests.helpers.made_advisories import made
from tests.helpers.patience import PATIENCE_S
from tests.helpers.plain_http import http_client

PARCELS = 20


@pytest.fixture
def outlet() -> Iterator[Hearer]:
    with hearing() as other:
        yield other


@asynccontextmanager
async def serving(data: Path, outlet: Hearer) -> AsyncIterator[tuple[OperatorRole, AsyncCaller]]:
    """A role that runs with a webhook, and the engine's end of its link."""
    with runtime_directory() as runtime:
        stop = asyncio.Event()
        (data / "secret").write_text(SECRET)
        webhook = Webhook(name="mes", url=outlet.url, secret=f"file:{data / 'secret'}", kinds=("advisory",))
        site = Site(operator=Operator(port=0), webhooks=(webhook,))
        role = OperatorRole(site, Path(runtime), data, render)
        running = asyncio.create_task(role.run(stop))
        await until(lambda: role._publisher.measures.values["deconflict_outlet_waiting"])
        try:
            yield role, AsyncCaller(Path(runtime), "operator")
        finally:
            stop.set()
            await running


def waiting(released: threading.Event) -> None:
    released.wait(PATIENCE_S)


def spinning(released: threading.Event) -> None:
    end_s = monotonic() + PATIENCE_S
    while not released.is_set() and monotonic() < end_s:
        pass


@pytest.mark.parametrize("occupy", [waiting, spinning])
async def test_whatever_occupies_the_port_delays_neither_storing_nor_outlets(
    tmp_path: Path, outlet: Hearer, occupy: Callable[[threading.Event], None]
) -> None:
    released, took_s = threading.Event(), []
    async with serving(tmp_path, outlet) as (role, engine), http_client() as client:
        health = f"http://127.0.0.1:{role.port}/healthz"
        first_seq = (await client.get(health)).json()["store"]["seq"]
        assert role._face._loop
        role._face._loop.call_soon_threadsafe(occupy, released)
        asked = asyncio.create_task(client.get(health, timeout=PATIENCE_S))
        for number in range(PARCELS):
            began_s = monotonic()
            assert await engine.call("publish", packed_parcel({}, [to_json(made(number))])) == STORED
            took_s.append(monotonic() - began_s)
        await until(lambda: len(outlet.heard) == PARCELS)
        assert role._store.last_seq() == first_seq + PARCELS
        assert role._store.unstored == 0
        assert not asked.done(), "the port is occupied"
        released.set()
        assert (await asked).json()["store"]["seq"] == first_seq + PARCELS
    assert sorted(took_s)[PARCELS // 2] < 0.25


async def test_a_subscriber_and_an_answer_of_a_person_come_through_from_the_other_event_loop(
    tmp_path: Path, outlet: Hearer
) -> None:
    async with (
        serving(tmp_path, outlet) as (role, engine),
        connect(f"ws://127.0.0.1:{role.port}/advisories/stream") as stream,
        http_client() as client,
    ):
        for number in range(PARCELS):
            await engine.call("publish", packed_parcel({}, [to_json(made(number))]))
            assert f'"id":"advisory-{number}"' in str(await stream.recv())
        path = f"http://127.0.0.1:{role.port}/advisories/advisory-1/acknowledgement"
        answer = await client.post(path, json={"name": "Kim", "reason": "seen"})
        assert answer.status_code == 201
        assert '"name":"Kim"' in str(await stream.recv())


async def test_a_role_whose_port_hangs_ends_with_everything_stored(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(public_face, "REFRESH_EVERY_S", 0.1)
    monkeypatch.setattr(public_face, "SILENCE_LIMIT_S", 2)
    released = threading.Event()
    with runtime_directory() as runtime:
        role = OperatorRole(Site(operator=Operator(port=0)), Path(runtime), tmp_path, render)
        running = asyncio.create_task(role.run(asyncio.Event()))
        await role.ready.wait()
        first_seq = role._store.last_seq()
        assert role._face._loop
        role._face._loop.call_soon_threadsafe(waiting, released)
        await AsyncCaller(Path(runtime), "operator").call("publish", packed_parcel({}, [to_json(made(1))]))
        with pytest.raises(HangingFaceError):
            await running
    released.set()
    await until(lambda: "public face" not in [thread.name for thread in threading.enumerate()])
    store = Store(tmp_path)
    assert store.last_seq() == first_seq + 1
    store.close()
