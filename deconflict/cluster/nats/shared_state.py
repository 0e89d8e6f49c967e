"""Buckets that all members of a cluster share: live members, owners of tiles and robots, learned state, identities."""

import json
import time
from collections import OrderedDict
from collections.abc import Callable
from contextlib import suppress
from math import inf
from typing import Any

import msgspec
from nats.aio.msg import Msg
from nats.js import api
from nats.js.errors import KeyWrongLastSequenceError

from deconflict.cluster.nats.nats_connection import NatsConnection, entry
from deconflict.cluster.nats.subscriptions import newest_of_each
from ingest.fleet.shared_identities import SharedIdentity
from ingest.recording.operator_events import OffFloorMark

LEASE_S = 4.0
"""A member that has sent no heartbeat for this long is gone."""
MOST_REMEMBERED = 1_000
"""Members, also of before, whose last heartbeat is known when it comes again."""
CLOCK_WARNING_S = 5.0
"""A warning is logged if a member's clock differs by more. A heartbeat is received within `LEASE_S`."""
INTRODUCTION_BYTES = 1 << 26
"""Size of the bucket for identity reports: enough for some hundred thousand robots."""
GIVEN_BYTES = 1 << 24
"""Size of the bucket for robots that people gave to a vendor: enough for a hundred thousand."""
FEED = "feed-"
"""Prefix of the names of members that are ingests."""


