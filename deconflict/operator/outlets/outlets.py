"""The outlets of the settings in force, each at work on a task of its own."""

import asyncio
import logging
import time
from collections import defaultdict
from collections.abc import Sequence
from typing import Protocol

from deconflict.operator.outlets.mqtt import Broker
from deconflict.operator.outlets.store_cursor import Following, ending
from deconflict.operator.outlets.webhooks import Poster
from deconflict.operator.store.publisher import Publisher
from deconflict.operator.store.store import Store
from deconflict.settings.outlet_settings import Backoff, Mqtt, Webhook

log = logging.getLogger(__name__)

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
        self._ending: defaultdict[str, set[asyncio.Task[None]]] = defaultdict(set)
        """By name, those that have been told to end and have not."""

    def renew(self, webhooks: Sequence[Webhook], mqtt: Mqtt | None) -> None:
        """Other settings from now on. Raises `SecretError` where a secret can't be had; then all stays as it was."""
        wanted: dict[str, Webhook | Mqtt] = {one.name: one for one in webhooks}
        if mqtt:
            wanted[MQTT] = mqtt
        begin = {name: self._made(name, one) for name, one in wanted.items() if self._settings.get(name) != one}
        for name in self._settings:
            if name in begin or name not in wanted:
                self._end(name)
        for name in self._settings.keys() - wanted.keys():
            del self._outlets[name]
            self._publisher.measures.values["deconflict_outlet_waiting"].pop((name,), None)
        for name, one in begin.items():
            self._outlets[name] = one
            self._tasks[name] = asyncio.create_task(self._run(name, one, wanted[name].retry_s))
        self._settings = wanted

    def refresh(self) -> None:
        """Read the secrets again."""
        for one in self._outlets.values():
            one.refresh()

    async def close(self) -> None:
        for name in list(self._tasks):
            self._end(name)
        await asyncio.gather(*(task for each in self._ending.values() for task in each), return_exceptions=True)

    def _made(self, name: str, settings: Webhook | Mqtt) -> Outlet:
        following = Following(name, self._store, self._publisher)
        if isinstance(settings, Mqtt):
            return Broker(settings, following, self._store)
        return Poster(settings, following)

    def _end(self, name: str) -> None:
        task = self._tasks.pop(name)
        task.cancel()
        self._ending[name].add(task)
        task.add_done_callback(self._ending[name].discard)

    async def _run(self, name: str, outlet: Outlet, retry_s: Backoff) -> None:
        """Begins where those have ended whose place it takes, and again after an error that nobody foresaw."""
        if before := set(self._ending[name]):
            await asyncio.wait(before)
        wait_s, longest_s = retry_s
        while True:
            began_s = time.monotonic()
            try:
                await outlet.run()
            except Exception:
                if ending():
                    return
                log.exception("%s was ended by an error, which should be reported; it begins again", name)
                self._publisher.measures.count("deconflict_outlet_failures_total", name)
            if time.monotonic() - began_s > longest_s:
                wait_s = retry_s[0]
            await asyncio.sleep(wait_s)
            wait_s = min(2 * wait_s, longest_s)
