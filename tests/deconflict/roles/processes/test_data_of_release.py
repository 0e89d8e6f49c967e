"""A service goes on with the data directory that an older release left, with all that is in it."""

import asyncio
import csv
import json
import tarfile
import time
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from operator import itemgetter
from pathlib import Path
from typing import Any

import pytest
from websockets.asyncio.client import connect

from deconflict.engine.engine import Engine
from deconflict.engine.learned.first_learned_format import NO_LABELS
from deconflict.operator.blackbox.archive import FOLDER, Archive
from deconflict.operator.store.learned_file import FILE_NAME
from deconflict.runtime.learned_state import Part, unpacked
from deconflict.settings import site_file
from ingest.recording.log_reader import LogReader, Received
from metrics.replay.blackbox_verify import verify
from tests.deconflict.roles.made_service import Served
from tests.helpers.commands import run
from tests.helpers.patience import PATIENCE_S

ARCHIVE = Path(__file__).parent / "data_of_release.tar.xz"
"""`data_of_release.txt` says how it was made."""
SPAN = ("--until", "2026-11-29T00:00:00+00:00", "--days", "2")
"""All that the ledger holds."""
SOONER = "[reading]\nquiet_after_s = 10.0\nsilent_after_s = 10.0\n"
"""Robots that were there then, and are not now, are waited for less long."""
OWN_PATHS = ("Corvid", "Walkers")
"""Vendors that connect to a URL path with their name."""

Answer = dict[str, Any]


@dataclass
class Continued:
    """What the older release answered at its end, and what this one answers after it."""

    data: Path
    site: Path
    then: dict[str, Any]
    """By name, answers of the older release."""
    robots: dict[str, str]
    """One robot of each vendor that `owners.json` had."""
    learned: dict[str, Part]
    log: list[Path]
    """The segments that the older release wrote."""
    listed: list[Answer] = field(default_factory=list)
    """The open advisories and situations that this release lists first."""
    revisions: list[Answer] = field(default_factory=list)
    """The stream from the first number on, until all that was open has ended."""
    refused: dict[str, Answer] = field(default_factory=dict)
    """By vendor, what the quarantine has of its robot after another vendor reported it."""
    messages: str = ""
    """What the service logged."""

    @property
    def stored(self) -> list[Answer]:
        """The revisions that the older release had published."""
        revisions: list[Answer] = self.then["stream"]
        return revisions

    def open_then(self) -> list[Answer]:
        return [*self.then["advisories"]["advisories"], *self.then["situations"]["situations"]]


@pytest.fixture(scope="module")
def continued(tmp_path_factory: pytest.TempPathFactory) -> Continued:
    """Serve the directory as a user does, until what was open has ended: its robots are not there any more."""
    home = tmp_path_factory.mktemp("older")
    with tarfile.open(ARCHIVE) as archive:
        archive.extractall(home, filter="data")
    then = {path.stem: json.loads(path.read_text()) for path in (home / "answers").glob("*.json")}
    data, site = home / "data", home / "site.toml"
    with site.open("a") as file:
        file.write(SOONER)
    learned = unpacked((data / FILE_NAME).read_bytes())
    robots = {vendor: uuid for uuid, vendor in json.loads((data / "owners.json").read_text())["owners"]}
    found = Continued(data, site, then, robots, learned, sorted((data / "log").iterdir()))
    served = Served(data, site, home / "service.log")
    with served.running():
        asyncio.run(_observe(served, found))
    found.messages = (home / "service.log").read_text()
    return found


async def _observe(served: Served, found: Continued) -> None:
    for name in ("advisories", "situations"):
        found.listed += (await served.until(f"/{name}", itemgetter(name)))[name]
    await served.until("/robots", lambda answer: "robots" in answer)
    for vendor, uuid in found.robots.items():
        found.refused[vendor] = await _refused(served, vendor, uuid, found)
    found.revisions = await _stream(served, {each["id"] for each in found.open_then()})


async def _refused(served: Served, vendor: str, uuid: str, found: Continued) -> Answer:
    """Report a robot as another vendor's; what the quarantine has of it then."""
    (status,) = (each["status"] for each in found.then["robots"]["robots"] if each["uuid"] == uuid)
    other = next(name for name in OWN_PATHS if name != vendor)
    async with connect(f"{served.robots_url}/{other}") as socket:
        now = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
        await socket.send(json.dumps(status | {"timestamp": now}))
        quarantine = await served.until("/quarantine", lambda answer: _about(answer["rejected"], uuid))
    return _about(quarantine["rejected"], uuid)[0]


def _about(rejected: Iterable[Answer], uuid: str) -> list[Answer]:
    return [each for each in rejected if uuid in json.dumps(each["message"])]


