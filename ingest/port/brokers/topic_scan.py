"""Looks at a broker for robots under other topics than those that are heard: another prefix, or another version.

It never subscribes to everything, and never for long: every few minutes a connection of its own listens for some
seconds to topics of the standard's form with any prefix, until it has had enough of them. What is heard from robots is
not touched by it.
"""

import asyncio
import logging
from collections.abc import Collection, Iterable, Sequence
from contextlib import suppress
from typing import NamedTuple

from aiomqtt import Client, Message, MqttError

from ingest.languages.front_ends import FRONT_ENDS
from ingest.port.brokers.mqtt_source import MqttSource
from ingest.security.certificates import CertificateError, client_context
from ingest.security.tokens import SecretError, secret

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
_CLIENT_LOG = log.getChild("client")
_CLIENT_LOG.setLevel(logging.ERROR)  # it warns of each message beyond the most


class OtherTopics(NamedTuple):
    """Topics that look like those of robots and are not heard."""

    prefix: str
    example: str
    advice: str
    """What to set in the site file."""


class TopicScan:
    """Scans one broker."""

    def __init__(
        self, settings: MqttSource, sources: Sequence[MqttSource], found_before: Collection[OtherTopics] = ()
    ) -> None:
        """`sources` are all of the site file: what another of them hears at the same broker is heard.

        The first of them at a broker looks for languages, too, that none of them hears.
        """
        self._settings = settings
        same = [each for each in sources if (each.host, each.port) == (settings.host, settings.port)]
        spoken = {each.language for each in same}
        unspoken = [language for language in SCANNED if language not in spoken] if settings is same[0] else []
        self._languages = (settings.language, *unspoken)
        self._heard = {
            _prefix(topic_filter)
            for each in same
            for topic_filter in FRONT_ENDS[each.language].topic_filters(each.prefixes, ())
        }
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
            with suppress(MqttError, OSError, SecretError, CertificateError):
                await self.scan()

    async def scan(self, seconds: float | None = None) -> None:
        """Listen once. Raises `MqttError`, `OSError` or `SecretError` if the broker can't be heard."""
        settings, before = self._settings, set(self._found)
        async with Client(
            settings.host,
            settings.port,
            username=settings.user or None,
            password=secret(settings.password) if settings.password else None,
            tls_context=client_context(settings.ca) if settings.tls else None,
            max_queued_incoming_messages=MOST_MESSAGES,
            logger=_CLIENT_LOG,
        ) as client:
            await client.subscribe([(topic_filter, 0) for topic_filter in filters(self._languages)])
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
        prefix, kind = _prefix(topic), topic.rpartition("/")[2]
        if prefix in self._heard or prefix in self._found or len(topic) > LONGEST_TOPIC or not isinstance(raw, bytes):
            return
        for language in self._languages:
            kinds = (end.rpartition("/")[2] for end in SCANNED[language])
            if kind in kinds and all(key in raw for key in TYPICAL_KEYS[language]):
                self._found[prefix] = OtherTopics(prefix, topic, self._advice(language, prefix, topic))
                return

    def _advice(self, language: str, prefix: str, topic: str) -> str:
        standard = FRONT_ENDS[language].standard.partition(",")[0]
        seen = f"the broker has topics such as {topic!r} that look like {standard} and are not heard"
        if language == self._settings.language:
            wanted = ", ".join(f'"{each}"' for each in (*sorted(self._heard), prefix))
            return f"{seen}; set mqtt_sources.prefixes = [{wanted}] for {self._settings.name!r} to hear them"
        section = f'language = "{language}" and prefixes = ["{prefix}"]'
        return f"{seen}; add a section [[mqtt_sources]] of this broker with {section}"


def _prefix(topic: str) -> str:
    return "/".join(topic.split("/")[:-PARTS_AFTER_PREFIX])


def filters(languages: Iterable[str]) -> list[str]:
    """What a scan subscribes to: topics of the languages' form, with a prefix of any few levels."""
    ends = [end for language in languages for end in SCANNED[language]]
    return [f"{'+/' * levels}{end}" for levels in range(MOST_PREFIX_LEVELS + 1) for end in ends]
