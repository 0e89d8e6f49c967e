"""Subscriptions to streams of a NATS server that resume after each reconnect."""

from collections.abc import Awaitable, Callable
from contextlib import suppress
from datetime import UTC, datetime, timedelta

from nats.aio.msg import Msg
from nats.errors import Error as NatsError
from nats.js import JetStreamContext, api

REPLAYED_S = 15.0
"""An engine that takes over a tile receives the parcels of this time before again."""
IDLE_HEARTBEAT_S = 1.0
"""How often a server says that there is nothing new. One server of several serves a subscription. After two to four of
these times without a sign of it the subscription begins again at another."""
MOST_PENDING_MESSAGES, MOST_PENDING_BYTES = 1 << 20, 1 << 30
"""Messages and bytes that may wait in the client."""

BUS_ERRORS = (NatsError, TimeoutError, OSError)
"""Errors of a call while no server answers."""


class ConsumerEndedError(NatsError):
    """A server that is late has ended a subscription while it began."""

    def __str__(self) -> str:
        return "a subscription ended while it began"


class Subscription:
    """One subscription, which begins again with every connection."""

    def __init__(
        self,
        subject: str,
        stream: str,
        on_message: Callable[[Msg], Awaitable[None]],
        config: Callable[[], api.ConsumerConfig],
    ) -> None:
        """`config` is called at each begin, and gives the position to start from."""
        self._subject, self._stream, self._on_message, self._config = subject, stream, on_message, config
        self._subscribed: JetStreamContext.PushSubscription | None = None
        self._ended = False

    async def begin(self, js: JetStreamContext) -> int:
        """Subscribe; returns how many messages are there already. Does nothing after `end`, even one meanwhile."""
        await self._unsubscribe()
        if self._ended:
            return 0
        config = self._config()
        try:
            return await self._begin(js, config)
        except TypeError as error:  # a consumer described without its name: probably ended meanwhile
            raise ConsumerEndedError from error

    async def _begin(self, js: JetStreamContext, config: api.ConsumerConfig) -> int:
        self._subscribed = await js.subscribe(
            self._subject,
            stream=self._stream,
            cb=self._on_message,
            config=config,
            ordered_consumer=True,
            idle_heartbeat=IDLE_HEARTBEAT_S,
            pending_msgs_limit=MOST_PENDING_MESSAGES,
            pending_bytes_limit=MOST_PENDING_BYTES,
        )
        if self._ended:
            await self._unsubscribe()
            return 0
        config.opt_start_time = None  # else the client sends both it and a number when it recreates a lost consumer
        state = await self._subscribed.consumer_info()
        return (state.num_pending or 0) + (state.delivered.consumer_seq if state.delivered else 0)

    async def end(self) -> None:
        self._ended = True
        await self._unsubscribe()

    async def _unsubscribe(self) -> None:
        subscribed, self._subscribed = self._subscribed, None
        if subscribed:
            with suppress(*BUS_ERRORS):
                await subscribed.unsubscribe()


def newest_of_each() -> api.ConsumerConfig:
    """Start with the newest message of each subject."""
    return api.ConsumerConfig(deliver_policy=api.DeliverPolicy.LAST_PER_SUBJECT)


def since_lately() -> api.ConsumerConfig:
    """Start `REPLAYED_S` before now."""
    since = datetime.now(UTC) - timedelta(seconds=REPLAYED_S)
    return api.ConsumerConfig(deliver_policy=api.DeliverPolicy.BY_START_TIME, opt_start_time=since)
