"""The cluster's use of NATS. Only this folder imports its client.

Parcels of robots are on `NAME.rows.CHANNEL`, in a stream in memory that keeps them for half a minute. The other parts
of the bus are in `revision_stream`, `loss_stream`, `shared_state`, `member_roster` and `ingest_requests`.
"""

from collections.abc import Awaitable, Callable
from typing import Any

from nats.aio.msg import Msg
from nats.js import api

from deconflict.cluster.nats.ingest_requests import IngestRequests
from deconflict.cluster.nats.loss_stream import LossStream
from deconflict.cluster.nats.member_roster import MemberRoster
from deconflict.cluster.nats.nats_connection import NatsConnection
from deconflict.cluster.nats.revision_stream import SAME_S, RevisionStream
from deconflict.cluster.nats.shared_state import SharedState
from deconflict.cluster.nats.subscriptions import since_lately
from deconflict.settings.cluster_settings import Cluster

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
