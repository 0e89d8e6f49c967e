"""The canaries of all ingests, as one engine of the cluster judges them.

They come as robots come, and what is made of them goes to the operator faces with the heartbeats of the engine. The
oldest counts: an ingest, or a pass of an engine, that hangs makes it grow old.
"""

from collections.abc import Collection
from typing import Any

from deconflict.engine.canary.canary_engine import judged
from deconflict.engine.canary.canary_parcel import Canary, oldest_canary, unpacked


class HeardCanaries:
    """Keeps the newest canary of each ingest."""

    def __init__(self) -> None:
        self._waiting: dict[str, Canary] = {}
        self._judged: dict[str, dict[str, Any]] = {}

    def add(self, parcel: bytes) -> None:
        ingest, canary = unpacked(parcel)
        if canary:
            self._waiting[ingest.decode()] = canary

    def judge(self) -> None:
        """Judge what has come since the last pass."""
        while self._waiting:
            ingest, canary = self._waiting.popitem()
            self._judged[ingest] = judged(canary)

    def oldest(self, ingests: Collection[str]) -> dict[str, Any] | None:
        """Of the ingests that are there, the canary that was due first; None if none has come."""
        self._judged = {ingest: canary for ingest, canary in self._judged.items() if ingest in ingests}
        return oldest_canary(self._judged.values())
