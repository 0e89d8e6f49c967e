"""What the command says that watches what a running service hears."""

import asyncio
import json
import time
from pathlib import Path
from typing import Any

import pytest
from websockets.asyncio.client import connect

from deconflict.__main__ import parser
from ingest.settings import Vendor
from metrics.conformance.senders_command import Answers, broker_notes, page, watched
from tests.deconflict.roles.made_service import SITE, free_ports, running
from tests.helpers.saying import identity, robot, status

ODD = {"rule": "number-as-text", "path": "agvPosition.mapId", "value": "3", "reading": 'read as "3"', "nearest": ""}


def robot_of(vendor: str, name: str, **fields: Any) -> dict[str, Any]:
    plain = {"examined": True, "compared": True, "not_compared_reason": None, "location": {"x": 0.0, "y": 0.0}}
    return {"uuid": robot(name), "name": name, "vendor": vendor, "age_s": 0.2} | plain | fields


def answers(robots: list[dict[str, Any]], rejected: list[dict[str, Any]] | None = None, **vendors: Any) -> Answers:
    return Answers(vendors, robots, rejected or [], {"brokers": {"status": "ok", "notes": []}}, frozenset(("Alder",)))


def odd(count: int, **fields: Any) -> dict[str, Any]:
    return {**ODD, "robots": 2, "count": count, **fields}


def test_a_vendor_whose_messages_are_right_has_nothing_to_mend() -> None:
    robots = [robot_of("Alder", "A-1"), robot_of("Alder", "A-2", age_s=900.0)]
    (alder,) = watched(
        answers(robots, Alder={"messages": 10}),
        answers(robots, Alder={"messages": 70, "languages": ["vda5050"], "deviations_by_rule": {}}),
        60.0,
    )
    assert (alder.messages, alder.heard, alder.placed, alder.compared, alder.to_mend) == (60, 1, 1, 1, ())
    assert page([alder], [], 60.0) == (
        "Alder (VDA 5050, versions 2.0, 2.1 and 3.0): 60 messages in 60 s; 1 robot heard, 1 placed, 1 compared\n"
        "nothing to mend\n"
    )


def test_only_what_came_while_it_was_watched_is_listed() -> None:
    before = {"messages": 10, "odd_values": [odd(4)], "deviations_by_rule": {"number-as-text": 4, "stamp-stale": 9}}
    after = before | {"messages": 20}
    (same,) = watched(answers([], Alder=before), answers([], Alder=after), 60.0)
    assert same.to_mend == ()
    after = after | {
        "odd_values": [odd(6), odd(1, rule="key-unknown", path="locaton", nearest="location", robots=1)],
        "deviations_by_rule": {"number-as-text": 6, "stamp-stale": 10, "key-unknown": 1},
    }
    (more,) = watched(answers([], Alder=before), answers([], Alder=after), 60.0)
    assert more.to_mend[:2] == (
        '2 x number-as-text: agvPosition.mapId: sent 3, read: "3" (2 robots)',
        '1 x key-unknown: locaton: sent 3, read: "3"; did you mean location? (1 robot)',
    )
    assert more.to_mend[2].startswith("1 x stamp-stale: ")
    assert len(more.to_mend) == 3


def test_a_service_that_was_started_anew_counts_from_nothing() -> None:
    (alder,) = watched(answers([], Alder={"messages": 1000}), answers([], Alder={"messages": 30}), 60.0)
    assert alder.messages == 30


def test_a_rejection_has_the_reason_and_the_values_of_a_kept_message() -> None:
    kept = [
        {"vendor": vendor, "rule": "key-missing", "reason": reason, "odd_values": [{**ODD, "nearest": "mapId"}]}
        for vendor, reason in (("Basalt", "send y"), ("Alder", "send x"), ("Alder", "send z"))
    ]
    now = {"messages": 5, "rejections_by_rule": {"key-missing": 5}}
    (alder,) = watched(answers([], Alder={}), answers([], kept, Alder=now), 60.0)
    assert alder.to_mend == (
        "5 x rejected, key-missing: send x",
        '  agvPosition.mapId: sent 3, read: "3"; did you mean mapId?',
    )


