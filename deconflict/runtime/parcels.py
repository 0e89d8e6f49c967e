"""Parcels: what the engine hands to the operator face, in parts of bounded size.

A parcel is a head, one line of JSON, and then one line of JSON for each revision.
"""

import json
from collections.abc import Iterable, Mapping
from typing import Any

from pydantic_core import to_json

MOST_LINES, MOST_BYTES = 500, 1 << 20
"""Most revisions of a parcel, and most bytes of all its revisions. A larger revision has a parcel of its own."""
STORED, REFUSED = b"stored", b"refused"
"""Answers of the operator face to a parcel. A refused one is to be sent again."""


def cut_into_parcels(lines: Iterable[bytes]) -> list[list[bytes]]:
    """The lines of each parcel, in order."""
    parcels: list[list[bytes]] = []
    size_bytes = 0
    for line in lines:
        if not parcels or len(parcels[-1]) == MOST_LINES or size_bytes + len(line) > MOST_BYTES:
            parcels.append([])
            size_bytes = 0
        parcels[-1].append(line)
        size_bytes += len(line)
    return parcels


def packed_parcel(head: Mapping[str, Any], lines: Iterable[bytes] = ()) -> bytes:
    return b"\n".join([to_json(head), *lines])


def unpacked_parcel(parcel: bytes) -> tuple[dict[str, Any], list[bytes]]:
    """The head and the lines."""
    head, *lines = parcel.split(b"\n")
    return json.loads(head), lines
