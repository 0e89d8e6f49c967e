"""The outlets of the settings in force, each at work on a task of its own."""

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from typing import Protocol

from deconflict.outlets.broker import Broker
from deconflict.outlets.following import Following
from deconflict.outlets.settings import Mqtt, Webhook
from deconflict.outlets.webhooks import Poster
from deconflict.publisher import Publisher
from deconflict.store import Store

MQTT = "mqtt"
"""What the broker is called among the outlets; no webhook may be."""


class Outlet(Protocol):
    async def run(self) -> None: ...

    def refresh(self) -> None: ...


class Outlets:
    """Begins and ends outlets as the settings change. One that stays as it was is not disturbed."""

    def __init__(self, store: Store, publisher: Publisher) -> None:
        self._store, self._publisher = store, publisher
        self._settings: dict[str, Webhook | Mqtt] = {}
        self._outlets: dict[str, Outlet] = {}
        self._tasks: dict[str, asyncio.Task[None]] = {}

    def renew(self, webhooks: Sequence[Webhook], mqtt: Mqtt | None) -> None:
        """Other settings from now on. Raises `SecretError` where a secret can't be had; then all stays as it was."""
        wanted: dict[str, Webhook | Mqtt] = {one.name: one for one in webhooks}
        if mqtt:
            wanted[MQTT] = mqtt
        begin = {name: self._made(name, one) for name, one in wanted.items() if self._settings.get(name) != one}
        ended = {name: self._end(name) for name in self._settings if name in begin or name not in wanted}
        for name in ended.keys() - wanted.keys():
            del self._outlets[name]
            self._publisher.measures.values["deconflict_outlet_waiting"].pop((name,), None)
        for name, one in begin.items():
            self._outlets[name] = one
            self._tasks[name] = asyncio.create_task(_after(ended.get(name), one.run))
        self._settings = wanted

    def refresh(self) -> None:
        """Read the secrets again."""
        for one in self._outlets.values():
            one.refresh()

    async def close(self) -> None:
        await asyncio.gather(*(self._end(name) for name in list(self._tasks)), return_exceptions=True)

    def _made(self, name: str, settings: Webhook | Mqtt) -> Outlet:
        following = Following(name, self._store, self._publisher)
        if isinstance(settings, Mqtt):
            return Broker(settings, following, self._store)
        return Poster(settings, following)

    def _end(self, name: str) -> asyncio.Task[None]:
        task = self._tasks.pop(name)
        task.cancel()
        return task


async def _after(before: asyncio.Task[None] | None, run: Callable[[], Awaitable[None]]) -> None:
    """One that takes another's place begins where that one has ended."""
    if before:
        await asyncio.wait({before})
    await run()
