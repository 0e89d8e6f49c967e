"""One connection to the NATS servers: reconnects, renews its subscriptions, and reports problems to the log."""

import asyncio
import logging
import time
from collections import deque
from collections.abc import Awaitable, Callable
from contextlib import suppress
from math import inf
from typing import Any

from nats.aio.client import Client
from nats.aio.msg import Msg
from nats.js import JetStreamContext, api
from nats.js.errors import BadRequestError, KeyNotFoundError
from nats.js.kv import KeyValue

from deconflict.cluster.nats.nats_credentials import certificates, credentials
from deconflict.cluster.nats.subscriptions import BUS_ERRORS, Subscription
from deconflict.settings.cluster_settings import Cluster

log = logging.getLogger(__name__)

CLOSE_TIMEOUT_S = 2.0
PING_S = 5
"""Interval of pings. The client reconnects if the server answers none of two in a row."""
QUICK_TIMEOUT_S = 1.0
"""Time limit for heartbeats of members: a later one would not count in time."""
CUT_OFF_S = 2.0
"""Without a server for this long, this machine goes on by itself. A client finds another server sooner."""
SILENT_S = 30.0
"""The same if a server is connected, and takes no heartbeat: most of the others are lost. Others are elected sooner."""
SETTLE_S = 2.0
"""It goes on so for this long after a reconnect: by then the stream has what each machine decided by itself."""
RETRY_S = 0.2
WARN_AGAIN_S = 10.0
"""The same warning is logged once in this time."""


