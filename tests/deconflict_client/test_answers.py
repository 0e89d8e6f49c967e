"""The models of answers have every key that a service sends, and the client gives them."""

import asyncio
import time
from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel

from deconflict.roles.health.file_health import FileHealth
from deconflict.roles.health.positions_health import brokers_document
from deconflict.settings.site import Site
from deconflict_client.advisory import ClearedCode
from deconflict_client.answers.blackbox_models import BlackBoxList
from deconflict_client.answers.health_models import BrokersHealthPart, FilesHealthPart, ServiceHealth
from deconflict_client.answers.robot_models import RobotList
from deconflict_client.answers.site_models import SiteMap
from deconflict_client.client import Client, ClientError, NoSuchAdvisoryError
from ingest.settings import Vendor
from tests.deconflict.operator.http.served_face import ROBOT_DOCUMENTS, Served, served
from tests.deconflict.roles.made_service import MEETING, drive, running
from tests.helpers.made_advisories import ROBOTS, START, made, made_advice
from tests.helpers.made_site import sound
from tests.helpers.patience import PATIENCE_S
from tests.helpers.typed_answers import left_out
from tests.inventory.kept import kept

MODELS: dict[str, type[BaseModel]] = {
    "/blackboxes": BlackBoxList,
    "/healthz": ServiceHealth,
    "/robots": RobotList,
    "/site": SiteMap,
}


def fields(model: type[BaseModel]) -> set[str]:
    """The paths of a model's fields. Below what may be anything is `*`."""
    whole = model.model_json_schema(by_alias=True)

    def below(schema: dict[str, Any], path: str) -> set[str]:
        if "$ref" in schema:
            schema = whole["$defs"][schema["$ref"].rpartition("/")[2]]
        found = {path}
        for variant in schema.get("anyOf", ()):
            found |= below(variant, path)
        for name, inner in schema.get("properties", {}).items():
            found |= below(inner, f"{path}.{name}".lstrip("."))
        if isinstance(items := schema.get("items"), dict):
            found |= below(items, f"{path}[]")
        return found | ({f"{path}.*"} if schema.get("additionalProperties") else set())

    return below(whole, "")


@pytest.mark.parametrize("path", sorted(MODELS))
def test_the_model_of_an_answer_has_what_services_were_seen_to_send(path: str) -> None:
    begin = f"live http GET {path} "
    seen = {line.removeprefix(begin) for line in kept(live=True) if line.startswith(begin) and " role: " not in line}
    known = fields(MODELS[path])
    anything = tuple(each.removesuffix("*") for each in known if each.endswith("*"))
    assert seen
    assert not {each for each in seen - known if not each.startswith(anything)}


async def test_the_models_have_every_key_that_a_running_service_sends(tmp_path: Path) -> None:
    async with running(tmp_path / "data") as service:
        driving = asyncio.create_task(drive(service.robots_url, MEETING, PATIENCE_S, time.time()))
        async with asyncio.timeout(PATIENCE_S):
            while not any(row["forecast"] for row in (await service.get("/robots")).json()["robots"]):
                await asyncio.sleep(0.1)
        answers = {path: (await service.get(path)).json() for path in MODELS}
        driving.cancel()
    assert not set().union(*(left_out(model, answers[path]) for path, model in MODELS.items()))


def test_the_models_of_parts_have_the_keys_that_come_with_a_fault() -> None:
    broker = {"name": "hall", "other_topics": [], "heard": [], "ingest": ""}
    assert not left_out(BrokersHealthPart, brokers_document([broker]))
    assert not left_out(FilesHealthPart, FileHealth([]).document(time.monotonic(), {"losses.db": "it is locked"}))


def named(face: Served) -> None:
    """Let the site file name a vendor that has not come yet."""
    face.app.state.site = Site(vendors=(Vendor(name="Cargo"),))


async def test_the_client_gets_robots_and_is_told_of_a_vendor_that_nobody_knows(tmp_path: Path) -> None:
    async with served(tmp_path) as face, Client(face.http) as client:
        named(face)
        everyone = await client.robots()
        assert [(robot.vendor, robot.age_s) for robot in everyone.robots] == [("Acme", 0.5), ("Borealis", None)]
        assert [robot.uuid for robot in (await client.robots("Acme")).robots] == [ROBOT_DOCUMENTS[0]["uuid"]]
        assert (await client.robot(ROBOT_DOCUMENTS[1]["uuid"])).clock.delay_s == 0.25
        expected = await client.robots("Cargo")
        assert (expected.robots, expected.unknown) == ([], {})
        for answer in (await client.robots("Carg"), await client.advice("Carg")):
            assert answer.unknown == {"vendor": "no vendor 'Carg' is known; known: Acme and Cargo"}
        with pytest.raises(NoSuchAdvisoryError, match="404: no robot 'x' has reported"):
            await client.robot("x")


async def test_the_client_lists_advice_by_the_vendor_and_the_robot_that_is_asked_and_by_state(tmp_path: Path) -> None:
    async with served(tmp_path) as face, Client(face.http) as client:
        first, second = made_advice(1), made_advice(2, robot=ROBOTS[1], vendor="Borealis", other=ROBOTS[0])
        await face.publish(first, second, second.cleared_revision(START.timestamp() + 1.0, ClearedCode.DONE))
        assert [each.id for each in (await client.advice()).advice] == [first.id]
        listings = [
            await client.advice("Borealis", state="all"),
            await client.advice(robot=ROBOTS[1].upper(), state="all"),
            await client.advice(state="cleared"),
        ]
        assert [[each.id for each in listing.advice] for listing in listings] == [[second.id]] * 3


async def test_the_client_gets_the_state_of_a_service_that_is_degraded(tmp_path: Path) -> None:
    async with served(tmp_path) as face, Client(face.http) as client:
        assert ((await client.health()).status, (await client.health()).store.seq) == ("ok", 0)
        face.sources.down = {"engine"}
        health = await client.health()
        assert (health.status, health.roles["engine"], health.canary) == ("degraded", "down", None)
        face.sources.down = {"supervisor"}
        assert (await client.health()).roles == {"supervisor": "down"}


async def test_the_client_gets_the_site_and_the_black_boxes(tmp_path: Path) -> None:
    async with served(tmp_path) as face, Client(face.http) as client:
        face.app.state.site = Site.model_validate(sound())
        site = await client.site()
        assert [(floor.name, len(floor.marks)) for floor in site.floors] == [("Hall", 4), ("Yard", 0)]
        assert [vendor.name for vendor in site.vendors] == ["acme", "bolt"]
        assert await client.blackboxes() == []
        assert (await client.suggestions()).places == []


async def test_an_exception_has_the_sentence_of_the_service(tmp_path: Path) -> None:
    async with served(tmp_path) as face, Client(face.http) as client:
        await face.publish(made(1))
        with pytest.raises(ClientError, match=r"^422: reason: String should have at least 1 character$"):
            await client.acknowledge("advisory-1", name="Kim", reason=" ")
