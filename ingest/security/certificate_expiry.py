"""When the certificates of a PEM file end. Python reads this of certificates of peers and authorities only."""

import re
from base64 import b64decode
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

from ingest.plain_files import opened

MOST_FILE_BYTES = 1 << 20
"""A file of all authorities of a machine takes 200 kB."""
VALIDITY = 3
"""The place of the validity in a certificate, after serial number, algorithm and issuer (RFC 5280, 4.1)."""
UTC_TIME, VERSION_TAG, CENTURY_TURN = 0x17, 0xA0, 50

_PEM = re.compile(r"-----BEGIN (?:X509 |TRUSTED )?CERTIFICATE-----([^-]+)-----END ")
"""The three names under which OpenSSL reads a certificate; the last one has a trailer."""


def expires_s(file: str) -> float | None:
    """When the first of a file's certificates ends, as a time stamp. None if there is none that can be read."""
    try:
        with opened(Path(file), most_bytes=None) as content:
            found = _PEM.findall(content.read(MOST_FILE_BYTES).decode("ascii", "replace"))
        return min((_not_after_s(b64decode(each)) for each in found), default=None)
    except (OSError, ValueError, IndexError, StopIteration):
        return None


def _not_after_s(der: bytes) -> float:
    (_, certificate), *_ = _values(der)
    (_, signed), *_ = _values(certificate)
    fields = [value for tag, value in _values(signed) if tag != VERSION_TAG]
    _, (tag, raw) = _values(fields[VALIDITY])
    text = raw.decode("ascii")
    if tag == UTC_TIME:
        text = ("20" if int(text[:2]) < CENTURY_TURN else "19") + text
    return datetime.strptime(text, "%Y%m%d%H%M%SZ").replace(tzinfo=UTC).timestamp()


def _values(der: bytes) -> Iterator[tuple[int, bytes]]:
    """Tag and content of each value in a DER sequence."""
    at = 0
    while at < len(der):
        tag, length, at = der[at], der[at + 1], at + 2
        if length & 0x80:
            digits = length & 0x7F
            length, at = int.from_bytes(der[at : at + digits]), at + digits
        yield tag, der[at : at + length]
        at += length