class SharedState:
    """Buckets `NAME-members`, `NAME-table`, `NAME-learned`, `NAME-introduced`, `NAME-given` and `NAME-off`."""

    def __init__(self, connection: NatsConnection) -> None:
        self._connection, self._name = connection, connection.name
        self._heartbeats: dict[str, tuple[float, dict[str, Any]]] = {}
        """By member, when its last heartbeat came by this machine's clock, and its contents."""
        self._sent_s: OrderedDict[str, float | None] = OrderedDict()
        """By member, when it sent its last heartbeat by its own clock."""
        self._given_to: dict[str, str] = {}
        """By robot that a person gave to a vendor, that vendor."""

    async def ensure(self) -> None:
        """Create the buckets that do not exist, and have as many copies of the others as the site file says."""
        await self._connection.ensure_bucket("members", ttl=LEASE_S, storage=api.StorageType.MEMORY)
        await self._connection.ensure_bucket("table")
        self._learned = await self._connection.ensure_bucket("learned")
        self._introduced = await self._connection.ensure_bucket("introduced", max_bytes=INTRODUCTION_BYTES)
        self._given = await self._connection.ensure_bucket("given", max_bytes=GIVEN_BYTES)
        self._off = await self._connection.ensure_bucket("off", max_bytes=GIVEN_BYTES)
        self._table = await self._connection.quick.key_value(f"{self._name}-table")

    async def follow_members(self) -> None:
        bucket = f"{self._name}-members"
        await self._connection.subscribe(f"$KV.{bucket}.*", f"KV_{bucket}", self._on_heartbeat, newest_of_each)

    async def beat(self, member: str, document: dict[str, Any]) -> None:
        """Send a member's heartbeat, with a document for the other members."""
        data = json.dumps(document | {"at_s": time.time()}).encode()
        await self._connection.quick.publish(f"$KV.{self._name}-members.{member}", data)
        self._connection.answered_s = time.monotonic()

    def members(self) -> dict[str, dict[str, Any]]:
        """The last document of every member that has sent a heartbeat within `LEASE_S`."""
        since_s = time.monotonic() - LEASE_S
        self._heartbeats = {
            member: heartbeat for member, heartbeat in self._heartbeats.items() if heartbeat[0] >= since_s
        }
        return {member: document for member, (_, document) in self._heartbeats.items()}

    def last_sent_s(self, member: str) -> float:
        """When a member sent the last heartbeat that is known, Unix time by its own clock; -inf if none is."""
        return self._sent_s.get(member) or -inf

    def working(self) -> set[str]:
        """The members that do their work: not an ingest whose receiver does not answer."""
        return {member for member, document in self.members().items() if document.get("receives", True)}

    def ingests(self) -> set[str]:
        """The members that are ingests."""
        return {member for member in self.members() if member.startswith(FEED)}

    def is_cut_off(self) -> bool:
        """Whether no server has been connected for a while."""
        return self._connection.is_cut_off()

    def knows_members(self) -> bool:
        """Whether every live member has had the time to send a heartbeat since the last reconnect."""
        return not self._connection.is_lost() and time.monotonic() - self._connection.renewed_s > LEASE_S

    async def _on_heartbeat(self, message: Msg) -> None:
        member, document = message.subject.rsplit(".", 1)[1], json.loads(message.data or b"{}")
        if document.get("at_s") == self._sent_s.get(member):  # a server that leads from now on sends it again
            return
        self._sent_s[member] = document.get("at_s")
        self._sent_s.move_to_end(member)
        while len(self._sent_s) > MOST_REMEMBERED:
            self._sent_s.popitem(last=False)
        self._heartbeats[member] = time.monotonic(), document
        off_s = document.get("at_s", now_s := time.time()) - now_s
        if abs(off_s) > CLOCK_WARNING_S:
            self._connection.warn(
                f"the clock of {member} differs by {off_s:.0f} s from this machine's; synchronise both by NTP"
            )

    async def keep(self, name: str, data: bytes) -> None:
        """Keep learned state for members that start later. Data that is too large for the server is not kept."""
        if self._connection.fits(name, data):
            await self._learned.put(name, data)

    async def kept(self, name: str) -> bytes | None:
        """The learned state under a name; None if there is none."""
        return (await entry(self._learned, name))[1]

    async def give(self, uuid: str, vendor: str) -> None:
        """Let a robot belong to a vendor. The identity report that others sent of it is removed."""
        await self._given.put(uuid, vendor.encode())
        bucket = f"{self._name}-introduced"
        await self._connection.js.purge_stream(f"KV_{bucket}", subject=f"$KV.{bucket}.{uuid}")

    async def follow_given(self, receive: Callable[[str, str], None]) -> None:
        """Receive each robot that was given to a vendor, with the vendor, and then each new one."""

        async def on_message(message: Msg) -> None:
            uuid, vendor = message.subject.rsplit(".", 1)[1], message.data.decode()
            self._given_to[uuid] = vendor
            receive(uuid, vendor)

        bucket = f"{self._name}-given"
        await self._connection.subscribe(f"$KV.{bucket}.*", f"KV_{bucket}", on_message, newest_of_each)

    async def mark_off_floor(self, mark: OffFloorMark) -> OffFloorMark:
        """Let a robot be off the floor, or on it, for all ingests. The first mark counts until it is taken back, so
        this returns which holds."""
        while True:
            last, kept = await entry(self._off, mark.uuid)
            before = msgspec.json.decode(kept, type=OffFloorMark) if kept else None
            if before and before.is_off and (mark.is_off or mark.at_s < before.at_s):
                return before
            with suppress(KeyWrongLastSequenceError):
                await self._off.update(mark.uuid, msgspec.json.encode(mark), last=last)
                return mark

    async def follow_off_floor(self, receive: Callable[[OffFloorMark], None]) -> None:
        """Receive the last mark of each robot, and then each new one."""

        async def on_message(message: Msg) -> None:
            receive(msgspec.json.decode(message.data, type=OffFloorMark))

        bucket = f"{self._name}-off"
        await self._connection.subscribe(f"$KV.{bucket}.*", f"KV_{bucket}", on_message, newest_of_each)

    def is_owned(self, shared_identity: SharedIdentity) -> bool:
        """Whether the robot was given to no other vendor than that of its identity report."""
        return self._given_to.get(shared_identity.uuid, shared_identity.owner) == shared_identity.owner

    async def put_identity(self, shared_identity: SharedIdentity) -> None:
        """Keep a robot's identity report, unless the bucket has it, a newer one, or another vendor's."""
        if not self.is_owned(shared_identity):
            return
        data = json.dumps(shared_identity.document()).encode()
        while self._connection.fits(shared_identity.uuid, data):
            last, kept = await entry(self._introduced, shared_identity.uuid)
            if not shared_identity.is_news_to(SharedIdentity.of_document(json.loads(kept)) if kept else None):
                return
            with suppress(KeyWrongLastSequenceError):
                await self._introduced.update(shared_identity.uuid, data, last=last)
                return

    async def follow_identities(self, receive: Callable[[SharedIdentity], None]) -> None:
        """Receive the last identity report of each robot, and then each new one."""

        async def on_message(message: Msg) -> None:
            if message.data:
                receive(SharedIdentity.of_document(json.loads(message.data)))

        bucket = f"{self._name}-introduced"
        await self._connection.subscribe(f"$KV.{bucket}.*", f"KV_{bucket}", on_message, newest_of_each)

    async def table(self) -> tuple[int, dict[str, Any] | None]:
        """The revision number and the document of the owner table; 0 and None if there is none."""
        last, data = await entry(self._table, "table")
        return last, json.loads(data or b"null")

    async def write_table(self, document: dict[str, Any], last: int) -> bool:
        """Replace the owner table of revision `last`. False if it has changed in the meantime."""
        try:
            await self._table.update("table", json.dumps(document).encode(), last=last)
        except KeyWrongLastSequenceError:
            return False
        return True
