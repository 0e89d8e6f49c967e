"""What a role does all the time goes on after any fault, which is counted, logged and said in health."""

import asyncio
import json
import logging
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest
from pydantic_core import to_json
from websockets.asyncio.client import connect

from deconflict.operator.live.live_socket import LiveSocket
from deconflict.roles.operator_role import OperatorRole
from deconflict.roles.receiver_role import ReceiverRole
from deconflict.roles.service import run_in_one_process, runtime_directory
from deconflict.runtime.parcels import STORED, packed_parcel
from deconflict.settings.hot_reload import SITE_FILE
from deconflict.settings.site import Operator, Site
from ingest.measures import lasting_loops
from ingest.measures.lasting_loops import FAULTS
from ingest.measures.measures import Measures
from ingest.settings import ReceiverSettings
from metrics.monitoring.exposition import render
from tests.deconflict.operator.http.served_face import until
from tests.deconflict.roles.made_face import serving
from tests.helpers.made_advisories import made
from tests.helpers.patience import PATIENCE_S
from tests.helpers.plain_http import http_client
from tests.helpers.saying import status

SITE = Site(receiver=ReceiverSettings(port=0), operator=Operator(port=0))
SEEN_WITHIN_S = 10.0


@pytest.fixture(autouse=True)
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lasting_loops, "AGAIN_S", 0.05)


def failing_once(loop: Callable[[], Awaitable[None]], begun: set[str], part: str) -> Callable[[], Awaitable[None]]:
    is_first = True

    async def run() -> None:
        nonlocal is_first
        if is_first:
            is_first = False
            raise ArithmeticError(part)
        begun.add(part)
        await loop()

    return run


@pytest.mark.parametrize("role", [OperatorRole, ReceiverRole])
async def test_each_loop_of_a_role_goes_on_after_a_fault_that_health_says(
    role: type[OperatorRole] | type[ReceiverRole],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    loops_of, begun, parts = role._loops, set[str](), set[str]()

    def loops(self: Any) -> dict[str, Callable[[], Awaitable[None]]]:
        found = {part: failing_once(loop, begun, part) for part, loop in loops_of(self).items()}
        parts.update(found)
        return found

    monkeypatch.setattr(role, "_loops", loops)
    async with run_in_one_process(SITE, tmp_path, render) as (_, operator), http_client() as client:
        await until(lambda: parts and begun == parts)

        async def said() -> str:
            health = (await client.get(f"http://127.0.0.1:{operator.port}/healthz")).json()["refused_or_lost"]
            return str(health.get("reason", "")) if health["status"] == "degraded" else ""

        async with asyncio.timeout(SEEN_WITHIN_S):
            while f"{len(parts)} faults of the program" not in await said():
                await asyncio.sleep(0.1)
    assert all(f"a fault of the program in {part}, " in caplog.text for part in parts)


@pytest.mark.parametrize("is_receiver", [False, True])
async def test_settings_that_could_not_be_read_for_a_while_are_used_later(is_receiver: bool, tmp_path: Path) -> None:
    with runtime_directory() as name:
        runtime, stop = Path(name), asyncio.Event()
        role = (
            ReceiverRole(SITE, runtime, tmp_path / "log")
            if is_receiver
            else OperatorRole(SITE, runtime, tmp_path, render)
        )
        measures = role.measures if isinstance(role, ReceiverRole) else role._publisher.measures
        running = asyncio.create_task(role.run(stop))
        await role.ready.wait()
        (runtime / SITE_FILE).mkdir()
        await until(lambda: measures.values[FAULTS])
        (runtime / SITE_FILE).rmdir()
        changed = SITE.model_copy(update={"name": "Another hall"})
        (runtime / SITE_FILE).write_text(changed.model_dump_json())
        await until(lambda: (role.site if isinstance(role, ReceiverRole) else role._site).name == "Another hall")
        stop.set()
        await running


async def test_settings_that_fail_while_they_are_applied_are_applied_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The last step of them fails once."""
    with runtime_directory() as name:
        runtime, stop = Path(name), asyncio.Event()
        role, dialled = ReceiverRole(SITE, runtime, tmp_path / "log"), list[str]()
        running = asyncio.create_task(role.run(stop))
        await role.ready.wait()

        def dial() -> None:
            dialled.append(role.site.name)
            if len(dialled) == 1:
                raise ArithmeticError

        monkeypatch.setattr(role, "_dial", dial)
        (runtime / SITE_FILE).write_text(SITE.model_copy(update={"name": "Another hall"}).model_dump_json())
        await until(lambda: dialled == ["Another hall", "Another hall"])
        stop.set()
        await running


async def test_measures_that_nobody_can_read_stop_no_look_at_what_is_refused(tmp_path: Path) -> None:
    async with serving(tmp_path) as (role, engine):
        assert await engine.call("publish", packed_parcel({"measures": [{"values": {FAULTS: [[1]]}}]})) == STORED
        measures = role._publisher.measures
        await until(lambda: measures.values[FAULTS], 2 * SEEN_WITHIN_S)
        assert await engine.call("publish", packed_parcel({"measures": [Measures().as_document()]})) == STORED
        looked_s = role.sources._refusals.looked_s
        await until(lambda: role.sources._refusals.looked_s > looked_s, 2 * SEEN_WITHIN_S)


async def test_what_comes_beside_advisories_and_can_not_be_read_holds_none_of_them_up(tmp_path: Path) -> None:
    async with serving(tmp_path) as (role, engine):
        unreadable = {"near_misses": [["a"]], "losses": {"sender": 1}, "canary": {"due_s": 1}, "measures": [1]}
        for number, beside in enumerate({name: value} for name, value in unreadable.items()):
            assert await engine.call("publish", packed_parcel(beside, [to_json(made(number))])) == STORED
        assert sum(role._publisher.measures.values[FAULTS].values()) == 4
        assert len(role._store.after(0, -1)) == 4


async def test_a_message_that_meets_a_fault_costs_no_other_message_and_no_connection(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    with runtime_directory() as name:
        role, stop = ReceiverRole(SITE, Path(name), tmp_path / "log"), asyncio.Event()
        running, receive = asyncio.create_task(role.run(stop)), role.fleet.receive
        await role.ready.wait()

        def fails_once(*message: Any) -> str | None:
            monkeypatch.setattr(role.fleet, "receive", receive)
            raise ArithmeticError

        monkeypatch.setattr(role.fleet, "receive", fails_once)
        async with connect(f"ws://127.0.0.1:{role.receiver.port}") as socket:
            for robot in ("A-1", "B-1"):
                await socket.send(status(robot, time.time()))
            await until(lambda: role.fleet.robots)
        assert role.measures.values[FAULTS] == {("reading a message",): 1}
        stop.set()
        await running
    assert "a fault of the program in reading a message" in caplog.text


async def test_the_page_hears_of_health_again_after_a_fault(caplog: pytest.LogCaptureFixture) -> None:
    asked = 0

    async def health() -> dict[str, Any]:
        nonlocal asked
        asked += 1
        if asked == 1:
            raise ArithmeticError
        return {"asked": asked}

    async def follow(_: int) -> Any:
        await asyncio.sleep(PATIENCE_S)

    measures = Measures()
    pages = LiveSocket(follow, health, lambda: 0, measures, lambda: 1.0)
    with caplog.at_level(logging.ERROR):
        pages._count(+1)
        await until(lambda: json.loads(pages._health_text).get("asked") == 2)
        pages._count(-1)
    assert measures.values[FAULTS] == {("asking for the health",): 1}
