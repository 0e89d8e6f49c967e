"""Carries advice to robots of VDA 5050: a robot that should wait is paused, and goes on once the advice has ended.

    python examples/vda5050_carrier.py http://127.0.0.1:8080 --broker 127.0.0.1:1883 --vendor Siemens

Run it as a part of the fleet control, or with its consent: it sends `startPause` and `stopPause` as instant actions.
It answers for the robots of one vendor: `wait_before` is accepted, everything else is declined, since only the fleet
control changes orders. `DECONFLICT_TOKEN` is the token of a person with the role `answer` and this vendor, if the site
uses them. If it ends, the robots that it has paused go on. If it is killed, the fleet control has to let them go on.
"""

import argparse
import asyncio
import json
import os
import signal
from collections.abc import Set
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from itertools import count
from uuid import uuid4

from aiomqtt import Client as Broker

from deconflict_client.advisory import AdvisoryState
from deconflict_client.advisory.robot_advice import RobotAdvice
from deconflict_client.client import Client, ClientError, PositionLostError
from ingest.languages.vda5050.vda_front_end import robot_uuid

VERSION, PREFIX = "2.0.0", "uagv/v2"
HEARD_WITHIN_S = 2.0


class Carrier:
    """The robots of one vendor at one broker, and those that are paused."""

    def __init__(self, service: Client, broker: Broker, vendor: str) -> None:
        self._service, self._broker, self._vendor = service, broker, vendor
        self._robots: dict[str, tuple[str, str]] = {}
        """By UUID, manufacturer and serial number of the robots that were heard."""
        self._pausing: dict[str, str] = {}
        """By id of advice, the robot that it pauses."""
        self._ending: dict[str, asyncio.Task[None]] = {}
        """By id of advice, what lets its robot go on at the latest."""
        self._header_ids, self._news = count(), asyncio.Condition()

    async def hear(self) -> None:
        """Learn which robots there are, from the topics of their connections, which brokers retain."""
        await self._broker.subscribe(f"{PREFIX}/+/+/connection")
        async for message in self._broker.messages:
            *_, manufacturer, serial, _ = message.topic.value.split("/")
            async with self._news:
                self._robots[robot_uuid(manufacturer, serial)] = manufacturer, serial
                self._news.notify_all()

    async def _is_heard(self, robot: str) -> bool:
        """Whether a robot is at this broker. Waits a moment: its connection may be on its way."""
        with suppress(TimeoutError):
            async with asyncio.timeout(HEARD_WITHIN_S), self._news:
                await self._news.wait_for(lambda: robot in self._robots)
        return robot in self._robots

    async def follow(self) -> None:
        """Carry advice, until cancelled."""
        while True:
            with suppress(PositionLostError):
                listing = await self._service.advice(self._vendor)
                await self.end(kept={advice.id for advice in listing.advice})
                for advice in listing.advice:
                    await self._carry(advice)
                async for revision in self._service.follow(listing.seq, ["advice"]):
                    if isinstance(revision, RobotAdvice) and revision.vendor == self._vendor:
                        await self._carry(revision)

    async def end(self, kept: Set[str] = frozenset()) -> None:
        """Let robots go on that are paused, but for the advice whose ids are `kept`."""
        for advice_id in self._pausing.keys() - kept:
            await self._go_on(advice_id)

    async def _carry(self, advice: RobotAdvice) -> None:
        if advice.state is AdvisoryState.CLEARED:
            await self._go_on(advice.id)
        elif not advice.acknowledgement:
            await self._answer(advice)

    async def _answer(self, advice: RobotAdvice) -> None:
        why = ""
        if advice.verb != "wait_before":
            why = "cannot: only the fleet control changes orders"
        elif not await self._is_heard(advice.robot):
            why = "busy: it is not at this broker"
        with suppress(ClientError):  # it has ended meanwhile
            await self._service.answer(advice.id, "declined" if why else "accepted", why=why, name="carrier")
            if not why:
                self._pausing[advice.id] = advice.robot
                await self._send(advice.robot, "startPause")
                self._ending[advice.id] = asyncio.create_task(
                    self._go_on_after(advice.latest_at - advice.raised_at, advice.id)
                )

    async def _go_on_after(self, time: timedelta, advice_id: str) -> None:
        """Let a robot go on once its advice has lapsed, also if the service does not say so any more."""
        await asyncio.sleep(time.total_seconds())
        await self._go_on(advice_id)

    async def _go_on(self, advice_id: str) -> None:
        robot, ending = self._pausing.pop(advice_id, None), self._ending.pop(advice_id, None)
        if ending and ending is not asyncio.current_task():
            ending.cancel()
        if robot and robot not in self._pausing.values():
            await self._send(robot, "stopPause")

    async def _send(self, robot: str, action: str) -> None:
        manufacturer, serial = self._robots[robot]
        actions = [{"actionType": action, "actionId": str(uuid4()), "blockingType": "HARD"}]
        instant = {
            "headerId": next(self._header_ids),
            "timestamp": datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z"),
            "version": VERSION,
            "manufacturer": manufacturer,
            "serialNumber": serial,
            "actions": actions,
            "instantActions": actions,  # the key of version 1.1, which many robots of 2.0 still read
        }
        await self._broker.publish(f"{PREFIX}/{manufacturer}/{serial}/instantActions", json.dumps(instant), 1)


async def run(url: str, host: str, port: int, vendor: str) -> None:
    token = os.environ.get("DECONFLICT_TOKEN")
    async with Client(url, token=token) as service, Broker(host, port) as broker:
        carrier = Carrier(service, broker, vendor)
        carrying = asyncio.gather(carrier.hear(), carrier.follow())
        asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, carrying.cancel)
        try:
            with suppress(asyncio.CancelledError):
                await carrying
        finally:
            await carrier.end()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Pauses robots of VDA 5050 that advice lets wait.")
    parser.add_argument("url", help="of the service, such as http://127.0.0.1:8080")
    parser.add_argument("--broker", default="127.0.0.1:1883", help="HOST:PORT of the robots' broker")
    parser.add_argument("--vendor", required=True, help="the vendor for whose robots it answers")
    given = parser.parse_args()
    broker_host, _, broker_port = given.broker.rpartition(":")
    asyncio.run(run(given.url, broker_host, int(broker_port), given.vendor))
