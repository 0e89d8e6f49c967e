import asyncio
import json
import re
import threading
from collections.abc import AsyncIterator
from dataclasses import replace
from datetime import timedelta
from pathlib import Path
from typing import Any

import httpx
import pytest
from websockets.asyncio.client import connect

from deconflict.operator.http.page_routes import page_files, site_document
from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import Site
from deconflict.settings.site_file import load
from deconflict_client.advisory import Location
from deconflict_client.answers.site_models import SiteMap
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from tests.deconflict.operator.http.served_face import GivenSources, Served, served, stuck_subscriber, until
from tests.helpers.made_advisories import START, cleared, cleared_situation, made, situation
from tests.helpers.made_site import written
from tests.helpers.patience import PATIENCE_S
from tests.helpers.plain_http import http_client
from tests.helpers.saying import robot, status
from tests.helpers.typed_answers import left_out

NOW_S = 1_792_000_000.0
DEMO = Path(__file__).parents[4] / "deconflict" / "settings" / "sites" / "demo.toml"


@pytest.fixture
async def face(tmp_path: Path) -> AsyncIterator[Served]:
    async with served(tmp_path) as served_face:
        yield served_face


@pytest.fixture
async def client(face: Served) -> AsyncIterator[httpx.AsyncClient]:
    async with http_client(face.http) as http:
        yield http


async def test_every_file_of_the_page_is_served_and_loads_only_from_this_service(client: httpx.AsyncClient) -> None:
    addresses = ["/", *(f"/page/{name}" for name in page_files())]
    assert len(addresses) > 8
    for address in addresses:
        answer = await client.get(address)
        assert answer.status_code == 200, address
        policy = answer.headers["content-security-policy"]
        assert "default-src 'none'" in policy
        assert "unsafe" not in policy
        assert not re.findall(r"https?://(?!www\.w3\.org/2000/svg)", answer.text), address


@pytest.mark.parametrize("name", ["absent.js", "..%2Foperator.py", "%2e%2e/operator.py", ".html"])
async def test_nothing_but_the_page_is_served(client: httpx.AsyncClient, name: str) -> None:
    assert (await client.get(f"/page/{name}")).status_code == 404


def test_no_module_of_the_page_creates_markup_from_data() -> None:
    code = b"".join(content for name, content in page_files().items() if name.endswith(".js"))
    assert not re.findall(rb"innerHTML|outerHTML|insertAdjacentHTML|document\.write|eval\(", code)


def test_the_site_has_its_floors_in_order_and_the_places_on_them() -> None:
    document = site_document(load(DEMO))
    assert not left_out(SiteMap, document)
    assert [floor["name"] for floor in document["floors"]] == ["Ground hall", "Mezzanine"]
    assert {mark["name"] for mark in document["floors"][0]["marks"]} >= {"Column A1", "Column C5"}
    floors = {floor["id"] for floor in document["floors"]}
    assert all(place["floor"] in floors and len(place["polygon"]) >= 3 for place in document["places"])


def test_the_site_has_its_obstacles_on_their_floors(tmp_path: Path) -> None:
    rack = {"name": "R1", "kind": "rack", "outline_m": [[1, 1], [9, 1], [9, 2]]}
    datum = {"id": "HALL", "name": "Hall", "level": 0}
    site = load(written({"datums": [datum], "obstacles": [rack, {**rack, "floor": "Hall"}]}, tmp_path))
    assert [obstacle["floor"] for obstacle in site_document(site)["obstacles"]] == ["hall", "hall"]


async def test_a_shift_has_the_worst_severity_of_each_situation(face: Served, client: httpx.AsyncClient) -> None:
    await face.publish(situation(1, severity="critical", cost_s=50.0), cleared_situation(1, severity="caution"))
    shift = (await client.get("/shift?since_s=0")).json()
    (found,) = shift["situations"]
    assert (found["situation"]["state"], found["worst_severity"], found["most_cost_s"]) == ("cleared", "critical", 50.0)
    assert shift["complete"]
    assert (found["first_kind"], shift["counts"]) == ("meeting", {"meeting": 1})
    assert (await client.get(f"/shift?since_s={START.timestamp() + 3600}")).json()["situations"] == []


async def test_the_heat_map_counts_advisories_raised_in_the_hour_before(
    face: Served, client: httpx.AsyncClient
) -> None:
    here, there = (Location(datum="hall", x=x, y=2.5) for x in (3.2, -0.5))
    await face.publish(made(1, location=here), made(1, 2, location=there), cleared(1, 3), made(2, location=here))
    until_s = (START + timedelta(minutes=2, seconds=30)).timestamp()
    heat = (await client.get(f"/heat?until_s={until_s}")).json()
    assert heat["floors"] == {"hall": [[3.0, 2.0, 2]]}
    assert (await client.get("/heat")).json()["floors"] == {}


async def test_the_past_has_what_was_open_then(face: Served, client: httpx.AsyncClient) -> None:
    await face.publish(made(1), situation(1), cleared(1), cleared_situation(1), made(2), situation(2))
    at_s = (START + timedelta(minutes=1)).timestamp()
    past = (await client.get(f"/past?at_s={at_s}")).json()
    assert [advisory["id"] for advisory in past["advisories"]] == ["advisory-1"]
    assert [each["id"] for each in past["situations"]] == ["situation-1"]
    assert past["floor"]["now_s"] == at_s
    assert (await client.get("/past?at_s=nan")).status_code == 422
    face.sources.down.add("recording")
    assert (await client.get(f"/past?at_s={at_s}")).status_code == 503


