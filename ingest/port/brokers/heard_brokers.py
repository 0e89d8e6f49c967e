"""The brokers whose robots the receiver hears."""

import asyncio
import json
from collections.abc import Callable, Sequence
from random import Random
from typing import Any

from aiomqtt import Message

from ingest.measures.measures import Measures
from ingest.port.brokers.broker_source import BrokerSource
from ingest.port.brokers.topic_scan import TopicScan
from ingest.port.receiver import Receiver
from ingest.settings import MqttSource

VendorNames = tuple[Callable[[str], str], Callable[[str], bool]]
"""The vendor of a manufacturer, and whether the site file has configured a vendor."""


class HeardBrokers:
    """Hears those of the site file, and looks for robots at them that their settings leave out."""

    def __init__(self, receiver: Receiver, measures: Measures) -> None:
        self._receiver, self._measures = receiver, measures
        self._sources: dict[MqttSource, tuple[BrokerSource, asyncio.Task[None]]] = {}
        self._scans: dict[MqttSource, tuple[TopicScan, asyncio.Task[None]]] = {}
        measures.call_before_reading(self._measure)

    @property
    def tasks(self) -> list[asyncio.Task[None]]:
        return [task for _, task in (*self._sources.values(), *self._scans.values())]

    def use(self, sources: Sequence[MqttSource], names: VendorNames, again: bool = False) -> None:
        """Hear these brokers, and no others. With `again` connect anew, since manufacturers may mean other vendors."""
        for settings in [known for known in self._sources if again or known not in sources]:
            self._sources.pop(settings)[1].cancel()
        for settings in sources:
            if settings not in self._sources:
                source = BrokerSource(settings, self._receiver, *names, self._measures, Random())
                self._sources[settings] = source, asyncio.create_task(source.run())
        for _, task in self._scans.values():
            task.cancel()
        self._scans = {settings: self._scan(settings, sources) for settings in self._sources if settings.host}

    def _scan(self, settings: MqttSource, sources: Sequence[MqttSource]) -> tuple[TopicScan, asyncio.Task[None]]:
        known = self._scans.get(settings)
        scan = TopicScan(settings, sources, known[0].found if known else ())
        return scan, asyncio.create_task(scan.run())

    async def hear(self, payload: bytes) -> bytes:
        """Take messages that come without a broker. Each is the name of its source, topic, text, and if retained."""
        sources = {settings.name: source for settings, (source, _) in self._sources.items() if not settings.host}
        for name, topic, text, is_retained in json.loads(payload):
            sources[name].take(Message(topic, text.encode(), 0, is_retained, 0, None))
        return b"heard"

    def documents(self) -> list[dict[str, Any]]:
        """Of each broker its name, whether robots are heard there, and topics of others that are not. JSON-ready."""
        return [
            {
                "name": settings.name,
                "heard": self._sources[settings][0].has_heard,
                "other_topics": [found._asdict() for found in scan.found],
            }
            for settings, (scan, _) in self._scans.items()
        ]

    def _measure(self) -> None:
        connected: dict[tuple[str, ...], float] = {
            (settings.name,): float(source.is_connected) for settings, (source, _) in self._sources.items()
        }
        self._measures.level("deconflict_broker_connected", connected)
