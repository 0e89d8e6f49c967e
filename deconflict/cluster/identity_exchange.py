"""What robots say of themselves, shared by all ingests: it may come to one of them, and their statuses to another."""

import asyncio
import json
import logging
import time
from collections.abc import Iterator
from math import inf

from deconflict.cluster.nats.bus import Bus
from deconflict.cluster.nats.subscriptions import BUS_ERRORS
from deconflict.runtime.rpc import AsyncCaller, LinkDownError
from ingest.fleet.introductions import Introduction

log = logging.getLogger(__name__)

LOOK_S = 1.0
AGAIN_S = 20.0
"""A robot that still goes without is handed what is known again: it may have been forgotten and have come back."""
AT_ONCE = 200
"""Are told, or handed to a receiver, which has messages to read."""


class Introductions:
    """Those of one ingest."""

    def __init__(self, bus: Bus, receiver: AsyncCaller) -> None:
        self._bus, self._receiver = bus, receiver
        self._told_s, self._renewals = -inf, 0
        """When the newest that was told to the others had arrived, and over which connection."""
        self._known: dict[str, Introduction] = {}
        self._news: dict[str, Introduction] = {}
        """Heard of since the last look."""
        self._handed_s: dict[str, float] = {}
        """When what is known of a robot that goes without was handed to it last."""

    async def run(self) -> None:
        """Hear and tell for ever; while the server or the receiver can't be had, go on trying."""
        await self._bus.hear_introductions(self._hear)
        while True:
            await asyncio.sleep(LOOK_S)
            try:
                await self._tell()
                await self._hand()
            except (LinkDownError, *BUS_ERRORS) as error:
                log.warning("robots' identities wait: %s", error or type(error).__name__)

    def _hear(self, one: Introduction) -> None:
        self._known[one.uuid] = self._news[one.uuid] = one

    async def _tell(self) -> None:
        """Tell the others what is new, or everything where the server may have lost it."""
        if self._renewals != self._bus.renewals:
            self._told_s, self._renewals = -inf, self._bus.renewals
        said = await self._receiver.call("introductions", str(self._told_s).encode())
        told = [Introduction.of_document(one) for one in json.loads(said)]
        for part in parts(told):
            await asyncio.gather(*map(self._bus.introduce, part))
        self._told_s = max((one.arrival_s for one in told), default=self._told_s)

    async def _hand(self) -> None:
        """Hand the receiver what is new, and what is known of robots that go without."""
        now_s = time.monotonic()
        self._handed_s = {uuid: at_s for uuid, at_s in self._handed_s.items() if now_s - at_s < AGAIN_S}
        unidentified = self._known.keys() & json.loads(await self._receiver.call("unidentified"))
        lacking = {uuid: self._known[uuid] for uuid in unidentified - self._handed_s.keys()}
        handed = self._news | lacking
        for part in parts([handed[uuid] for uuid in sorted(handed)]):
            documents = [one.document() for one in part]
            await self._receiver.call("introduce", json.dumps(documents).encode())
        self._news = {uuid: one for uuid, one in self._news.items() if handed.get(uuid) is not one}
        self._handed_s |= dict.fromkeys(lacking, now_s)


def parts(introductions: list[Introduction]) -> Iterator[list[Introduction]]:
    """At most `AT_ONCE` at a time."""
    return (introductions[at : at + AT_ONCE] for at in range(0, len(introductions), AT_ONCE))
