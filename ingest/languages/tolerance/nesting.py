"""Values that stand one level too deep in a message, or too flat, as bridges send them."""

from collections.abc import Iterator, Mapping
from itertools import islice
from typing import Any, NamedTuple

from ingest.languages.tolerance.spelling import folded
from ingest.languages.tolerance.value_kinds import ObjectKind

MOST_OTHERS = 40
"""Keys that an object should not have, of which it is asked what they mean."""
Aliases = Mapping[str, tuple[str, ...]]
"""From other names of keys, folded, to those in the schema."""


class Moved(NamedTuple):
    """What stands at another level than in the schema."""

    key: str
    """Under which it is read, or under which it was sent if that is too deep."""
    value: dict[str, Any]
    keys_sent: frozenset[str]
    """Keys of the object that stand for it."""
    is_too_deep: bool


def moved(sent: dict[str, Any], kind: ObjectKind, needed: frozenset[str], aliases: Aliases) -> Iterator[Moved]:
    """What an object has at another level: keys of an absent object beside it, or its own keys within another object.

    `needed` are keys without which it says little, beside those that it requires.
    """
    others = dict(islice(((key, value) for key, value in sent.items() if key not in kind.keys), MOST_OTHERS))
    for key, known in kind.keys.items():
        if key not in sent and isinstance(known.kind, ObjectKind) and not known.is_list:
            value, keys_sent = _raised(others, known.kind, aliases)
            if value:
                others = {other: each for other, each in others.items() if other not in keys_sent}
                yield Moved(key, value, keys_sent, is_too_deep=False)
                sent = sent | {key: value}
    absent = (kind.required | (needed & kind.names)) - sent.keys()
    for key, value in others.items() if absent else ():
        if isinstance(value, dict):
            inner = {_meant(name, kind, aliases): each for name, each in islice(value.items(), MOST_OTHERS)}
            if absent & inner.keys() and kind.required <= sent.keys() | inner.keys():
                own = {name: each for name, each in inner.items() if name in kind.keys and name not in sent}
                yield Moved(key, own, frozenset((key,)), is_too_deep=True)
                return


def _raised(
    others: Mapping[str, Any], kind: ObjectKind, aliases: Aliases, depth: int = 2
) -> tuple[dict[str, Any], frozenset[str]]:
    """An object of which the keys stand beside it, and these keys. Empty if one is absent that it can't do without."""
    meant = {key: _meant(key, kind, aliases) for key in others}
    value = {name: others[key] for key, name in meant.items() if name in kind.keys}
    keys_sent = frozenset(key for key, name in meant.items() if name in kind.keys)
    for name, known in kind.keys.items() if depth > 1 else ():
        if name not in value and isinstance(known.kind, ObjectKind) and not known.is_list:
            rest = {key: each for key, each in others.items() if key not in keys_sent}
            part, keys_of_part = _raised(rest, known.kind, aliases, depth - 1)
            if part:
                value[name], keys_sent = part, keys_sent | keys_of_part
    return (value, keys_sent) if kind.required <= value.keys() else ({}, frozenset())


def unwrapped(sent: dict[str, Any]) -> dict[str, Any] | None:
    """A message that stands within another object, with what is beside it. None if there is not one such object."""
    within = [(key, value) for key, value in sent.items() if isinstance(value, dict)]
    if len(within) != 1:
        return None
    ((key, value),) = within
    return {name: each for name, each in sent.items() if name != key} | value


def _meant(key: str, kind: ObjectKind, aliases: Aliases) -> str:
    return key if key in kind.keys else kind.meant(folded(key), aliases) or key
