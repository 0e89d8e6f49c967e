"""Looks at a broker for robots under other topics than those that are heard: another prefix, or another version.

It never subscribes to everything, and never for long: every few minutes a connection of its own listens for some
seconds to topics of the standard's form with any prefix, until it has had enough of them. What is heard from robots is
not touched by it.
"""

import asyncio
import logging
import ssl
from collections.abc import Collection, Iterable
from contextlib import suppress
from typing import NamedTuple

from aiomqtt import Client, Message, MqttError

from ingest.languages.front_ends import FRONT_ENDS
from ingest.security.tokens import SecretError, secret
from ingest.settings import MqttSource

SCAN_S, SCAN_EVERY_S = 5.0, 600.0
FIRST_AFTER_S = 2.0
"""The broker is heard first."""
MOST_MESSAGES = 2000
"""After so many messages a scan ends."""
MOST_FOUND = 10
MOST_PREFIX_LEVELS = 4
LONGEST_TOPIC = 200
PARTS_AFTER_PREFIX = 3
"""Levels of a topic after its prefix, in each language."""
SCANNED = {
    "vda5050": ("+/+/connection", "+/+/state", "+/+/factsheet"),
    "iso21423": ("IMR/+/identity", "IMR/+/odometry", "IMR/+/status"),
}
"""What follows the prefix in the topics that are looked at, by language."""
TYPICAL_KEYS = {"vda5050": (b'"headerId"', b'"serialNumber"'), "iso21423": (b'"timestamp"',)}
"""What their messages have; other things have topics of this form too."""

log = logging.getLogger(__name__)


class OtherTopics(NamedTuple):
    """Topics that look like those of robots and are not heard."""

    prefix: str
    example: str
    advice: str
    """What to set in the site file."""


class TopicScan:
    """Scans one broker."""

    def __init__(
        self, settings: MqttSource, sources: Iterable[MqttSource], found_before: Collection[OtherTopics] = ()
    ) -> None:
        """`sources` are all of the site file: what another of them hears at the same broker is heard."""
        self._settings = settings
        heard = (
            _prefix(topic_filter)
            for source in sources
            if (source.host, source.port, source.language) == (settings.host, settings.port, settings.language)
            for topic_filter in FRONT_ENDS[source.language].topic_filters(source.prefixes, ())
        )
        self._heard = [*dict.fromkeys(heard)]
        self._found = {other.prefix: other for other in found_before if other.prefix not in self._heard}

    @property
    def found(self) -> tuple[OtherTopics, ...]:
        return tuple(self._found.values())

    async def run(self) -> None:
        """Scan again and again, until cancelled. A broker that does not answer is the business of `BrokerSource`."""
        wait_s = FIRST_AFTER_S
        while True:
            await asyncio.sleep(wait_s)
            wait_s = SCAN_EVERY_S
            with suppress(MqttError, OSError, SecretError):
                await self.scan()

    async def scan(self, seconds: float | None = None) -> None:
        """Listen once. Raises `MqttError`, `OSError` or `SecretError` if the broker can't be heard."""
        settings, before = self._settings, set(self._found)
        async with Client(
            settings.host,
            settings.port,
            username=settings.user or None,
            password=secret(settings.password) if settings.password else None,
            tls_context=ssl.create_default_context(cafile=settings.ca or None) if settings.tls else None,
            max_queued_incoming_messages=MOST_MESSAGES,
        ) as client:
            await client.subscribe([(topic_filter, 0) for topic_filter in filters(settings.language)])
            self._found = {}
            with suppress(TimeoutError):
                async with asyncio.timeout(SCAN_S if seconds is None else seconds):
                    await self._listen(client)
        for prefix in self._found.keys() - before:
            log.warning("%s: %s", settings.name, self._found[prefix].advice)

    async def _listen(self, client: Client) -> None:
        messages = 0
        async for message in client.messages:
            self.look_at(message)
            messages += 1
            if messages >= MOST_MESSAGES or len(self._found) >= MOST_FOUND:
                return

    def look_at(self, message: Message) -> None:
        """Take note of the message's topic if it is a robot's and is not heard."""
        topic, raw = message.topic.value, message.payload
        prefix = _prefix(topic)
        if prefix in self._heard or prefix in self._found or len(topic) > LONGEST_TOPIC:
            return
        if isinstance(raw, bytes) and all(key in raw for key in TYPICAL_KEYS[self._settings.language]):
            self._found[prefix] = OtherTopics(prefix, topic, self._advice(prefix, topic))

    def _advice(self, prefix: str, topic: str) -> str:
        standard = FRONT_ENDS[self._settings.language].standard.partition(",")[0]
        wanted = ", ".join(f'"{each}"' for each in (*self._heard, prefix))
        return (
            f"the broker has topics such as {topic!r} that look like {standard} and are not heard; "
            f"set mqtt_sources.prefixes = [{wanted}] for {self._settings.name!r} to hear them"
        )


def _prefix(topic: str) -> str:
    return "/".join(topic.split("/")[:-PARTS_AFTER_PREFIX])


def filters(language: str) -> list[str]:
    """What a scan subscribes to: topics of the language's form, with a prefix of any few levels."""
    return [f"{'+/' * levels}{end}" for levels in range(MOST_PREFIX_LEVELS + 1) for end in SCANNED[language]]
