"""A load of robots at a broker, in the languages that are spoken there.

Each robot reports once a second: a state of VDA 5050 along an order, or an odometry and a trajectory of ISO 21423. They
drive beside each other, to and fro, apart from the robots of `benchmarks/offer.py`.
"""

import asyncio
import multiprocessing
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.process import BaseProcess
from typing import Any

from aiomqtt import Client

from benchmarks import offer
from ingest.port.brokers.mqtt_source import MqttSource
from tests.helpers import iso_saying, vda_saying

APART_M, WAY_M, LANES = 3.0, 30.0, 50
PORT = 18950
Messages = Iterator[tuple[str, bytes]]


def _place(robot: int, t_s: float) -> tuple[float, float, int]:
    """Where a robot is, and whether it drives to the end of its lane (1) or back (0)."""
    lap, along_m = divmod(t_s + robot, WAY_M)
    on = int(lap) % 2
    x_m = (robot // LANES) * (WAY_M + APART_M) + (along_m if on else WAY_M - along_m)
    return x_m, -(robot % LANES + 1) * APART_M, on


def _vda(robot: int, now_s: float, t_s: float) -> Messages:
    serial, place = f"{robot:05}", {"mapId": offer.DATUM}
    x_m, y_m, on = _place(robot, t_s)
    lap = int((t_s + robot) // WAY_M)
    start_m = (robot // LANES) * (WAY_M + APART_M)
    ends = (start_m, start_m + WAY_M) if on else (start_m + WAY_M, start_m)
    nodes = [
        {**vda_saying.node(number, 0.0), "nodePosition": {"x": x, "y": y_m, **place}} for number, x in enumerate(ends)
    ]
    keys: dict[str, Any] = {"serialNumber": serial, "orderId": f"o{lap}"}
    if t_s < 1 or (t_s + robot) % WAY_M < 1:
        yield vda_saying.topic("factsheet", serial), vda_saying.factsheet(now_s, serialNumber=serial)
        yield vda_saying.topic("order", serial), vda_saying.order(now_s, nodes, **keys)
    pose = vda_saying.position(x_m, y_m, 0.0 if on else 3.1416, **place)
    state = vda_saying.under_way(now_s, 0.0, 0.0, nodes[1:], agvPosition=pose, velocity={"vx": 1.0}, **keys)
    yield vda_saying.topic("state", serial), state


def _iso(robot: int, now_s: float, t_s: float) -> Messages:
    uuid = f"91403a21-7534-4467-99a6-{robot:012d}"
    if t_s < 1:
        yield iso_saying.topic("identity", uuid), iso_saying.identity(now_s, imrSerialNumber=f"{robot:05}")
        yield iso_saying.topic("status", uuid), iso_saying.states(now_s, "MODE_AUTO", "FORWARD")
    ahead = [(now_s + i, *_place(robot, t_s + i)[:2]) for i in range(1, 11)]
    x_m, y_m, on = _place(robot, t_s)
    for resource, raw in (
        ("localTrajectory", iso_saying.trajectory(now_s, *ahead)),
        ("odometry", iso_saying.odometry(now_s, x_m, y_m, 0.0 if on else 3.1416, 1.0)),
    ):
        yield iso_saying.topic(resource, uuid), raw.replace(b'"ccsId": "hall"', b'"ccsId": "%s"' % offer.DATUM.encode())


LANGUAGES: dict[str, Callable[[int, float, float], Messages]] = {"vda5050": _vda, "iso21423": _iso}


def sources(languages: list[str]) -> tuple[MqttSource, ...]:
    """The section of the site file by which a service hears them."""
    makers = {"vda5050": (vda_saying.MAKER,)}
    return tuple(
        MqttSource(name=name, host="127.0.0.1", port=PORT, language=name, manufacturers=makers.get(name, ()))
        for name in languages
    )


def send(robots: int, seconds: float, languages: list[str]) -> None:
    """Publish for all robots, spread over each second."""
    asyncio.run(_send(robots, seconds, languages))


async def _send(robots: int, seconds: float, languages: list[str]) -> None:
    began_s = time.time()
    async with Client("127.0.0.1", PORT, max_queued_outgoing_messages=0) as client:
        paho = client._client
        for second in range(int(seconds)):
            for robot in range(robots):
                due_s = began_s + second + robot / robots
                if due_s > time.time() + 0.005:
                    await asyncio.sleep(due_s - time.time())
                for topic, raw in LANGUAGES[languages[robot % len(languages)]](robot, time.time(), due_s - began_s):
                    paho.publish(topic, raw)


def start(robots: int, seconds: float, languages: list[str]) -> BaseProcess:
    """The load, in its own process."""
    process = multiprocessing.get_context("spawn").Process(target=send, args=(robots, seconds, languages))
    process.start()
    return process


@contextmanager
def broker() -> Iterator[None]:
    """A broker, until the block ends."""
    mosquitto = shutil.which("mosquitto", path="/usr/sbin:/usr/local/sbin:/usr/bin")
    if mosquitto is None:
        raise SystemExit("install mosquitto: it is the broker of this benchmark")
    quiet = subprocess.DEVNULL
    with subprocess.Popen([mosquitto, "-p", str(PORT)], stdout=quiet, stderr=quiet) as process:
        try:
            yield
        finally:
            process.terminate()
