"""Subscriptions to streams of a NATS server, which outlast the connections that they are heard over."""

from collections.abc import Awaitable, Callable
from contextlib import suppress
from datetime import UTC, datetime, timedelta

from nats.aio.msg import Msg
from nats.errors import Error as NatsError
from nats.js import JetStreamContext, api

REPLAYED_S = 15.0
"""How much of the rows who takes a tile over hears again."""
PENDING = 1 << 20
"""Messages that may wait to be taken in."""

BUS_ERRORS = (NatsError, TimeoutError, OSError)
"""What a call raises while the server can't be had."""


class Hearing:
    """One subscription, begun again with every connection."""

    def __init__(
        self,
        subject: str,
        stream: str,
        taken: Callable[[Msg], Awaitable[None]],
        config: Callable[[], api.ConsumerConfig],
    ) -> None:
        """`config` says from where on each time it begins."""
        self._subject, self._stream, self._taken, self._config = subject, stream, taken, config
        self._heard: JetStreamContext.PushSubscription | None = None
        self._ended = False

    async def begin(self, js: JetStreamContext) -> int:
        """How many messages there are for it already. One that has been ended, also meanwhile, stays so."""
        await self._leave()
        if self._ended:
            return 0
        config = self._config()
        self._heard = await js.subscribe(
            self._subject,
            stream=self._stream,
            cb=self._taken,
            config=config,
            ordered_consumer=True,
            pending_msgs_limit=PENDING,
            pending_bytes_limit=1 << 30,
        )
        if self._ended:
            await self._leave()
            return 0
        config.opt_start_time = None  # the client begins a lost subscription anew at a number, and keeps this otherwise
        state = await self._heard.consumer_info()
        return (state.num_pending or 0) + (state.delivered.consumer_seq if state.delivered else 0)

    async def end(self) -> None:
        self._ended = True
        await self._leave()

    async def _leave(self) -> None:
        heard, self._heard = self._heard, None
        if heard:
            with suppress(*BUS_ERRORS):
                await heard.unsubscribe()


def latest() -> api.ConsumerConfig:
    return api.ConsumerConfig(deliver_policy=api.DeliverPolicy.LAST_PER_SUBJECT)


def lately() -> api.ConsumerConfig:
    since = datetime.now(UTC) - timedelta(seconds=REPLAYED_S)
    return api.ConsumerConfig(deliver_policy=api.DeliverPolicy.BY_START_TIME, opt_start_time=since)
