"""The durable stream of revisions and answers. Its sequence numbers are those of the advisories."""

import logging
from collections.abc import Callable
from contextlib import suppress
from uuid import uuid4

from nats.aio.msg import Msg
from nats.errors import MaxPayloadError
from nats.js import api
from nats.js.errors import APIError, NotFoundError

from deconflict.cluster.nats.nats_connection import NatsConnection
from deconflict.cluster.nats.stream_records import StreamPosition, StreamRecord, key_of, read_record, record_bytes
from deconflict.cluster.nats.subscriptions import newest_of_each
from deconflict_client.advisory import Acknowledgement
from deconflict_client.situations import AnyRevision
from ingest.batch import FloorPoint

log = logging.getLogger(__name__)

SAME_S = 120.0
"""The server recognises a revision that is sent again within this time, and stores it once."""
WRONG_LAST_SEQUENCE, NO_MESSAGE = 10071, 10037


class OverruledError(Exception):
    """Another engine has written under that key in the meantime."""


class UnwritableRevisionError(Exception):
    """No server would accept a revision, or nobody could read it."""


class RevisionStream:
    """Revisions are on `NAME.told.KEY`, answers on `NAME.answer.ID`."""

    def __init__(self, connection: NatsConnection, keep_days: float) -> None:
        self._connection, self._name = connection, connection.name
        self.kept_s = 86400 * keep_days
        """How long the stream keeps a revision."""
        self.replacements = 0
        """How often the stream turned out to be another one, or to have lost its end."""
        self._writer = uuid4().hex
        """Part of message ids. The server ignores a message with a known id, whatever it contains."""
        self._position: StreamPosition | None = None
        """The last record that was received."""

    def warn(self, text: str) -> None:
        """As of `NatsConnection`."""
        self._connection.warn(text)

    async def ensure(self) -> None:
        """Create the stream if it does not exist."""
        subjects = [f"{self._name}.told.*", f"{self._name}.answer.*"]
        await self._connection.ensure_stream("told", subjects, api.StorageType.FILE, self.kept_s, SAME_S)

    async def check(self) -> None:
        """After a reconnect: notice a stream that is another one, or has lost its end."""
        if self._position and not await self.continues_from(self._position):
            log.error("%s: the NATS servers have lost revisions that they had, or are others", self._name)
            self._position, self.replacements = None, self.replacements + 1

    async def continues_from(self, position: StreamPosition) -> bool:
        """Whether the stream is the one of this position, and has everything after it."""
        if not position.seq:
            return True
        stream = f"{self._name}-told"
        with suppress(NotFoundError):
            if position.id:
                found = await self._connection.js.get_msg(stream, position.seq)
                return read_record(position.seq, found.subject or "", found.data or b"").is_at(position)
        state = (await self._connection.js.stream_info(stream)).state
        return state.first_seq <= position.seq + 1 <= state.last_seq + 1

    async def write(self, home: FloorPoint | None, advisory: AnyRevision, last_seq: int, *, again: bool = False) -> int:
        """Write a revision and return its number. `again` writes a stored revision once more, under a new number.

        Raises `OverruledError` if the last revision under its key is not number `last_seq`, and
        `UnwritableRevisionError`.
        """
        headers = {"Nats-Expected-Last-Subject-Sequence": str(last_seq)}
        if not again:
            headers["Nats-Msg-Id"] = f"{self._writer}:{advisory.id}:{advisory.revision}"
        subject = f"{self._name}.told.{key_of(advisory)}"
        try:
            data = record_bytes(home, advisory)
            read_record(0, subject, data)
            stored = await self._connection.js.publish(subject, data, headers=headers)
        except (ValueError, MaxPayloadError) as error:
            raise UnwritableRevisionError(error or type(error).__name__) from error
        except APIError as error:
            if error.err_code == WRONG_LAST_SEQUENCE:
                raise OverruledError from error
            raise
        return stored.seq

    async def last(self, key: str) -> StreamRecord | None:
        """The newest revision under a key; None if the stream has none."""
        try:
            found = await self._connection.js.get_last_msg(f"{self._name}-told", f"{self._name}.told.{key}")
        except NotFoundError as error:
            if error.err_code == NO_MESSAGE:
                return None
            raise
        return read_record(found.seq or 0, found.subject or "", found.data or b"")

    async def write_answer(self, advisory_id: str, answer: Acknowledgement) -> int:
        """Write an answer and return its number."""
        data = answer.model_dump_json().encode()
        return (await self._connection.js.publish(f"{self._name}.answer.{advisory_id}", data)).seq

    async def follow(self, receive: Callable[[StreamRecord], None], after: StreamPosition | None = None) -> int:
        """Receive the records after a position; without one, first the newest revision of each key, and no answers.

        Returns how many records are there already. If the stream turns out to be another one, this continues from its
        beginning, after `replacements` has risen.
        """
        self._position = after

        async def on_message(message: Msg) -> None:
            seq = message.metadata.sequence.stream
            if self._position is None or seq > self._position.seq:
                try:
                    record = read_record(seq, message.subject, message.data)
                except ValueError as error:
                    log.error("record %d of %s can't be read and is left out: %s", seq, self._name, error)
                    return
                self._position = record.position()
                receive(record)

        def config() -> api.ConsumerConfig:
            if after is None and self._position is None:
                return newest_of_each()
            first = self._position.seq + 1 if self._position else 1
            return api.ConsumerConfig(deliver_policy=api.DeliverPolicy.BY_START_SEQUENCE, opt_start_seq=first)

        subject = f"{self._name}.told.*" if after is None else f"{self._name}.>"
        _, waiting = await self._connection.subscribe(subject, f"{self._name}-told", on_message, config)
        return waiting
