"""Robots of all three languages in a cluster of two ingests, of which the one that hears the brokers is killed."""

import asyncio
import json
import signal
import time
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager, suppress
from math import copysign, pi
from pathlib import Path
from typing import Any

from aiomqtt import Client
from websockets.exceptions import ConnectionClosed

from deconflict.cluster.nats.shared_state import LEASE_S
from deconflict.runtime.rpc import AsyncCaller
from ingest.languages.vda5050.vda_front_end import robot_uuid
from ingest.port.brokers.mqtt_source import MqttSource
from tests.deconflict.cluster.made_cluster import cluster, lives, needs_server, until
from tests.deconflict.operator.outlets.made_outlets import broker, needs_mosquitto
from tests.deconflict.roles.made_service import SITE, Course, drive
from tests.helpers import iso_saying, vda_saying
from tests.helpers.patience import PATIENCE_S
from tests.helpers.saying import HALL, robot

pytestmark = [needs_server, needs_mosquitto]

LEG_S, HALF_M = 16.0, 8.0
TAKEN_OVER_WITHIN_S = 10.0
DRIVEN_S = 300.0
BROKERS = {"hall": "vda5050", "yard": "iso21423"}
"""Both are one broker, in two languages."""
ISO_MAP = f'"{iso_saying.CCS}"'.encode()
VDA_ROBOT = robot_uuid(vda_saying.MAKER, vda_saying.SERIAL)


def shuttle(t: float) -> tuple[float, float]:
    """Place and velocity of a robot that drives up and down a line of twice `HALF_M` at 1 m/s, from its lower end."""
    part = t % (2 * LEG_S)
    return (part - HALF_M, 1.0) if part < LEG_S else (2 * LEG_S - part - HALF_M, -1.0)


def eastwards(late_s: float, y: float) -> Course:
    def course(t: float) -> tuple[float, float, float]:
        x, velocity = shuttle(t - late_s)
        return x, y, 0.0 if velocity > 0 else pi

    return course


def way(velocity: float) -> list[dict[str, Any]]:
    """Two nodes on x = 0, in the direction of the velocity."""
    from_y = copysign(HALF_M, -velocity)
    places = [{"x": 0.0, "y": y, "mapId": HALL} for y in (from_y, -from_y)]
    return [vda_saying.node(number, 0.0, nodePosition=place) for number, place in enumerate(places)]


