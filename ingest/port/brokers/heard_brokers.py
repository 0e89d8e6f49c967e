"""The brokers whose robots the receiver hears."""

import asyncio
import json
import logging
import os
import socket
import time
from collections.abc import Callable, Collection, Sequence
from random import Random
from typing import Any

from aiomqtt import Message

from ingest.measures.lasting_loops import lasting
from ingest.measures.measures import Measures
from ingest.port.brokers.broker_source import BrokerSource
from ingest.port.brokers.mqtt_source import MqttSource
from ingest.port.brokers.topic_scan import TopicScan
from ingest.port.receiver import Receiver

VendorNames = tuple[Callable[[str], str], Callable[[str], bool]]
"""The vendor of a manufacturer, and whether the site file has configured a vendor."""

log = logging.getLogger(__name__)


class HeardBrokers:
    """Hears those of the site file, and looks for robots at them that their settings leave out.

    If several ingests share the brokers, it hears those that `grant` names, and none after the grant has ended.
    """

    def __init__(self, receiver: Receiver, measures: Measures, *, shared: bool = False) -> None:
        self._receiver, self._measures = receiver, measures
        self._ingest = f"{socket.gethostname()}, process {os.getpid()}" if shared else ""
        """This ingest, for people; "" if it hears every broker."""
        self._configured: tuple[MqttSource, ...] = ()
        self._granted: frozenset[str] = frozenset()
        """Names of the brokers that this ingest may hear now, if it shares them."""
        self._end_of_grant: asyncio.TimerHandle | None = None
        self._sources: dict[MqttSource, tuple[BrokerSource, asyncio.Task[None]]] = {}
        self._scans: dict[MqttSource, tuple[TopicScan, asyncio.Task[None]]] = {}
        measures.call_before_reading(self._measure)

    @property
    def tasks(self) -> list[asyncio.Task[None]]:
        return [task for _, task in (*self._sources.values(), *self._scans.values())]

    def use(self, sources: Sequence[MqttSource], names: VendorNames, again: bool = False) -> None:
        """Hear these brokers, and no others. With `again` connect anew, since manufacturers may mean other vendors."""
        self._configured, self._vendor_names = tuple(sources), names
        self._hear_allowed(again)

    async def grant(self, payload: bytes) -> bytes:
        """Hear some of the shared brokers until a moment of `time.monotonic`. The payload is `[names, until_s]`."""
        names, until_s = json.loads(payload)
        if self._end_of_grant:
            self._end_of_grant.cancel()
        left_s = until_s - time.monotonic()
        self._allow(names if left_s > 0 else ())
        self._end_of_grant = asyncio.get_running_loop().call_later(max(left_s, 0.0), self._allow, ())
        return b"granted"

    def _allow(self, names: Collection[str]) -> None:
        before, self._granted = self._granted, frozenset(names)
        if given_up := before - self._granted:
            log.info("%s: heard by another ingest from now on, or by none", ", ".join(sorted(given_up)))
        if before != self._granted:
            self._hear_allowed()

    def _may_hear(self, settings: MqttSource) -> bool:
        return not (self._ingest and settings.host) or settings.name in self._granted

    def _hear_allowed(self, again: bool = False) -> None:
        sources = [settings for settings in self._configured if self._may_hear(settings)]
        for settings in [known for known in self._sources if again or known not in sources]:
            source, task = self._sources.pop(settings)
            task.cancel()
            source.forget()
        for settings in sources:
            if settings not in self._sources:
                source = BrokerSource(settings, self._receiver, *self._vendor_names, self._measures, Random())
                self._sources[settings] = source, asyncio.create_task(source.run())
        for _, task in self._scans.values():
            task.cancel()
        self._scans = {settings: self._scan(settings) for settings in self._sources if settings.host}

    def _scan(self, settings: MqttSource) -> tuple[TopicScan, asyncio.Task[None]]:
        known = self._scans.get(settings)
        scan = TopicScan(settings, self._configured, known[0].found if known else ())
        return scan, asyncio.create_task(lasting("looking for topics that are not heard", scan.run, self._measures))

    async def hear(self, payload: bytes) -> bytes:
        """Take messages that come without a broker. Each is the name of its source, topic, text, and if retained."""
        sources = {settings.name: source for settings, (source, _) in self._sources.items() if not settings.host}
        for name, topic, text, is_retained in json.loads(payload):
            sources[name].take(Message(topic, text.encode(), 0, is_retained, 0, None))
        return b"heard"

    def documents(self) -> list[dict[str, Any]]:
        """Of each broker its name, whether robots are heard there, and topics of others that are not. JSON-ready.

        Of a shared broker `ingest`, too: this one if it is connected there, else "".
        """
        return [self._document(settings) for settings in self._configured if settings.host]

    def _document(self, settings: MqttSource) -> dict[str, Any]:
        source, scan = self._sources.get(settings, (None,))[0], self._scans.get(settings, (None,))[0]
        document: dict[str, Any] = {
            "name": settings.name,
            "heard": source is not None and source.has_heard,
            "other_topics": [found._asdict() for found in scan.found] if scan else [],
        }
        if self._ingest:
            document["ingest"] = self._ingest if source and source.is_connected else ""
        return document

    def _measure(self) -> None:
        connected: dict[tuple[str, ...], float] = {(settings.name,): 0.0 for settings in self._configured}
        connected |= {(settings.name,): float(source.is_connected) for settings, (source, _) in self._sources.items()}
        self._measures.level("deconflict_broker_connected", connected)