async def test_a_long_read_of_the_past_delays_no_other_request(face: Served, client: httpx.AsyncClient) -> None:
    await face.publish(*(made(number) for number in range(1, 101)))
    began, goes_on = threading.Event(), threading.Event()

    def slow() -> bool:
        began.set()
        return not goes_on.wait(PATIENCE_S)

    face.store.connections._file.long_reader.set_progress_handler(slow, 100)  # as an hour of revisions is: long
    looking = asyncio.create_task(client.get(f"/past?at_s={(START + timedelta(minutes=90)).timestamp()}"))
    await until(began.is_set)
    await face.publish(made(101))
    assert (await client.get("/advisories")).json()["seq"] == 101
    assert not looking.done()
    goes_on.set()
    assert len((await looking).json()["advisories"]) == 61


async def test_a_page_is_sent_the_floor_and_then_what_changes(face: Served) -> None:
    fleet = fleet_of(Site(), Measures())
    fleet.receive(status("A-1", NOW_S), NOW_S, Connection(1))
    face.sources.whole = fleet.snapshot(NOW_S)
    face.sources.recent.add(NOW_S, fleet.next_batch(NOW_S).to_bytes())
    async with connect(f"ws://{face.address}/live") as page:
        known: set[str] = set()
        health: dict[str, Any] = {}
        while robot("A-1") not in known or not health:
            message = json.loads(await page.recv())
            known |= {row[0] for row in message["floor"]["robots"]}
            health = message.get("health", health)
        fleet.receive(status("A-2", NOW_S), NOW_S, Connection(1))
        face.sources.recent.add(NOW_S + 0.1, fleet.next_batch(NOW_S + 0.1).to_bytes())
        while True:
            frame = json.loads(await page.recv())
            if frame["floor"]["robots"]:
                break
        assert [row[0] for row in frame["floor"]["robots"]] == [robot("A-2")]
        assert (frame["floor"]["whole"], frame["floor"]["now_s"]) == (False, NOW_S + 0.1)
        assert health["roles"] == {"receiver": "up", "engine": "up"}
        assert face.measured("deconflict_page_viewers") == 1
    await until(lambda: face.measured("deconflict_page_viewers") == 0)


async def test_a_live_message_has_the_health_only_if_it_is_news(face: Served) -> None:
    async with connect(f"ws://{face.address}/live") as page:
        healths, fleet = [], fleet_of(Site(), Measures())
        for step in range(30):
            face.sources.recent.add(NOW_S + step, fleet.next_batch(NOW_S + step).to_bytes())
            healths.append(json.loads(await page.recv()).get("health"))
    sent = [health["at_s"] for health in healths if health]
    assert len(sent) == len(set(sent)) < 5


async def test_the_service_beats_though_no_role_answers_and_returns_the_newest_number_of_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def no_answer(*_: object) -> Any:
        await asyncio.Event().wait()

    monkeypatch.setattr(GivenSources, "follow", no_answer)
    monkeypatch.setattr(GivenSources, "live_status", no_answer)
    async with served(tmp_path) as face, connect(f"ws://{face.address}/live") as page, asyncio.timeout(PATIENCE_S):
        messages = [json.loads(await page.recv())]
        (published,) = await face.publish(made(101))
        for sent in ("7", "no number", "1" * 40, b"8"):
            await page.send(sent)
        while messages[-1].get("heard") != 7 or len(messages) < 5:
            messages.append(json.loads(await page.recv()))
    assert [message["number"] for message in messages] == list(range(1, len(messages) + 1))
    assert messages[-1]["seq"] == published.seq
    assert {message.get("heard") for message in messages} == {None, 7}


async def test_a_page_that_reads_nothing_is_dropped_and_delays_no_other(tmp_path: Path) -> None:
    async with served(tmp_path, stream_send_timeout_s=0.5) as face:
        fleet = fleet_of(Site(), Measures())
        for i in range(3000):
            fleet.receive(status(f"A-{i}", NOW_S), NOW_S, Connection(1))
        stuck = await stuck_subscriber(face, "/live")
        async with connect(f"ws://{face.address}/live", max_size=None) as page:
            step = 0
            while face.measured("deconflict_stream_dropped_total") == 0:
                step += 1
                face.sources.whole = batch = replace(fleet.snapshot(NOW_S), now_s=NOW_S + step)
                face.sources.recent.add(NOW_S + step, batch.to_bytes())
                async with asyncio.timeout(PATIENCE_S):
                    while json.loads(await page.recv())["floor"]["now_s"] < NOW_S + step:
                        pass
            assert step > 1
            await until(lambda: face.measured("deconflict_page_viewers") == 1)
        stuck.close()


async def test_while_the_receiver_is_down_the_page_shows_it_and_then_the_floor_comes_back(face: Served) -> None:
    face.sources.down.add("receiver")
    async with connect(f"ws://{face.address}/live") as page:
        while json.loads(await page.recv()).get("health", {}).get("roles") != {"receiver": "down", "engine": "up"}:
            pass
        fleet = fleet_of(Site(), Measures())
        fleet.receive(status("A-1", NOW_S), NOW_S, Connection(1))
        face.sources.whole = fleet.snapshot(NOW_S)
        face.sources.recent.add(NOW_S, fleet.next_batch(NOW_S).to_bytes())
        face.sources.down.clear()
        while not json.loads(await page.recv())["floor"]["robots"]:
            pass