async def report_vda(client: Client, start_s: float) -> None:
    """A robot on x = 0. It retains its factsheet, and gets an order for each leg, which nobody retains."""
    await client.publish(vda_saying.topic("factsheet"), vda_saying.factsheet(start_s), 1, retain=True)
    leg = -1
    while (now_s := time.time()) < start_s + DRIVEN_S:
        y, velocity = shuttle(now_s - start_s)
        nodes, before = way(velocity), leg
        if (leg := int((now_s - start_s) // LEG_S)) != before:
            order = vda_saying.order(now_s, nodes, orderId=f"leg {leg}")
            await client.publish(vda_saying.topic("order"), order, 1)
        pose = vda_saying.position(0.0, y, copysign(pi / 2, velocity), mapId=HALL)
        keys = {"orderId": f"leg {leg}", "agvPosition": pose, "velocity": {"vx": 1.0}}
        await client.publish(vda_saying.topic("state"), vda_saying.under_way(now_s, 0.0, y, nodes[1:], **keys))
        await asyncio.sleep(0.5)


async def report_iso(client: Client, start_s: float) -> None:
    """A robot on x = 4, four seconds later. It retains its identity."""
    await client.publish(iso_saying.topic("identity"), iso_saying.identity(start_s), 1, retain=True)
    while (now_s := time.time()) < start_s + DRIVEN_S:
        y, velocity = shuttle(t := now_s - start_s - 4.0)
        path = [(now_s + ahead_s, 4.0, shuttle(t + ahead_s)[0]) for ahead_s in range(11)]
        messages = {
            "odometry": iso_saying.odometry(now_s, 4.0, y, copysign(pi / 2, velocity), 1.0),
            "localTrajectory": iso_saying.trajectory(now_s, *path),
        }
        for resource, raw in messages.items():
            await client.publish(iso_saying.topic(resource), raw.replace(ISO_MAP, f'"{HALL}"'.encode()))
        await asyncio.sleep(0.5)


async def drive_until_killed(url: str, name: str, course: Course, start_s: float) -> None:
    """A robot of MassRobotics, until its ingest is killed."""
    with suppress(ConnectionClosed):
        await drive(url, {name: course}, DRIVEN_S, start_s)


@asynccontextmanager
async def driving(port: int, urls: Sequence[str]) -> AsyncIterator[None]:
    """The two robots of the broker, and one of MassRobotics at each ingest: A-1 on y = 0, A-2 on y = 4."""
    start_s = time.time()
    async with Client("127.0.0.1", port) as client:
        tasks = [
            asyncio.create_task(reports)
            for reports in (
                report_vda(client, start_s),
                report_iso(client, start_s),
                drive_until_killed(urls[0], "A-1", eastwards(0.0, 0.0), start_s),
                drive_until_killed(urls[1], "A-2", eastwards(4.0, 4.0), start_s),
            )
        ]
        try:
            yield
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)


async def owners(base: str) -> dict[str, str]:
    """The vendor of each robot."""
    return {robot["uuid"]: robot["vendor"] for robot in (await until(base, "/robots", bool))["robots"]}


async def meet(base: str, after: int) -> None:
    """Wait until A-1 and the robot of either broker are warned of each other, in advisories that are new since then."""
    wanted = {frozenset({robot("A-1"), uuid}) for uuid in (VDA_ROBOT, iso_saying.ROBOT)}
    async with asyncio.timeout(PATIENCE_S):
        while True:
            raised = [life[0] for life in await lives(base)]
            if wanted <= {frozenset(each.robots) for each in raised if (each.seq or 0) > after}:
                return
            await asyncio.sleep(0.2)


async def hear_both(folder: Path, seconds: float) -> None:
    """Have an ingest hear brokers that are not its own, and give them to it again whenever its feed takes them away."""
    receiver, began_s = AsyncCaller(folder, "receiver"), time.monotonic()
    while (now_s := time.monotonic()) < began_s + seconds:
        await receiver.call("grant_brokers", json.dumps([list(BROKERS), now_s + 1.0]).encode())
        await asyncio.sleep(0.1)


async def hearers(base: str, wanted: Callable[[dict[str, list[str]]], bool]) -> dict[str, list[str]]:
    """The ingests that hear each broker, once they are as wanted."""
    health = await until(base, "/healthz", lambda health: wanted(health["brokers"].get("heard_by", {})))
    heard_by: dict[str, list[str]] = health["brokers"]["heard_by"]
    return heard_by


async def test_another_ingest_hears_the_brokers_of_a_killed_one_and_warns_again(tmp_path: Path) -> None:
    async with broker() as port:
        sources = (MqttSource(name=name, host="127.0.0.1", port=port, language=BROKERS[name]) for name in BROKERS)
        site = SITE.model_copy(update={"mqtt_sources": tuple(sources)})
        async with cluster(tmp_path, site) as (machines, operator):
            base = f"http://127.0.0.1:{operator.port}"
            urls = {name: f"ws://127.0.0.1:{machines.start(name, 'receiver', 'feed')}" for name in ("west", "east")}
            for name in ("first", "second"):
                machines.start(name, "engine")
            await until(base, "/healthz", lambda health: health["roles"]["engine"] == "up")
            heard_by = await hearers(base, lambda found: found.keys() == BROKERS.keys() and all(found.values()))
            assert [len(ingests) for ingests in heard_by.values()] == [1, 1]
            (killed_ingest,) = heard_by["hall"]
            killed = machines.machine_of(int(killed_ingest.rpartition(" ")[2]))
            (left,) = urls.keys() - {killed}
            async with driving(port, [urls[left], urls[killed]]):
                await meet(base, after=0)
                before = await owners(base)
                overlapping = asyncio.create_task(hear_both(tmp_path / left, 3.0))
                heard_by = await hearers(base, lambda found: len(found["hall"]) == 2)
                await overlapping
                for role in ("receiver", "feed"):
                    machines.kill(killed, role)
                killed_s, left_ingests = time.monotonic(), [each for each in heard_by["hall"] if each != killed_ingest]
                await hearers(base, lambda found: found == dict.fromkeys(BROKERS, left_ingests))
                assert time.monotonic() - killed_s < TAKEN_OVER_WITHIN_S
                await meet(base, after=(await until(base, "/advisories", bool))["seq"])
            kinds = {life[0].kind for life in await lives(base)}
            after = await owners(base)
    assert kinds == {"conflict"}
    assert {VDA_ROBOT, iso_saying.ROBOT} <= after.keys()
    assert {uuid: before[uuid] for uuid in after} == after


async def connected(folder: Path) -> bool:
    """Whether the receiver of an ingest hears a broker."""
    documents = json.loads(await AsyncCaller(folder, "receiver").call("brokers"))
    return any(document["ingest"] for document in documents)


async def test_an_ingest_that_is_cut_off_from_the_servers_stops_hearing_before_another_begins(tmp_path: Path) -> None:
    async with broker() as port:
        sources = (MqttSource(name="hall", host="127.0.0.1", port=port),)
        async with cluster(tmp_path, SITE.model_copy(update={"mqtt_sources": sources})) as (machines, operator):
            base = f"http://127.0.0.1:{operator.port}"
            for name in ("west", "east"):
                machines.start(name, "receiver", "feed")
            heard_by = await hearers(base, lambda found: len(found.get("hall", ())) == 1)
            cut_off = machines.machine_of(int(heard_by["hall"][0].rpartition(" ")[2]))
            other = "east" if cut_off == "west" else "west"
            machines.signal(cut_off, "feed", signal.SIGSTOP)
            cut_off_s = time.monotonic()
            while not await connected(tmp_path / other):
                assert time.monotonic() - cut_off_s < TAKEN_OVER_WITHIN_S
                await asyncio.sleep(0.05)
            assert not await connected(tmp_path / cut_off)
            machines.signal(cut_off, "feed", signal.SIGCONT)
            await hearers(base, lambda found: found["hall"] == heard_by["hall"])
            machines.broker.kill()
            cut_off_s = time.monotonic()
            while time.monotonic() - cut_off_s < 2 * LEASE_S:
                assert await connected(tmp_path / cut_off), "its own engine goes on without a server"
                assert not await connected(tmp_path / other)
                await asyncio.sleep(0.1)
            machines.broker.start()
            await hearers(base, lambda found: found.get("hall") == heard_by["hall"])
