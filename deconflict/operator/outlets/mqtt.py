"""The open advisories as retained messages of an MQTT broker.

`TOPIC/advisories/ID` holds the newest revision while the advisory is open; what clears it is sent as a message that is
not kept, and the topic is then emptied. `TOPIC/service` holds "online", or "offline" by the broker's own doing.
"""

import asyncio
import ssl
from contextlib import suppress
from typing import NamedTuple

from aiomqtt import Client, MqttError, Will

from deconflict.advisory import ADVISORY, AdvisoryState
from deconflict.operator.outlets.store_cursor import Following, ending
from deconflict.operator.store.publisher import Line
from deconflict.operator.store.store import Store, StoreError
from deconflict.runtime.first_of import until_either
from deconflict.settings.outlet_settings import Mqtt
from ingest.security.tokens import renewed, secret

AT_LEAST_ONCE = 1
GOODBYE_S = 2.0
"""A broker that does not answer is left after this long, twice."""


class Said(NamedTuple):
    """One message to the broker."""

    topic: str
    payload: str | None
    retain: bool


class Broker:
    """Keeps a broker's picture of the open advisories true; after each connection it is brought up to date."""

    def __init__(self, settings: Mqtt, following: Following, store: Store) -> None:
        """Raises `SecretError` where the password can't be had."""
        self._settings, self._following, self._store = settings, following, store
        self._password = secret(settings.password) if settings.password else None

    def refresh(self) -> None:
        """Read the password again; it counts at the next connection."""
        if self._password:
            self._password = renewed(self._settings.password, self._password)

    async def run(self) -> None:
        """Until cancelled."""
        await self._following.begin()
        wait_s, longest_s = self._settings.retry_s
        while True:
            before = self._following.seq
            try:
                await self._connected()
            except (MqttError, StoreError) as error:
                if ending():
                    return
                self._following.failed(str(error))
            if self._following.seq > before:
                wait_s = self._settings.retry_s[0]
            await asyncio.sleep(wait_s)
            wait_s = min(2 * wait_s, longest_s)

    async def _connected(self) -> None:
        """Until the connection is lost."""
        one = self._settings
        service = f"{one.topic}/service"
        async with Client(
            one.host,
            one.port,
            username=one.user or None,
            password=self._password,
            tls_context=ssl.create_default_context() if one.tls else None,
            will=Will(service, "offline", AT_LEAST_ONCE, retain=True),
        ) as client:
            await self._say(client, Said(service, "online", True))
            try:
                await until_either(self._feed(client), _lost(client))
            except asyncio.CancelledError:
                client.timeout = GOODBYE_S
                with suppress(MqttError):
                    await self._say(client, Said(service, "offline", True))
                raise

    async def _feed(self, client: Client) -> None:
        """What stands at the position, in case the broker has forgotten, then all that follows."""
        for advisory in await asyncio.to_thread(self._store.open):
            if advisory.seq <= self._following.seq:
                topic = f"{self._settings.topic}/advisories/{advisory.id}"
                await self._say(client, Said(topic, advisory.model_dump_json(), True))
        async for line in self._following.lines():
            for said in told(self._settings.topic, line):
                await self._say(client, said)
            self._following.taken(line)

    async def _say(self, client: Client, said: Said) -> None:
        await client.publish(said.topic, said.payload, AT_LEAST_ONCE, said.retain)


def told(topic: str, line: Line) -> list[Said]:
    """What the broker is told of one revision."""
    advisory = ADVISORY.validate_json(line.text)
    at = f"{topic}/advisories/{advisory.id}"
    if advisory.state is AdvisoryState.CLEARED:
        return [Said(at, line.text, False), Said(at, None, True)]
    return [Said(at, line.text, True)]


async def _lost(client: Client) -> None:
    """Raises `MqttError` when the connection is lost; nothing is subscribed to."""
    async for _ in client.messages:
        pass
