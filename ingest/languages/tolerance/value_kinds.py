"""What belongs under each key of a message, derived from the structs that decode it."""

from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple, cast

import msgspec
from msgspec.inspect import (
    BoolType,
    Field,
    FloatType,
    IntType,
    ListType,
    LiteralType,
    NoneType,
    StrType,
    StructType,
    Type,
    UnionType,
    type_info,
)

from ingest.languages.tolerance.spelling import folded

UNKNOWN = "UNKNOWN"
"""Stands in an enumeration for any word that it does not have. What it means, the motion shows."""
TIME_KEYS = frozenset(("timestamp", "eta"))


class Words(NamedTuple):
    """An enumeration."""

    terms: frozenset[str]
    by_folded: dict[str, str]
    """From a word without case, hyphens, underscores and spaces to the standard's spelling."""


class ObjectKind:
    """A JSON object of the standard. Each is one object, so that it can be a key of caches."""

    def __init__(self, fields: tuple[Field, ...]) -> None:
        self.keys = {field.encode_name: _key_kind(field) for field in fields}
        self.names = frozenset(self.keys)
        self.required = frozenset(key for key, kind in self.keys.items() if kind.is_required)
        self.by_folded = {folded(key): key for key in self.keys}
        self.is_timed = not TIME_KEYS.isdisjoint(self.keys)

    def meant(self, plain: str, others: Mapping[str, tuple[str, ...]]) -> str:
        """The key that a folded one means, by its spelling or by other names. "" if it means none."""
        return self.by_folded.get(plain) or next((key for key in others.get(plain, ()) if key in self.keys), "")


Kind = type | Words | ObjectKind
"""`float`, `int`, `str`, `bool`; `object` for anything; an enumeration or an object."""


class KeyKind(NamedTuple):
    """What belongs under a key."""

    kind: Kind
    is_list: bool
    is_required: bool
    is_time: bool
    """Whether it is a time: text, or a number since 1970."""


_SCALARS: dict[type[Type], type] = {FloatType: float, IntType: int, StrType: str, BoolType: bool}


@cache
def object_kind(struct: type[msgspec.Struct]) -> ObjectKind:
    """The kind of objects that a struct decodes."""
    return ObjectKind(cast(StructType, type_info(struct)).fields)


def _key_kind(field: Field) -> KeyKind:
    info = _not_none(field.type)
    is_list = isinstance(info, ListType)
    item: Any = _not_none(info.item_type) if isinstance(info, ListType) else info
    return KeyKind(_kind(item), is_list, field.required, field.encode_name in TIME_KEYS)


def _not_none(info: Type) -> Type:
    """The type without null."""
    if not isinstance(info, UnionType):
        return info
    return next(each for each in info.types if not isinstance(each, NoneType))


def _kind(info: Type) -> Kind:
    if isinstance(info, StructType):
        return object_kind(info.cls)
    if isinstance(info, LiteralType):
        terms = [str(term) for term in info.values if term != UNKNOWN]
        return Words(frozenset(terms), {folded(term): term for term in reversed(terms)})
    return _SCALARS.get(type(info), object)
