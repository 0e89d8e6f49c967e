"""Makes inputs from other inputs: replaces, moves or removes a part of a document, or damages its bytes."""

import json
import tomllib
from collections.abc import Callable, Iterator
from copy import deepcopy
from random import Random
from typing import Any

from tests.helpers.made_site import toml

HOSTILE: tuple[Any, ...] = (
    None,
    True,
    0,
    -1,
    2**63,
    10**30,
    1e308,
    -1e308,
    5e-324,
    1e7,
    float("nan"),
    float("inf"),
    "",
    " ",
    "\x00",
    "\ud7ff\uffff",
    "x" * 300,
    "NaN",
    "-0",
    "1e999",
    "9999-12-31T23:59:60Z",
    "0001-01-01T00:00:00+23:59",
    "1969-12-31T23:59:59Z",
    "2023-11-14T22:13:20.123456789012Z",
    "1700000000.5",
    "00000000-0000-0000-0000-000000000000",
    "{0d6f4f0e9d0c4a6f8a550c9f5f4a1b01}",
    [],
    {},
    [[]],
    [0.0, 0.0],
)
"""Values that no sender should send, or only in another place."""
SCALES = (0.0, -1.0, 1e-6, 0.5, 2.0, 1000.0, 1e15)
Format = tuple[Callable[[bytes], Any], Callable[[Any], bytes]]
JSON: Format = (json.loads, lambda document: json.dumps(document).encode())
TOML: Format = (
    lambda raw: tomllib.loads(raw.decode()),
    lambda document: toml(document).encode("utf-8", "surrogatepass"),
)


def mutated(raw: bytes, random: Random, form: Format) -> bytes:
    """`raw` changed in one to four places: as a document if it is one, else as bytes."""
    read, write = form
    try:
        document = read(raw)
        for _ in range(random.randint(1, 4)):
            document = _changed(document, random)
        written = write(document)
    except (ValueError, RecursionError):
        return _damaged(raw, random)
    return _damaged(written, random) if random.random() < 0.1 else written


def _changed(document: Any, random: Random) -> Any:
    places = list(_places(document))
    if not places:
        return document
    holder, key = random.choice(places)
    change = random.choice((_replace, _remove, _exchange, _scale, _repeat, _rename))
    change(holder, key, places, random)
    return document


def _places(document: Any) -> Iterator[tuple[Any, Any]]:
    """All containers of a document with each of their keys."""
    keys = list(document) if isinstance(document, dict) else range(len(document)) if isinstance(document, list) else ()
    for key in keys:
        yield document, key
        yield from _places(document[key])


def _replace(holder: Any, key: Any, _: list[tuple[Any, Any]], random: Random) -> None:
    holder[key] = deepcopy(random.choice(HOSTILE))


def _remove(holder: Any, key: Any, _: list[tuple[Any, Any]], __: Random) -> None:
    del holder[key]


def _exchange(holder: Any, key: Any, places: list[tuple[Any, Any]], random: Random) -> None:
    other, its_key = random.choice(places)
    holder[key] = deepcopy(other[its_key])


def _scale(holder: Any, key: Any, _: list[tuple[Any, Any]], random: Random) -> None:
    if isinstance(holder[key], int | float):
        holder[key] *= random.choice(SCALES)


def _repeat(holder: Any, key: Any, _: list[tuple[Any, Any]], random: Random) -> None:
    """Repeat an item of a list, or double a text."""
    if isinstance(holder, list):
        holder.extend(deepcopy(holder[key]) for _ in range(random.choice((1, 2, 12))))
    elif isinstance(holder[key], str):
        holder[key] *= 2


def _rename(holder: Any, key: Any, places: list[tuple[Any, Any]], random: Random) -> None:
    names = [name for _, name in places if isinstance(name, str)]
    if isinstance(holder, dict) and names:
        holder[random.choice(names)] = holder.pop(key)


def _damaged(raw: bytes, random: Random) -> bytes:
    """Bytes changed, inserted, removed or cut off."""
    damaged = bytearray(raw or b"{}")
    at = random.randrange(len(damaged))
    match random.randrange(4):
        case 0:
            damaged[at] ^= 1 << random.randrange(8)
        case 1:
            damaged[at:at] = random.randbytes(random.randint(1, 4))
        case 2:
            del damaged[at : at + random.randint(1, 16)]
        case _:
            del damaged[at:]
    return bytes(damaged)
