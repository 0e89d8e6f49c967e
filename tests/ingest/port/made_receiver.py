"""A receiver on a free port, and what it delivered."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from typing import Any

from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.port.receiver import Receiver
from ingest.security.vendor_credentials import VendorCredentials
from ingest.settings import ReceiverSettings, Vendor
from tests.helpers.patience import PATIENCE_S

REFUSED = "deconflict_connections_refused_total"


@dataclass
class Floor:
    """A receiver and everything it told."""

    receiver: Receiver
    measures: Measures
    delivered: list[tuple[bytes, float, Connection]] = field(default_factory=list)
    refused: list[tuple[str, str, Connection]] = field(default_factory=list)
    closed: list[Connection] = field(default_factory=list)
    owners: dict[str, str] = field(default_factory=dict)
    """By topic."""

    @property
    def url(self) -> str:
        return f"ws://127.0.0.1:{self.receiver.port}"

    @property
    def connections(self) -> float:
        return self.measures.values["deconflict_connections"][()]

    def count(self, reason: str) -> float:
        return self.measures.values[REFUSED].get((reason,), 0)

    def raws(self) -> list[bytes]:
        return [raw for raw, _, _ in self.delivered]


@asynccontextmanager
async def floor(vendors: tuple[Vendor, ...] = (), **settings: Any) -> AsyncIterator[Floor]:
    measures, closed = Measures(), list[Connection]()
    ticks = iter(range(1_790_000_000, 1_800_000_000))
    receiver = Receiver(
        ReceiverSettings(port=0, **settings),
        VendorCredentials(vendors),
        lambda raw, arrival_s, connection: served_floor.delivered.append((raw, arrival_s, connection)),
        lambda rule, reason, _, connection: served_floor.refused.append((rule, reason, connection)),
        closed.append,
        overtaken=lambda *_: None,
        measures=measures,
        clock=lambda: float(next(ticks)),
        owner_of=lambda connection: served_floor.owners.get(connection.topic),
    )
    served_floor = Floor(receiver, measures, closed=closed)
    await receiver.start()
    try:
        yield served_floor
    finally:
        await receiver.close()


async def until(true: Callable[[], object]) -> None:
    async with asyncio.timeout(PATIENCE_S):
        while not true():
            await asyncio.sleep(0.005)
