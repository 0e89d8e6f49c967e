"""The examples do what they say, with the service and in processes of their own."""

import asyncio
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
import trustme

from deconflict.settings.site import Person
from deconflict_client.advisory import AnyAdvisory, Severity
from deconflict_client.situations import advisories_of
from ingest.settings import Tls
from tests.deconflict.operator.http.served_face import Served, served, until
from tests.deconflict.operator.outlets.made_outlets import SECRET, delivered, kept, posting
from tests.deconflict.roles.made_service import Served as Service
from tests.deconflict.roles.made_service import free_ports, healthy
from tests.helpers.made_advisories import START, cleared, cleared_situation, made, situation
from tests.helpers.patience import PATIENCE_S

EXAMPLES = Path(__file__).parent.parent / "examples"
EXAMPLE, BOARD = EXAMPLES / "site_service.py", EXAMPLES / "situation_board.py"
TUTORIAL = EXAMPLES.parent / "docs" / "tutorial.md"
RECEIVER = EXAMPLES / "webhook_receiver.py"
SAID = "the-token-of-the-site-service"

NODE = ["node", "--experimental-websocket"]


def node_has_websockets() -> bool:
    tried = [*NODE, "-e", "WebSocket"]
    return bool(shutil.which("node")) and subprocess.run(tried, check=False, capture_output=True).returncode == 0


def started(service: Served, place: Path) -> subprocess.Popen[bytes]:
    directory = place.parent
    secrets = {"DECONFLICT_TOKEN": SAID, "DECONFLICT_AUTHORITY": str(directory / "ca.pem")}
    command = [sys.executable, str(EXAMPLE), f"https://{service.address}", str(place)]
    return subprocess.Popen(command, stderr=subprocess.PIPE, env=os.environ | secrets)


def secured(directory: Path) -> dict[str, Any]:
    """The settings of a port that takes a token, with a certificate of the authority in `ca.pem`."""
    authority = trustme.CA()
    authority.cert_pem.write_to_path(str(directory / "ca.pem"))
    authority.issue_cert("127.0.0.1").private_key_and_cert_chain_pem.write_to_path(str(directory / "site.pem"))
    (directory / "token").write_text(SAID)
    person = Person(name="site service", role="acknowledge", token=f"file:{directory / 'token'}")
    return {"people": (person,), "tls": Tls(certificate=str(directory / "site.pem"))}


def place_of(place: Path) -> int:
    return int(json.loads(place.read_text())["seq"]) if place.exists() else -1


def taken_up(service: Served) -> list[AnyAdvisory]:
    """Each revision with which an advisory was taken up."""
    all_of_it = advisories_of(service.store.after(0, 1000))
    return [
        advisory
        for advisory in all_of_it
        if advisory.acknowledgement and advisory.acknowledgement.name == "site service"
    ]


async def test_the_site_service_takes_up_each_advisory_once_though_it_is_killed(tmp_path: Path) -> None:
    place = tmp_path / "place.json"
    async with served(tmp_path, **secured(tmp_path)) as service:
        await service.publish(made(1))
        running = started(service, place)
        await until(lambda: place_of(place) == 2)
        await service.publish(made(2), made(3, severity=Severity.CAUTION))
        await until(lambda: len(taken_up(service)) == 2)
        running.kill()
        assert await asyncio.to_thread(running.wait) == -9
        await service.publish(made(4), made(5), cleared(5))
        place.write_text(json.dumps({"seq": 1}))  # as if it had been killed before it could note its place
        again = started(service, place)
        await until(lambda: len(taken_up(service)) == 3)
        await until(lambda: place_of(place) == service.store.last_seq())
        again.kill()
        await asyncio.to_thread(again.wait)
        assert {advisory.id for advisory in taken_up(service)} == {"advisory-1", "advisory-2", "advisory-4"}
    for service_process in (running, again):
        assert service_process.stderr
        assert b"Traceback" not in service_process.stderr.read()
        service_process.stderr.close()