def test_rejected_messages_come_first_and_are_counted_in_the_first_line() -> None:
    values = [odd(1, path=f"key{number}") for number in range(25)]
    row = {"uuid": robot("A-1"), "name": "A-1", "reason": "it waits", "fault": "not read", "placed": False}
    named = [{**ODD, "path": f"path[{number}].x"} for number in range(9)]
    kept = [{"vendor": "Alder", "rule": "key-missing", "reason": "send x", "odd_values": named}]
    counts = {"key-missing": 5, "not-json": 2}
    now = {"messages": 60, "rejections_by_rule": counts, "odd_values": values, "not_compared": [row]}
    text = page(watched(answers([], Alder={}), answers([], kept, Alder=now), 60.0), [], 60.0)
    lines = text.splitlines()
    assert lines[0] == "Alder: 60 messages in 60 s, 7 rejected; 0 robots heard, 0 placed, 0 compared"
    assert lines[1] == "  5 x rejected, key-missing: send x"
    assert lines[5].startswith("  2 x rejected, not-json: ")
    assert lines[6] == "  A-1 is compared with nobody: it waits"
    assert lines[7].startswith("  1 x number-as-text: key0")


def test_robots_that_are_compared_with_nobody_are_listed_unless_they_have_only_begun() -> None:
    robots = [
        robot_of("Alder", "A-1", compared=False, not_compared_reason="no position", location=None),
        robot_of("Alder", "A-2", compared=False, not_compared_reason="just heard", location=None),
        robot_of("Alder", "A-3", compared=False, not_compared_reason="it waits", examined=False),
    ]
    rows = [
        {"uuid": robot("A-1"), "name": "A-1", "reason": "send a position", "fault": "no position", "placed": False},
        {"uuid": robot("A-2"), "name": "A-2", "reason": "just heard", "fault": "", "placed": False},
    ]
    (alder,) = watched(answers([], Alder={}), answers(robots, Alder={"messages": 9, "not_compared": rows}), 60.0)
    assert (alder.heard, alder.placed, alder.compared) == (3, 1, 0)
    assert alder.to_mend == (
        "A-3 is compared with nobody: it waits",
        "A-1 is compared with nobody: send a position",
    )


def test_a_vendor_of_the_site_file_that_sends_nothing_is_named() -> None:
    (alder,) = watched(answers([]), answers([]), 60.0)
    assert alder.to_mend == ("no message of Alder has come in 60 s: is it connected? GET /healthz and docs/access.md",)
    unheard = Answers({}, [], [], {"brokers": {"notes": ["hall: set mqtt_sources.prefixes"]}})
    assert broker_notes(unheard) == ["hall: set mqtt_sources.prefixes"]
    assert page([], broker_notes(unheard), 5.0).splitlines()[0] == "hall: set mqtt_sources.prefixes"


def senders(*words: str) -> int:
    args = parser().parse_args(["senders", *words])
    return int(args.run(args))


async def test_a_running_service_is_watched(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    vendors = (Vendor(name="Alder"), Vendor(name="Basalt", robots=(robot("B-1"), robot("B-2"))))
    async with running(tmp_path, SITE.model_copy(update={"vendors": vendors})) as service:
        sending = asyncio.create_task(_send(service.robots_url))
        await service.until("/robots", lambda answer: len(answer["robots"]) == 2)
        code = await asyncio.to_thread(senders, f"http://{service.face}", "--seconds", "3")
        sending.cancel()
    output = capsys.readouterr().out
    assert code == 1
    lines = output.splitlines()
    assert lines[0].startswith("Alder (MassRobotics")
    assert lines[0].endswith("1 robot heard, 1 placed, 1 compared")
    assert "rejected, not-json" in output
    (at,) = [number for number, line in enumerate(lines) if line.startswith("Basalt")]
    assert "is compared with nobody: its position names no map" in "\n".join(lines[at:])
    assert lines[-1].endswith(" to mend")


async def _send(url: str) -> None:
    """One robot is right, one names no map, and some messages are none."""
    async with connect(url) as socket:
        await socket.send(identity("A-1", time.time()))
        while True:
            now_s = time.time()
            await socket.send(status("A-1", now_s))
            place = json.loads(status("B-1", now_s))["location"]
            del place["planarDatum"]
            await socket.send(status("B-1", now_s, location=place))
            await socket.send(status("B-2", now_s)[:-1])
            await asyncio.sleep(0.2)


@pytest.mark.parametrize("url", ["http://127.0.0.1:{port}", "not an address", "ftp://127.0.0.1"])
def test_a_service_that_does_not_answer_is_an_error_of_its_own(url: str, capsys: pytest.CaptureFixture[str]) -> None:
    (port,) = free_ports(1)
    assert senders(url.format(port=port), "--seconds", "1") == 2
    assert "give the address of its operators' port" in capsys.readouterr().err


@pytest.mark.parametrize("seconds", ["0", "-1", "nan", "soon"])
def test_a_time_that_is_none_is_refused(seconds: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        senders("--seconds", seconds)
    assert "give a number from 0.1 to" in capsys.readouterr().err
