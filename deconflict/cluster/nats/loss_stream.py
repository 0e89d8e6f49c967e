"""The durable stream of losses. Engines write those of their tiles, and each operator face adds all to its ledger."""

import json
from collections.abc import Callable, Sequence
from uuid import uuid4

from nats.aio.msg import Msg
from nats.js import api

from deconflict.cluster.nats.nats_connection import NatsConnection
from deconflict.cluster.nats.revision_stream import SAME_S
from deconflict.operator.ledger.loss_ledger import LedgerEntry, LossParcel

KEPT_S = 2 * 86400.0
"""An operator face that was down for longer misses losses."""


class LossStream:
    """Losses are on `NAME.lost.WRITER`, those of one pass in one message."""

    def __init__(self, connection: NatsConnection) -> None:
        self._connection, self._stream = connection, f"{connection.name}-lost"
        self._subject = f"{connection.name}.lost"
        self._writer, self._written = uuid4().hex, 0
        self._sender, self._number = "", 0
        """The stream that is followed, and the number of its last message that was received."""

    async def ensure(self) -> None:
        """Create the stream if it does not exist."""
        await self._connection.ensure_stream("lost", [f"{self._subject}.*"], api.StorageType.FILE, KEPT_S, SAME_S)

    async def check(self) -> None:
        """After a reconnect: begin anew if the stream is another one. Raises one of `BUS_ERRORS`."""
        if self._sender and (sender := await self._identity()) != self._sender:
            self._sender, self._number = sender, 0

    def next_id(self) -> str:
        """An id for a message. A message that is written twice under its id is stored once."""
        self._written += 1
        return f"{self._writer}:{self._written}"

    async def write(self, message_id: str, entries: Sequence[LedgerEntry]) -> None:
        """Raises one of `BUS_ERRORS`."""
        headers = {"Nats-Msg-Id": message_id}
        data = json.dumps(entries).encode()
        await self._connection.js.publish(f"{self._subject}.{self._writer}", data, headers=headers)

    async def follow(self, receive: Callable[[LossParcel], None], sender: str, number: int) -> None:
        """Receive the losses after message `number` of the stream `sender`; all, if the stream is another one.

        Each message is a parcel. A stream that was created anew is another sender.
        """
        self._sender = await self._identity()
        self._number = number if sender == self._sender else 0

        async def on_message(message: Msg) -> None:
            number = message.metadata.sequence.stream
            if number > self._number:
                self._number = number
                receive(LossParcel(self._sender, number, [LedgerEntry(*entry) for entry in json.loads(message.data)]))

        def config() -> api.ConsumerConfig:
            policy = api.DeliverPolicy.BY_START_SEQUENCE
            return api.ConsumerConfig(deliver_policy=policy, opt_start_seq=self._number + 1)

        await self._connection.subscribe(f"{self._subject}.*", self._stream, on_message, config)

    async def _identity(self) -> str:
        created = (await self._connection.js.stream_info(self._stream)).created
        return f"{self._stream} {created}"