async def _stream(served: Served, waiting: set[str]) -> list[Answer]:
    """Every stored revision from the first, until these have been cleared."""
    url = f"ws://127.0.0.1:{served.operator_port}/advisories/stream?after=0&kinds=situation,advisory"
    revisions: list[Answer] = []
    with suppress(TimeoutError):  # the tests say what is missing
        async with connect(url) as stream, asyncio.timeout(PATIENCE_S):
            while waiting:
                revisions.append(json.loads(await stream.recv()))
                if revisions[-1]["state"] == "cleared":
                    waiting = waiting - {revisions[-1]["id"]}
    return revisions


def keys_of(then: Any, now: Any) -> Any:
    """What is now of the keys that there were then, at any depth. This release adds keys and takes none away."""
    if isinstance(then, dict) and isinstance(now, dict):
        return {key: keys_of(value, now.get(key)) for key, value in then.items()}
    if isinstance(then, list) and isinstance(now, list) and len(then) == len(now):
        return [*map(keys_of, then, now)]
    return now


def test_what_was_open_is_listed_first_with_its_id_and_begin(continued: Continued) -> None:
    listed = {each["id"]: each for each in continued.listed}
    assert continued.open_then()
    for then in continued.open_then():
        now = listed[then["id"]]
        assert (now["kind"], now["raised_at"]) == (then["kind"], then["raised_at"])
        assert now["revision"] >= then["revision"]


def test_the_stream_has_the_stored_revisions_and_goes_on_with_new_numbers(continued: Continued) -> None:
    again = continued.revisions[: len(continued.stored)]
    assert [keys_of(then, now) for then, now in zip(continued.stored, again, strict=True)] == continued.stored
    numbers = [each["seq"] for each in continued.revisions]
    assert numbers == sorted(set(numbers))
    added = continued.revisions[len(continued.stored) :]
    assert {each["id"] for each in added} >= {each["id"] for each in continued.open_then()}
    pairs = [(each["id"], each["revision"], json.dumps(each.get("acknowledgement"))) for each in continued.revisions]
    assert len(set(pairs)) == len(pairs)


def test_acknowledgements_are_kept_also_when_what_they_are_of_ends(continued: Continued) -> None:
    acknowledged = {each["id"]: each["acknowledgement"] for each in continued.stored if each.get("acknowledgement")}
    newest = {each["id"]: each for each in continued.revisions}
    assert {name: newest[name]["acknowledgement"] for name in acknowledged} == acknowledged
    assert {each["name"] for each in acknowledged.values()} == {"Kim", "Robin"}
    assert acknowledged.keys() & {each["id"] for each in continued.open_then()}


def test_robots_still_belong_to_their_vendors(continued: Continued) -> None:
    assert continued.refused.keys() == {"Alder", "Basalt", "Corvid", "Walkers"}
    (then,) = continued.then["quarantine"]["rejected"]
    assert {each["rule"] for each in continued.refused.values()} == {then["rule"]} == {"uuid-of-another-vendor"}
    assert all(
        f"is {vendor}'s; that vendor may report it" in each["reason"] for vendor, each in continued.refused.items()
    )


def test_the_ledger_has_the_same_figures(continued: Continued, tmp_path: Path) -> None:
    run("losses", "--data", continued.data, "--site", continued.site, "--csv", tmp_path / "now.csv", *SPAN)
    then, now = (_rows(path) for path in (continued.site.with_name("losses.csv"), tmp_path / "now.csv"))
    assert then
    assert [{column: row[column] for column in then[0]} for row in now] == then


def _rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_the_learned_state_is_taken_up_but_for_what_is_numbered_by_another_part(continued: Continued) -> None:
    engine = Engine(site_file.load(continued.site), learned=continued.learned)
    assert engine.set_aside == {"starts": NO_LABELS}
    assert [list(kind) for kind in engine.foresight.ledger.kinds] == continued.learned["ledger"]["kinds"]
    aside = [line for line in continued.messages.splitlines() if "is set aside" in line]
    assert len(aside) == 1
    assert f"the part 'starts' is set aside: {NO_LABELS}; it is learned anew" in aside[0]


def test_the_log_is_replayed_with_every_message(continued: Continued, tmp_path: Path) -> None:
    run("replay", *continued.log, "--site", continued.site, "--json", tmp_path / "scores.json", "--jobs", "1")
    scores = json.loads((tmp_path / "scores.json").read_text())
    reader = LogReader()
    messages = sum(isinstance(event, Received) for event in reader.read(continued.log))
    assert scores["messages"] == messages == continued.then["replay"]["messages"]
    assert reader.unreadable == 0


def test_black_boxes_are_listed_and_unchanged(continued: Continued) -> None:
    boxes = Archive(continued.data / FOLDER).boxes()
    assert {box["file"] for box in continued.then["blackboxes"]["blackboxes"]} <= {box["file"] for box in boxes}
    for box in boxes:
        assert verify(continued.data / FOLDER / box["file"]).lines
