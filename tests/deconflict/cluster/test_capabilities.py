"""docs/cluster.md says what works in a cluster as on one machine, and a running cluster shows it."""

import asyncio
import re
import sqlite3
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, closing, suppress
from datetime import UTC, datetime
from math import pi, sin
from pathlib import Path
from typing import Any

import httpx
import pytest
from websockets.asyncio.client import connect
from websockets.asyncio.server import ServerConnection, serve

from deconflict.cluster.engine_member import EngineMember
from deconflict.cluster.nats.stream_records import StreamRecord
from deconflict.cluster.tiles.tiles import Grid
from deconflict.operator.store.sqlite_connections import FILE_NAME
from deconflict.settings.cluster_settings import Cluster
from deconflict.settings.site import EngineSettings
from deconflict.settings.site_file import SiteError, load
from deconflict_client.advisory import Hold, Recommendation
from ingest.batch import FloorPoint
from ingest.port.connection import Connection
from ingest.settings import Vendor
from tests.deconflict.cluster.made_cluster import HOME, cluster, ingest, needs_server
from tests.deconflict.cluster.made_shards import fleet
from tests.deconflict.roles.made_service import SITE, Course, drive
from tests.helpers.made_advisories import made
from tests.helpers.made_site import put, sound, written
from tests.helpers.patience import PATIENCE_S
from tests.helpers.plain_http import http_client
from tests.helpers.saying import HALL, identity, points, robot, status

DOC = (Path(__file__).parents[3] / "docs" / "cluster.md").read_text(encoding="utf-8")
SECTION = DOC.split("\n## Capabilities beside one machine\n", 1)[1].split("\n## ", 1)[0]
ROWS = {
    capability: (verdict, why)
    for capability, verdict, why in re.findall(r"^\| (.+?) \| (works|differs|no) \| (.*?) ?\|$", SECTION, re.M)
}
OVERLOADED = EngineSettings(deadline_s=1e-6)
"""Each pass is late."""
SERVERS = {"nats": ["nats://127.0.0.1:4222"]}

CROSSING: dict[str, Course] = {
    "A": lambda t: (8.0 * sin(t / 8.0), 0.0, 0.0),
    "B": lambda t: (0.0, 8.0 * sin(t / 8.0), pi / 2),
}
"""Two that meet again and again in the middle."""


async def holds_at_last(holds: Callable[[], Awaitable[bool]]) -> bool:
    """Whether something holds before patience ends."""
    with suppress(TimeoutError):
        async with asyncio.timeout(PATIENCE_S):
            while not await holds():
                await asyncio.sleep(0.2)
            return True
    return False


class Tried:
    """A cluster that runs, with an overloaded engine."""

    def __init__(self, client: httpx.AsyncClient, folder: Path, dialled: list[ServerConnection]) -> None:
        self._client, self.folder, self.dialled = client, folder, dialled

    async def get(self, path: str) -> httpx.Response:
        return await self._client.get(path)

    async def gives(self, vendor: str, name: str) -> bool:
        """Whether a robot can be given to a vendor."""
        answer = await self._client.post(f"/robots/{robot(name)}/owner", json={"vendor": vendor})
        return answer.status_code == 200

    async def marks(self, name: str, *, off_floor: bool) -> bool:
        """Whether a robot is off the floor, or on it, once somebody said so."""
        statement = {"off_floor": off_floor, "name": "Petra"}
        answer = await self._client.post(f"/robots/{robot(name)}/off-floor", json=statement)
        assert answer.json()["off_floor"] is off_floor
        path = f"/robots/{robot(name)}"
        return await self.comes(path, lambda found: bool(found.json()["off_floor"]) is off_floor)

    async def comes(self, path: str, wanted: Callable[[httpx.Response], bool]) -> bool:
        """Whether the answer is as wanted at last."""

        async def is_wanted() -> bool:
            return wanted(await self.get(path))

        return await holds_at_last(is_wanted)

    async def counts(self, series: str) -> bool:
        """Whether the scrape has a series above 0."""
        return await self.comes("/metrics", lambda answer: bool(re.search(rf"^{series} (?!0\.0$)", answer.text, re.M)))

    def is_refused(self, key: str, value: Any) -> bool:
        """Whether a site file with a key is refused beside `[cluster]`, and taken without."""
        document = put(sound(), key, value)
        load(written(document, self.folder))
        try:
            load(written(put(document, "cluster", SERVERS), self.folder))
        except SiteError as error:
            return "a cluster" in str(error)
        return False


