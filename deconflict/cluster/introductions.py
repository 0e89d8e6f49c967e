"""What robots say of themselves, shared by all ingests: it may come to one of them, and their statuses to another."""

import asyncio
import json
import logging
from collections.abc import Iterator
from math import inf

from deconflict.cluster.bus import Bus
from deconflict.cluster.hearing import BUS_ERRORS
from deconflict.link import AsyncCaller, LinkDownError
from ingest.introductions import Introduction

log = logging.getLogger(__name__)

LOOK_S = 1.0
AT_ONCE = 500
"""Are handed to a receiver, which has messages to read."""


class Introductions:
    """Those of one ingest. Each is handed to its receiver once, and again only where the robot goes on without."""

    def __init__(self, bus: Bus, receiver: AsyncCaller) -> None:
        self._bus, self._receiver = bus, receiver
        self._told_s, self._renewals = -inf, 0
        """When the newest that was told to the others had arrived, and over which connection."""
        self._known: dict[str, Introduction] = {}
        self._news: dict[str, Introduction] = {}
        """Heard of since the last look."""
        self._handed: dict[str, Introduction] = {}

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
        for document in json.loads(await self._receiver.call("introductions", str(self._told_s).encode())):
            one = Introduction.of_document(document)
            await self._bus.introduce(one)
            self._told_s = one.arrival_s

    async def _hand(self) -> None:
        """Hand the receiver what is new, and what is known of robots that go without."""
        without = self._known.keys() & json.loads(await self._receiver.call("unidentified"))
        lacking = {uuid: self._known[uuid] for uuid in without if self._handed.get(uuid) is not self._known[uuid]}
        handed = self._news | lacking
        for uuids in batched(sorted(handed)):
            documents = [handed[uuid].document() for uuid in uuids]
            await self._receiver.call("introduce", json.dumps(documents).encode())
        self._news = {uuid: one for uuid, one in self._news.items() if handed.get(uuid) is not one}
        self._handed |= lacking


def batched(uuids: list[str]) -> Iterator[list[str]]:
    """At most `AT_ONCE` at a time."""
    return (uuids[at : at + AT_ONCE] for at in range(0, len(uuids), AT_ONCE))