@asynccontextmanager
async def receiving(port: int, secret: str) -> AsyncIterator[asyncio.subprocess.Process]:
    """The receiver of webhooks, until the end of the block."""
    command, environment = [sys.executable, str(RECEIVER), str(port)], os.environ | {"DECONFLICT_SECRET": secret}
    pipe = asyncio.subprocess.PIPE
    receiver = await asyncio.create_subprocess_exec(*command, env=environment, stdout=pipe, stderr=pipe)
    try:
        yield receiver
    finally:
        receiver.kill()
        await receiver.wait()


async def lines_of(process: asyncio.subprocess.Process, count: int) -> list[str]:
    assert process.stdout
    async with asyncio.timeout(PATIENCE_S):
        return [(await process.stdout.readline()).decode() for _ in range(count)]


async def test_the_webhook_receiver_takes_each_signed_revision_and_no_other(tmp_path: Path) -> None:
    (port,) = free_ports(1)
    with kept(tmp_path) as (store, publisher):
        async with posting(f"http://127.0.0.1:{port}/", store, publisher, tmp_path):
            await publisher.publish([made(1), made(2)])
            async with receiving(port, SECRET) as receiver:
                taken = await lines_of(receiver, 2)
                await delivered(publisher, 2)  # it prints a revision before it accepts it
            async with receiving(port, "another secret") as wary:
                assert wary.stderr
                await publisher.publish([cleared(1)])
                async with asyncio.timeout(PATIENCE_S):
                    assert b'" 401 ' in await wary.stderr.readline()
            async with receiving(port, SECRET) as receiver:
                taken += await lines_of(receiver, 1)
    assert taken == [
        "1 raised conflict: Tug 1 and Lift 2 cross in 4 s\n",
        "2 raised conflict: Tug 1 and Lift 2 cross in 4 s\n",
        "3 cleared conflict: Tug 1 and Lift 2 cross in 4 s\n",
    ]


def with_removed(folder: Path) -> None:
    """Numbers 1 to 3 of a store, of which 2 and 3 were removed."""
    with kept(folder) as (store, _):
        store.append([made(1), made(2), cleared(2)])
        store.prune(START + timedelta(days=1))


async def test_the_site_service_whose_position_is_lost_begins_with_what_is_open(tmp_path: Path) -> None:
    place = tmp_path / "place.json"
    place.write_text(json.dumps({"seq": 2}))
    with_removed(tmp_path)
    async with served(tmp_path, **secured(tmp_path)) as service:
        running = started(service, place)
        await until(lambda: place_of(place) == 4)
        running.kill()
        await asyncio.to_thread(running.communicate)
        assert [advisory.id for advisory in taken_up(service)] == ["advisory-1"]


@pytest.mark.skipif(not node_has_websockets(), reason="needs node 22, or 20.10")
async def test_the_javascript_client_resumes_after_a_restart_of_the_service_and_of_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DECONFLICT_TOKEN", SAID)
    people = (Person(name="site service", token="env:DECONFLICT_TOKEN"),)
    (port,) = free_ports(1)
    command = [*NODE, str(EXAMPLES / "follow_stream.mjs"), f"http://127.0.0.1:{port}", str(tmp_path / "place.json")]
    (tmp_path / "place.json").write_text('{"seq": 0}')
    async with served(tmp_path, at=f"127.0.0.1:{port}", people=people) as service:
        await service.publish(made(1))
        client = await asyncio.create_subprocess_exec(*command, stdout=asyncio.subprocess.PIPE)
        printed = await lines_of(client, 1)
    async with served(tmp_path, at=f"127.0.0.1:{port}", people=people) as service:
        await service.publish(made(2))
        printed += await lines_of(client, 1)
        client.kill()
        await client.wait()
        await until(lambda: place_of(tmp_path / "place.json") >= 1)
        (tmp_path / "place.json").write_text('{"seq": 2}')
        await service.publish(situation(1), cleared(2))
        again = await asyncio.create_subprocess_exec(*command, stdout=asyncio.subprocess.PIPE)
        printed += await lines_of(again, 2)
        again.kill()
        await again.wait()
    numbers_and_kinds = [line.partition(":")[0] for line in printed]
    assert numbers_and_kinds == ["1 raised conflict", "2 raised conflict", "3 raised situation", "4 cleared conflict"]