class NatsConnection:
    """Calls raise one of `BUS_ERRORS` while no server answers. Subscriptions resume by themselves."""

    def __init__(self, settings: Cluster) -> None:
        """Raises `SecretError` and `CertificateError`."""
        self.settings, self.name = settings, settings.name
        self.renewals = 0
        """Number of reconnects. Messages in flight at a reconnect may be lost."""
        self.renewed_s = -inf
        """When the last reconnect was complete, monotonic time."""
        self._credentials, self._certificates = credentials(settings), certificates(settings)
        self._subscriptions: list[Subscription] = []
        self._lost_s: float | None = None
        """Since when no server is connected, monotonic time; None while one is."""
        self._was_cut_off = False
        """As of the last look."""
        self._served_s = inf
        """Since when all is as before, monotonic time."""
        self.answered_s = inf
        """When a server took the last heartbeat, monotonic time; inf before the first."""
        self._reconnected, self._is_closed = asyncio.Event(), False
        self._renewing: asyncio.Task[None] | None = None
        self._warned_s: dict[str, float] = {}
        """When each warning was logged last."""

    async def connect(self) -> None:
        self.client, self._is_closed = Client(), False
        await self.client.connect(
            list(self.settings.nats),
            max_reconnect_attempts=-1,
            ping_interval=PING_S,
            **{"reconnect_time_wait": RETRY_S} | self._credentials,
            tls=self._certificates.context if self._certificates else None,
            error_cb=self._on_error,
            disconnected_cb=self._on_disconnect,
            reconnected_cb=self._on_reconnect,
        )
        self.js: JetStreamContext = self.client.jetstream()
        self.quick: JetStreamContext = self.client.jetstream(timeout=QUICK_TIMEOUT_S)

    def renew_after_reconnects(self, restore: Callable[[], Awaitable[None]]) -> None:
        """From now on call `restore` and then begin every subscription again after each reconnect."""
        self._renewing = asyncio.create_task(self._renew(restore))

    async def close(self) -> None:
        if self._renewing:
            self._renewing.cancel()
        with suppress(*BUS_ERRORS):
            async with asyncio.timeout(CLOSE_TIMEOUT_S):
                await self.client.close()
        self._is_closed = True

    def is_connected(self) -> bool:
        return bool(self.client.is_connected)

    def is_lost(self) -> bool:
        """Whether no server is connected, or not all is as before a reconnect."""
        return self._lost_s is not None

    def is_cut_off(self) -> bool:
        """Whether this machine goes on by itself: from a while without a server to a moment after all is as before."""
        now_s, is_connected = time.monotonic(), self.is_connected()
        is_gone = not is_connected and self._lost_s is not None and now_s - self._lost_s > CUT_OFF_S
        if is_gone or now_s - self.answered_s > SILENT_S:
            self._was_cut_off, self._served_s = True, inf
        elif self._was_cut_off and self._lost_s is None:
            self._served_s = min(self._served_s, now_s)
            self._was_cut_off = now_s - self._served_s < SETTLE_S
        return self._was_cut_off

    async def subscribe(
        self,
        subject: str,
        stream: str,
        on_message: Callable[[Msg], Awaitable[None]],
        config: Callable[[], api.ConsumerConfig],
    ) -> tuple[Subscription, int]:
        """Subscribe to a stream. Returns the subscription, and how many messages it already has."""
        subscription = Subscription(subject, stream, on_message, config)
        try:
            waiting = await subscription.begin(self.js)
        except BaseException:
            await subscription.end()
            raise
        self._subscriptions.append(subscription)
        return subscription, waiting

    async def unsubscribe(self, subscription: Subscription) -> None:
        self._subscriptions.remove(subscription)
        await subscription.end()

    async def ensure_stream(
        self, kind: str, subjects: list[str], storage: api.StorageType, age_s: float, same_s: float
    ) -> None:
        """Create a stream, or change its settings. `same_s` is how long the server recognises a repeated message."""
        config = api.StreamConfig(
            name=f"{self.name}-{kind}",
            subjects=subjects,
            storage=storage,
            max_age=age_s,
            duplicate_window=min(same_s, age_s),
            num_replicas=self.settings.copies,
        )
        try:
            await self.js.add_stream(config)
        except BadRequestError:  # it exists with other settings
            await self.js.update_stream(config)

    async def ensure_bucket(self, kind: str, **settings: Any) -> KeyValue:
        """Create a bucket that is kept on disk, or change how many copies there are of it."""
        name, copies = f"{self.name}-{kind}", self.settings.copies
        config = api.KeyValueConfig(bucket=name, replicas=copies, **{"storage": api.StorageType.FILE} | settings)
        try:
            return await self.js.create_key_value(config)
        except BadRequestError:  # it exists with another number of copies
            existing = await self.js.stream_info(f"KV_{name}")
            await self.js.update_stream(existing.config, num_replicas=copies)
            return await self.js.key_value(name)

    def fits(self, key: str, data: bytes) -> bool:
        """Whether the server accepts a message of this size. Logs a warning if not."""
        most_bytes = self.client.max_payload
        if len(data) <= most_bytes:
            return True
        log.warning("%s takes %s bytes, and the NATS server accepts at most %s", key, len(data), most_bytes)
        return False

    def warn(self, text: str) -> None:
        """Log a warning, but not again within `WARN_AGAIN_S`."""
        now_s = time.monotonic()
        self._warned_s = {text: at_s for text, at_s in self._warned_s.items() if now_s - at_s <= WARN_AGAIN_S}
        if text not in self._warned_s:
            self._warned_s[text] = now_s
            log.warning("%s", text)

    async def _on_disconnect(self) -> None:
        self._lost_s = time.monotonic() if self._lost_s is None else self._lost_s
        await self._renew_certificates()

    async def _on_reconnect(self) -> None:
        self._end_attempts()
        self._reconnected.set()

    async def _on_error(self, error: Exception) -> None:
        """The client retries five times a second; `warn` limits the log."""
        self._end_attempts()
        self.warn(f"the NATS server: {error or type(error).__name__}")
        await self._renew_certificates()

    def _end_attempts(self) -> None:
        """End the client's task that connects again if this is closed.

        Its cancellation is lost if it comes together with a refused connection, and the process would never end.
        """
        if self._is_closed:
            raise asyncio.CancelledError

    async def _renew_certificates(self) -> None:
        """Use changed files for the next attempt. The client has no call for this; it asks its options each time."""
        if self._certificates:
            self._certificates.refresh()
            self.client.options["tls"] = self._certificates.context

    async def _renew(self, restore: Callable[[], Awaitable[None]]) -> None:
        while True:
            await self._reconnected.wait()
            self._reconnected.clear()
            try:
                self.js = self.quick  # a call that a lost server was to answer is made again soon
                await restore()
                await self._begin_again()
            except BUS_ERRORS as error:
                log.warning("%s is not connected again yet: %s", self.name, error or type(error).__name__)
                self._reconnected.set()
                await asyncio.sleep(RETRY_S)
            except Exception:
                log.exception("%s can't be used again, which should be reported; it is tried again", self.name)
                self._reconnected.set()
                await asyncio.sleep(RETRY_S)
            else:
                self.js = self.client.jetstream()
                self.renewed_s, self._lost_s = time.monotonic(), None
                self.renewals += 1
                log.warning("%s is connected again", self.name)

    async def _begin_again(self) -> None:
        """Begin every subscription again. A server may be asked to serve one that is lost itself: then the others come
        first, and it is asked again. Raises `BUS_ERRORS` if none of those left begins, or after another reconnect."""
        waiting, failed = deque(self._subscriptions), 0
        while waiting:
            subscription = waiting.popleft()
            try:
                await subscription.begin(self.quick)
                failed = 0
            except BUS_ERRORS:
                waiting.append(subscription)
                failed += 1
                if failed >= len(waiting) or self._reconnected.is_set():
                    raise


async def entry(bucket: KeyValue, key: str) -> tuple[int, bytes | None]:
    """The revision number and the bytes under a key; 0 and None if there is no entry."""
    try:
        found = await bucket.get(key)
    except KeyNotFoundError:
        return 0, None
    return found.revision or 0, found.value
