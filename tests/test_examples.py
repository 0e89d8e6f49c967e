"""The examples do what they say, with the service and in processes of their own."""

import asyncio
import json
import subprocess
import sys
from pathlib import Path

from deconflict.advisory import AnyAdvisory, Severity
from tests.deconflict.made_advisories import cleared, made
from tests.deconflict.served_face import Served, served, until

EXAMPLE = Path(__file__).parent.parent / "examples" / "site_service.py"


def started(service: Served, place: Path) -> subprocess.Popen[bytes]:
    return subprocess.Popen([sys.executable, str(EXAMPLE), service.http, str(place)], stderr=subprocess.PIPE)


def place_of(place: Path) -> int:
    return int(json.loads(place.read_text())["seq"]) if place.exists() else -1


def taken_up(service: Served) -> list[AnyAdvisory]:
    """Each revision with which an advisory was taken up."""
    all_of_it = service.store.after(0, 1000)
    return [one for one in all_of_it if one.acknowledgement and one.acknowledgement.name == "site service"]


async def test_the_site_service_takes_up_each_advisory_once_though_it_is_killed(tmp_path: Path) -> None:
    place = tmp_path / "place.json"
    async with served(tmp_path) as service:
        await service.publish(made(1))
        running = started(service, place)
        await until(lambda: place_of(place) == 2)
        await service.publish(made(2), made(3, severity=Severity.CAUTION))
        await until(lambda: len(taken_up(service)) == 2)
        running.kill()
        assert await asyncio.to_thread(running.wait) == -9
        await service.publish(made(4), made(5), cleared(5))
        place.write_text(json.dumps({"seq": 1}))  # as if it had been killed before it could note its place
        again = started(service, place)
        await until(lambda: len(taken_up(service)) == 3)
        await until(lambda: place_of(place) == service.store.last_seq())
        again.kill()
        await asyncio.to_thread(again.wait)
        assert {one.id for one in taken_up(service)} == {"advisory-1", "advisory-2", "advisory-4"}
    for one in (running, again):
        assert one.stderr
        assert b"Traceback" not in one.stderr.read()
        one.stderr.close()
