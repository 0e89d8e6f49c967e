"""Broken and hostile senders, all at once, beside two honest robots that are about to meet."""

import asyncio
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

from websockets.asyncio.client import connect

from deconflict.roles.service import run_in_one_process
from deconflict.settings.site import Conflict, Operator, Site
from deconflict_client.advisory import ADVISORY, AdvisoryState
from ingest.settings import Datum, Reading, ReceiverSettings, Vendor
from metrics.monitoring.exposition import render
from tests.deconflict.roles.made_abuses import (
    ABUSES,
    BROKEN,
    change_who_it_is,
    claim_anothers_robot,
    jump_by_hours,
    make_up_uuids,
    mallory,
    name_made_up_floors,
    repeat_one_instant,
    say_absurd_points,
    say_what_is_broken,
    send_compressed,
)
from tests.deconflict.roles.made_service import CROSSING, Running, drive
from tests.helpers.patience import PATIENCE_S
from tests.helpers.saying import HALL, robot, status

SITE = Site(
    datums=(Datum(id=HALL, name="Hall"),),
    vendors=(Vendor(name="Alder"), Vendor(name="Mallory")),
    receiver=ReceiverSettings(
        port=0, open_timeout_s=1.0, idle_timeout_s=4.0, max_messages_per_s=200, max_connections=200
    ),
    reading=Reading(max_robots_per_vendor=50),
    operator=Operator(port=0),
    conflict=Conflict(clear_after_s=1.0),
)
OWN = tuple(f"M-{i}" for i in range(1, 10))


async def come_in(service: Running) -> None:
    """Be known with the robots that the abuse is about, before made up ones fill what the vendor may have."""
    async with mallory(service.robots_url) as socket, asyncio.timeout(PATIENCE_S):
        while robots_of((await service.get("/robots")).json(), "Mallory") < len(OWN):
            for name in OWN:
                await socket.send(status(name, time.time(), 500.0, 150.0))
            await asyncio.sleep(0.1)


def robots_of(answer: dict[str, Any], vendor: str) -> int:
    return sum(row["vendor"] == vendor for row in answer["robots"])


async def be_in_two_places(url: str, found: Callable[[], Awaitable[Any]]) -> Any:
    """One robot over two connections, until somebody is told; what was told."""
    telling = asyncio.ensure_future(found())
    async with connect(f"{url}/Mallory") as here, connect(f"{url}/Mallory") as there:
        while not telling.done():
            await here.send(status("M-3", time.time(), 500.0, 300.0))
            await asyncio.sleep(0.1)
            await there.send(status("M-3", time.time(), 900.0, 300.0))
            await asyncio.sleep(0.1)
    return telling.result()


SHED = (
    say_what_is_broken,
    make_up_uuids,
    claim_anothers_robot,
    change_who_it_is,
    jump_by_hours,
    repeat_one_instant,
    say_absurd_points,
    name_made_up_floors,
)
"""Of which a flood beside them may leave nothing to count: said again where that is so."""


def counted(text: str, name: str, label: str = "rule") -> set[str]:
    """The values of a label, of Mallory where it is of a vendor, in the metrics as Prometheus reads them."""
    rows = (line for line in text.splitlines() if line.startswith(f"deconflict_{name}{{"))
    return {row.split(f'{label}="')[1].split('"')[0] for row in rows if "vendor=" not in row or '"Mallory"' in row}


async def test_hostile_senders_are_counted_and_honest_robots_are_still_warned(tmp_path: Path) -> None:
    async with run_in_one_process(SITE, tmp_path, render) as roles:
        service = Running(*roles)
        await come_in(service)
        driving = asyncio.create_task(drive(f"{service.robots_url}/Alder", CROSSING, 40, time.time() + 8))
        await service.until("/robots", lambda answer: robots_of(answer, "Alder") == len(CROSSING))
        await send_compressed(service.robots_url)
        abusing = [asyncio.create_task(abuse(service.robots_url)) for abuse in ABUSES]
        advisory = await first_advisory(service, "conflict")
        assert (advisory.state, set(advisory.robots)) == (AdvisoryState.RAISED, {robot("A-1"), robot("B-1")})
        await asyncio.gather(*abusing)
        claimed = await first_advisory(service, "foreign_claim")
        assert (claimed.owner, claimed.claimant, claimed.robots) == ("Alder", "Mallory", (robot("A-1"),))
        until_s = time.monotonic() + PATIENCE_S
        while (missing := uncounted((await service.get("/metrics")).text)) and time.monotonic() < until_s:
            for abuse in SHED:
                await abuse(service.robots_url)
        assert not missing
        telling = first_advisory(service, "two_places", "Mallory", robot("M-3"))
        doubled = await be_in_two_places(service.robots_url, lambda: telling)
        assert robot("M-3") in doubled.robots
        driving.cancel()
        robots = {row["uuid"]: row for row in (await service.get("/robots")).json()["robots"]}
        assert robots[robot("A-1")]["vendor"] == "Alder"
        assert abs(robots[robot("A-1")]["location"]["x"]) < 50
        assert sum(robot["vendor"] == "Mallory" for robot in robots.values()) == 50
        text = (await service.get("/metrics")).text
        assert 'deconflict_messages_shed_total{vendor="Mallory"}' in text
        assert 'result="rejected",vendor="Alder"' not in text
        await service.health(is_as_before)


def is_as_before(health: dict[str, Any]) -> bool:
    """Whether nothing is wrong but for robots of Mallory."""
    parts = ((name, part) for name, part in health.items() if isinstance(part, dict))
    wrong = {name for name, part in parts if part.get("status", "ok") != "ok"}
    all_up = set(health["roles"].values()) == {"up"}
    return all_up and wrong <= {"positions"} and "Alder" not in health["positions"].get("reason", "")


def uncounted(text: str) -> set[str]:
    """What was done to it and is not counted."""
    rejected = {*BROKEN, "robots-too-many", "uuid-of-another-vendor", "message-too-large"}
    deviating = {"identity-changed", "path-times-equal", "point-absurd", "battery-out-of-range", "clock-off"}
    return (
        rejected - counted(text, "rejections_total")
        | {*deviating, "datum-too-many"} - counted(text, "deviations_total")
        | {"protocol-error", "idle"} - counted(text, "connections_refused_total", "reason")
    )


async def first_advisory(service: Running, kind: str, vendor: str = "Alder", uuid: str = "") -> Any:
    """The first of that kind and vendor, with that robot if one is given."""
    async with connect(f"ws://{service.face}/advisories/stream?after=0") as stream, asyncio.timeout(PATIENCE_S):
        while True:
            advisory = ADVISORY.validate_json(await stream.recv())
            if advisory.kind == kind and vendor in advisory.vendors and (not uuid or uuid in advisory.robots):
                return advisory
