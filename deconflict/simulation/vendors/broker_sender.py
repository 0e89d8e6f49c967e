"""Simulated robots that report to an MQTT broker."""

import asyncio
import json
from pathlib import Path
from typing import Literal

from aiomqtt import Client, MqttError

from deconflict.runtime.rpc import AsyncCaller, LinkDownError
from deconflict.simulation.participants import VendorName
from deconflict.simulation.robot_state import RobotState
from deconflict.simulation.vendors.iso_dialect import IsoRobot
from deconflict.simulation.vendors.vda_dialect import TopicMessage, VdaRobot

MOST_UNSENT = 20_000
"""Messages that wait for a slow broker. Further messages are dropped."""
RETRY_S = 1.0
AT_LEAST_ONCE = 1
ON_BROKERS: dict[VendorName, type[VdaRobot] | type[IsoRobot]] = {
    VendorName.BASALT: VdaRobot,
    VendorName.ALDER: IsoRobot,
}
"""Vendors that report to a broker if there is one, and how."""
LANGUAGES: dict[VendorName, Literal["vda5050", "iso21423"]] = {
    VendorName.BASALT: "vda5050",
    VendorName.ALDER: "iso21423",
}


class BrokerSender:
    """The messages of all robots of one vendor."""

    def __init__(self, vendor: VendorName, host: str = "", port: int = 0) -> None:
        self.vendor = vendor
        self._host, self._port = host, port
        self.introduced: set[int] = set()
        """Rows whose identity was sent on this connection."""
        self.sent = 0
        self.up = False
        self._robots: dict[str, VdaRobot | IsoRobot] = {}
        """By UUID."""
        self._queue: asyncio.Queue[TopicMessage] = asyncio.Queue(MOST_UNSENT)

    def report(self, robot: RobotState, now_s: float, *, introduce: bool) -> None:
        """Queue what a robot says."""
        speaker = self._robots.setdefault(robot.member.uuid, ON_BROKERS[self.vendor]())
        for message in speaker.messages(robot, now_s, introduce=introduce):
            if not self._queue.full():
                self._queue.put_nowait(message)

    async def send(self) -> None:
        """Send queued messages to the broker, again after each lost connection. Ends only when cancelled."""
        while True:
            try:
                async with Client(self._host, self._port) as client:
                    self.introduced.clear()
                    self.up = True
                    await self._send(client)
            except MqttError:
                pass
            finally:
                self.up = False
            await asyncio.sleep(RETRY_S)

    async def _send(self, client: Client) -> None:
        while True:
            message = await self._queue.get()
            qos = AT_LEAST_ONCE if message.is_retained else 0
            await client.publish(message.topic, message.raw, qos, message.is_retained)
            self.sent += 1


class DirectSender(BrokerSender):
    """Hands the messages to the receiver of a service of this machine, without a broker. Its source has the vendor's
    name."""

    def __init__(self, vendor: VendorName, runtime: Path) -> None:
        super().__init__(vendor)
        self._receiver = AsyncCaller(runtime, "receiver")

    async def send(self) -> None:
        while True:
            self.up = True
            messages = [await self._queue.get()]
            while not self._queue.empty():
                messages.append(self._queue.get_nowait())
            lines = [[self.vendor, each.topic, each.raw.decode(), each.is_retained] for each in messages]
            try:
                await self._receiver.call("hear", json.dumps(lines).encode())
                self.sent += len(messages)
            except LinkDownError:
                self.introduced.clear()
                await asyncio.sleep(RETRY_S)
