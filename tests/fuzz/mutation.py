"""Inputs made of other inputs: a document with a part replaced, moved or taken away, or its bytes damaged."""

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
"""What no sender should say, or only in another place."""
SCALES = (0.0, -1.0, 1e-6, 0.5, 2.0, 1000.0, 1e15)
Format = tuple[Callable[[bytes], Any], Callable[[Any], bytes]]
JSON: Format = (json.loads, lambda told: json.dumps(told).encode())
TOML: Format = (
    lambda raw: tomllib.loads(raw.decode()),
    lambda told: toml(told).encode("utf-8", "surrogatepass"),
)


def mutated(raw: bytes, random: Random, form: Format) -> bytes:
    """`raw` changed in one to four places: as a document where it is one, else as bytes."""
    read, write = form
    try:
        told = read(raw)
        for _ in range(random.randint(1, 4)):
            told = _changed(told, random)
        written = write(told)
    except (ValueError, RecursionError):
        return _damaged(raw, random)
    return _damaged(written, random) if random.random() < 0.1 else written


def _changed(told: Any, random: Random) -> Any:
    places = list(_places(told))
    if not places:
        return told
    holder, key = random.choice(places)
    change = random.choice((_replace, _remove, _exchange, _scale, _repeat, _rename))
    change(holder, key, places, random)
    return told


def _places(told: Any) -> Iterator[tuple[Any, Any]]:
    """Every holder and key of a document."""
    keys = list(told) if isinstance(told, dict) else range(len(told)) if isinstance(told, list) else ()
    for key in keys:
        yield told, key
        yield from _places(told[key])


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
    """The same item again, or a text as many times."""
    if isinstance(holder, list):
        holder.extend(deepcopy(holder[key]) for _ in range(random.choice((1, 2, 12))))
    elif isinstance(holder[key], str):
        holder[key] *= 2


def _rename(holder: Any, key: Any, places: list[tuple[Any, Any]], random: Random) -> None:
    names = [name for _, name in places if isinstance(name, str)]
    if isinstance(holder, dict) and names:
        holder[random.choice(names)] = holder.pop(key)


def _damaged(raw: bytes, random: Random) -> bytes:
    """Bytes changed, put in, taken out or cut off."""
    told = bytearray(raw or b"{}")
    at = random.randrange(len(told))
    match random.randrange(4):
        case 0:
            told[at] ^= 1 << random.randrange(8)
        case 1:
            told[at:at] = random.randbytes(random.randint(1, 4))
        case 2:
            del told[at : at + random.randint(1, 16)]
        case _:
            del told[at:]
    return bytes(told)