@pytest.mark.skipif(not node_has_websockets(), reason="needs node 22, or 20.10")
@pytest.mark.parametrize("seq", [2, 99])
async def test_the_javascript_client_says_that_its_position_is_lost_and_begins_anew(tmp_path: Path, seq: int) -> None:
    (tmp_path / "place.json").write_text(json.dumps({"seq": seq}))
    with_removed(tmp_path)
    async with served(tmp_path) as service:
        command = [*NODE, str(EXAMPLES / "follow_stream.mjs"), service.http, str(tmp_path / "place.json")]
        pipe = asyncio.subprocess.PIPE
        client = await asyncio.create_subprocess_exec(*command, stdout=pipe, stderr=pipe)
        assert client.stderr
        async with asyncio.timeout(PATIENCE_S):
            assert (await client.stderr.readline()).startswith(b"4416: ")
        await until(lambda: service.measured("deconflict_stream_subscribers") == 1)
        await service.publish(made(3))
        assert await lines_of(client, 1) == ["4 raised conflict: Tug 1 and Lift 2 cross in 4 s\n"]
        client.kill()
        await client.wait()


@pytest.mark.skipif(not node_has_websockets(), reason="needs node 22, or 20.10")
def test_the_javascript_client_says_what_it_needs(tmp_path: Path) -> None:
    command = [*NODE, str(EXAMPLES / "follow_stream.mjs"), "http://127.0.0.1:1"]
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (run.returncode, run.stderr.startswith("usage: "), list(tmp_path.iterdir())) == (2, True, [])


async def test_the_board_shows_the_open_situations_after_each_change(tmp_path: Path) -> None:
    async with served(tmp_path) as service:
        await service.publish(situation(1), made(1))
        command = [sys.executable, str(BOARD), service.http]
        board = await asyncio.create_subprocess_exec(*command, stdout=asyncio.subprocess.PIPE)
        assert board.stdout
        meets = b"warning: Tug 1 and Lift 2 meet at the dock. Tug 1 waits 3 s\n"
        assert [await board.stdout.readline() for _ in range(2)] == [b"1 open\n", meets]
        await service.publish(made(2), cleared_situation(1))
        assert await board.stdout.readline() == b"0 open\n"
        board.kill()
        await board.wait()


async def test_the_robots_of_the_tutorial_conform_and_are_warned_of(tmp_path: Path) -> None:
    blocks = dict(re.findall(r"^```(toml|python)\n(.*?)^```", TUTORIAL.read_text(), re.M | re.S))
    commands = re.findall(r"^python robot.py (.*)$", TUTORIAL.read_text(), re.M)
    (tmp_path / "site.toml").write_text(blocks["toml"])
    service = Service(tmp_path / "data", tmp_path / "site.toml")
    (tmp_path / "robot.py").write_text(blocks["python"].replace("ws://127.0.0.1:3000", service.robots_url))
    with service.running():
        await service.until("/healthz", healthy)
        robots = [subprocess.Popen([sys.executable, str(tmp_path / "robot.py"), *each.split()]) for each in commands]
        try:
            opened = await service.until("/advisories", lambda answer: answer["advisories"])
            known = await service.until("/robots", lambda answer: answer["robots"])
        finally:
            for robot in robots:
                robot.kill()
                robot.wait()
    assert " cross in " in opened["advisories"][0]["summary"]
    assert [(robot["identified"], robot["deviations"]) for robot in known["robots"]] == [(True, {}), (True, {})]


@pytest.mark.parametrize("example", [EXAMPLE, BOARD, RECEIVER], ids=lambda path: path.stem)
def test_an_example_without_its_arguments_says_which_it_needs(example: Path) -> None:
    tried = subprocess.run([sys.executable, str(example)], check=False, capture_output=True, text=True)
    assert tried.returncode == 2
    assert tried.stderr.startswith("usage: ")
    assert "required" in tried.stderr