async def lie(url: str) -> None:
    """A robot that announces a path to the east and drives north."""
    began_s = time.time()
    async with connect(url) as socket:
        await socket.send(identity("L", began_s))
        while True:
            now_s = time.time()
            y = 20.0 + (now_s - began_s) % 60.0
            path = points(*((now_s + i, 20.0 + i, y, 0.0) for i in range(1, 11)))
            await socket.send(status("L", now_s, 20.0, y, 0.0, path=path))
            await asyncio.sleep(0.5)


async def rest(url: str) -> None:
    """A robot that stands."""
    async with connect(url) as socket:
        await socket.send(identity("S", time.time()))
        while True:
            stands: dict[str, Any] = {"operationalState": "idle", "velocity": {"linear": 0.0}}
            await socket.send(status("S", time.time(), 40.0, 40.0, **stands))
            await asyncio.sleep(0.5)


@asynccontextmanager
async def tried(folder: Path) -> AsyncIterator[Tried]:
    """Two ingests, two engines and a face, with robots."""
    dialled: list[ServerConnection] = []

    async def take(connection: ServerConnection) -> None:
        dialled.append(connection)
        await connection.wait_closed()

    async with serve(take, "127.0.0.1", 0) as server:
        port = next(iter(server.sockets)).getsockname()[1]
        site = SITE.model_copy(
            update={"engine": OVERLOADED, "vendors": (Vendor(name="Alder", dial=(f"ws://127.0.0.1:{port}/",)),)}
        )
        async with (
            cluster(folder, site) as (machines, operator),
            ingest(machines, folder / "west") as west,
            ingest(machines, folder / "east") as east,
            http_client(base_url=f"http://127.0.0.1:{operator.port}") as client,
        ):
            for name in ("first", "second"):
                machines.start(name, "engine")
            reports = drive(west, CROSSING, 600.0), lie(east), rest(east)
            driving = [asyncio.create_task(report) for report in reports]
            try:
                yield Tried(client, folder, dialled)
            finally:
                for task in driving:
                    task.cancel()
                await asyncio.gather(*driving, return_exceptions=True)


def is_tried(module: str, test: str) -> bool:
    """Whether a test beside this one tries a capability in a cluster of its own."""
    return f"\nasync def {test}(" in Path(__file__).with_name(f"{module}.py").read_text(encoding="utf-8")


async def hears_brokers(run: Tried) -> bool:
    assert is_tried("test_brokers_in_cluster", "test_another_ingest_hears_the_brokers_of_a_killed_one_and_warns_again")
    source = {"name": "hall", "host": "broker", "language": "vda5050"}
    return not run.is_refused("mqtt_sources", [source])


async def dials(run: Tried) -> bool:
    return await run.comes("/healthz", lambda _: len(run.dialled) == 2)


async def has_a_canary(run: Tried) -> bool:
    def is_stored(answer: httpx.Response) -> bool:
        with closing(sqlite3.connect(run.folder / "face" / FILE_NAME)) as db:
            tables = {name for (name,) in db.execute("SELECT name FROM sqlite_master")}
            kept = db.execute("SELECT count(*) FROM canary").fetchone()[0] if "canary" in tables else 0
        return kept > 0 and answer.json()["canary"]["status"] == "ok"

    return await run.comes("/healthz", is_stored) and await run.counts("deconflict_canary_latency_seconds")


async def does_less(run: Tried) -> bool:
    is_coarse = await run.comes("/healthz", lambda answer: answer.json()["effort"] == "coarse")
    return is_coarse and await run.counts("deconflict_engine_effort_reduced")


async def ends_if_it_hangs(_: Tried) -> bool:
    return is_tried("test_engine_member", "test_an_engine_whose_pass_hangs_ends_so_that_others_take_its_tiles")


async def counts_late_passes(run: Tried) -> bool:
    return await run.counts("deconflict_deadlines_missed_total")


async def counts_solves(run: Tried) -> bool:
    return await run.counts("deconflict_advice_solve_seconds_count")


async def counts_failures(run: Tried) -> bool:
    return "\ndeconflict_advice_failures_total" in (await run.get("/metrics")).text


async def names_the_distrusted(run: Tried) -> bool:
    return await run.comes("/presence", lambda answer: answer.json()["distrusted"] == [robot("L")])


