"""Attackers that send what robots may send, and many of them: large ones, of many makers, or a crowd.

Every message is made before the attack begins, and a connection carries many robots, so that the attacker takes little
of the processor time that it shares with the service.
"""

import asyncio
import multiprocessing
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.synchronize import Event

import numpy as np

from benchmarks.attack.courses import CROWD_VENDOR
from benchmarks.drawn_floors.motion import Robot, Sent, Way, sent_by
from benchmarks.drawn_floors.others import Body, Ground, moving_heap
from benchmarks.offer import Offered, RobotConnection, frame_head

MAKERS, CONNECTIONS = 64, 20
"""Invented makers; connections of robots that have one vendor."""
HEAP_AT_M = np.array([-20.0, 0.0])
LARGE_AT_M, LARGE_WITHIN_M = np.array([-300.0, -300.0]), 100.0
"""Where large robots stand: a body of 100 m reaches no honest robot."""
SLICE_S = 0.02
MADE_A_SECOND = 8_000
"""So many messages are surely made in a second, on a machine that is busy."""


def large(robots: int, size_m: float, _: float) -> list[Robot]:
    """Large robots of one vendor that stand."""
    places_m = LARGE_AT_M + np.random.default_rng(3).uniform(0, LARGE_WITHIN_M, (robots, 2))
    bodies = [Body(Way.standing(x_m, y_m), size_m, size_m) for x_m, y_m in places_m.tolist()]
    return _sent("large", bodies, 1)


def makers(robots: int, _: float, seconds: float) -> list[Robot]:
    """Robots of many invented makers that drive criss-cross in one place."""
    return _sent("made-up", _heap(robots, seconds), MAKERS)


def silent_crowd(robots: int, _: float, seconds: float) -> list[Robot]:
    """Robots of one vendor that drive criss-cross in one place, and fall silent under way."""
    return _sent("silent", _heap(robots, seconds), 1)


SWARMS: dict[str, Callable[[int, float, float], list[Robot]]] = {
    "large": large,
    "makers": makers,
    "silent-crowd": silent_crowd,
}
"""Each takes the number of robots, the size of large ones, and for how many seconds they send."""
ROBOTS = {"large": 1000, "makers": 1000, "silent-crowd": 500}
"""How many there are if it is not said."""


def _heap(robots: int, seconds: float) -> list[Body]:
    return moving_heap(Ground(np.random.default_rng(5), 0.1, seconds, (), HEAP_AT_M), robots)


def _sent(name: str, bodies: list[Body], number_of_makers: int) -> list[Robot]:
    phases_s = np.random.default_rng(4).uniform(0, 1, len(bodies)).round(3).tolist()
    names = [CROWD_VENDOR if number_of_makers == 1 else f"Maker-{number}" for number in range(number_of_makers)]
    robots = []
    for number, (body, phase_s) in enumerate(zip(bodies, phases_s, strict=True)):
        maker, begun = names[number % number_of_makers], body._replace(begins_s=0.0)
        robots.append(Robot(f"{name} {number}", maker, "", phase_s=phase_s, **begun._asdict()))
    return robots


@contextmanager
def swarming(url: str, robots: list[Robot], seconds: float, core: int | None = None) -> Iterator[None]:
    """Robots report for `seconds`, or until the block ends. It begins with the first report."""
    spawn = multiprocessing.get_context("spawn")
    begun, stop = spawn.Event(), spawn.Event()
    process = spawn.Process(target=_run, args=(url, robots, seconds, core, begun, stop))
    process.start()
    begun.wait()
    try:
        yield
    finally:
        stop.set()
        process.join()


def _run(url: str, robots: list[Robot], seconds: float, core: int | None, begun: Event, stop: Event) -> None:
    if core is not None:
        os.sched_setaffinity(0, {core})
    start_s = int(time.time() + 3.0 + len(robots) * seconds / MADE_A_SECOND)
    sent = [each._replace(raw=frame_head(len(each.raw)) + each.raw) for each in sent_by(robots, seconds, start_s)]
    asyncio.run(_send(url, robots, sent, start_s, begun, stop))


async def _send(url: str, robots: list[Robot], sent: list[Sent], start_s: int, begun: Event, stop: Event) -> None:
    """Send each message when it is due."""
    senders = {_sender(number, robot) for number, robot in enumerate(robots)}
    connections = {sender: RobotConnection(f"{url}/{sender[0]}", [], Offered()) for sender in sorted(senders)}
    await asyncio.gather(*(connection.open() for connection in connections.values()))
    of_robot = [connections[_sender(number, robot)] for number, robot in enumerate(robots)]
    await asyncio.sleep(max(start_s - time.time(), 0.0))
    begun.set()
    number = 0
    while number < len(sent) and not stop.is_set():
        while number < len(sent) and sent[number].at_s <= time.time() - start_s:
            of_robot[sent[number].robot].send(sent[number].raw)
            number += 1
        await asyncio.sleep(SLICE_S)
    for connection in connections.values():
        connection.close()


def _sender(number: int, robot: Robot) -> tuple[str, int]:
    """The connection of a robot: one for each maker, or one of some if all have one vendor."""
    return robot.maker, number % CONNECTIONS if robot.maker == CROWD_VENDOR else 0
