"""How long a canary takes from its messages to the stored advisory, as the operator face sees it."""

import asyncio
import json
import time
from typing import Any

from deconflict.cluster.members_health import health_part
from deconflict.engine.canary.canary_pair import CANARY_EVERY_S
from deconflict.operator.store.store import Store, StoreError

LATENCY = "deconflict_canary_latency_seconds"
LATE_S = 10.0
"""A longer latency, or a longer time without a canary beyond the usual, is reported as degraded."""


class CanaryHealth:
    """Stores each canary in the background: a disk that is stuck delays nothing else. All times are monotonic."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._latency_s, self._stored_s = 0.0, time.monotonic()
        """Of the last stored canary. Before the first, when this began."""
        self._storing: asyncio.Task[None] | None = None
        self._is_missed = False

    def arrived(self, canary: dict[str, Any]) -> None:
        """The canary's part of a parcel has come. It is left out if the one before is still being stored."""
        self._is_missed = canary["advisory"] is None
        if not self._is_missed and (self._storing is None or self._storing.done()):
            self._storing = asyncio.create_task(self._keep(canary["due_s"], json.dumps(canary["advisory"])))

    async def _keep(self, due_s: float, advisory: str) -> None:
        try:
            await asyncio.to_thread(self._store.keep_canary, advisory)
        except StoreError:
            return  # the health of the store says why, and that of the canary that none was stored
        self._stored_s = time.monotonic()
        self._latency_s = self._stored_s - due_s

    def latency_s(self, now_s: float) -> float:
        """Of the last canary. It grows while none is stored."""
        return max(self._latency_s, now_s - self._stored_s - CANARY_EVERY_S)

    def document(self, now_s: float) -> dict[str, Any]:
        """The part `canary` of the health."""
        latency_s = self.latency_s(now_s)
        what = "the engine warns of no made-up conflict" if self._is_missed else "a made-up conflict is not stored"
        reason = f"{what}, or {latency_s:.0f} s late; real ones may fare likewise"
        return {"status": "ok", "latency_s": round(latency_s, 3)} | health_part([reason] if latency_s > LATE_S else [])
