"""The open situations and advisories as retained messages of an MQTT broker.

`TOPIC/situations/ID` has the newest revision while the situation is open, `TOPIC/advisories/ID` that of an advisory,
`TOPIC/advice/ID` that of advice.
The clearing revision is sent without retain, and then the topic is emptied. `TOPIC/service` has "online", or "offline",
which the broker sets by itself (last will).
"""

import asyncio
from collections.abc import AsyncIterator, Mapping
from contextlib import suppress
from typing import NamedTuple

from aiomqtt import Client, MqttError, Will

from deconflict.operator.outlets.store_cursor import StoreCursor, is_being_cancelled
from deconflict.operator.store.publisher import PublishedLine
from deconflict.operator.store.store import Store, StoreError
from deconflict.operator.store.tables import StoredDocument
from deconflict.runtime.until_either import until_either
from deconflict.settings.outlet_settings import Mqtt
from deconflict_client.advisory import ADVICE, EVERY_KIND, SITUATION, AdvisoryState
from deconflict_client.situations import REVISION
from ingest.security.certificates import CertificateError, client_context
from ingest.security.tokens import SecretError, renewed

TOPICS = {SITUATION: "situations", ADVICE: "advice"}
"""By kind; of every other kind `advisories`."""
AT_LEAST_ONCE = 1
MOST_AT_ONCE = 500
"""Open situations and advisories that are read at once."""
GOODBYE_S = 2.0
"""Longest wait for a broker's answer to the goodbye, and again for its answer to the disconnect."""


class MqttMessage(NamedTuple):
    """One message to the broker."""

    topic: str
    payload: str | None
    retain: bool


class MqttOutlet:
    """Keeps a broker's retained messages up to date, and refreshes them after each connect."""

    def __init__(
        self, settings: Mqtt, cursor: StoreCursor, store: Store, known: Mapping[str, str] | None = None
    ) -> None:
        """`known` are the secrets in use, by source."""
        self._settings, self._cursor, self._store = settings, cursor, store
        self._password = (
            renewed(settings.password, (known or {}).get(settings.password, "")) if settings.password else None
        )
        """Empty while it has never been read: the broker is not asked then."""
        self._are_others_removed = False
        """Whether the topics of other kinds have been emptied."""

    @property
    def secrets(self) -> dict[str, str]:
        return {self._settings.password: self._password} if self._password else {}

    def refresh(self) -> None:
        """Read the password again; the next connection uses it."""
        if self._password is not None:
            self._password = renewed(self._settings.password, self._password)

    async def run(self) -> None:
        """Send revisions until cancelled."""
        await self._cursor.begin()
        wait_s, longest_s = self._settings.retry_s
        while True:
            before = self._cursor.seq
            try:
                await self._run_connection()
            except (MqttError, StoreError, OSError, CertificateError, SecretError) as error:
                if is_being_cancelled():
                    return
                self._cursor.failed(str(error))
            if self._cursor.seq > before:
                wait_s = self._settings.retry_s[0]
            await asyncio.sleep(wait_s)
            wait_s = min(2 * wait_s, longest_s)

    async def _run_connection(self) -> None:
        """Connect, and send revisions until the connection is lost."""
        settings = self._settings
        if self._password == "":
            raise SecretError(f"its password can't be read; look at {settings.password}")
        service = f"{settings.topic}/service"
        async with Client(
            settings.host,
            settings.port,
            username=settings.user or None,
            password=self._password,
            tls_context=client_context(settings.ca) if settings.tls else None,
            will=Will(service, "offline", AT_LEAST_ONCE, retain=True),
        ) as client:
            await self._send(client, MqttMessage(service, "online", True))
            try:
                await until_either(self._send_revisions(client), _lost(client))
            except asyncio.CancelledError:
                client.timeout = GOODBYE_S
                with suppress(MqttError):
                    await self._send(client, MqttMessage(service, "offline", True))
                raise

    async def _send_revisions(self, client: Client) -> None:
        """Send what is open up to the position, in case the broker has lost it, then all that follows."""
        if not self._are_others_removed:
            await self._remove_others(client)
            self._are_others_removed = True
        until = self._cursor.seq
        async for document in self._open_documents():
            if document.kind in self._cursor.kinds and document.seq <= until:
                topic = topic_of(self._settings.topic, document.kind, document.id)
                await self._send(client, MqttMessage(topic, document.text, True))
        async for line in self._cursor.lines():
            for message in messages_of(self._settings.topic, line):
                await self._send(client, message)
            self._cursor.delivered(line)

    async def _remove_others(self, client: Client) -> None:
        """Empty the topics of other kinds. Earlier settings may have sent them until the outlet's position."""
        others = EVERY_KIND - self._cursor.kinds
        for kind, revision_id in await asyncio.to_thread(self._store.held_at, self._cursor.seq, others):
            await self._send(client, MqttMessage(topic_of(self._settings.topic, kind, revision_id), None, True))

    async def _open_documents(self) -> AsyncIterator[StoredDocument]:
        last = 0
        while page := await asyncio.to_thread(self._store.open_after, last, MOST_AT_ONCE):
            for document in page:
                yield document
            last = page[-1].seq

    async def _send(self, client: Client, message: MqttMessage) -> None:
        await client.publish(message.topic, message.payload, AT_LEAST_ONCE, message.retain)


def messages_of(prefix: str, line: PublishedLine) -> list[MqttMessage]:
    """The messages for one revision."""
    revision = REVISION.validate_json(line.text)
    topic = topic_of(prefix, line.kind, revision.id)
    if revision.state is AdvisoryState.CLEARED:
        return [MqttMessage(topic, line.text, False), MqttMessage(topic, None, True)]
    return [MqttMessage(topic, line.text, True)]


def topic_of(prefix: str, kind: str, revision_id: str) -> str:
    return f"{prefix}/{TOPICS.get(kind, 'advisories')}/{revision_id}"


async def _lost(client: Client) -> None:
    """Raises `MqttError` when the connection is lost. There is no subscription, so no message comes."""
    async for _ in client.messages:
        pass
