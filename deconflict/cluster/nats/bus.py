"""The cluster's use of NATS. Only this folder imports its client.

Parcels of robots are on `NAME.rows.CHANNEL`, in a stream in memory that keeps them for half a minute. Requests
go to all ingests: questions of operator faces, and requests of engines for all robots of some channels. The other parts
of the bus are in `revision_stream`, `loss_stream`, `shared_state` and `member_roster`.
"""

import asyncio
import json
from collections.abc import Awaitable, Callable, Iterable
from contextlib import suppress
from typing import Any

from nats.aio.msg import Msg
from nats.js import api

from deconflict.cluster.nats.loss_stream import LossStream
from deconflict.cluster.nats.member_roster import MemberRoster
from deconflict.cluster.nats.nats_connection import NatsConnection
from deconflict.cluster.nats.revision_stream import SAME_S, RevisionStream
from deconflict.cluster.nats.shared_state import SharedState
from deconflict.cluster.nats.subscriptions import BUS_ERRORS, MOST_PENDING_BYTES, MOST_PENDING_MESSAGES, since_lately
from deconflict.cluster.tiles.tile_channels import MOST_BYTES
from deconflict.settings.cluster_settings import Cluster


class IngestRequests:
    """Questions go to `NAME.ask`, requests for robots to `NAME.want`. Answers come to an inbox."""

    def __init__(self, connection: NatsConnection, state: SharedState) -> None:
        self._connection, self._state, self._name = connection, state, connection.name

    async def open_inbox(self, receive: Callable[[bytes], None]) -> str:
        """Receive the answers to `request_robots`; returns the address of the inbox."""
        address = self._connection.client.new_inbox()

        async def on_message(message: Msg) -> None:
            if message.data:  # it is empty if nobody answers
                receive(message.data)

        await self._connection.client.subscribe(
            address,
            cb=on_message,
            pending_msgs_limit=MOST_PENDING_MESSAGES,
            pending_bytes_limit=MOST_PENDING_BYTES,
        )
        return address

    async def request_robots(self, channels: Iterable[str], inbox: str) -> None:
        """Request all robots of some channels from every ingest. The parcels come to `inbox`."""
        data = json.dumps(sorted(channels)).encode()
        await self._connection.client.publish(f"{self._name}.want", data, reply=inbox)

    async def serve_robots(self, parcels_of: Callable[[set[str]], Awaitable[list[bytes]]]) -> None:
        """Answer `request_robots`. `parcels_of` gives the parcels of some channels."""

        async def on_request(message: Msg) -> None:
            for parcel in await parcels_of(set(json.loads(message.data))):
                await self._connection.client.publish(message.reply, parcel)

        await self._connection.client.subscribe(f"{self._name}.want", cb=on_request)

    async def ask(self, question: str, within_s: float) -> list[bytes]:
        """The answers of all ingests that come in time, ordered by name."""
        expected = self._state.ingests()
        parts: dict[str, list[bytes]] = {ingest: [] for ingest in expected}
        answers: dict[str, bytes] = {}
        complete = asyncio.Event()

        async def on_answer(message: Msg) -> None:
            headers = message.headers or {}
            if (ingest := headers.get("From", "")) in expected:
                parts[ingest].append(message.data)
                if len(parts[ingest]) == int(headers["Parts"]):
                    answers[ingest] = b"".join(parts[ingest])
            if answers.keys() == expected:
                complete.set()

        client = self._connection.client
        address = client.new_inbox()
        subscription = await client.subscribe(address, cb=on_answer, pending_bytes_limit=MOST_PENDING_BYTES)
        try:
            await client.publish(f"{self._name}.ask", question.encode(), reply=address)
            with suppress(TimeoutError):
                async with asyncio.timeout(within_s if expected else 0):
                    await complete.wait()
        finally:
            with suppress(*BUS_ERRORS):
                await subscription.unsubscribe()
        return [answers[ingest] for ingest in sorted(answers) if answers[ingest]]

    async def serve_questions(self, ingest: str, answer_to: Callable[[str], Awaitable[bytes]]) -> None:
        """Answer `ask` in the name of an ingest. An empty answer means that it has none."""

        async def on_question(message: Msg) -> None:
            answer = await answer_to(message.data.decode())
            parts = [answer[at : at + MOST_BYTES] for at in range(0, len(answer), MOST_BYTES)] or [b""]
            for part in parts:
                headers = {"From": ingest, "Parts": str(len(parts))}
                await self._connection.client.publish(message.reply, part, headers=headers)

        await self._connection.client.subscribe(f"{self._name}.ask", cb=on_question)


KEPT_S = 30.0
"""How long parcels are kept."""


class Bus:
    """One member's access to the cluster. Calls raise one of `BUS_ERRORS` while no server answers."""

    def __init__(self, settings: Cluster, keep_days: float) -> None:
        """Raises `SecretError` and `CertificateError`."""
        self.name = settings.name
        self.connection = NatsConnection(settings)
        self.revisions = RevisionStream(self.connection, keep_days)
        self.losses = LossStream(self.connection)
        self.state = SharedState(self.connection)
        self.roster = MemberRoster(self.connection, self.state)
        self.requests = IngestRequests(self.connection, self.state)

    @property
    def renewals(self) -> int:
        """Number of reconnects. Messages in flight at a reconnect may be lost."""
        return self.connection.renewals

    async def open(self) -> None:
        """Connect, and create the streams and buckets that do not exist."""
        await self.connection.connect()
        try:
            await self._ensure()
            await self.state.follow_members()
            await self.roster.follow()
        except BaseException:
            await self.close()
            raise
        self.connection.renew_after_reconnects(self._restore)

    async def close(self) -> None:
        await self.connection.close()

    async def _restore(self) -> None:
        """Create again what a restarted server has lost, and check that the revisions are still the same."""
        await self._ensure()
        await self.revisions.check()
        await self.losses.check()

    async def _ensure(self) -> None:
        subjects = [f"{self.name}.rows.>"]
        await self.connection.ensure_stream("rows", subjects, api.StorageType.MEMORY, KEPT_S, SAME_S / 10)
        await self.revisions.ensure()
        await self.losses.ensure()
        await self.state.ensure()
        await self.roster.ensure()

    async def beat(self, member: str, document: dict[str, Any]) -> None:
        """Send a member's heartbeat, with a document for the other members."""
        await self.state.beat(member, document)
        await self.roster.note(member)

    async def send_parcel(self, channel: str, parcel: bytes) -> None:
        """Send one part of a batch, without a wait for an answer."""
        await self.connection.client.publish(f"{self.name}.rows.{channel}", parcel)

    async def follow_channel(self, channel: str, receive: Callable[[bytes], None]) -> Callable[[], Awaitable[None]]:
        """Receive the parcels of a channel, first those of the last seconds. Returns a function that ends it."""

        async def on_message(message: Msg) -> None:
            receive(message.data)

        subject = f"{self.name}.rows.{channel}"
        subscription, _ = await self.connection.subscribe(subject, f"{self.name}-rows", on_message, since_lately)

        async def leave() -> None:
            await self.connection.unsubscribe(subscription)

        return leave
