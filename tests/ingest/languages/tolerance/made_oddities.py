"""Draws one odd value in a message: where it stands, what it is instead, and what it should be."""

import copy
from collections.abc import Iterator
from math import inf, isfinite, nan
from random import Random
from typing import Any, NamedTuple

from ingest.languages.tolerance.value_kinds import KeyKind, ObjectKind, Words

Place = tuple[str | int, ...]
"""Keys and rows from the whole message to a value."""
ANYTHING: tuple[Any, ...] = (
    None,
    nan,
    inf,
    -inf,
    {},
    [],
    "",
    "odd",
    True,
    7,
    0.5,
    -1,
    10**400,
    ["odd"],
    {"odd": 1},
    "NaN",
    [[]],
    [None],
)


class Drawn(NamedTuple):
    """One odd message."""

    document: dict[str, Any]
    place: Place
    value: Any
    is_plain: bool
    """Whether its meaning is clear, so that nothing is lost."""

    @property
    def path(self) -> str:
        """Where the value stands, as findings name it."""
        return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in self.place).removeprefix(".")


def places(document: dict[str, Any], kind: ObjectKind) -> Iterator[tuple[Place, KeyKind]]:
    """Every value that is read, and what belongs there. Items of a list have the kind of the list."""
    for key, value in document.items():
        known = kind.keys.get(key)
        if known is None:
            continue
        yield (key,), known
        rows = value if known.is_list else [value]
        for row, item in enumerate(rows):
            at: Place = (key, row) if known.is_list else (key,)
            if known.is_list:
                yield at, known._replace(is_list=False)
            if isinstance(known.kind, ObjectKind) and isinstance(item, dict):
                yield from (((*at, *below), of_key) for below, of_key in places(item, known.kind))


def drawn(random: Random, document: dict[str, Any], kind: ObjectKind, but: tuple[Place, ...]) -> Drawn:
    """The document with one odd value, at no place that holds one of `but` or is within it."""
    free = [each for each in places(document, kind) if not any(_is_about(each[0], place) for place in but)]
    place, known = random.choice(free)
    changed = copy.deepcopy(document)
    holder: Any = changed
    for part in place[:-1]:
        holder = holder[part]
    plain = list(_plain_spellings(holder[place[-1]], known))
    is_plain = bool(plain) and random.random() < 0.5
    value = random.choice(plain if is_plain else [each for each in ANYTHING if _deviates(each, known)])
    holder[place[-1]] = value
    return Drawn(changed, place, value, is_plain)


def _is_about(place: Place, other: Place) -> bool:
    shorter = min(len(place), len(other))
    return place[:shorter] == other[:shorter]


def _plain_spellings(value: Any, known: KeyKind) -> Iterator[Any]:
    """The value in other types and spellings that can mean nothing else."""
    if known.is_list:
        if len(value) == 1:
            yield value[0]
        elif not value:
            yield {}
    elif known.kind is object:
        return
    elif isinstance(known.kind, Words):
        yield from {value.lower(), value.title(), f" {value} ", value.lower().replace("_", "-")} - {value}
    elif isinstance(known.kind, ObjectKind):
        yield [value]
    elif known.kind in (int, float):
        yield from (str(value), f" {value} ", [value])
    elif known.kind is bool:
        yield from (str(value), str(value).lower(), int(value), float(value), [value])
    elif value.isdecimal():
        yield from (int(value), float(value), [value])


def _deviates(value: Any, known: KeyKind) -> bool:
    """Whether a value does not belong here by its type."""
    kind = known.kind
    if kind is object:
        return value is None
    if known.is_list:
        return value != [] and (value, kind) != (["odd"], str)
    if isinstance(kind, ObjectKind):
        return value not in ({}, {"odd": 1}) or bool(kind.required)
    if isinstance(kind, Words):
        return True
    if isinstance(value, float) and not isfinite(value):
        return True
    types: dict[Any, Any] = {float: (int, float), int: int, str: str, bool: bool}
    return not isinstance(value, types[kind]) or (kind is not bool and isinstance(value, bool))


def respelt(random: Random, document: dict[str, Any], kind: ObjectKind) -> Drawn:
    """The document with one key in another spelling. The place is that of the key as it should be."""
    place, _ = random.choice([each for each in places(document, kind) if isinstance(each[0][-1], str)])
    changed = copy.deepcopy(document)
    holder: Any = changed
    for part in place[:-1]:
        holder = holder[part]
    key = str(place[-1])
    snake = "".join(f"_{letter.lower()}" if letter.isupper() else letter for letter in key)
    other = random.choice(
        [each for each in (snake, key.upper(), key[0].upper() + key[1:], snake.upper()) if each != key]
    )
    holder[other] = holder.pop(key)
    return Drawn(changed, place, other, is_plain=True)
