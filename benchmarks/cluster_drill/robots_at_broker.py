"""Robots of pairs that report through a broker, in VDA 5050 or ISO 21423."""

import asyncio
import ssl
import time
from collections.abc import Iterator, Sequence
from multiprocessing.synchronize import Event
from typing import Any

from aiomqtt import Client, MqttError

from benchmarks.cluster_drill.crossing_pairs import ISO, PATH_S, REPORTS_A_SECOND, SPEED_MPS, VDA, CrossingPair
from tests.helpers import iso_saying, vda_saying
from tests.helpers.saying import HALL

Messages = Iterator[tuple[str, bytes]]
RETRY_S = 0.5
ISO_MAP = f'"{iso_saying.CCS}"'.encode()


async def report_at_broker(port: int, pairs: Sequence[CrossingPair], start_s: float, ca: str, stop: Event) -> None:
    """All robots of pairs that speak one of the two languages report until the end."""
    trusted = ssl.create_default_context(cafile=ca)
    robots = [(pair, side) for pair in pairs for side in (0, 1) if pair.languages[side] in (VDA, ISO)]
    while robots and not stop.is_set():
        try:
            async with Client("127.0.0.1", port, tls_context=trusted) as client:
                await _report(client, robots, start_s, stop)
        except MqttError:
            await asyncio.sleep(RETRY_S)


async def _report(client: Client, robots: list[tuple[CrossingPair, int]], start_s: float, stop: Event) -> None:
    for pair, side in robots:
        topic, raw = _introduction(pair, side)
        await client.publish(topic, raw, 1, retain=True)
    legs: dict[tuple[int, int], int] = {}
    while not stop.is_set():
        for pair, side in robots:
            t_s = time.time() - start_s
            messages, leg = (_iso if pair.languages[side] == ISO else _vda), pair.leg(t_s)
            is_new = legs.get((pair.number, side)) != leg
            legs[pair.number, side] = leg
            for topic, raw in messages(pair, side, start_s, t_s, is_new):
                await client.publish(topic, raw, 1)
        await asyncio.sleep(1 / REPORTS_A_SECOND)


def _introduction(pair: CrossingPair, side: int) -> tuple[str, bytes]:
    """What the broker retains of a robot: its size and name."""
    now_s, name = time.time(), pair.name(side)
    if pair.languages[side] == ISO:
        raw = iso_saying.identity(now_s, imrSerialNumber=name).replace(
            iso_saying.ROBOT.encode(), pair.uuid(side).encode()
        )
        return iso_saying.topic("identity", pair.uuid(side)), raw
    return vda_saying.topic("factsheet", name), vda_saying.factsheet(now_s, serialNumber=name)


def _vda(pair: CrossingPair, side: int, start_s: float, t_s: float, is_new_leg: bool) -> Messages:
    """A state; at the begin of a leg an order before it, which nobody retains."""
    name, leg, now_s = pair.name(side), pair.leg(t_s), start_s + t_s
    ends = [pair.end_of_leg(side, leg, is_last) for is_last in (False, True)]
    places = [{"x": x, "y": y, "mapId": HALL} for x, y, _ in ends]
    nodes = [vda_saying.node(number, 0.0, nodePosition=place) for number, place in enumerate(places)]
    keys: dict[str, Any] = {"serialNumber": name, "orderId": f"leg {leg}"}
    if is_new_leg:
        yield vda_saying.topic("order", name), vda_saying.order(now_s, nodes, **keys)
    x, y, yaw = pair.pose(side, t_s)
    pose = vda_saying.position(x, y, yaw, mapId=HALL)
    velocity = {"vx": SPEED_MPS, "vy": 0.0, "omega": 0.0}
    state = vda_saying.under_way(now_s, x, y, nodes[1:], agvPosition=pose, velocity=velocity, **keys)
    yield vda_saying.topic("state", name), state


def _iso(pair: CrossingPair, side: int, start_s: float, t_s: float, is_new_leg: bool) -> Messages:
    """An odometry and a trajectory; at the begin of a leg the mode before them."""
    uuid, now_s = pair.uuid(side), start_s + t_s
    ahead = [(now_s + i, *pair.pose(side, t_s + i)[:2]) for i in range(1, PATH_S + 1)]
    messages = {
        "odometry": iso_saying.odometry(now_s, *pair.pose(side, t_s), SPEED_MPS),
        "localTrajectory": iso_saying.trajectory(now_s, *ahead),
    }
    if is_new_leg:
        yield iso_saying.topic("status", uuid), iso_saying.states(now_s, "MODE_AUTO", "FORWARD")
    for resource, raw in messages.items():
        yield iso_saying.topic(resource, uuid), raw.replace(ISO_MAP, f'"{HALL}"'.encode())