async def sees_advice_of_others_heeded(run: Tried) -> bool:
    """A robot stops, as an advisory says that another engine has published."""
    member, grid = EngineMember(SITE, Cluster(nats=("nats://127.0.0.1:4222",)), run.folder), Grid(64.0)
    tiles, line, heard, now_s = frozenset((grid.root(FloorPoint(HALL, 0.0, 0.0)),)), Connection(1), fleet(), time.time()

    def run_pass(t: float, x: float, *records: StreamRecord) -> None:
        path = points(*((now_s + t + i, x + i, 0.0, 0.0) for i in range(1, 11)))
        heard.receive(status("A", now_s + t, x, path=path), now_s + t, line)
        member._run_pass(tiles, None, [heard.next_batch(now_s + t).to_bytes()], records, [])

    for t in range(-6, 0):
        run_pass(t, float(t))
    hold = Hold(robot=robot("A"), hold_s=9.0)
    advice = Recommendation(holds=(hold,), cost_s=5.0, bound_s=5.0, proven_optimal=True)
    at = datetime.fromtimestamp(now_s, UTC)
    published = made(1, robots=(robot("A"), robot("B")), raised_at=at, updated_at=at, recommendation=advice)
    run_pass(0.0, 0.0, StreamRecord(1, "pair", HOME, published))
    for t in (1, 2, 3):
        run_pass(t, 0.0)
    return member._last_advised_wait_s(robot("A")) > 0.0


async def shows_the_past(run: Tried) -> bool:
    """The robots of both ingests."""

    async def shows_all() -> bool:
        if (at_s := (await run.get("/recorded")).json()["to_s"]) is None:
            return False
        floor = (await run.get(f"/past?at_s={at_s}")).json()["floor"]
        return {row[0] for row in floor["robots"]} == {robot(name) for name in (*CROSSING, "L", "S")}

    return await holds_at_last(shows_all)


async def gives_robots(run: Tried) -> bool:
    return await run.gives("Alder", "A")


async def takes_off_the_floor(run: Tried) -> bool:
    def is_counted(robots: int) -> Callable[[httpx.Response], bool]:
        return lambda answer: answer.json()["off_floor"]["robots"] == robots

    assert await run.comes(f"/robots/{robot('S')}", lambda answer: answer.status_code == 200)
    is_off = await run.marks("S", off_floor=True) and await run.comes("/healthz", is_counted(1))
    return is_off and await run.marks("S", off_floor=False) and await run.comes("/healthz", is_counted(0))


async def keeps_black_boxes(run: Tried) -> bool:
    return not run.is_refused("blackbox", {"files": 10})


async def asks_robots(run: Tried) -> bool:
    assert (await run.get("/advice")).json()["advice"] == []
    ignored: dict[str, Any] = {
        "vendors.0.verbs": ["go_around"],
        "mqtt": {"host": "hall", "kinds": ["advice"]},
        "operator.people": [{"name": "Ada", "role": "answer", "vendor": "acme", "token": "env:X"}],
    }
    return not all(run.is_refused(key, value) for key, value in ignored.items())


async def judges_warnings(run: Tried) -> bool:
    return "\ndeconflict_warnings_judged_total" in (await run.get("/metrics")).text


WORKS: dict[str, Callable[[Tried], Awaitable[bool]]] = {
    "robots of VDA 5050 and ISO 21423 at brokers": hears_brokers,
    "`vendors.dial`": dials,
    "the canary in health, `deconflict_canary_latency_seconds`": has_a_canary,
    "less effort under load, `deconflict_engine_effort_reduced`": does_less,
    "an engine that hangs is ended and restarted": ends_if_it_hangs,
    "`deconflict_deadlines_missed_total`": counts_late_passes,
    "`deconflict_advice_solve_seconds`": counts_solves,
    "`deconflict_advice_failures_total`": counts_failures,
    "robots whose forecasts are distrusted, in `GET /presence` and on the page": names_the_distrusted,
    "`heeded_s` of losses": sees_advice_of_others_heeded,
    "the past on the page, `GET /recorded` and `GET /past`": shows_the_past,
    "giving a robot to a vendor, `POST /robots/ID/owner`": gives_robots,
    "a robot that is off the floor, `POST /robots/ID/off-floor`": takes_off_the_floor,
    "black boxes, `[blackbox]`": keeps_black_boxes,
    "advice that ends standoffs, `GET /advice`, `verbs`, `kinds` with `advice`, the role `answer`": asks_robots,
    "judging warnings live, `deconflict_warnings_judged_total`": judges_warnings,
}
"""By capability, whether it is there, as tried in a running cluster."""


@needs_server
async def test_each_row_of_the_table_holds_in_a_running_cluster(tmp_path: Path) -> None:
    async with tried(tmp_path) as run:
        found = {capability: await works(run) for capability, works in WORKS.items()}
    assert {capability: verdict != "no" for capability, (verdict, _) in ROWS.items()} == found


@pytest.mark.parametrize("capability", ROWS)
def test_what_does_not_work_as_on_one_machine_says_why(capability: str) -> None:
    verdict, why = ROWS[capability]
    assert verdict == "works" or why
