"""Whose a robot is, in the running service: kept over a restart, and changed by a person."""

import time
from pathlib import Path

from websockets.asyncio.client import connect

from ingest.recording.log_reader import LogReader
from ingest.settings import Vendor
from metrics.replay.recorded_passes import PassReader
from tests.deconflict.roles.made_service import SITE, Running, running
from tests.helpers.plain_http import http_client
from tests.helpers.saying import robot, status

VENDORS = SITE.model_copy(update={"vendors": (Vendor(name="Alder"), Vendor(name="Basalt"))})


async def report(service: Running, vendor: str, x_m: float) -> None:
    async with connect(f"{service.robots_url}/{vendor}") as socket:
        await socket.send(status("A-1", time.time(), x_m))


async def test_a_robot_is_given_to_a_vendor_in_the_running_service_and_in_its_replay(tmp_path: Path) -> None:
    async with running(tmp_path, VENDORS) as service:
        await report(service, "Basalt", 1.0)
        await service.until("/robots", lambda answer: answer["robots"])
    async with running(tmp_path, VENDORS) as service:
        await report(service, "Alder", 2.0)
        (refused,) = (await service.until("/quarantine", lambda answer: answer["rejected"]))["rejected"]
        assert refused["rule"] == "uuid-of-another-vendor"
        async with http_client(f"http://{service.face}") as client:
            answer = await client.post(f"/robots/{robot('A-1')}/owner", json={"vendor": "Alder"})
        assert answer.json() == {"uuid": robot("A-1"), "vendor": "Alder", "before": "Basalt"}
        await report(service, "Alder", 3.0)
        await service.until("/robots", lambda answer: [each["vendor"] for each in answer["robots"]] == ["Alder"])
    passes = PassReader(VENDORS)
    for _ in passes.passes_of(LogReader().read([tmp_path / "log"])):
        pass
    again = passes.fleet.robots[robot("A-1")]
    assert again.seen
    assert (again.vendor, again.seen.x_m) == ("Alder", 3.0)
