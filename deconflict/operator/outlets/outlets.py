"""The outlets of the current settings, each on a task of its own."""

import asyncio
import logging
import time
from collections import defaultdict
from collections.abc import Sequence
from typing import Protocol

from deconflict.operator.outlets.mqtt import MqttOutlet
from deconflict.operator.outlets.store_cursor import StoreCursor, is_being_cancelled
from deconflict.operator.outlets.webhooks import WebhookOutlet
from deconflict.operator.store.publisher import Publisher
from deconflict.operator.store.store import Store
from deconflict.settings.outlet_settings import Backoff, Mqtt, Webhook

log = logging.getLogger(__name__)

MQTT = "mqtt"
"""Name of the MQTT outlet; no webhook may have it."""


class Outlet(Protocol):
    async def run(self) -> None: ...

    def refresh(self) -> None: ...

    @property
    def secrets(self) -> dict[str, str]:
        """Those in use, by source."""


class Outlets:
    """Starts and ends outlets as the settings change. An outlet whose settings stay the same keeps running."""

    def __init__(self, store: Store, publisher: Publisher) -> None:
        self._store, self._publisher = store, publisher
        self._settings: dict[str, Webhook | Mqtt] = {}
        self._outlets: dict[str, Outlet] = {}
        self._tasks: dict[str, asyncio.Task[None]] = {}
        self._ending: defaultdict[str, set[asyncio.Task[None]]] = defaultdict(set)
        """By name, the cancelled tasks that have not ended yet."""

    def renew(self, webhooks: Sequence[Webhook], mqtt: Mqtt | None) -> None:
        """Use other settings from now on."""
        new_settings: dict[str, Webhook | Mqtt] = {webhook.name: webhook for webhook in webhooks}
        if mqtt:
            new_settings[MQTT] = mqtt
        changed = {
            name: self._create(name, settings)
            for name, settings in new_settings.items()
            if self._settings.get(name) != settings
        }
        for name in self._settings:
            if name in changed or name not in new_settings:
                self._end(name)
        for name in self._settings.keys() - new_settings.keys():
            del self._outlets[name]
            self._publisher.measures.values["deconflict_outlet_waiting"].pop((name,), None)
        for name, outlet in changed.items():
            self._outlets[name] = outlet
            self._tasks[name] = asyncio.create_task(self._run(name, outlet, new_settings[name].retry_s))
        self._settings = new_settings

    def refresh(self) -> None:
        """Read the secrets again."""
        for outlet in self._outlets.values():
            outlet.refresh()

    async def close(self) -> None:
        for name in list(self._tasks):
            self._end(name)
        await asyncio.gather(*(task for tasks in self._ending.values() for task in tasks), return_exceptions=True)

    def _create(self, name: str, settings: Webhook | Mqtt) -> Outlet:
        cursor = StoreCursor(name, settings.kinds, self._store, self._publisher)
        known = {source: secret for outlet in self._outlets.values() for source, secret in outlet.secrets.items()}
        if isinstance(settings, Mqtt):
            return MqttOutlet(settings, cursor, self._store, known)
        return WebhookOutlet(settings, cursor, known)

    def _end(self, name: str) -> None:
        task = self._tasks.pop(name)
        task.cancel()
        self._ending[name].add(task)
        task.add_done_callback(self._ending[name].discard)

    async def _run(self, name: str, outlet: Outlet, retry_s: Backoff) -> None:
        """Start once the earlier outlets of this name have ended. Restart after an unexpected error."""
        if before := set(self._ending[name]):
            await asyncio.wait(before)
        wait_s, longest_s = retry_s
        while True:
            began_s = time.monotonic()
            try:
                await outlet.run()
            except Exception:
                if is_being_cancelled():
                    return
                log.exception("%s ended with an error, which should be reported; it restarts", name)
                self._publisher.measures.count("deconflict_outlet_failures_total", name)
            if time.monotonic() - began_s > longest_s:
                wait_s = retry_s[0]
            await asyncio.sleep(wait_s)
            wait_s = min(2 * wait_s, longest_s)
