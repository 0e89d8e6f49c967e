"""Files that may be compressed: plain, gzip or zstd."""

import gzip
import io
import os
import re
import zlib
from contextlib import suppress
from typing import IO, Any

import zstandard

_GZIP, _ZSTD, _SKIPPED = b"\x1f\x8b", zstandard.FRAME_HEADER, re.compile(rb"[\x50-\x5f]\x2a\x4d\x18")
"""How compressed logs begin. A zstd file may begin with a skippable frame."""
_HEADER_BYTES = 18
"""The longest header of a zstd frame."""
DAMAGED = (EOFError, zlib.error, zstandard.ZstdError)
"""The errors of a file that is damaged. One that is cut off may raise none: its last line is cut."""


def unpacked(stored: "io.BufferedReader[Any]") -> IO[bytes]:
    """The content of a log that is stored plain or compressed. Its first bytes decide, not its name."""
    first = stored.peek(4)
    if first.startswith(_GZIP):
        return io.BufferedReader(gzip.open(stored))
    if first.startswith(_ZSTD) or _SKIPPED.match(first):
        return io.BufferedReader(zstandard.open(stored, "rb"))
    return stored


def content_bytes(stored: "io.BufferedReader[Any]") -> int:
    """The length of the content, if a zstd file begins with it as packed segments do; else that of the file."""
    stored_bytes, first = os.fstat(stored.fileno()).st_size, stored.peek(_HEADER_BYTES)
    with suppress(zstandard.ZstdError):  # damaged
        if first.startswith(_ZSTD):
            return max(stored_bytes, zstandard.frame_content_size(first))
    return stored_bytes
