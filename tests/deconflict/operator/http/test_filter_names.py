"""A filter that names nobody known says so, in one way at every address that has filters."""

from collections.abc import AsyncIterator
from pathlib import Path

import httpx
import pytest

from deconflict.settings.shared_places import NamedArea
from deconflict.settings.site import Site
from ingest.settings import Vendor
from tests.deconflict.operator.http.served_face import Served, served
from tests.deconflict.operator.ledger.made_entries import CROSSED, QUEUED
from tests.helpers.made_advisories import ROBOTS, cleared, made, situation
from tests.helpers.plain_http import http_client

LISTS = ("/advisories", "/situations", "/advice")
NOBODY = "0c5b4a7e-0000-4000-8000-000000000009"
FLOOR = "5f1d0000-0000-4000-8000-00000000000a"
AREA = NamedArea(name="Packing", floor=FLOOR, outline_m=((0.0, 0.0), (9.0, 0.0), (9.0, 9.0)))
VENDORS = "known: Acme and Cargo"


@pytest.fixture
async def face(tmp_path: Path) -> AsyncIterator[Served]:
    async with served(tmp_path) as served_face:
        served_face.app.state.site = Site(vendors=(Vendor(name="Cargo"),)).model_copy(update={"areas": (AREA,)})
        yield served_face


@pytest.fixture
async def client(face: Served) -> AsyncIterator[httpx.AsyncClient]:
    async with http_client(face.http) as http:
        yield http


async def unknown(client: httpx.AsyncClient, address: str, **names: str) -> dict[str, str]:
    answer = await client.get(address, params=names)
    assert answer.status_code == 200, answer.text
    found: dict[str, str] = answer.json().get("unknown", {})
    return found


@pytest.mark.parametrize("address", [*LISTS, "/robots", "/losses"])
async def test_a_vendor_that_nobody_knows_is_named(client: httpx.AsyncClient, address: str) -> None:
    assert await unknown(client, address, vendor="acme") == {"vendor": f"no vendor 'acme' is known; {VENDORS}"}
    assert "unknown" not in (await client.get(address)).json()


@pytest.mark.parametrize("address", [*LISTS, "/robots", "/losses"])
@pytest.mark.parametrize("vendor", ["Acme", "Cargo"])
async def test_a_vendor_that_is_heard_or_in_the_site_file_is_known(
    client: httpx.AsyncClient, address: str, vendor: str
) -> None:
    assert await unknown(client, address, vendor=vendor) == {}


@pytest.mark.parametrize("address", LISTS)
async def test_a_robot_that_nobody_knows_is_named(client: httpx.AsyncClient, address: str) -> None:
    sentence = f"no robot {NOBODY!r} is known; GET /robots has the UUIDs of those that report"
    assert await unknown(client, address, robot=NOBODY) == {"robot": sentence}
    assert await unknown(client, address, robot=ROBOTS[0].upper()) == {}
    assert set(await unknown(client, address, robot=NOBODY, vendor="acme")) == {"robot", "vendor"}


@pytest.mark.parametrize("address", LISTS)
async def test_what_only_the_store_has_is_known(face: Served, client: httpx.AsyncClient, address: str) -> None:
    await face.publish(made(1, vendors=("Gone", "Left"), robots=("a", "b")), cleared(1, vendors=("Gone", "Left")))
    await face.publish(situation(2, vendors=("Old", "Older"), robots=("c", "d")))
    assert await unknown(client, address, vendor="Gone", robot="a") == {}
    assert await unknown(client, address, vendor="Older", robot="d", state="cleared") == {}


async def test_losses_know_vendors_and_places_of_the_site_file_and_of_the_ledger(
    face: Served, client: httpx.AsyncClient
) -> None:
    face.sources.ledger.add("engine", 1, [QUEUED, CROSSED])
    for known in ("Packing", QUEUED.place):
        assert await unknown(client, "/losses", place=known) == {}
    sentence = "no zone, resource or area 'packing' is known; known: Packing"
    assert await unknown(client, "/losses", place="packing") == {"place": sentence}
    assert await unknown(client, "/losses", by=QUEUED.by_vendor, vendor=QUEUED.vendor) == {}
    assert set(await unknown(client, "/losses", by="Nobody", vendor="Noone")) == {"by", "vendor"}


@pytest.mark.parametrize("address", LISTS)
async def test_nothing_is_named_while_nobody_can_say_who_is_known(
    face: Served, client: httpx.AsyncClient, address: str
) -> None:
    face.sources.down = {"receiver"}
    assert await unknown(client, address, vendor="acme", robot=NOBODY) == {}
