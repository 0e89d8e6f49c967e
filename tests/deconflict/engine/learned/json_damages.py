"""Damages of JSON values in a part of learned state."""

from collections.abc import Iterator
from typing import Any


def json_damages(value: Any) -> Iterator[Any]:
    """The value with one thing in it changed."""
    yield from (None, "x", -1, float("nan"), 10**400, [], {})
    if isinstance(value, list) and value:
        yield value[:-1]
        yield [*value, value[0]]
        yield from ([damaged, *value[1:]] for damaged in json_damages(value[0]))
    if isinstance(value, dict) and value:
        first = next(iter(value))
        yield from ({**value, first: damaged} for damaged in json_damages(value[first]))
