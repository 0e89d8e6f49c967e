"""Who belongs to the cluster: each member is noted until it says goodbye or another takes its place, for a day at most.

So a member that died is known, with its host, after its heartbeats have been forgotten, and to faces that start later.
"""

import json
import os
import socket
import time
from contextlib import suppress
from math import inf
from typing import NamedTuple

from nats.aio.msg import Msg
from nats.js.errors import BadRequestError
from nats.js.kv import KV_DEL, KV_OP

from deconflict.cluster.nats.nats_connection import NatsConnection
from deconflict.cluster.nats.shared_state import LEASE_S, SharedState
from deconflict.cluster.nats.subscriptions import BUS_ERRORS, newest_of_each

KEPT_S = 86400.0
"""A member that was not heard of for this long is forgotten."""
NOTE_EVERY_S = 5.0
PARTS = {"feed": "ingest", "engine": "engine", "face": "face"}
"""The part of the service by the first word of a member's name."""


class NotedMember(NamedTuple):
    """A member as it was last heard of."""

    part: str
    host: str
    process: int
    heard_s: float
    """Unix time, `NOTE_EVERY_S` exact."""


def part_of(member: str) -> str:
    """The part of the service that a member is."""
    return PARTS[member.partition("-")[0]]


class MemberRoster:
    """Bucket `NAME-roster`."""

    def __init__(self, connection: NatsConnection, state: SharedState) -> None:
        self._connection, self._state, self._name = connection, state, f"{connection.name}-roster"
        self._member = ""
        """Of this process; empty before its first note."""
        self._noted: dict[str, tuple[int, NotedMember]] = {}
        """By member, the number of its note, and the note."""
        self._noted_s, self._first_s, self._has_joined = -inf, inf, False
        self._began_s = time.time()

    async def ensure(self) -> None:
        """Create the bucket if it does not exist."""
        await self._connection.ensure_bucket("roster", ttl=KEPT_S)
        self._bucket = await self._connection.quick.key_value(self._name)

    async def follow(self) -> None:
        await self._connection.subscribe(f"$KV.{self._name}.*", f"KV_{self._name}", self._on_note, newest_of_each)

    async def _on_note(self, message: Msg) -> None:
        member = message.subject.rsplit(".", 1)[1]
        if message.data:
            self._noted[member] = message.metadata.sequence.stream, NotedMember(*json.loads(message.data))
        else:
            self._noted.pop(member, None)

    async def note(self, member: str) -> None:
        """Note a member that has sent a heartbeat. Once others are known, it takes the place of one that is gone."""
        now_s = time.monotonic()
        if now_s - self._noted_s < NOTE_EVERY_S:
            return
        own = NotedMember(part_of(member), socket.gethostname(), os.getpid(), time.time())
        with suppress(*BUS_ERRORS):
            await self._bucket.put(member, json.dumps(own).encode())
            self._member, self._noted_s, self._first_s = member, now_s, min(self._first_s, now_s)
            if not self._has_joined and now_s - self._first_s > LEASE_S and self._state.knows_members():
                await self._take_place(own)
                self._has_joined = True

    async def _take_place(self, own: NotedMember) -> None:
        """Of a member of the same part that ended before this one began: of this host if there is one, else of the one
        that is gone for longest."""
        gone = [each for each in self._gone() if self._state.last_sent_s(each) < self._began_s]
        alike = [each for each in gone if self._noted[each][1].part == own.part]
        for member in sorted(alike, key=lambda each: self._noted[each][1].host != own.host):
            with suppress(BadRequestError):  # another one has taken it
                await self._bucket.delete(member, last=self._noted[member][0])
                return

    async def leave(self) -> None:
        """Say goodbye for the member of this process: then nobody misses it. Waits for no answer."""
        if self._member:
            await self._connection.client.publish(f"$KV.{self._name}.{self._member}", headers={KV_OP: KV_DEL})

    def gone(self) -> list[NotedMember]:
        """The members that do not work any more and did not say goodbye, the one that was heard last first."""
        return [self._noted[member][1] for member in reversed(self._gone())]

    def _gone(self) -> list[str]:
        since_s, there = time.time() - KEPT_S, self._state.working()
        gone = [each for each, (_, noted) in self._noted.items() if each not in there and noted.heard_s >= since_s]
        return sorted(gone, key=lambda each: self._noted[each][1].heard_s)
