"""Delivers messages so that no vendor delays those of others: by rate limits, then newest first, in time slices.

Of the waiting statuses of one robot over one connection only the newest is read, in the place of the first. So under
overload the service reads what is true now, and no robot waits longer than one round through all robots takes.
"""

import asyncio
import time
from collections.abc import Callable
from functools import partial

from ingest.languages.front_ends import FRONT_ENDS
from ingest.measures.lasting_loops import note_fault
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.port.connection_shares import holder_of
from ingest.port.rate_limits import ArrivedMessage, RateLimits, Rates
from ingest.port.time_slices import TimeSlices
from ingest.settings import UNKNOWN, ReceiverSettings

RobotKey = tuple[int, bytes]
"""The number of a connection, and a UUID as it was sent."""


class Backlog:
    """Passes each message once, in order: to `deliver`, or to `overtaken` if a newer status has replaced it."""

    def __init__(
        self,
        slices: TimeSlices,
        deliver: Callable[[bytes, float, Connection], None],
        overtaken: Callable[[ArrivedMessage, str], None],
    ) -> None:
        """`overtaken` also gets the UUID as it was sent."""
        self._slices, self._deliver, self._overtaken = slices, deliver, overtaken
        self._newest: dict[RobotKey, ArrivedMessage] = {}
        """The waiting status of each robot."""

    def add(self, message: ArrivedMessage) -> None:
        """Deliver the message now, or let it wait."""
        if self._slices.is_free():
            self._deliver(*message)
            return
        connection = message.connection
        uuid = FRONT_ENDS[connection.language].superseded(message.raw, connection.topic)
        if uuid is None:
            self._slices.run(partial(self._deliver, *message), len(message.raw))
            return
        robot = connection.id, uuid
        older = self._newest.get(robot)
        self._newest[robot] = message
        if older is None:
            self._slices.run(partial(self._deliver_newest, robot, len(message.raw)), len(message.raw))
        else:
            self._slices.add_weight(len(message.raw) - len(older.raw))
            self._overtaken(older, uuid.decode(errors="replace"))

    def _deliver_newest(self, robot: RobotKey, first_bytes: int) -> None:
        message = self._newest.pop(robot)
        self._slices.add_weight(first_bytes - len(message.raw))
        self._deliver(*message)


Deliver = Callable[[bytes, float, Connection], str | None]
"""Returns the rule that a rejected message breaks; None if it is accepted."""
REJECTED_COSTS = 4.0
"""A rejected message counts as so many times its processor time: it is also recorded, shown and counted."""
DRAIN_EVERY_S = 0.02


class FairDelivery:
    """The way of every message from its socket to `deliver`. Belongs to one event loop."""

    def __init__(
        self,
        settings: ReceiverSettings,
        deliver: Deliver,
        overtaken: Callable[[ArrivedMessage, str], None],
        measures: Measures,
        owner_of: Callable[[Connection], str | None],
    ) -> None:
        """`owner_of` gives the vendor that owns the robot of a topic, if the topic names no vendor."""
        self._owner_of = owner_of
        self.slices = TimeSlices()
        self._rate_limits = RateLimits(_rates(settings))
        self._backlog = Backlog(self.slices, self._deliver_timed, self._note_overtaken)
        self._deliver, self._overtaken, self._measures = deliver, overtaken, measures
        self._delivering_s = 0.0
        """Time of the event loop spent on deliveries so far."""
        self._draining: asyncio.Task[None] | None = None

    def use_limits(self, settings: ReceiverSettings) -> None:
        self._rate_limits.rates = _rates(settings)

    def add(self, message: ArrivedMessage, now_s: float) -> None:
        """Deliver a message now, or when the rate limits of its sender allow it."""
        at_once, dropped = self._rate_limits.admit(self._sender(message.connection), message, now_s)
        if at_once:
            self._backlog.add(message)
        elif self._draining is None or self._draining.done():
            self._draining = asyncio.create_task(self._drain())
        if dropped:
            vendor = self._vendor(message.connection) or UNKNOWN
            self._measures.count("deconflict_messages_shed_total", vendor, by=len(dropped))

    def timed(self, connection: Connection, read: Callable[[], None], now_s: float) -> float:
        """Read from a socket. Returns for how long it should not be read, because its sender's take too much time.

        It is the time of the event loop, not of the processor: if other processes leave this one little of it, a sender
        gets its share of that only.
        """
        delivering_s, began_s = self._delivering_s, time.perf_counter()
        read()
        spent_s = time.perf_counter() - began_s - (self._delivering_s - delivering_s)
        return self._rate_limits.charge_reading(self._sender(connection), spent_s, now_s)

    async def close(self) -> None:
        """Let nothing more wait for rate limits."""
        if self._draining:
            self._draining.cancel()
            await asyncio.gather(self._draining, return_exceptions=True)

    def _deliver_timed(self, raw: bytes, arrival_s: float, connection: Connection) -> None:
        """Deliver a message, and charge its sender for the time that it takes."""
        began_s, began_loop_s, costs = time.thread_time(), time.perf_counter(), 1.0
        try:
            if self._deliver(raw, arrival_s, connection):
                costs = REJECTED_COSTS
        except Exception:  # noqa: BLE001 - it is logged
            note_fault("reading a message", self._measures)
        finally:
            spent_s = costs * (time.thread_time() - began_s)
            self._delivering_s += time.perf_counter() - began_loop_s
            self._rate_limits.delivered(self._sender(connection), len(raw), spent_s, time.monotonic())

    def _note_overtaken(self, message: ArrivedMessage, uuid: str) -> None:
        self._rate_limits.delivered(self._sender(message.connection), len(message.raw), 0.0, time.monotonic())
        self._overtaken(message, uuid)

    def _sender(self, connection: Connection) -> str:
        """By whom rates are limited."""
        owner = None if connection.vendor or not connection.topic else self._owner_of(connection)
        return holder_of(owner, connection.holder)

    def _vendor(self, connection: Connection) -> str | None:
        return connection.vendor or (self._owner_of(connection) if connection.topic else None)

    async def _drain(self) -> None:
        while self._rate_limits.waiting:
            await asyncio.sleep(DRAIN_EVERY_S)
            for message in self._rate_limits.due(asyncio.get_running_loop().time()):
                self._backlog.add(message)


def _rates(settings: ReceiverSettings) -> Rates:
    return Rates(settings.max_messages_per_s, settings.max_bytes_per_s, settings.max_processor_share)
