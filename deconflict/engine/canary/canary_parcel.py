"""A canary on its way from the receiver to the engine, and what is made of it."""

import struct
from collections.abc import Iterable
from typing import Any, NamedTuple

WITH_CANARY = b"canary"
"""In a request for a batch: the answer is `packed`, with the canary that is due."""
_HEAD = struct.Struct(">dI")


class Canary(NamedTuple):
    """Two robots that are about to meet."""

    due_s: float
    """When their messages were due, monotonic time, which all processes of a machine share."""
    batch: bytes
    """As `Batch.to_bytes` gives it."""


def packed(batch: bytes, canary: Canary | None) -> bytes:
    """A batch with a canary."""
    due_s, canary_bytes = canary or (0.0, b"")
    return _HEAD.pack(due_s, len(canary_bytes)) + canary_bytes + batch


def unpacked(reply: bytes) -> tuple[bytes, Canary | None]:
    """The batch and the canary of `packed`."""
    due_s, size = _HEAD.unpack_from(reply)
    canary = Canary(due_s, reply[_HEAD.size : _HEAD.size + size])
    return reply[_HEAD.size + size :], canary if size else None


def oldest_canary(judged_canaries: Iterable[dict[str, Any] | None]) -> dict[str, Any] | None:
    """The judged canary that was due first; None if there is none, or somebody has judged none yet."""
    found = list(judged_canaries)
    return min(filter(None, found), key=lambda canary: canary["due_s"]) if found and all(found) else None
