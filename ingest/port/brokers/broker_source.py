"""Hears robots over an MQTT broker, and connects again after each failure.

It only subscribes. Messages take the way of those of sockets: rate limits by vendor, the queue, the fleet. Each topic
counts as a connection of its own.
"""

import asyncio
import logging
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace
from random import Random
from typing import cast

from aiomqtt import Client, Message, MqttError

from ingest.languages.front_ends import FRONT_ENDS
from ingest.measures.measures import Measures
from ingest.measures.outages import STEADY_S, OutageLog, backoff_s
from ingest.port.brokers.mqtt_source import MqttSource
from ingest.port.connection import Connection
from ingest.port.receiver import Receiver
from ingest.security.certificates import CertificateError, client_context
from ingest.security.tokens import SecretError, secret

MOST_TOPICS = 100_000
"""Topics whose connections are kept. Beyond it, the one that was quiet for the longest is closed."""
LONGEST_TOPIC = 400
"""Characters. Messages of longer topics are refused: a topic is kept, and is in no limit of what messages may hold."""
KEEPALIVE_S = 15
"""A broker that answers nothing for about this long is gone."""
TIMEOUT_S = 10.0

log = logging.getLogger(__name__)


class BrokerSource:
    """Hears one broker."""

    def __init__(
        self,
        settings: MqttSource,
        receiver: Receiver,
        vendor_of: Callable[[str], str],
        is_configured: Callable[[str], bool],
        measures: Measures,
        random: Random,
    ) -> None:
        """`vendor_of` gives the vendor of a manufacturer that a topic names; the site file may have configured it."""
        self.settings, self._receiver = settings, receiver
        self._vendor_of, self._is_configured = vendor_of, is_configured
        self._measures, self._random = measures, random
        self._front_end = FRONT_ENDS[settings.language]
        self._connections: OrderedDict[str, Connection] = OrderedDict()
        """By topic, those heard longest ago first."""
        self.is_connected = False
        self._outages = OutageLog(time.monotonic)
        self._was_heard = False

    @property
    def has_heard(self) -> bool:
        """Whether a topic of it has been heard."""
        return bool(self._connections)

    async def run(self) -> None:
        """Hear the broker until cancelled. Without a broker, return."""
        failures, now_s = 0, asyncio.get_running_loop().time
        self.is_connected = not self.settings.host
        while self.settings.host:
            began_s = now_s()
            try:
                await self._hear()
            except (MqttError, OSError, SecretError, CertificateError) as error:
                self._note_failure(error, was_steady=now_s() - began_s > STEADY_S)
            except Exception:
                log.exception("hearing %s failed; connecting again", self.settings.name)
                self._measures.count("deconflict_broker_failures_total", self.settings.name)
            finally:
                self.is_connected = False
            failures = 0 if now_s() - began_s > STEADY_S else failures + 1
            await asyncio.sleep(backoff_s(self.settings.retry_s, failures, self._random))

    def _note_failure(self, error: Exception, *, was_steady: bool) -> None:
        """Count it, and log the first of several in a row; of a broker that comes and goes, not every outage."""
        self._measures.count("deconflict_broker_failures_total", self.settings.name)
        more = self._outages.failed(was_steady=was_steady)
        if more is not None:
            log.warning("the broker %s can't be heard: %s; trying until it answers%s", self.settings.name, error, more)

    async def _hear(self) -> None:
        settings = self.settings
        async with Client(
            settings.host,
            settings.port,
            username=settings.user or None,
            password=secret(settings.password) if settings.password else None,
            tls_context=client_context(settings.ca) if settings.tls else None,
            queue_type=cast(type[asyncio.Queue[Message]], self._new_delivery),
            keepalive=KEEPALIVE_S,
            timeout=TIMEOUT_S,
        ) as client:
            filters = self._front_end.topic_filters(settings.prefixes, settings.manufacturers)
            await client.subscribe([(topic_filter, 1) for topic_filter in filters])
            self.is_connected = True
            if self._outages.worked() or not self._was_heard:
                log.info("hearing %s at %s:%d", settings.name, settings.host, settings.port)
            self._was_heard = True
            async for _ in client.messages:  # none comes out of the queue; it raises when the connection is lost
                pass

    def _new_delivery(self, maxsize: int) -> "_Delivery":
        return _Delivery(self.take, maxsize)

    def take(self, message: Message) -> None:
        """Pass on one message, unless nobody can know how old it is."""
        topic, raw = message.topic.value, message.payload
        if not isinstance(raw, bytes):
            raw = str(raw or "").encode()
        connection = self._connection(topic if len(topic) <= LONGEST_TOPIC else "")
        if not raw:
            return  # the broker forgets a retained message
        if not connection.topic:
            reason = f"its topic is longer than {LONGEST_TOPIC} characters; shorten mqtt_sources.prefixes or names"
            self._receiver.refuse("message-too-large", reason, connection)
        elif len(raw) > self.settings.max_message_bytes:
            reason = f"larger than {self.settings.max_message_bytes} bytes; raise mqtt_sources.max_message_bytes"
            self._receiver.refuse("message-too-large", reason, connection)
        elif message.retain and self._front_end.has_pose(raw, topic):
            reason = "a retained pose may be of any age; publish it without retain"
            self._receiver.refuse("pose-retained", reason, connection)
        else:
            self._receiver.take(raw, connection)

    def forget(self) -> None:
        """Pass on that nothing more comes from its topics."""
        while self._connections:
            self._receiver.forget(self._connections.popitem()[1])

    def _connection(self, topic: str) -> Connection:
        known = self._connections.get(topic)
        if known is None:
            known = self._connections[topic] = self._new_connection(topic)
            if len(self._connections) > MOST_TOPICS:
                self._receiver.forget(self._connections.popitem(last=False)[1])
        else:
            self._connections.move_to_end(topic)
        return known

    def _new_connection(self, topic: str) -> Connection:
        sender = self._front_end.sender(topic)
        manufacturer = sender.manufacturer if sender else ""
        vendor = self._vendor_of(manufacturer) if manufacturer else None
        is_named = vendor is not None and (self._is_configured(vendor) or manufacturer in self.settings.manufacturers)
        connection = self._receiver.new_connection(self.settings.name, "/", vendor, proven=is_named)
        return replace(connection, language=self.settings.language, topic=topic)


class _Delivery(asyncio.Queue[Message]):
    """Passes each message on at once. From a queue, aiomqtt would hand it over in a task of its own."""

    def __init__(self, take: Callable[[Message], None], maxsize: int) -> None:
        super().__init__(maxsize)
        self._take = take

    def put_nowait(self, item: Message) -> None:
        self._take(item)
