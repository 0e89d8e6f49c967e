from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from deconflict_client.advisory import Severity
from deconflict_client.situations import Situation
from tests.deconflict.operator.http.served_face import Served, served
from tests.helpers.made_advisories import ROBOTS, cleared_situation, made, situation
from tests.helpers.plain_http import http_client


@pytest.fixture
async def face(tmp_path: Path) -> AsyncIterator[Served]:
    async with served(tmp_path) as served_face:
        yield served_face


async def got(face: Served, path: str) -> Any:
    async with http_client(face.http) as client:
        answer = await client.get(path)
    assert answer.is_success, answer.text
    return answer.json()


async def ids(face: Served, query: str = "") -> list[str]:
    return [each["id"] for each in (await got(face, f"/situations{query}"))["situations"]]


async def test_situations_are_the_open_ones_in_their_order_with_the_position_in_the_stream(face: Served) -> None:
    await face.publish(situation(1), made(1), situation(2), situation(3), cleared_situation(3), situation(1, 2))
    answer = await got(face, "/situations")
    assert [(each["id"], each["revision"]) for each in answer["situations"]] == [("situation-1", 2), ("situation-2", 1)]
    assert (answer["seq"], answer["more"]) == (6, False)
    assert [Situation.model_validate(each).seq for each in answer["situations"]] == [6, 3]


async def test_situations_by_state_kind_severity_vendor_robot_and_limit(face: Served) -> None:
    await face.publish(
        situation(1, situation_kind="queue"),
        situation(2, severity=Severity.CRITICAL),
        situation(3, robots=(ROBOTS[0],), names=("Tug 1",), vendors=("Acme",)),
        situation(4),
        cleared_situation(4),
    )
    assert await ids(face, "?state=cleared") == ["situation-4"]
    assert await ids(face, "?state=all&limit=2") == ["situation-4", "situation-3"]
    assert await ids(face, "?kind=queue") == ["situation-1"]
    assert await ids(face, "?severity=critical") == ["situation-2"]
    assert await ids(face, "?vendor=Borealis") == ["situation-2", "situation-1"]
    assert await ids(face, f"?robot={ROBOTS[1].upper()}") == ["situation-2", "situation-1"]


async def test_the_most_urgent_of_all_that_are_open_are_listed_and_of_others_the_newest(face: Served) -> None:
    mixed: dict[str, Any] = {"participants": ("robot", "person"), "severity": Severity.CRITICAL}
    await face.publish(situation(1, **mixed), situation(2, severity=Severity.CRITICAL), situation(3))
    answer = await got(face, "/situations?limit=2")
    assert ([each["id"] for each in answer["situations"]], answer["more"]) == (["situation-1", "situation-2"], True)
    assert await ids(face) == ["situation-1", "situation-2", "situation-3"]
    assert await ids(face, "?state=all") == ["situation-3", "situation-2", "situation-1"]


@pytest.mark.parametrize("query", ["kind=conflict", "severity=high", "limit=0"])
async def test_an_invalid_query_is_refused(face: Served, query: str) -> None:
    async with http_client(face.http) as client:
        assert (await client.get(f"/situations?{query}")).status_code == 422


async def test_advisories_are_listed_without_situations_unless_asked(face: Served) -> None:
    await face.publish(situation(1), made(1))
    assert [each["id"] for each in (await got(face, "/advisories"))["advisories"]] == ["advisory-1"]
    assert [each["id"] for each in (await got(face, "/advisories?state=all"))["advisories"]] == ["advisory-1"]
    assert [each["id"] for each in (await got(face, "/advisories?kind=situation"))["advisories"]] == ["situation-1"]


async def test_one_situation_is_all_its_revisions_and_an_advisory_is_none(face: Served) -> None:
    await face.publish(situation(1), made(1), situation(1, 2), cleared_situation(1, 3))
    revisions = (await got(face, "/situations/situation-1"))["situations"]
    assert [(each["revision"], each["state"]) for each in revisions] == [(1, "raised"), (2, "updated"), (3, "cleared")]
    async with http_client(face.http) as client:
        assert (await client.get("/situations/advisory-1")).status_code == 404


@pytest.mark.parametrize("path", ["/situations", "/advisories"])
async def test_a_situation_is_acknowledged(face: Served, path: str) -> None:
    await face.publish(situation(1), made(1))
    async with http_client(face.http) as client:
        answer = {"name": "Kim", "reason": "on my way"}
        answered = await client.post(f"{path}/situation-1/acknowledgement", json=answer)
        assert (await client.post("/situations/advisory-1/acknowledgement", json=answer)).status_code == 404
    assert (answered.status_code, answered.json()["acknowledgement"]["name"]) == (201, "Kim")
    (listed,) = (await got(face, "/situations"))["situations"]
    assert (listed["seq"], listed["acknowledgement"]["reason"]) == (3, "on my way")


async def test_an_open_situation_is_listed_after_a_restart_with_its_answer(tmp_path: Path) -> None:
    async with served(tmp_path) as first:
        await first.publish(situation(1), situation(2))
        async with http_client(first.http) as client:
            answer = {"name": "Kim", "reason": "on my way"}
            await client.post("/situations/situation-1/acknowledgement", json=answer)
    async with served(tmp_path) as second:
        assert await ids(second) == ["situation-1", "situation-2"]
        (continued,) = await second.publish(situation(1, 2))
    assert (continued.seq, continued.acknowledgement and continued.acknowledgement.name) == (4, "Kim")


async def test_the_heat_map_counts_advisories_and_not_situations(face: Served) -> None:
    await face.publish(situation(1), made(1))
    until_s = made(1).raised_at.timestamp() + 60
    floors = (await got(face, f"/heat?until_s={until_s}"))["floors"]
    assert sum(count for cells in floors.values() for _, _, count in cells) == 1


async def test_the_schema_of_a_situation_has_its_keys_and_no_recommendation(face: Served) -> None:
    properties = (await got(face, "/schema/situation"))["properties"]
    assert {"situation_kind", "advice", "outline", "seq", "safety_rated"} <= set(properties)
    assert "recommendation" not in properties
