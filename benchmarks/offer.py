"""A load: robots of several vendors that report once a second with ten points of path, over real sockets.

Open loop: a message is sent when it is due whether or not the service keeps up. The generator's own lateness is told,
so that a figure of the service is not one of the generator.
"""

import asyncio
import json
import os
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from multiprocessing.connection import Connection as PipeConnection
from uuid import UUID, uuid5

import numpy as np
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, WebSocketException

from ingest.seam import Floats

DATUM = "0d6f4f0e-9d0c-4a6f-8a55-0c9f5f4a1b01"
ROBOTS = UUID("3f0d9a52-9a64-4f55-8a3c-4a8f4d1f7b10")
VENDORS = ("Alder", "Basalt", "Corvid", "Dune")
SPACING_M, RADIUS_M = 6.8, 3.0
SLICE_S = 0.02
ROBOTS_A_CONNECTION = 10


def vendor_of(robot: int) -> str:
    """Every connection is of one vendor's robots and names it, so that each vendor has a share of its own."""
    return VENDORS[robot // ROBOTS_A_CONNECTION % len(VENDORS)]


@dataclass(slots=True)
class Offered:
    """What a load did. Times in seconds."""

    connections: int = 0
    sent: int = 0
    broken: int = 0
    """Connections that the service ended; each is opened again."""
    unsent: int = 0
    """Messages due while their connection was down."""
    late_s: float = 0.0
    """The most that a message was sent after it was due."""
    core_s: float = 0.0
    seconds: float = 0.0
    """From the first message that was due."""


class Circling:
    """n robots, each round a circle of its own; neighbours' circles nearly touch, so some meet at every moment."""

    def __init__(self, robots: int, seed: int = 1) -> None:
        rng = np.random.default_rng(seed)
        across = int(np.ceil(np.sqrt(robots)))
        self.x, self.y = np.arange(robots) % across * SPACING_M, np.arange(robots) // across * SPACING_M
        self.turn_radps = rng.uniform(0.15, 0.4, robots) * rng.choice([-1, 1], robots)
        self.angle = rng.uniform(0, 2 * np.pi, robots)
        self.due_s = rng.uniform(0, 1, robots)
        """When within each second a robot reports."""
        self.uuids = [str(uuid5(ROBOTS, str(i))) for i in range(robots)]

    def poses(self, robots: np.ndarray, t_s: Floats) -> tuple[Floats, Floats, Floats]:
        """x, y and yaw of `robots` (m,) at `t_s` (m, k), each (m, k)."""
        angle = self.angle[robots, None] + self.turn_radps[robots, None] * t_s
        yaw = angle + np.sign(self.turn_radps[robots, None]) * np.pi / 2
        x, y = self.x[robots, None] + RADIUS_M * np.cos(angle), self.y[robots, None] + RADIUS_M * np.sin(angle)
        return x, y, yaw

    def identity(self, robot: int) -> str:
        return json.dumps(
            {
                "uuid": self.uuids[robot],
                "timestamp": _stamp(time.time()),
                "manufacturerName": vendor_of(robot),
                "robotModel": "M1",
                "robotSerialNumber": f"R-{robot}",
                "baseRobotEnvelope": {"x": 1.0, "y": 0.6, "z": 1.0},
            }
        )

    def statuses(self, robots: np.ndarray, began_s: float, now_s: float) -> list[str]:
        """A status of each robot, as of `now_s`, epoch seconds."""
        ahead = np.arange(11, dtype=np.float64)
        x, y, yaw = self.poses(robots, (now_s - began_s) + ahead[None, :].repeat(len(robots), axis=0))
        stamps = [_stamp(now_s + one) for one in ahead]
        z, w = np.sin(yaw / 2), np.cos(yaw / 2)
        speed = RADIUS_M * np.abs(self.turn_radps[robots])
        rows = zip(robots.tolist(), x.tolist(), y.tolist(), z.tolist(), w.tolist(), speed.tolist(), strict=True)
        return [_status(self.uuids[robot], stamps, *row) for robot, *row in rows]


async def offer(url: str, robots: int, seconds: float, ended: Callable[[], bool]) -> Offered:
    """Connect, identify, then send for `seconds` or until `ended`."""
    world, told, began_core_s = Circling(robots), Offered(), time.process_time()
    groups = np.array_split(np.arange(robots), -(-robots // ROBOTS_A_CONNECTION))
    lines = [
        Line(f"{url}/{vendor_of(group[0])}", [world.identity(robot) for robot in group.tolist()], told)
        for group in groups
    ]
    line_of = [line for line, group in zip(lines, groups, strict=True) for _ in group]
    for line in lines:
        await line.open()
    told.connections = len(lines)
    began_s, done_s = time.time(), 0.0
    while done_s < seconds and not ended():
        await asyncio.sleep(max(began_s + done_s + SLICE_S - time.time(), 0.0))
        now_s = time.time()
        elapsed_s = min(now_s - began_s, seconds)
        due = np.flatnonzero(np.floor(elapsed_s - world.due_s) > np.floor(done_s - world.due_s))
        told.late_s = max(told.late_s, elapsed_s - done_s)
        for robot, status in zip(due.tolist(), world.statuses(due, began_s, now_s), strict=True):
            await line_of[robot].send(status)
        done_s = elapsed_s
    for line in lines:
        await line.close()
    told.core_s, told.seconds = time.process_time() - began_core_s, time.time() - began_s
    return told


class Line:
    """One connection, opened again when it breaks, each time with the identities of its robots."""

    def __init__(self, url: str, identities: list[str], told: Offered) -> None:
        self._url, self._identities, self._told = url, identities, told
        self._socket: ClientConnection | None = None
        self._opening: asyncio.Task[None] | None = None

    async def open(self) -> None:
        while self._socket is None:
            try:
                socket = await connect(self._url, compression=None, ping_interval=None)
                for identity in self._identities:
                    await socket.send(identity)
            except (OSError, WebSocketException):
                await asyncio.sleep(0.2)
            else:
                self._socket = socket

    async def send(self, message: str) -> None:
        if self._socket is None:
            self._told.unsent += 1
            return
        try:
            await self._socket.send(message)
            self._told.sent += 1
        except ConnectionClosed:
            self._told.broken += 1
            self._socket, self._opening = None, asyncio.create_task(self.open())

    async def close(self) -> None:
        if self._opening:
            self._opening.cancel()
        if self._socket:
            await self._socket.close()


def serve(parent: PipeConnection, url: str, robots: int, seconds: float, core: int | None = None) -> None:
    """The load in this process, to the end or until `parent` says anything; tells it what was done."""
    if core is not None:
        os.sched_setaffinity(0, {core})
    parent.send(asdict(asyncio.run(offer(url, robots, seconds, parent.poll))))


def _stamp(t_s: float) -> str:
    return datetime.fromtimestamp(t_s, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _status(uuid: str, stamps: list[str], x: Floats, y: Floats, z: Floats, w: Floats, speed: float) -> str:
    path = ",".join(
        f'{{"timestamp":"{stamps[i]}","x":{x[i]:.3f},"y":{y[i]:.3f},"angle":{{"x":0,"y":0,"z":{z[i]:.5f},"w":{w[i]:.5f}}},'
        f'"planarDatumUUID":"{DATUM}"}}'
        for i in range(1, 11)
    )
    return (
        f'{{"uuid":"{uuid}","timestamp":"{stamps[0]}","operationalState":"navigating",'
        f'"location":{{"x":{x[0]:.3f},"y":{y[0]:.3f},"angle":{{"x":0,"y":0,"z":{z[0]:.5f},"w":{w[0]:.5f}}},'
        f'"planarDatum":"{DATUM}"}},"velocity":{{"linear":{speed:.3f}}},"path":[{path}]}}'
    )
