import asyncio
import os
import socket
import subprocess
import sys
from contextlib import aclosing, suppress
from datetime import timedelta
from pathlib import Path

import httpx
import pytest
import trustme

from deconflict.settings.site import Person
from deconflict_client.advisory import AnyAdvisory
from deconflict_client.client import (
    Client,
    ClientError,
    NoSuchAdvisoryError,
    NotAllowedError,
    PositionLostError,
    UntrustedError,
)
from ingest.settings import Tls
from tests.deconflict.operator.http.served_face import Served, served
from tests.helpers.made_advisories import START, cleared, cleared_situation, made, situation
from tests.helpers.patience import PATIENCE_S


def client(service: Served, token: str | None = None) -> Client:
    return Client(service.http, token=token, backoff_s=(0.02, 0.1))


async def first(subscriber: Client, after: int, count: int) -> list[AnyAdvisory]:
    advisories: list[AnyAdvisory] = []
    async with asyncio.timeout(PATIENCE_S), aclosing(subscriber.follow(after)) as following:
        async for advisory in following:
            advisories.append(advisory)
            if len(advisories) == count:
                break
    return advisories


async def test_the_client_gets_open_advisories_and_every_later_revision_without_a_gap(tmp_path: Path) -> None:
    async with served(tmp_path) as service, client(service) as subscriber:
        published = await service.publish(made(1), made(2), cleared(2))
        listing = await subscriber.open()
        assert (listing.seq, listing.advisories, listing.more) == (3, [published[0]], False)
        assert await first(subscriber, 1, 2) == published[1:]
        later = await service.publish(made(3))
        assert await first(subscriber, listing.seq, 1) == later
        assert await subscriber.revisions("advisory-2") == published[1:]


async def test_the_client_gets_open_situations_and_follows_the_kinds_that_it_asks_for(tmp_path: Path) -> None:
    async with served(tmp_path) as service:
        await service.publish(made(1), situation(1), situation(2), cleared_situation(2))
        async with client(service) as subscriber:
            listing = await subscriber.situations()
            assert ([each.id for each in listing.situations], listing.seq, listing.more) == (["situation-1"], 4, False)
            await service.publish(made(2), situation(3), made(3))
            following = subscriber.follow(after=0, kinds=["situation"])
            assert [(await anext(following)).seq for _ in range(4)] == [2, 3, 4, 6]
            everything = subscriber.follow(after=listing.seq, kinds=["situation", "conflict"])
            assert [(await anext(everything)).id for _ in range(3)] == ["advisory-2", "situation-3", "advisory-3"]
            answered = await subscriber.acknowledge("situation-3", name="Kim", reason="on my way")
            assert answered == (await subscriber.revisions("situation-3"))[-1] == await anext(following)


async def test_kinds_that_do_not_exist_are_an_error(tmp_path: Path) -> None:
    async with served(tmp_path) as service, client(service) as subscriber:
        with pytest.raises(ClientError, match="kinds: found 'rumour'"):
            await anext(subscriber.follow(after=0, kinds=["rumour"]))  # type: ignore[list-item]


async def test_the_client_gets_the_state_of_each_vendor(tmp_path: Path) -> None:
    async with served(tmp_path) as service, client(service) as subscriber:
        (acme,) = await subscriber.vendors()
        assert (acme.name, acme.messages, acme.grade, acme.flags) == ("Acme", 7, None, [])
        service.sources.down.add("receiver")
        with pytest.raises(ClientError, match="503"):
            await subscriber.vendors()


async def test_an_acknowledgement_comes_back_in_the_stream(tmp_path: Path) -> None:
    async with served(tmp_path) as service, client(service) as subscriber:
        await service.publish(made(1))
        answered = await subscriber.acknowledge("advisory-1", name="Kim", reason="A-7 is called back")
        assert answered.acknowledgement
        assert (answered.acknowledgement.name, answered.seq) == ("Kim", 2)
        assert (await first(subscriber, 1, 1))[0] == answered
        with pytest.raises(NoSuchAdvisoryError, match="no advisory 'advisory-9' is stored"):
            await subscriber.acknowledge("advisory-9", name="Kim", reason="none")
        with pytest.raises(ClientError, match="422"):
            await subscriber.acknowledge("advisory-1", name="", reason="none")


@pytest.mark.parametrize("name", ["pipe", "none", "."])
def test_an_authority_that_is_no_file_is_refused_and_not_waited_for(tmp_path: Path, name: str) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(FileNotFoundError, match="is no file"):
        Client("https://127.0.0.1:9", authority=tmp_path / name)


