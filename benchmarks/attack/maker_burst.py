"""One burst of states of robots of many invented makers, at a broker without credentials."""

import multiprocessing
import os
import shutil
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.synchronize import Event

from benchmarks import offer
from benchmarks.broker_offer import PORT
from tests.helpers import vda_saying

MESSAGES, MAKERS, WITHIN_M = 40_000, 3_000, 3.0
APART_S = 0.1
"""Between the times of two states of a robot."""
CONNECT = b"\x10\x11\x00\x04MQTT\x04\x02\x00\x00\x00\x05burst"
"""MQTT 3.1.1, a clean session, no keep-alive, the client `burst`."""
ACCEPTED = b"\x20\x02\x00\x00"


def burst(now_s: float, messages: int = MESSAGES, makers: int = MAKERS) -> bytes:
    """The packets: states of as many robots as makers, again and again up to `now_s`, all within a few metres."""
    packets = []
    for number in range(messages):
        maker, serial = f"Maker{number % makers}", f"{number % makers:05}"
        x_m, y_m = number * 0.618 % 1 * WITHIN_M - 40.0, number * 0.382 % 1 * WITHIN_M
        pose = vda_saying.position(x_m, y_m, mapId=offer.DATUM)
        at_s = now_s - APART_S * ((messages - 1) // makers - number // makers)
        raw = vda_saying.state(at_s, agvPosition=pose, manufacturer=maker, serialNumber=serial, driving=True)
        packets.append(_published(vda_saying.topic("state", serial, maker).encode(), raw))
    return b"".join(packets)


@contextmanager
def bursting(core: int | None = None) -> Iterator[None]:
    """One burst, which begins with the block."""
    spawn = multiprocessing.get_context("spawn")
    made, go = spawn.Event(), spawn.Event()
    process = spawn.Process(target=_run, args=(core, made, go))
    process.start()
    made.wait()
    go.set()
    try:
        yield
    finally:
        process.join()


def _run(core: int | None, made: Event, go: Event) -> None:
    if core is not None:
        os.sched_setaffinity(0, {core})
    packets = burst(time.time())
    made.set()
    go.wait()
    send(packets)


def send(packets: bytes) -> None:
    """Publish them all at once, and stay connected until the broker has taken them."""
    with socket.create_connection(("127.0.0.1", PORT), timeout=60.0) as connection:
        connection.sendall(CONNECT)
        if connection.recv(4) != ACCEPTED:
            raise ConnectionRefusedError("the broker does not accept the attacker")
        connection.sendall(packets)
        connection.shutdown(socket.SHUT_WR)
        while connection.recv(4096):
            time.sleep(0.01)


def broker_is_installed() -> bool:
    """Whether there is a broker to be attacked."""
    return shutil.which("mosquitto", path="/usr/sbin:/usr/local/sbin:/usr/bin") is not None


def _published(topic: bytes, raw: bytes) -> bytes:
    """A packet that publishes without an acknowledgement."""
    body = len(topic).to_bytes(2, "big") + topic + raw
    length, left = b"", len(body)
    while True:
        left, seven = divmod(left, 128)
        length += bytes([seven | (128 if left else 0)])
        if not left:
            return b"\x30" + length + body
