"""Files that may be compressed: plain, gzip or zstd."""

import gzip
import io
import re
from typing import IO, Any

import zstandard

_GZIP, _ZSTD, _SKIPPED = b"\x1f\x8b", zstandard.FRAME_HEADER, re.compile(rb"[\x50-\x5f]\x2a\x4d\x18")
"""How compressed logs begin. A zstd file may begin with a skippable frame."""


def unpacked(stored: "io.BufferedReader[Any]") -> IO[bytes]:
    """The content of a log that is stored plain or compressed. Its first bytes decide, not its name."""
    first = stored.peek(4)
    if first.startswith(_GZIP):
        return io.BufferedReader(gzip.open(stored))
    if first.startswith(_ZSTD) or _SKIPPED.match(first):
        return io.BufferedReader(zstandard.open(stored, "rb"))
    return stored
