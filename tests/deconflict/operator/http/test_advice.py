"""The routes of advice: who sees what is asked, and who may answer."""

from pathlib import Path

import pytest

from deconflict.settings.site import Person
from deconflict_client.advisory import ClearedCode
from tests.deconflict.operator.http.served_face import served
from tests.helpers.made_advisories import START, made, made_advice, situation
from tests.helpers.plain_http import http_client

TOKENS = {name: f"{name}-0123456789abcdef" for name in ("ACME", "BOREALIS", "LEADER", "READER")}


@pytest.fixture
def people(monkeypatch: pytest.MonkeyPatch) -> tuple[Person, ...]:
    for name, token in TOKENS.items():
        monkeypatch.setenv(name, token)
    return (
        Person(name="Acme fleet", role="answer", vendor="Acme", token="env:ACME"),
        Person(name="Borealis fleet", role="answer", vendor="Borealis", token="env:BOREALIS"),
        Person(name="Ada", role="acknowledge", token="env:LEADER"),
        Person(name="wallboard", token="env:READER"),
    )


async def test_a_program_answers_for_the_robots_of_its_own_vendor_only(
    tmp_path: Path, people: tuple[Person, ...]
) -> None:
    statuses: dict[str, int] = {}
    async with served(tmp_path, people=people) as face, http_client(face.http) as client:
        await face.publish(made_advice(1), made(1))
        for name, token in TOKENS.items():
            headers = {"authorization": f"Bearer {token}"}
            given = {"answer": "declined", "why": f"busy, says {name}"}
            statuses[name] = (await client.post("/advice/advice-1/answer", headers=headers, json=given)).status_code
            (seen,) = (await client.get("/advice", headers=headers)).json()["advice"]
        headers = {"authorization": f"Bearer {TOKENS['ACME']}"}
        refused = await client.post("/advisories/advisory-1/acknowledgement", headers=headers, json={"reason": "seen"})
    assert statuses == {"ACME": 201, "BOREALIS": 403, "LEADER": 201, "READER": 403}
    assert (seen["acknowledgement"]["name"], seen["acknowledgement"]["answer"]) == ("Acme fleet", "declined")
    assert refused.status_code == 403, "who answers for a vendor acknowledges nothing"


async def test_advice_is_listed_for_itself_and_in_no_other_list(tmp_path: Path) -> None:
    ended = made_advice(2).cleared_revision(START.timestamp() + 5, ClearedCode.DONE)
    async with served(tmp_path) as face, http_client(face.http) as client:
        await face.publish(made_advice(1), made(1), situation(1), made_advice(2), ended)
        listed = {path: (await client.get(path)).json() for path in ("/advice", "/advisories", "/situations")}
        cleared = (await client.get("/advice?state=cleared")).json()["advice"]
        revisions = (await client.get("/advice/advice-2")).json()["advice"]
        heat = (await client.get(f"/heat?until_s={START.timestamp() + 600}")).json()["floors"]
    assert [each["id"] for each in listed["/advice"]["advice"]] == ["advice-1"]
    assert [each["id"] for each in listed["/advisories"]["advisories"]] == ["advisory-1"]
    assert [each["id"] for each in listed["/situations"]["situations"]] == ["situation-1"]
    assert [each["cleared_code"] for each in cleared] == ["done"]
    assert [each["revision"] for each in revisions] == [1, 2]
    assert sum(len(cells) for cells in heat.values()) == 1, "where advisories were, not advice"


@pytest.mark.parametrize(
    ("path", "body", "status", "reason"),
    [
        ("/advice/advice-1/answer", {"answer": "accepted"}, 422, "name"),
        ("/advice/advice-1/answer", {"answer": "perhaps", "name": "fleet"}, 422, "answer"),
        ("/advice/advice-2/answer", {"answer": "done", "name": "fleet"}, 409, "it is done"),
        ("/advice/advisory-1/answer", {"answer": "done", "name": "fleet"}, 404, "no advice"),
        ("/advisories/advice-1/acknowledgement", {"reason": "seen", "name": "Kim"}, 409, "/advice/advice-1/answer"),
    ],
)
async def test_an_answer_that_nobody_can_use_is_refused_with_what_to_do(
    tmp_path: Path, path: str, body: dict[str, str], status: int, reason: str
) -> None:
    ended = made_advice(2).cleared_revision(START.timestamp() + 5, ClearedCode.DONE)
    async with served(tmp_path) as face, http_client(face.http) as client:
        await face.publish(made_advice(1), made(1), made_advice(2), ended)
        refused = await client.post(path, json=body)
    assert refused.status_code == status
    assert reason in refused.text


async def test_only_the_first_answer_counts_and_done_after_it(tmp_path: Path) -> None:
    given = ("accepted", "accepted", "declined", "done", "done", "accepted")
    async with served(tmp_path) as face, http_client(face.http) as client:
        await face.publish(made_advice(1))
        answers = [
            await client.post("/advice/advice-1/answer", json={"answer": answer, "name": "fleet"}) for answer in given
        ]
        last = face.store.last_seq()
    assert [each.status_code for each in answers] == [201, 201, 409, 201, 201, 409]
    assert "accepted; only 'done' may follow" in answers[2].text
    assert answers[0].json() == answers[1].json(), "an answer that is sent again is stored once"
    assert answers[4].json()["seq"] == last


def test_the_role_answer_needs_a_vendor() -> None:
    with pytest.raises(ValueError, match="name whose robots"):
        Person(name="fleet", role="answer", token="env:ACME")
