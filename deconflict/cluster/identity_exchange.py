"""What all ingests share of robots: identity reports, since statuses may come to another ingest, given owners, and
which robots are off the floor."""

import asyncio
import json
import logging
import time
from collections.abc import Iterator
from math import inf

import msgspec

from deconflict.cluster.nats.bus import Bus
from deconflict.cluster.nats.subscriptions import BUS_ERRORS
from deconflict.runtime.rpc import AsyncCaller, LinkDownError
from ingest.fleet.shared_identities import SharedIdentity
from ingest.recording.operator_events import OffFloorMark

log = logging.getLogger(__name__)

EXCHANGE_EVERY_S = 1.0
AGAIN_S = 20.0
"""The receiver gets a known report again if the robot still has none: it may have been forgotten and have come back."""
MOST_AT_ONCE = 200
"""Most reports in one call, so that the receiver can read messages in between."""


class IdentityExchange:
    """The exchange between one receiver and the other ingests."""

    def __init__(self, bus: Bus, receiver: AsyncCaller) -> None:
        self._bus, self._receiver = bus, receiver
        self._sent_s, self._renewals = -inf, 0
        """Arrival time of the newest report sent to the others, and the bus's count of reconnects then."""
        self._known: dict[str, SharedIdentity] = {}
        self._new: dict[str, SharedIdentity] = {}
        """Reports of other ingests that the receiver does not have yet."""
        self._given: dict[str, str] = {}
        """Robots that the receiver does not know to be given yet, with their vendors."""
        self._marks: dict[str, OffFloorMark] = {}
        """Robots of which the receiver does not know yet whether they are off the floor."""
        self._returned: list[OffFloorMark] = []
        """Robots that were heard elsewhere here, which the others do not know yet."""
        self._delivered_s: dict[str, float] = {}
        """When the receiver last got the report of an unidentified robot."""

    async def run(self) -> None:
        """Exchange reports without end, also while the server or the receiver does not answer."""
        await self._bus.state.follow_given(self._give)
        await self._bus.state.follow_off_floor(self._mark)
        await self._bus.state.follow_identities(self._add)
        while True:
            await asyncio.sleep(EXCHANGE_EVERY_S)
            try:
                await self._deliver_given()
                await self._exchange_marks()
                await self._send_new()
                await self._deliver()
            except (LinkDownError, *BUS_ERRORS) as error:
                log.warning("identity reports wait: %s", error or type(error).__name__)

    def _give(self, uuid: str, vendor: str) -> None:
        self._given[uuid] = vendor
        for identities in (self._known, self._new):
            if (known := identities.get(uuid)) and known.owner != vendor:
                del identities[uuid]

    def _add(self, shared_identity: SharedIdentity) -> None:
        if not self._bus.state.is_owned(shared_identity):
            return
        self._known[shared_identity.uuid] = self._new[shared_identity.uuid] = shared_identity

    async def _deliver_given(self) -> None:
        for uuid, vendor in list(self._given.items()):
            answer = json.loads(await self._receiver.call("give_robot", json.dumps([uuid, vendor]).encode()))
            if answer["problem"]:
                log.warning("robot %s can't be given to %s here: %s", uuid, vendor, answer["problem"])
            if self._given[uuid] == vendor:
                del self._given[uuid]

    def _mark(self, mark: OffFloorMark) -> None:
        self._marks[mark.uuid] = mark

    async def _exchange_marks(self) -> None:
        """Tell the others which robots came back here, and the receiver what was said of robots elsewhere."""
        self._returned += msgspec.json.decode(await self._receiver.call("take_returned"), type=list[OffFloorMark])
        while self._returned:
            await self._bus.state.mark_off_floor(self._returned[0])
            del self._returned[0]
        for uuid, mark in list(self._marks.items()):
            await self._receiver.call("mark_off_floor", msgspec.json.encode(mark))
            if self._marks[uuid] is mark:
                del self._marks[uuid]

    async def _send_new(self) -> None:
        """Send the receiver's new reports to the others; all of them after a reconnect, which may lose some."""
        if self._renewals != self._bus.renewals:
            self._sent_s, self._renewals = -inf, self._bus.renewals
        answer = await self._receiver.call("shared_identities", str(self._sent_s).encode())
        shared_identities = [SharedIdentity.of_document(document) for document in json.loads(answer)]
        for part in parts(shared_identities):
            await asyncio.gather(*map(self._bus.state.put_identity, part))
        self._sent_s = max((shared_identity.arrival_s for shared_identity in shared_identities), default=self._sent_s)

    async def _deliver(self) -> None:
        """Give the receiver the new reports of others, and the known reports of its unidentified robots."""
        now_s = time.monotonic()
        self._delivered_s = {uuid: at_s for uuid, at_s in self._delivered_s.items() if now_s - at_s < AGAIN_S}
        unidentified = self._known.keys() & json.loads(await self._receiver.call("unidentified"))
        lacking = {uuid: self._known[uuid] for uuid in unidentified - self._delivered_s.keys()}
        delivered = self._new | lacking
        for part in parts([delivered[uuid] for uuid in sorted(delivered)]):
            documents = [shared_identity.document() for shared_identity in part]
            await self._receiver.call("add_identities", json.dumps(documents).encode())
        self._new = {
            uuid: shared_identity
            for uuid, shared_identity in self._new.items()
            if delivered.get(uuid) is not shared_identity
        }
        self._delivered_s |= dict.fromkeys(lacking, now_s)


def parts(shared_identities: list[SharedIdentity]) -> Iterator[list[SharedIdentity]]:
    """Lists of at most `MOST_AT_ONCE` each."""
    return (shared_identities[at : at + MOST_AT_ONCE] for at in range(0, len(shared_identities), MOST_AT_ONCE))