async def test_a_lost_stream_is_resumed(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as probe:
        address = f"127.0.0.1:{probe.getsockname()[1]}"
    numbers: list[int] = []

    async def follow() -> None:
        async with Client(f"http://{address}", backoff_s=(0.02, 0.1)) as subscriber:
            async for advisory in subscriber.follow(0):
                numbers.append(advisory.seq)  # noqa: PERF401 - it never ends

    following = asyncio.create_task(follow())
    for last in (2, 4):
        async with served(tmp_path, at=address) as service:
            await service.publish(made(last), cleared(last))
            async with asyncio.timeout(PATIENCE_S):
                while numbers[-1:] != [last]:
                    await asyncio.sleep(0.01)
    following.cancel()
    with suppress(asyncio.CancelledError):
        await following
    assert numbers == [1, 2, 3, 4]


async def test_a_position_beyond_the_store_is_an_error_without_a_wait(tmp_path: Path) -> None:
    async with served(tmp_path) as service, client(service) as subscriber:
        with pytest.raises(PositionLostError, match="beyond the last seq 0"):
            await first(subscriber, 7, 1)


async def test_a_position_before_what_was_removed_is_an_error_and_what_is_left_can_be_read(tmp_path: Path) -> None:
    async with served(tmp_path) as service:
        await service.publish(made(1), made(2), cleared(2), made(3))
        service.store.prune(START + timedelta(days=1))
    async with served(tmp_path) as service, client(service) as subscriber:
        with pytest.raises(PositionLostError, match="some revisions after 2 were removed"):
            await first(subscriber, 2, 1)
        assert [advisory.seq for advisory in await first(subscriber, 0, 2)] == [1, 4]


async def test_a_missing_permission_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "token").write_text("kim-has-a-long-token")
    people = (Person(name="Kim", role="read", token=f"file:{tmp_path / 'token'}"),)
    async with served(tmp_path, people=people) as service:
        async with client(service) as nobody:
            with pytest.raises(NotAllowedError, match="401"):
                await nobody.open()
            with pytest.raises(NotAllowedError, match="401: send 'Authorization"):
                await first(nobody, 0, 1)
        async with client(service, "kim-has-a-long-token") as kim:
            published = await service.publish(made(1))
            assert await first(kim, 0, 1) == published
            with pytest.raises(NotAllowedError, match="this takes the role acknowledge"):
                await kim.acknowledge("advisory-1", name="Kim", reason="none")


async def test_only_a_service_with_a_certificate_of_the_given_authority_is_trusted(tmp_path: Path) -> None:
    site, foreign = trustme.CA(), trustme.CA()
    site.issue_cert("127.0.0.1").private_key_and_cert_chain_pem.write_to_path(str(tmp_path / "site.pem"))
    for name, authority in (("site", site), ("foreign", foreign)):
        authority.cert_pem.write_to_path(str(tmp_path / f"{name}-ca.pem"))
    (tmp_path / "token").write_text("kim-has-a-long-token")
    people = (Person(name="Kim", role="acknowledge", token=f"file:{tmp_path / 'token'}"),)
    async with served(tmp_path, people=people, tls=Tls(certificate=str(tmp_path / "site.pem"))) as service:
        url = f"https://{service.address}"
        published = await service.publish(made(1))
        async with Client(url, token="kim-has-a-long-token", authority=tmp_path / "site-ca.pem") as kim:
            assert (await kim.open()).advisories == published
            assert await first(kim, 0, 1) == published
            answered = await kim.acknowledge("advisory-1", name="", reason="A-7 is called back")
            assert answered.acknowledgement
            assert answered.acknowledgement.name == "Kim"
        async with Client(url, token="kim-has-a-long-token", authority=tmp_path / "foreign-ca.pem") as fooled:
            with pytest.raises(httpx.ConnectError):
                await fooled.open()
            with pytest.raises(UntrustedError, match="unable to get local issuer"):
                await first(fooled, 0, 1)


async def test_an_unreachable_service_is_an_error() -> None:
    async with Client("http://127.0.0.1:1") as subscriber:
        with pytest.raises(httpx.ConnectError):
            await subscriber.open()


@pytest.mark.parametrize(
    ("module", "not_needed"),
    [
        (
            "deconflict_client.client",
            {"deconflict", "fastapi", "ingest", "metrics", "numba", "numpy", "sqlite3", "uvicorn"},
        ),
        ("deconflict.client", {"fastapi", "ingest", "metrics", "numba", "numpy", "sqlite3", "uvicorn"}),
    ],
)
def test_the_client_loads_no_server_code(module: str, not_needed: set[str]) -> None:
    script = f"import sys, {module}; print(*sorted({not_needed} & set(sys.modules)))"
    loaded = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert loaded.stdout.split() == []
